"""Shipping: logs sent as bytes to workers that do not see the files, results sent back."""

import tempfile
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from vftcli.batch.engine import begin
from vftcli.batch.keys import with_files
from vftcli.batch.log_work import LogTask, work_on_log
from vftcli.outputs.batch_folder import BatchFolder
from vftcli.readers.opening import files_of
from vftcli.signals.errors import LogError

LIMIT = 64 * 1024 * 1024  #: Bytes of a log and of all that its options name that are sent. [B]


class Parcel(NamedTuple):
    """A task with the files that it needs."""

    task: LogTask  #: The task; its paths are those of the sender.
    #: Path at the sender → (name, content); a folder's files have names below its own.
    files: Mapping[str, bytes] = {}
    failure: str = ""  #: Why it cannot be sent, "" where it can.


def packed(task: LogTask, files: tuple[Path, ...]) -> Parcel:
    """A task with its log's files, and those that its options name."""
    named: list[Path] = []

    def noted(path: Path) -> Path:
        named.append(path)
        return path

    with_files(task.job.choice, noted)
    every = [*files, *(file for path in named for file in files_of(path))]
    try:
        size = sum(path.stat().st_size for path in every)
        if size > LIMIT:
            return Parcel(
                task,
                failure=f"{task.path} and what goes with it has {size / 2**20:.0f} MiB, more than "
                f"the {LIMIT // 2**20} MiB that are sent; let the workers see the folder",
            )
        return Parcel(task, {str(path): path.read_bytes() for path in every})
    except OSError as error:
        return Parcel(task, failure=f"{task.path}: cannot be read ({error.strerror})")


def work_on_parcel(parcel: Parcel) -> dict[str, bytes]:
    """Unpack a log in a folder of its own, do the work there, and return the files it wrote.

    Returns:
        Name in the batch's folder → content, the rows last.
    """
    begin("sending")
    if parcel.failure:
        raise LogError(parcel.failure)
    with tempfile.TemporaryDirectory(prefix="vftcli-") as place:
        top = Path(place)

        def moved(path: Path) -> Path:
            return top / "in" / path.relative_to(path.anchor)

        for name, content in parcel.files.items():
            path = moved(Path(name))
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content)
        task = parcel.task
        job = replace(task.job, choice=with_files(task.job.choice, moved))
        there = replace(
            task, job=job, folder=top / "out", path=moved(task.path), told_path=task.path
        )
        work_on_log(there)
        folder = BatchFolder(there.folder)
        return {
            path.relative_to(folder.path).as_posix(): path.read_bytes()
            for path in folder.files_of(task.key)
        }
