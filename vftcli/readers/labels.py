"""Labels: what each log of a command is called in tables, so that no two are called alike."""

import os
from collections.abc import Iterable
from pathlib import Path


def labelled(paths: Iterable[str | Path]) -> dict[Path, str]:
    """Give every path a label that no other of them has.

    A label is the file's name where that is unique, else as many folders before it as tell it from
    every other path: `a/log.csv` and `b/log.csv`. Spellings of one path have one label.

    Returns:
        Path as it was given → label.
    """
    given = [Path(path) for path in paths]
    # Spellings of one path count once, or no tail of it would be unique.
    parts = {path: absolute(path).parts for path in given}
    return {path: _shortest_tail(parts[path], set(parts.values())) for path in given}


def absolute(path: str | Path) -> Path:
    """A path from the root, without `.` and `..`; links are not followed, they have names too."""
    return Path(os.path.abspath(path))  # noqa: PTH100 - Path.absolute leaves `..` in the path


def _shortest_tail(parts: tuple[str, ...], all_parts: set[tuple[str, ...]]) -> str:
    """The last parts of a path, as many as no other path ends with."""
    for count in range(1, len(parts) + 1):
        tail = parts[-count:]
        if sum(other[-count:] == tail for other in all_parts) == 1:
            break
    return str(Path(*tail))
