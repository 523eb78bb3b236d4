"""What a paper is here: its tables and figures, what they print, and what measures the same.

A paper is a file that declares one `Paper`; how its experiments run, and how they are shown, is
the same for all.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from vftcli.outputs.page.charts import Chart
from vftcli.signals.errors import ParameterError

#: Variants of a value: by the printed formulas; by the corrected ones; these with R and Q read as
#: densities; the reference's own error.
AS_PRINTED, CORRECTED, DENSITY, FLOOR = "as printed", "corrected", "R density", "floor"
#: Key of a line → variant → value, None where it did not happen.
Values = dict[str, dict[str, float | None]]


@dataclass(frozen=True)
class RunResult:
    """What one run of an experiment gave."""

    values: Values  #: Its numbers.
    charts: Mapping[str, Chart] = field(default_factory=dict)  #: Name of an item → its traces.


@dataclass(frozen=True)
class Experiment:
    """One experiment, which several tables and figures may show."""

    title: str  #: What it is, with its scenario.
    work: Callable[[int], RunResult]  #: Seed → what came out.
    seeds: tuple[int, ...] = (1, 2, 3, 4, 5)  #: Those of a full run; ``--fast`` takes the first.
    alone: bool = False  #: Whether nothing may run beside it, because it takes the time.


class PrintedLine(NamedTuple):
    """One line of an item's table."""

    key: str  #: Where its values stand among the measured ones.
    label: str  #: What it is.
    unit: str = ""  #: Its unit, "" for none.
    printed: str = ""  #: What the paper prints, "" for nothing.
    #: Whether ours over the print says anything: not where it is another machine's time or another
    #: arm's error.
    compared: bool = True

    @property
    def number(self) -> float | None:
        """The printed number; None where none is printed, or a bound."""
        try:
            return float(self.printed)
        except ValueError:
            return None


@dataclass(frozen=True, kw_only=True)
class PaperItem:
    """A table or a figure of the paper, or what it concludes."""

    label: str  #: What the paper calls it.
    title: str  #: What it shows.
    why: str  #: Why ours differs, or why nothing can be compared, in a sentence.
    verdict: str  #: Whether it is reproduced, in a few words.
    experiments: tuple[str, ...] = ()  #: Those that it shows; none for a picture.
    lines: tuple[PrintedLine, ...] = ()  #: Its table.
    #: Columns of ours between the print and the floor.
    variants: tuple[str, ...] = (AS_PRINTED, CORRECTED)
    nearest: str = CORRECTED  #: The column of ours that is set beside the print in the overview.
    drawn: bool = False  #: Whether it has traces.


@dataclass(frozen=True, kw_only=True)
class Paper:
    """A paper."""

    name: str  #: What it is called at the command line.
    title: str  #: Authors, title, place.
    doi: str  #: Its identifier.
    experiments: Mapping[str, Experiment]  #: Name → experiment.
    items: Mapping[str, PaperItem]  #: Name → table or figure, in the paper's order.
    setting: tuple[str, ...]  #: How it is run, in sentences.

    def chosen(self, only: str | None) -> tuple[str, ...]:
        """The names of these items, all if none are named."""
        if only is None:
            return tuple(self.items)
        names = [name.strip() for name in only.split(",") if name.strip()]
        unknown = [name for name in names if name not in self.items]
        if unknown or not names:
            what = f"no {unknown[0]!r} in {self.name}" if unknown else "--only names nothing"
            raise ParameterError(f"{what}; there is {', '.join(self.items)}")
        return tuple(name for name in self.items if name in names)


@dataclass(frozen=True)
class ShownItem:
    """An item with what its experiments gave."""

    item: PaperItem  #: It.
    #: Key of a line → variant → one value a seed.
    values: Mapping[str, Mapping[str, Sequence[float | None]]]
    chart: Chart | None  #: Its traces, of the first seed.
    failures: tuple[str, ...]  #: One line for each run that failed.
