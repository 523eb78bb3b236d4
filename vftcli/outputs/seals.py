"""Seals: `run.json` lists the digest of every file that its run wrote beside it."""

import hashlib
import json
from collections.abc import Iterator
from pathlib import Path

#: The last file of a run to come and the first to go; beside other files `NAME.run.json`.
SEAL = "run.json"


def is_seal(path: Path) -> bool:
    """Whether a file is the seal of a run."""
    return path.name == SEAL or path.name.endswith(f".{SEAL}")


def digests(folder: Path) -> dict[str, str]:
    """The sha256 of every file in a folder and below it, by its name there, in order."""
    return {
        path.relative_to(folder).as_posix(): digest(path)
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def digest(path: Path) -> str:
    """The sha256 of a file's bytes, in hex."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def sealed_files(seal: Path, at: Path | None = None) -> Iterator[Path]:
    """The files that an earlier run's seal lists, where they still are as that run left them.

    A seal is a file like any other: what it lists outside its folder is not believed.
    """
    try:
        files = json.loads(seal.read_text(encoding="utf-8"))["files"]
        listed = {str(name): str(sha) for name, sha in files.items()}
    except (OSError, ValueError, LookupError, TypeError, AttributeError, RecursionError):
        return  # an earlier version's, or none of ours
    top = seal.parent if at is None else at
    folder = top.resolve()
    for name, sha in listed.items():
        path = top / name
        try:
            inside = path.resolve().is_relative_to(folder)
            if inside and path.is_file() and digest(path) == sha:
                yield path
        except (OSError, ValueError):
            continue
