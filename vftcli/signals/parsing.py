"""Words that rooms share: a span of time, a list of numbers, an assignment, a TOML text."""

from collections.abc import Iterable
from difflib import get_close_matches
from typing import Any

from vftcli.signals.errors import ParameterError

#: Share of two words' letters that must agree in order: one slip in four letters, two in eight.
LIKE = 0.74


def nearest(word: str, known: Iterable[str]) -> str:
    """The known name nearest to a word, "" where none is near."""
    names = {name.lower(): name for name in known}
    close = get_close_matches(word.lower(), names, n=1, cutoff=LIKE)
    return names[close[0]] if close else ""


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """The known name nearest to a word, as a question behind a blank; "" where none is near."""
    close = nearest(word, known)
    return f" Did you mean {close}?" if close else ""


def check_known(word: str, known: Iterable[str], complaint: str) -> None:
    """Raise a ParameterError of the complaint and of what there is unless a word is known."""
    if word not in (there := list(known)):
        near = did_you_mean(word, there)
        raise ParameterError(f"{complaint}; there is {', '.join(there)}{'.' * bool(near)}{near}")


def interval(text: str) -> tuple[float, float]:
    """First and last time of ``A:B``, infinite where an end is left out. [s]"""
    left, colon, right = text.partition(":")
    try:
        start = float(left) if left.strip() else float("-inf")
        stop = float(right) if right.strip() else float("inf")
    except ValueError:
        colon = ""
    if not colon or not start < stop:
        raise ParameterError(
            f"interval {text!r} is not A:B with A < B, in seconds from the log's first sample"
        )
    return start, stop


def interval_text(start: float, stop: float) -> str:
    """The ``A:B`` that `interval` reads as these times, an infinite end left out. [s]"""
    return ":".join("" if abs(end) == float("inf") else f"{end:g}" for end in (start, stop))


def numbers(text: str) -> tuple[float, ...] | None:
    """The numbers of ``A,B,C``, None where a part is no number: the caller says what was due."""
    try:
        return tuple(float(part) for part in text.split(","))
    except ValueError:
        return None


def assignment(text: str, option: str, form: str) -> tuple[str, str]:
    """Key and value of ``KEY=VALUE``, without the blanks around them."""
    key, _, value = text.partition("=")
    if not key.strip() or not value.strip():
        raise ParameterError(f"{option} {text!r} is not {form}")
    return key.strip(), value.strip()


def check_kind(value: object, kind: type, name: str, how: str) -> None:
    """Raise a ParameterError unless what a caller gives is of a kind."""
    if not isinstance(value, kind):
        told = shown(value) if isinstance(value, str) else type(value).__name__
        raise ParameterError(f"{name} is {told}; expected {kind.__name__}: {how} is one")


def shown(value: object) -> str:
    """A value of a file as a complaint quotes it, cut where it is long."""
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


LONGEST = 10_000  #: Letters of a line of TOML; 50 000 dots in one take Python's parser 15 s.


def toml_tables(text: str) -> dict[str, Any]:
    """The tables of a TOML text."""
    import tomllib  # loaded where a file is read, not for --help

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
    except ValueError as error:  # TOML's own, and that of an integer of thousands of digits
        raise ParameterError(f"not valid TOML: {error}") from None
