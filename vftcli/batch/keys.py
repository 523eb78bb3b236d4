"""Keys of results, by which a second run finds them.

A key is the sha256 of the log's bytes, the options, the files they name (robot, gains,
free runs, reference) and the program's version.
"""

import hashlib
import json
from collections.abc import Callable, Iterable, Mapping
from dataclasses import fields, is_dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

from vftcli.outputs.files import digest
from vftcli.readers.opening import files_of
from vftcli.signals.option import FILE
from vftcli.signals.packages import VERSION


@cache
def digest_of(path: Path) -> str:
    """The sha256 of a file, or of a folder's files and their names; read once."""
    if not path.is_dir():
        return digest(path)
    lines = (f"{file.relative_to(path).as_posix()} {digest(file)}" for file in files_of(path))
    return sha256("\n".join(lines))


def content_digest(files: Iterable[Path]) -> str:
    """The sha256 of a log's file, or of several files' digests."""
    each = [digest_of(path) for path in files]
    return each[0] if len(each) == 1 else sha256("\n".join(each))


def options_digest(options: Any) -> str:  # noqa: ANN401 - choices of every room
    """The sha256 of options, of the files they name, and of the program's version."""
    named = with_files(options, lambda path: Path(digest_of(path)))
    return sha256(json.dumps([VERSION, named], sort_keys=True, default=plain))


def key_of(content: str, options: str, part: object = None) -> str:
    """The key of one log's result, from its content, options and part of the file."""
    return sha256("\n".join((content, options, "" if part is None else str(part))))


def sha256(text: str) -> str:
    """The sha256 of a text, in hex."""
    return hashlib.sha256(text.encode("utf-8", "backslashreplace")).hexdigest()


def with_files(value: Any, change: Callable[[Path], Path]) -> Any:  # noqa: ANN401
    """Options with every file name changed: paths, ``file:PATH``, robot files."""
    match value:
        case Path():
            return change(value)
        case str() if value.startswith(FILE):
            return f"{FILE}{change(Path(value.removeprefix(FILE)))}"
        case str() if Path(value).suffix and len(value) < 4096 and Path(value).is_file():
            return str(change(Path(value)))
        case tuple() if hasattr(value, "_fields"):
            return type(value)(*(with_files(item, change) for item in value))
        case tuple() | list():
            return type(value)(with_files(item, change) for item in value)
        case Mapping():
            return {key: with_files(item, change) for key, item in value.items()}
        case _ if is_dataclass(value) and not isinstance(value, type):
            own = {f.name: getattr(value, f.name) for f in fields(value) if f.compare}
            changed = {name: with_files(item, change) for name, item in own.items()}
            different = {name: x for name, x in changed.items() if x is not own[name]}
            return replace(value, **different)
    return value


def plain(value: Any) -> Any:  # noqa: ANN401
    """A form for JSON, equal in every process: sets in order, classes by name."""
    match value:
        case frozenset() | set():
            return sorted(map(str, value))
        case Mapping():
            return dict(value)
        case _ if is_dataclass(value) and not isinstance(value, type):
            own = {f.name: getattr(value, f.name) for f in fields(value) if f.compare}
            return {type(value).__name__: own}
    return value.tolist() if hasattr(value, "tolist") else str(value)
