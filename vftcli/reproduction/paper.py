"""What a paper is here: its tables and figures, what they print, and what measures the same.

A paper is a file that declares one `Paper`; how its experiments run, and how they are shown, is
the same for all.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from vftcli.outputs.page.charts import Chart
from vftcli.signals.errors import ParameterError

AS_PRINTED, CORRECTED, DENSITY, FLOOR = "as printed", "corrected", "R density", "floor"
"""Variants of a value: by the printed formulas; by the corrected ones; these with R and Q read as
densities; the reference's own error."""

Values = dict[str, dict[str, float | None]]
"""Key of a line → variant → value, None where it did not happen."""


@dataclass(frozen=True)
class RunResult:
    """What one run of an experiment gave.

    Attributes:
        values: Its numbers.
        charts: Name of an item → its traces.
    """

    values: Values
    charts: Mapping[str, Chart] = field(default_factory=dict)


@dataclass(frozen=True)
class Experiment:
    """One experiment, which several tables and figures may show.

    Attributes:
        title: What it is, with its scenario.
        work: Seed → what came out.
        seeds: Those of a full run; ``--fast`` takes the first.
        alone: Whether nothing may run beside it, because it takes the time.
    """

    title: str
    work: Callable[[int], RunResult]
    seeds: tuple[int, ...] = (1, 2, 3, 4, 5)
    alone: bool = False


class PrintedLine(NamedTuple):
    """One line of an item's table.

    Attributes:
        key: Where its values stand among the measured ones.
        label: What it is.
        unit: Its unit, "" for none.
        printed: What the paper prints, "" for nothing.
        compared: Whether ours over the print says anything: not where it is another machine's time
            or another arm's error.
    """

    key: str
    label: str
    unit: str = ""
    printed: str = ""
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
    """A table or a figure of the paper, or what it concludes.

    Attributes:
        label: What the paper calls it.
        title: What it shows.
        why: Why ours differs, or why nothing can be compared, in a sentence.
        verdict: Whether it is reproduced, in a few words.
        experiments: Those that it shows; none for a picture.
        lines: Its table.
        variants: Columns of ours between the print and the floor.
        nearest: The column of ours that is set beside the print in the overview.
        drawn: Whether it has traces.
    """

    label: str
    title: str
    why: str
    verdict: str
    experiments: tuple[str, ...] = ()
    lines: tuple[PrintedLine, ...] = ()
    variants: tuple[str, ...] = (AS_PRINTED, CORRECTED)
    nearest: str = CORRECTED
    drawn: bool = False


@dataclass(frozen=True, kw_only=True)
class Paper:
    """A paper.

    Attributes:
        name: What it is called at the command line.
        title: Authors, title, place.
        doi: Its identifier.
        experiments: Name → experiment.
        items: Name → table or figure, in the paper's order.
        setting: How it is run, in sentences.
    """

    name: str
    title: str
    doi: str
    experiments: Mapping[str, Experiment]
    items: Mapping[str, PaperItem]
    setting: tuple[str, ...]

    def chosen(self, only: str | None) -> tuple[str, ...]:
        """The names of these items, all if none are named.

        Args:
            only: Names, comma-separated.

        Raises:
            ParameterError: If one is not there.
        """
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
    """An item with what its experiments gave.

    Attributes:
        item: It.
        values: Key of a line → variant → one value a seed.
        chart: Its traces, of the first seed.
        failures: One line for each run that failed.
    """

    item: PaperItem
    values: Mapping[str, Mapping[str, Sequence[float | None]]]
    chart: Chart | None
    failures: tuple[str, ...]
