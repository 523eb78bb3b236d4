"""Reading bags: containers of messages, walked in bulk and decoded by topic."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from importlib import import_module

from vftcli.readers.bags.container import Batch, Ingest, printable, storage_files
from vftcli.readers.bags.decode import Decoder
from vftcli.readers.bags.documents import Documents
from vftcli.readers.bags.topics import aligned
from vftcli.readers.formats import LogFormat
from vftcli.readers.reader import LogFile, RawLog, ReadChoice, open_log
from vftcli.signals.errors import LogError
from vftcli.signals.remarks import Where, fact, warning

METADATA_BYTES = 1024 * 1024
#: How a file of a container begins → the module here that reads it.
CONTAINERS = {
    b"#ROSBAG V2.0\n": "rosbag1",
    b"\x89MCAP0\r\n": "mcap_file",
    b"SQLite format 3\0": "db3",
}


def recognises(file: LogFile, _: LogFormat) -> bool:
    """Whether a folder holds files of a ROS 2 bag."""
    return bool(storage_files(file))


def read(file: LogFile, request: ReadChoice, _: LogFormat) -> RawLog:
    """Read any container of messages."""
    paths = [file.path / name for name in storage_files(file)]
    size = sum(path.stat().st_size for path in paths) if file.is_folder else len(file.content)
    ingest = Ingest(path=file.path, size=size)
    decoder, documents = Decoder(ingest), Documents(ingest)
    messages = 0
    for batch in _batches([open_log(path) for path in paths] if paths else [file], ingest):
        messages += len(batch.offsets)
        if not documents.take(batch):
            decoder.take(batch)
    if "metadata.yaml" in file.entries:
        with (file.path / "metadata.yaml").open("rb") as metadata:
            text = metadata.read(METADATA_BYTES)
        match = re.search(rb"^  message_count: (\d{1,15})\s*$", text, flags=re.MULTILINE)
        counted = messages if match is None else int(match[1])
        if messages < counted:
            said = warning("messages-missing", kept=messages, counted=counted, by="metadata.yaml")
            ingest.note(said)
        elif messages > counted:
            ingest.note(fact("message-count-differs", counted=counted, found=messages))
    if messages == 0:
        why = "; ".join(["no messages in any whole chunk", *map(str, ingest.remarks)])
        raise LogError(f"{file.path}: {why}.")
    of_documents = documents.streams(request)
    streams = [*decoder.streams(), *of_documents]
    # ROS messages go before documents: their types say what they hold.
    if documents.found and not any("q" in stream.signals for stream in streams):
        raw = documents.read(request)
    else:
        known = {stream.channel.topic for stream in of_documents}
        rows = (channel for channel in documents.found if channel.topic not in known)
        others = decoder.others | {c.topic: c.type or c.encoding for c in rows}
        raw = aligned(streams, file.path, request, others)
    return replace(raw, remarks=(*ingest.remarks, *raw.remarks))


def _batches(files: Sequence[LogFile], ingest: Ingest) -> Iterator[Batch]:
    """The messages of files, one behind the other; what a library raises is told in one line."""
    for file in files:
        begins = next((magic for magic in CONTAINERS if file.head.startswith(magic)), None)
        if begins is None:
            raise LogError(f"{file.path}: neither a ROS bag nor an MCAP file.")
        container = import_module(f"vftcli.readers.bags.{CONTAINERS[begins]}")
        try:
            for batch in container.batches(file, ingest):
                yield batch
                file.release()
        except LogError:
            raise
        except MemoryError:
            raise LogError(
                f"{ingest.path}: a part of it claims more memory than the file holds; it is "
                "damaged."
            ) from None
        except Exception as error:  # noqa: BLE001 - libraries document none of what damage raises
            reason = printable(f"{type(error).__name__}: {error}")[:100]
            raise LogError(
                f"{ingest.path}: not a readable bag; it is damaged ({reason})."
            ) from None
        if file.path != ingest.path:
            for remark in file.remarks:
                ingest.note(replace(remark, where=Where(about=file.path.name)))
