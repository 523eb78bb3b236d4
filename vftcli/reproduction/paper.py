"""A paper: its tables and figures, their print, and their experiments.

A paper is a TOML file beside this one; all run and are shown alike.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product
from typing import Any, NamedTuple

from vftcli.evaluation.published import TABLES
from vftcli.outputs.charts import Chart
from vftcli.signals.errors import ParameterError
from vftcli.signals.parsing import check_known, tables_beside

#: Variants of a value: printed formulas; corrected ones; these with R and Q as densities;
#: the reference's own error.
AS_PRINTED, CORRECTED, DENSITY, FLOOR = "as printed", "corrected", "R density", "floor"
Value = float | Chart | None  #: A number, traces, or None for what did not happen.
#: One result: a variant, a line's key and its number; or "", an item's name, its traces.
Given = tuple[str, str, Value]


@dataclass(frozen=True, kw_only=True)
class Experiment:
    """One experiment, for one or more tables and figures."""

    name: str
    title: str  #: Its content, with its scenario.
    run: str  #: Name of the function that runs it.
    given: Mapping[str, Any] = field(default_factory=dict)  #: Its arguments beside the seed.
    seeds: Sequence[int] = (1, 2, 3, 4, 5)

    alone: bool = False  #: Whether it measures time: nothing may run beside.


class PrintedLine(NamedTuple):
    """One line of an item's table."""

    key: str  #: Where its values stand among the measured ones.
    label: str
    unit: str = ""  #: Its unit, "" for none.
    printed: str = ""  #: Number in the paper, "" for none.
    compared: bool = True  #: Whether ours over the print says anything.

    @property
    def number(self) -> float | None:
        """The printed number; None where none is printed, or a bound."""
        try:
            return float(self.printed)
        except ValueError:
            return None


@dataclass(frozen=True, kw_only=True)
class PaperItem:
    """A table or a figure of the paper; once run, with its results."""

    label: str  #: Its name in the paper.
    title: str
    #: Why ours differs, or why nothing can be compared, in a sentence.
    why: str = "Photographs."
    verdict: str = "a picture"  #: Whether it is reproduced, in a few words.
    experiments: Sequence[str] = ()  #: Those that it shows; none for a picture.
    lines: Sequence[PrintedLine] = ()
    #: Columns of ours between the print and the floor.
    variants: Sequence[str] = (AS_PRINTED, CORRECTED)
    #: The column of ours beside the print in the overview.
    nearest: str = CORRECTED
    traces: str = ""  #: Title of its chart, "" if it has none.
    #: Key of a line → variant → one value a seed.
    values: Mapping[str, Mapping[str, Sequence[float | None]]] = field(default_factory=dict)
    chart: Chart | None = None  #: Its traces, of the first seed.
    failures: Sequence[str] = ()  #: One line for each run that failed.

    @property
    def heading(self) -> str:
        """Its name and title."""
        return f"{self.label}: {self.title}"


@dataclass(frozen=True, kw_only=True)
class Paper:
    """A paper."""

    name: str  #: Its name at the command line.
    title: str  #: Authors, title, place.
    doi: str
    experiments: Mapping[str, Experiment]  #: Name → experiment.
    items: Mapping[str, PaperItem]  #: Name → table or figure, in the paper's order.
    setting: Sequence[str]  #: Settings, in sentences.

    def chosen(self, only: str | None) -> tuple[str, ...]:
        """The names of these items, all if none are named."""
        if only is None:
            return tuple(self.items)
        names = [name.strip() for name in only.split(",") if name.strip()]
        if not names:
            raise ParameterError(f"--only names nothing; there is {', '.join(self.items)}")
        for name in names:
            check_known(name, self.items, f"no {name!r} in {self.name}")
        return tuple(name for name in self.items if name in names)


def load_paper(name: str) -> Paper:
    """The paper of a TOML file beside this one."""
    declared = dict(tables_beside(__file__, f"{name}.toml"))
    each = declared.pop("each")
    items = {}
    for key, entry in declared.pop("items").items():
        lines = [line for row in entry.get("lines", ()) for line in lines_of(row, each)]
        items[key] = PaperItem(**entry | {"lines": lines})
    experiments = {
        key: Experiment(name=key, **entry) for key, entry in declared.pop("experiments").items()
    }
    return Paper(name=name, experiments=experiments, items=items, **declared)


def lines_of(row: Sequence[Any], each: Mapping[str, Mapping[str, str]]) -> Iterator[PrintedLine]:
    """The lines of a row, one for each of the names in braces."""
    line = PrintedLine(*row)
    names = re.findall(r"{(\w+)}", line.key)
    choices = list(product(*(each[name].items() for name in names)))
    numbers: Any = line.printed
    if isinstance(numbers, str) and (table := TABLES.get(numbers)):
        numbers = [f"{rmse:.4f}" for own in table.rmse.values() for rmse in own]
    elif isinstance(numbers, str):
        numbers = [numbers] * len(choices)
    for choice, number in zip(choices, numbers, strict=True):
        each_name = dict(zip(names, choice, strict=True))
        keys = {name: key for name, (key, _) in each_name.items()}
        words = {name: word for name, (_, word) in each_name.items()}
        yield line._replace(
            key=line.key.format(**keys), label=line.label.format(**words), printed=number
        )


#: Name at the command line → the paper.
PAPERS = {name: load_paper(name) for name in ("huang2025",)}


def paper_of(name: str) -> Paper:
    """The paper of this name."""
    check_known(name, PAPERS, f"no paper {name!r}")
    return PAPERS[name]
