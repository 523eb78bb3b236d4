"""Reading bags: containers of messages, walked in bulk and decoded by topic."""

import re
from collections.abc import Iterator
from dataclasses import replace

from vftcli.readers.bags import db3
from vftcli.readers.bags.container import (
    MCAP,
    ROSBAG1,
    SQLITE,
    Batch,
    Ingest,
    printable,
    storage_files,
)
from vftcli.readers.bags.decode import Decoder
from vftcli.readers.bags.documents import Documents, read_documents
from vftcli.readers.bags.topics import aligned
from vftcli.readers.formats import LogFormat
from vftcli.readers.reader import LogFile, RawLog, ReadChoice, open_log
from vftcli.signals.errors import LogError
from vftcli.signals.remarks import Where, fact, warning

METADATA_BYTES = 1024 * 1024


def recognises(file: LogFile, _: LogFormat) -> bool:
    """Whether a folder holds files of a ROS 2 bag."""
    return bool(storage_files(file))


def read(file: LogFile, request: ReadChoice, _: LogFormat) -> RawLog:
    """Read any container of messages."""
    ingest = Ingest(path=file.path, size=_size(file))
    decoder, documents = Decoder(ingest), Documents(ingest)
    messages = 0
    for batch in _batches(file, ingest):
        messages += len(batch.offsets)
        if not documents.take(batch):
            decoder.take(batch)
    _check_count(file, ingest, messages)
    if messages == 0:
        said = "; ".join(["no messages in any whole chunk", *map(str, ingest.remarks)])
        raise LogError(f"{file.path}: {said}.")
    of_documents = documents.streams(request)
    streams = [*decoder.streams(), *of_documents]
    # ROS messages go before documents: their types say what they hold.
    if documents.rows and not any("q" in stream.signals for stream in streams):
        raw = read_documents(file, documents, request)
    else:
        known = {stream.channel.topic for stream in of_documents}
        rows = (channel for channel in documents.rows if channel.topic not in known)
        others = decoder.others | {c.topic: c.type or c.encoding for c in rows}
        raw = aligned(streams, file.path, request, others)
    return replace(raw, remarks=(*ingest.remarks, *raw.remarks))


def _size(file: LogFile) -> int:
    """Bytes of a file or of all storage files of a folder."""
    if not file.is_folder:
        return len(file.content)
    return sum((file.path / name).stat().st_size for name in storage_files(file))


def _batches(file: LogFile, ingest: Ingest) -> Iterator[Batch]:
    """The messages of a file, or of a folder's files one behind the other."""
    if not file.is_folder:
        yield from _file_batches(file, ingest)
        return
    for name in storage_files(file):
        inner = open_log(file.path / name)
        yield from _file_batches(inner, ingest)
        for remark in inner.remarks:
            ingest.note(replace(remark, where=Where(about=name)))


def _file_batches(file: LogFile, ingest: Ingest) -> Iterator[Batch]:
    """The messages of one file; whatever a library raises on it is told in one line."""
    try:
        for batch in _container(file, ingest):
            yield batch
            file.release()
    except LogError:
        raise
    except MemoryError:
        raise LogError(
            f"{ingest.path}: a part of it claims more memory than the file holds; it is damaged."
        ) from None
    except Exception as error:  # noqa: BLE001 - libraries document none of what damage raises
        reason = printable(f"{type(error).__name__}: {error}")[:100]
        raise LogError(f"{ingest.path}: not a readable bag; it is damaged ({reason}).") from None


def _container(file: LogFile, ingest: Ingest) -> Iterator[Batch]:
    """The messages of one file, by the container that its first bytes tell."""
    if file.head.startswith(ROSBAG1):
        from vftcli.readers.bags import rosbag1

        return rosbag1.batches(file.content, ingest)
    if file.head.startswith(MCAP):
        from vftcli.readers.bags import mcap_file

        return mcap_file.batches(file.content, ingest)
    if file.head.startswith(SQLITE):
        return db3.batches(file, ingest)
    raise LogError(f"{file.path}: neither a ROS bag nor an MCAP file.")


def _check_count(file: LogFile, ingest: Ingest, messages: int) -> None:
    """Say so if metadata.yaml counts another number of messages than were found."""
    if "metadata.yaml" not in file.entries:
        return
    with (file.path / "metadata.yaml").open("rb") as metadata:
        text = metadata.read(METADATA_BYTES)
    match = re.search(rb"^  message_count: (\d{1,15})\s*$", text, flags=re.MULTILINE)
    if match is None or (counted := int(match[1])) == messages:
        return
    if messages < counted:
        ingest.note(warning("messages-missing", kept=messages, counted=counted, by="metadata.yaml"))
    else:
        ingest.note(fact("message-count-differs", counted=counted, found=messages))
