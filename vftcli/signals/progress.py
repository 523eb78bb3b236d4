"""How far a long piece of work is: loops say it to whoever watches."""

from collections.abc import Callable, Iterator, Sequence
from contextvars import ContextVar
from typing import TypeVar

Item = TypeVar("Item")


def nobody(_share: float) -> None:
    """Tell nobody."""


def no_stage(_stage: str, _begin: float, _end: float) -> None:
    """Tell nobody what is being done."""


_watcher: ContextVar[Callable[[float], None]] = ContextVar("watcher", default=nobody)
_part: ContextVar[tuple[float, float]] = ContextVar("part", default=(0.0, 1.0))


def watch(watcher: Callable[[float], None]) -> None:
    """From now on tell someone the share of the work that is done, 0 to 1."""
    _watcher.set(watcher)


def enter(begin: float, end: float) -> None:
    """What is done now is the work from one share to another."""
    _part.set((begin, end - begin))
    _watcher.get()(begin)


def steps(items: Sequence[Item]) -> Iterator[Item]:
    """The items of a loop; before each it says what share is done."""
    begin, width = _part.get()
    for k, item in enumerate(items):
        first = begin + width * k / len(items)
        _part.set((first, width / len(items)))
        _watcher.get()(first)
        yield item
    _part.set((begin, width))
