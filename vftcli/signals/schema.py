"""Kinds of values that keys of TOML files have, and the complaint about one of another kind."""

import math
from collections.abc import Callable, Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np

from vftcli.signals.arrays import Array
from vftcli.signals.errors import ParameterError
from vftcli.signals.parsing import numbers, shown


class ValueKind(NamedTuple):
    """One kind of value."""

    words: str  #: What such a value is, as it ends "it must be …".
    fits: Callable[[Any], bool]  #: Whether a value of TOML is one.

    def broken(self, name: str, value: object) -> str:
        """The complaint about the value of a key, "" where it is of the kind."""
        return "" if self.fits(value) else f"{name} is {shown(value)}; it must be {self.words}"

    def check(self, name: str, value: object) -> None:
        """Raise a ParameterError unless the value of a key is of the kind."""
        if why := self.broken(name, value):
            raise ParameterError(why)


def is_finite(value: object) -> bool:
    """Whether a value of TOML is a finite number; true and false are none."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    try:
        return math.isfinite(value)
    except OverflowError:  # an integer beyond the largest float
        return False


def several(least: int) -> ValueKind:
    """The kind of a list of so many numbers or more."""
    words = f"a list of at least {least} finite numbers"
    return ValueKind(words, lambda v: LIST.fits(v) and len(v) >= least and all(map(is_finite, v)))


def vector(length: int) -> ValueKind:
    """The kind of a list of so many numbers."""
    words = f"{length} finite numbers"
    return ValueKind(words, lambda v: several(length).fits(v) and len(v) == length)


def word_of(known: Iterable[str]) -> ValueKind:
    """The kind of a word of a list."""
    there = list(known)
    return ValueKind(f"one of {', '.join(there)}", lambda v: v in there)


def tables(key: str) -> ValueKind:
    """The kind of the ``[[key]]`` tables."""
    words = f"tables, each headed [[{key}]]"
    return ValueKind(words, lambda v: LIST.fits(v) and all(map(TABLE.fits, v)))


def one_each(of: str, fits: Callable[[Any], bool]) -> ValueKind:
    """The kind of a number, or a list with one for each."""
    words = f"a number or one {of}"
    return ValueKind(words, lambda v: v != [] and all(map(fits, v if LIST.fits(v) else [v])))


NUMBER = ValueKind("a finite number", is_finite)
WHOLE = ValueKind("a whole number", lambda v: isinstance(v, int) and not isinstance(v, bool))
SWITCH = ValueKind("true or false", lambda v: isinstance(v, bool))
TEXT = ValueKind("text in quotes", lambda v: isinstance(v, str))
LIST = ValueKind("a list", lambda v: isinstance(v, list | tuple))
TEXTS = ValueKind(
    "text in quotes, or a list of it",
    lambda v: TEXT.fits(v) or (LIST.fits(v) and all(map(TEXT.fits, v))),
)
TABLE = ValueKind("a section", lambda v: isinstance(v, Mapping))
PER_JOINT = one_each("a joint", is_finite)
PER_AXIS = one_each("an axis", lambda v: is_finite(v) or v == math.inf)


def spread(value: Any, count: int, each: str, what: str) -> Array:  # noqa: ANN401 - TOML's
    """One number each from one number or a list with one for each. (count,)"""
    array = np.atleast_1d(np.asarray(value, dtype=np.float64))
    if array.shape not in {(1,), (count,)}:
        raise ParameterError(
            f"{what} has {array.size} values; give one, or one for each of {count} {each}"
        )
    return np.array(np.broadcast_to(array, (count,)))


def set_value(text: str, whole: str) -> float | list[float]:
    """One number or several of an assignment of ``--set``."""
    values = numbers(text)
    if values is None:
        raise ParameterError(f"--set {whole!r}: {text!r} is not a number or a list")
    return values[0] if len(values) == 1 else list(values)
