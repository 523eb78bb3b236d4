"""Canvas: what a terminal can show, and text that fits it."""

import textwrap
from typing import NamedTuple, Self

NARROWEST, WIDEST = 72, 100  #: Columns that a screen uses at least, and at most.
#: Style → ANSI code.
STYLES = {"good": "32", "caution": "33", "bad": "31", "unknown": "2", "bold": "1", "bar": "36"}
#: ASCII for a letter on a terminal without it.
PLAIN = {
    "·": "-", "–": "-", "−": "-", "…": "...", "±": "+/-", "≤": "<=", "→": "->", "°": " deg",
    "✓": "+", "△": "!", "✗": "x", "┤": "|", "ω": "w", "τ": "tau", "×": "x", "≥": ">=", "√": "sqrt",
    "₃": "3", "²": "2", "≈": "~", "’": "'",
}  # fmt: skip


class Canvas(NamedTuple):
    """Abilities of a terminal."""

    width: int = 80  #: Columns that are used.
    unicode: bool = True  #: Whether it has more letters than ASCII.
    colour: bool = False  #: Whether it has colours.

    @classmethod
    def of(cls, *, columns: int, unicode: bool, colour: bool) -> Self:
        """The canvas of a terminal with so many columns."""
        return cls(min(max(columns, NARROWEST), WIDEST), unicode, colour)

    def painted(self, text: str, style: str) -> str:
        """A text in a style, as it is where there are no colours."""
        return f"\x1b[{STYLES[style]}m{text}\x1b[0m" if self.colour and text else text

    def shown(self, text: str) -> str:
        """A text in letters that the terminal has."""
        if self.unicode:
            return text
        plain = "".join(PLAIN.get(letter, letter) for letter in text)
        return plain.encode("ascii", "replace").decode()

    def wrapped(self, text: str, indent: int, lines: int | None = None) -> list[str]:
        """A text in lines behind an indent, cut behind so many of them; the first has none."""
        found = textwrap.wrap(
            text,
            self.width - indent,
            max_lines=lines,
            placeholder=" …",
            break_long_words=False,
            break_on_hyphens=False,
        )
        return [line if k == 0 else " " * indent + line for k, line in enumerate(found or [""])]
