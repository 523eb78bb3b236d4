"""Parsing that begins before the rest of the program is there.

Loading code holds the interpreter's lock, parsing a table does not: while NumPy and all that will
use a log is loaded, its columns are parsed. Which these are is guessed by the first lines alone,
for a table of RTDE names; the reader takes what was parsed where it asks for the very same, and
else parses for itself. So nothing depends on the guess but time. No module here needs NumPy.
"""

from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from vftcli.readers.opening import WHOLE_ROWS, Digest, head_of
from vftcli.readers.rtde_names import CLOCK, JOINT_COLUMNS, PAYLOAD
from vftcli.signals.background import Background
from vftcli.signals.errors import LogError

if TYPE_CHECKING:
    import polars as pl


class TextParse(NamedTuple):
    """How a table of text is parsed."""

    separator: str  #: What stands between two cells.
    width: int  #: Number of columns.
    kinds: Mapping[int, Any]  #: Column that is wanted → its polars type.
    skip: int  #: Lines before the rows.
    quoted: bool = False  #: Whether cells may stand in quotes.
    decimal_comma: bool = False  #: Whether numbers are written 0,5.

    def frame(self, source: Any) -> "pl.DataFrame":  # noqa: ANN401 - a path or bytes
        """The rows by polars, every wanted column with its type and its number as name."""
        import polars as pl

        return pl.read_csv(
            source,
            has_header=False,
            skip_lines=self.skip,
            separator=self.separator,
            columns=sorted(self.kinds),
            schema={str(c): self.kinds.get(c, pl.String) for c in range(self.width)},
            quote_char='"' if self.quoted else None,
            decimal_comma=self.decimal_comma,
            glob=False,
        )


class Ahead:
    """A table that is being parsed, and its file's digest.

    Attributes:
        path: The file.
        digest: Its digest, begun.
        parse: How it is parsed.
    """

    def __init__(self, path: Path, parse: TextParse, digest: Digest) -> None:
        self.path, self.parse, self.digest = path, parse, digest
        self._frame: Background[pl.DataFrame] | None = Background(lambda: parse.frame(path))

    @classmethod
    def of(cls, path: Path, signals: frozenset[str] | None) -> "Ahead | None":
        """Begin to parse a log, None where its first lines do not say what will be wanted of it."""
        with suppress(LogError):  # what cannot be opened is said by who reads it
            head, wrapping = head_of(path)
            columns = {} if wrapping else wanted_columns(head, path.stat().st_size, signals)
            if columns:
                digest = Digest((path,))
                digest.start()  # loading polars leaves a core idle
                import polars as pl

                names, separator = header(head)
                kinds = dict.fromkeys(columns, pl.Float64)
                return cls(path, TextParse(separator, len(names), kinds, skip=1), digest)
        return None

    def frame(self, parse: TextParse) -> "pl.DataFrame | None":
        """What was parsed, once, if it was parsed like this; None if it was not."""
        background, self._frame = self._frame, None
        return background.result() if background is not None and parse == self.parse else None


def header(head: bytes) -> tuple[list[str], str]:
    """The names in the first line of a text, and what separates them."""
    line = head.partition(b"\n")[0].decode("latin-1").strip()
    separator = "," if "," in line else " "
    return [name.strip() for name in line.split(separator)], separator


def wanted_columns(head: bytes, size: int, signals: frozenset[str] | None) -> list[int]:
    """The columns that will be wanted of a log of RTDE names; none of any other."""
    names, _ = header(head)
    lines = head.split(b"\n")[1:-1]
    if f"{JOINT_COLUMNS['q']}_0" not in names or CLOCK not in names or not lines or b'"' in head:
        return []
    if size * len(lines) > WHOLE_ROWS * sum(len(line) + 1 for line in lines):
        return []
    groups = [
        [f"{name}_{joint}" for joint in range(6)]
        for field, name in JOINT_COLUMNS.items()
        if signals is None or field in signals or field == "q"
    ]
    wanted = [CLOCK, *PAYLOAD, *(n for group in groups if set(group) <= {*names} for n in group)]
    return sorted(names.index(name) for name in wanted if name in names)
