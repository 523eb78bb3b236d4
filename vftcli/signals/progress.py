"""Progress of long work: stages and loops report it to any listener."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TypeVar

Item = TypeVar("Item")
#: Hears what is done now, "" for the same as before, and the share of the work that is done.
Hearer = Callable[[str, float], None]


def nobody(_stage: str, _share: float) -> None:
    """Hear nothing."""


_hearer: ContextVar[Hearer] = ContextVar("hearer", default=nobody)
_part: ContextVar[tuple[float, float]] = ContextVar("part", default=(0.0, 1.0))


@contextmanager
def heard_by(hearer: Hearer) -> Iterator[None]:
    """Report to another listener within a block, or to `nobody`."""
    token = _hearer.set(hearer)
    try:
        yield
    finally:
        _hearer.reset(token)


def stage(name: str, begin: float = 0.0, end: float = 1.0) -> None:
    """Report the current work, from one share to another."""
    _part.set((begin, end - begin))
    _hearer.get()(name, begin)


def passed(share: float) -> None:
    """Report that so much of the current work is done."""
    begin, width = _part.get()
    _hearer.get()("", begin + width * share)


def steps(items: Sequence[Item]) -> Iterator[Item]:
    """The items of a loop; before each its share is reported."""
    begin, width = _part.get()
    for k, item in enumerate(items):
        first = begin + width * k / len(items)
        _part.set((first, width / len(items)))
        _hearer.get()("", first)
        yield item
    _part.set((begin, width))
