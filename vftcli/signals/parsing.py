"""Texts: letters that can be shown, known names, the tables of TOML."""

import re
import unicodedata
from collections.abc import Iterable
from difflib import get_close_matches
from functools import cache
from pathlib import Path
from typing import Any

from vftcli.signals.errors import ParameterError

#: Not UTF-8: bytes of a file name, half a letter of JSON.
HALVES = re.compile(r"[\ud800-\udfff]")
#: Words without width, as colours.
COLOUR = re.compile(r"\x1b\[[0-9;]*m")
#: Unicode categories that a terminal acts on or hides: controls, writing direction, line ends.
HIDDEN = {"Cc", "Cf", "Co", "Zl", "Zp"}


def counted(count: int, noun: str) -> str:
    """A number of things: ``1 contact``, ``2 contacts``."""
    return f"{count} {noun}{'s' * (count != 1)}"


def whole(text: str) -> str:
    r"""A text in valid UTF-8: a file name's byte without a letter becomes ``\xff``."""
    return text if text.isascii() else HALVES.sub(half, text)


def half(found: re.Match[str]) -> str:
    """The text for one half: the byte that it is, or its number."""
    number = ord(found[0])
    # Python reads byte xx of a name as U+DCxx (PEP 383).
    return f"\\x{number - 0xDC00:02x}" if 0xDC80 <= number <= 0xDCFF else f"\\u{number:04x}"


def printable(text: str) -> str:
    r"""A text on one line, every letter seen: ``\x1b`` for what a terminal would obey."""
    if text.isprintable():
        return text
    return "".join(
        letter.encode("unicode_escape").decode()
        if unicodedata.category(letter) in HIDDEN
        else letter
        for letter in whole(text)
    )


#: Share of letters that agree: one slip in four, two in eight.
LIKE = 0.74


def nearest(word: str, known: Iterable[str]) -> str:
    """The known name nearest to a word, "" where none is near."""
    names = {name.lower(): name for name in known}
    close = get_close_matches(word.lower(), names, n=1, cutoff=LIKE)
    return names[close[0]] if close else ""


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """The known name nearest to a word, as a question; "" where none is near."""
    close = nearest(word, known)
    return f" Did you mean {close}?" if close else ""


def check_known(word: str, known: Iterable[str], complaint: str) -> None:
    """Raise a ParameterError with what there is unless a word is known."""
    if word not in (there := list(known)):
        near = did_you_mean(word, there)
        raise ParameterError(f"{complaint}; there is {', '.join(there)}{'.' * bool(near)}{near}")


def check_kind(value: object, kind: type, name: str, how: str) -> None:
    """Raise a ParameterError unless what a caller gives is of a kind."""
    if not isinstance(value, kind):
        given = shown(value) if isinstance(value, str) else type(value).__name__
        raise ParameterError(f"{name} is {given}; expected {kind.__name__}: {how} is one")


def shown(value: object) -> str:
    """A value of a file as a complaint quotes it, cut where it is long."""
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


@cache
def tables_beside(module: str, name: str) -> dict[str, Any]:
    """The tables of our own file of TOML beside a module's."""
    import tomllib  # loaded where a file is read, not for --help

    return tomllib.loads(Path(module).with_name(name).read_text(encoding="utf-8"))


LARGEST = 1 << 20  #: Letters of a text of TOML that a user gives.
LONGEST = 10_000  #: Letters of a line of TOML; 50 000 dots in one take Python's parser 15 s.


def toml_tables(text: str) -> dict[str, Any]:
    """The tables of a TOML text."""
    import tomllib

    if len(text) > LARGEST:
        raise ParameterError(f"too large: TOML may have {LARGEST} letters")
    for number, line in enumerate(text.split("\n"), start=1):
        if len(line) > LONGEST:
            raise ParameterError(
                f"line {number} has {len(line)} letters; a line of TOML has at most {LONGEST}: "
                "break it up"
            )
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise ParameterError("not valid TOML: nested too deep") from None
    except ValueError as error:  # TOML's own, or an integer's
        raise ParameterError(f"not valid TOML: {error}") from None


def toml_file(path: Path, what: str) -> dict[str, Any]:
    """The tables of a user's TOML, as "a scenario"; a ParameterError names the file."""
    try:
        with path.open(encoding="utf-8-sig") as file:
            return toml_tables(file.read(LARGEST + 1))
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or "not a text in UTF-8"
        raise ParameterError(f"{path}: cannot be read as {what} ({reason})") from None
    except ParameterError as error:
        raise ParameterError(f"{path}: {error}") from None
