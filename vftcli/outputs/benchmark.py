"""What a benchmark says, of its table of rows: the headline, each arm, the lists, the page."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import reduce
from operator import add
from typing import Any, NamedTuple

import numpy as np
import polars as pl

from vftcli.evaluation.detection import rate_interval, share_interval
from vftcli.evaluation.scores import LAGS, Score, percentiles
from vftcli.outputs.charts import Span, colours_of_names
from vftcli.outputs.grid import (
    Column,
    Grid,
    Rows,
    csv_rows,
    keyed_grid,
    latex,
    markdown,
    terminal,
    words,
)
from vftcli.outputs.page.shell import Box, Scales, page
from vftcli.outputs.quantity import DASH

LISTS = {"list": "counted", "list with candidates": "all"}
#: What the marks of a method mean.
MARKS = {
    "*": "uses the whole log, its future too",
    "!": "scored in spite of a complaint (--anyway)",
    "~": "nearer to the least error than the truth's own error",
}
COUNTS = ("found", "true_contacts", "false", "free_h")
GATHERED = pl.col("onset_s", "peak_error_N", "true_peak_N")
TOTALS = pl.col("true_contacts", "found", "found_as_load", "split", "false", "free_h", "peaks_held")


class ArmResult(NamedTuple):
    """One method on one part of the logs of an arm, by one protocol."""

    arm: str
    protocol: str
    method: str  #: With its marks.
    part: str
    score: Score
    exact_model: bool
    truth_error: float  #: [N·m]
    lag: tuple[float, float] | None  #: Shift of least error [s], and the RMSE there over that at 0.

    def record(self, best: "ArmResult | None") -> dict[str, Any]:
        """The row for machines and tables; `best` is what it is compared with draw by draw."""
        score, drawn = self.score, self.score.drawn
        low, high = percentiles(drawn)
        less: tuple[float, float] = (np.nan, np.nan)
        if best is not None and drawn is not None and best.score.drawn is not None:
            less = percentiles(drawn - best.score.drawn)
        return {
            "arm": self.arm,
            "protocol": self.protocol,
            "method": self.method,
            "part": self.part,
            "seconds": float(score.seconds.sum()),
            "rmse_Nm": float(score.rmse.mean()),
            "rmse_low_Nm": low,
            "rmse_high_Nm": high,
            "l1_Nm": float(score.l1.mean()),
            # Zero is perfect in free motion: there L1 and false rows speak.
            "skill": np.nan if self.part == "free" else score.skill,
            "coverage_95": score.coverage,
            "interval_score_Nm": score.interval_score,
            "missing": score.missed,
            "lag_s": None if self.lag is None else self.lag[0],
            "rmse_at_lag": None if self.lag is None else self.lag[1],
            "over_best_low_Nm": less[0],
            "over_best_high_Nm": less[1],
            "exact_model": self.exact_model,
        }


class Results:
    """Everything that a benchmark found, pooled by arm and never across arms."""

    def __init__(self, table: pl.DataFrame) -> None:
        marks = pl.when("future").then(pl.lit(" *")).otherwise(pl.lit(""))
        marked = pl.when("marked").then(pl.lit(" !")).otherwise(pl.lit(""))
        self.table = table.with_columns(method=pl.col("method") + marks + marked)
        self.methods = self.table["method"].unique(maintain_order=True).to_list()
        self.protocols = self.table["protocol"].unique(maintain_order=True).to_list()
        self.arms = list(self._pooled())

    def _pooled(self) -> Iterator[ArmResult]:
        keys = ("arm", "protocol", "method", "part")
        joints = self.table.drop_nulls("joint")
        lags = self.table.drop_nulls("lag_squares")
        for (arm, protocol, method, part), rows in joints.group_by(keys, maintain_order=True):
            logs = rows.partition_by("log", maintain_order=True)
            score = reduce(add, (Score.joined(log.to_dicts()) for log in logs))
            own = lags.filter(arm=arm, protocol=protocol, method=method)["lag_squares"].to_list()
            lag = None
            if own and part == "all":
                sums = np.sum(own, axis=0)
                at = int(np.argmin(sums))
                lag = float(LAGS[at]), float(np.sqrt(sums[at] / sums[np.argmin(abs(LAGS))]))
            exact, error = rows["exact_model"].all(), rows["truth_error_Nm"].max()
            named = str(arm), str(protocol), str(method), str(part)
            yield ArmResult(*named, score, bool(exact), float(error), lag)  # type: ignore[arg-type]

    def rows(self) -> list[dict[str, Any]]:
        """One row an arm, protocol, method and part."""
        best = {(r.arm, r.protocol, r.part): r for r in self.arms if r.method.startswith("best")}
        return [r.record(best.get((r.arm, r.protocol, r.part))) for r in self.arms]

    def counted(self, protocol: str, part: str) -> list[str]:
        """The arms in the headline of a part: those of an exact model only if all are."""
        own = [r for r in self.arms if (r.protocol, r.part) == (protocol, part)]
        real = [r.arm for r in own if not r.exact_model]
        return list(dict.fromkeys(real or [r.arm for r in own]))

    def mean(self, protocol: str, method: str, part: str) -> float | None:
        """Mean over the arms of skill in contact, of L1 elsewhere; None unless it has all."""
        arms = self.counted(protocol, part)
        found = {
            r.arm: r.score.skill if part == "contact" else float(r.score.l1.mean())
            for r in self.arms
            if (r.protocol, r.method, r.part) == (protocol, method, part)
        }
        return (
            float(np.mean([found[a] for a in arms])) if arms and found.keys() >= {*arms} else None
        )

    def headline(self) -> Grid:
        """Methods down; skill in contact and L1 in free motion of each protocol across."""
        asked = [(p, part) for part in ("contact", "free") for p in self.protocols]
        asked = [(p, part) for p, part in asked if self.counted(p, part)]
        columns = [
            Column(f"skill, {p}", form=".2f")
            if part == "contact"
            else Column(f"free L1, {p}", "N·m")
            for p, part in asked
        ]
        rows: Rows = [
            (method, *(self.mean(p, method, part) for p, part in asked)) for method in self.methods
        ]
        known = [row for row in rows if any(value is not None for value in row[1:])]
        return Grid((*words("method"), *columns), known, swatches=True)

    def counts(self, *keys: str) -> list[dict[str, Any]]:
        """Counts of lists against the true contacts, pooled by these keys of a row."""
        lists = self.table.filter(pl.col("part").is_in([*LISTS]))
        gathered = (TOTALS.sum(), GATHERED.explode().drop_nulls(), pl.col("hardest_false_N").max())
        return lists.group_by(keys, maintain_order=True).agg(*gathered).to_dicts()

    def lists(self) -> Iterator[Grid]:
        """How the lists of contacts agree with the true ones, a table a protocol and method."""
        rows = self.counts("protocol", "method", "arm", "part")
        for protocol, method in dict.fromkeys((r["protocol"], r["method"]) for r in rows):
            own = [list_row(r) for r in rows if (r["protocol"], r["method"]) == (protocol, method)]
            title = f"Contacts listed by {method}, {protocol}; onset: median (90 %)"
            yield Grid(LIST_COLUMNS, own, title)

    def list_lines(self) -> Iterator[str]:
        """The lists in a line a protocol and method, over the arms that are counted."""
        named = {
            p: set(self.counted(p, "contact") + self.counted(p, "free")) for p in self.protocols
        }
        rows = self.counts("protocol", "method", "arm", "part")
        own = [r for r in rows if r["part"] == "list" and r["arm"] in named[r["protocol"]]]
        for protocol, method in dict.fromkeys((r["protocol"], r["method"]) for r in own):
            each = [r for r in own if (r["protocol"], r["method"]) == (protocol, method)]
            found, true, false, hours = (sum(r[k] for r in each) for k in COUNTS)
            low, high = rate_interval(false, hours)
            yield (
                f"{method} lists, {protocol}: {found} of {true} true contacts; {false} false, "
                f"{false / hours if hours else 0:.0f} an hour ({low:.0f} to {high:.0f})"
            )

    def arm_grids(self) -> Iterator[Grid]:
        """Of each arm and protocol its methods, part by part."""
        rows = self.rows()
        for arm, protocol in dict.fromkeys((row["arm"], row["protocol"]) for row in rows):
            for part in ("contact", "all", "free"):
                key = arm, protocol, part
                own = [r for r in rows if (r["arm"], r["protocol"], r["part"]) == key]
                if own:
                    title = f"{', '.join(key)} ({own[0]['seconds']:.0f} s)"
                    shown = map(shown_row, self.greyed(own))
                    yield keyed_grid(ARM_COLUMNS, shown, title, swatches=True)

    def greyed(self, rows: Sequence[dict[str, Any]]) -> Iterator[dict[str, Any]]:
        """Rows of one table, marked where the truth's own error hides what parts them."""
        key = rows[0]["arm"], rows[0]["protocol"], rows[0]["part"]
        error = max(r.truth_error for r in self.arms if (r.arm, r.protocol, r.part) == key)
        least = min(row["rmse_Nm"] for row in rows if row["method"] != "zero" or len(rows) == 1)
        for row in rows:
            near = 0.0 < row["rmse_Nm"] - least < error
            yield {**row, "method": row["method"] + " ~" * near}

    def wrenches(self) -> Iterator[Grid]:
        """Errors of the wrench in contact, and of a carried weight."""
        sums = pl.col("^(true_)?(force|moment)_squares$", "wrench_missing_s", "wrench_s").sum()
        pooled = self.table.filter(part="wrench").group_by(
            ("arm", "protocol", "method"), maintain_order=True
        )
        found: Rows = [
            (
                *(row[k] for k in ("arm", "protocol", "method")),
                *(float(np.sqrt(row[f"{k}_squares"] / row["wrench_s"])) for k in WRENCH_KEYS),
                row["wrench_missing_s"] / row["wrench_s"],
            )
            for row in pooled.agg(sums).iter_rows(named=True)
        ]
        if found:
            yield Grid(
                (*words("arm", "protocol", "method"), *WRENCH_COLUMNS),
                found,
                "Wrench in contact, rms error",
            )
        weight = self.table.filter(part="weight")
        if len(weight):
            columns = {
                **dict(
                    zip(
                        ("log", "protocol", "method"),
                        words("log", "protocol", "method"),
                        strict=True,
                    )
                ),
                "weight_N": Column("true weight", "N", ".1f"),
                "mean_N": Column("mean found", "N", ".1f"),
                "rms_error_N": Column("rms error", "N", ".1f"),
                "answered": Column("answered", form=".2f"),
            }
            yield keyed_grid(columns, weight.iter_rows(named=True), "A carried weight")

    def grids(self) -> Iterator[Grid]:
        """Every table, the headline first."""
        title = "Skill in contact, and L1 in free motion"
        yield replace(self.headline(), title=title, notes=(*self.marks(),))
        yield from self.lists()
        yield from self.arm_grids()
        yield from self.wrenches()

    def marks(self) -> list[str]:
        """What the marks mean that are used."""
        used = "".join(self.methods) + "~" * any(r.truth_error for r in self.arms)
        return [f"{mark}: {meaning}" for mark, meaning in MARKS.items() if mark in used]

    def arms_line(self) -> str:
        """Of which arms the headline is the mean, protocol by protocol."""
        named = {p: self.counted(p, "contact") for p in self.protocols}
        free = list(dict.fromkeys(a for p in self.protocols for a in self.counted(p, "free")))
        lines = [f"skill, {p}: {'; '.join(arms)}" for p, arms in named.items() if arms]
        return "\n".join([*lines, f"free L1: {'; '.join(free)}"] if free else lines)


WRENCH_KEYS = ("force", "true_force", "moment", "true_moment")
WRENCH_COLUMNS = (
    Column("force", "N", ".2f"), Column("truth's rms", "N", ".2f"),
    Column("moment", "N·m", ".2f"), Column("truth's rms", "N·m", ".2f"),
    Column("no answer", form=".2f"),
)  # fmt: skip
ARM_COLUMNS = {
    "method": Column("method", words=True),
    "rmse_Nm": Column("RMSE", "N·m"),
    "interval": Column("95 %", words=True),
    "l1_Nm": Column("L1", "N·m"),
    "skill": Column("skill", form=".2f"),
    "coverage_95": Column("band holds", form=".2f"),
    "interval_score_Nm": Column("interval score", "N·m", seldom=True),
    "missing": Column("no answer", form=".2f", seldom=True),
    "lag": Column("lag", "s", words=True, seldom=True),
    "over_best": Column("over best, 95 %", words=True, seldom=True),
}
LIST_COLUMNS = (
    *words("arm", "rows", "found", "false/h"), Column("onset", "s", words=True),
    Column("split", seldom=True), Column("as load", seldom=True),
    Column("peak error", "N", words=True, seldom=True),
    Column("hardest false", "N", ".0f", seldom=True),
)  # fmt: skip


def shown_row(row: Mapping[str, Any]) -> dict[str, Any]:
    """A row with its intervals as text."""
    lag = None if row["lag_s"] is None else f"{row['lag_s']:+.2f} (× {row['rmse_at_lag']:.2f})"
    return {
        **row,
        "interval": between(row["rmse_low_Nm"], row["rmse_high_Nm"]),
        "over_best": between(row["over_best_low_Nm"], row["over_best_high_Nm"]),
        "lag": lag,
    }


def between(low: float, high: float, form: str = ".3g") -> str:
    """An interval as text, a dash for none."""
    return f"{low:{form}}–{high:{form}}" if np.isfinite(low) else DASH


def list_row(row: Mapping[str, Any]) -> Sequence[Any]:
    """Counts of one arm's lists as texts, with their intervals."""
    found, true, false, hours = (row[k] for k in COUNTS)
    low, high = share_interval(found, true)
    share = f"{found}/{true} ({between(low, high, '.2f')})" if true else DASH
    rate = DASH
    if hours:
        rate = f"{false / hours:.0f} ({between(*rate_interval(false, hours), '.0f')})"
    onset, error = np.array(row["onset_s"], float), np.array(row["peak_error_N"], float)
    late = f"{np.median(onset):.2f} ({np.quantile(onset, 0.9):.2f})" if len(onset) else DASH
    peaks = DASH
    if len(error):
        rms, mean = np.sqrt(np.mean(error**2)), np.mean(row["true_peak_N"])
        peaks = f"{error.mean():+.1f}, rms {rms:.1f} of {mean:.0f}, {row['peaks_held']} held"
    hardest = row["hardest_false_N"] if false else None
    texts = row["arm"], LISTS[row["part"]], share, rate, late
    return *texts, row["split"], row["found_as_load"], peaks, hardest


class Dot(NamedTuple):
    """A method's skill on one arm, in the drawing."""

    x: float
    low: float
    high: float
    y: float
    colour: str
    words: str


def dots(results: Results, protocol: str) -> tuple[Scales, list[tuple[float, str]], list[Dot]]:
    """Skill in contact of every arm, with its interval: scales, names by height, dots."""
    own = [r for r in results.arms if (r.protocol, r.part) == (protocol, "contact")]
    arms, colours = list(dict.fromkeys(r.arm for r in own)), colours_of_names(
        [m.split()[0] for m in results.methods]
    )  # fmt: skip
    low = min([0.0, *(r.score.skill for r in own)])
    box = Box(width=720.0, height=34.0 * len(arms) + 30.0, left=190.0)
    scales = Scales(box, Span(max(low, -1.0) - 0.05, 1.05), Span(0.0, float(len(arms))))
    found = []
    for r in own:
        if r.method.startswith("zero"):
            continue
        level = r.score.rmse.mean() / (1.0 - r.score.skill) if r.score.skill < 1.0 else np.nan
        ends = [1.0 - end / level for end in percentiles(r.score.drawn)]
        place = results.methods.index(r.method) / len(results.methods)
        y = float(scales.up(len(arms) - arms.index(r.arm) - 0.15 - 0.7 * place))
        x, high_x, low_x = (
            float(scales.across(np.clip(v, scales.x.low, 1.05)))
            for v in (r.score.skill, ends[0], ends[1])
        )
        text = f"{r.arm}, {r.method}: {r.score.skill:.2f}"
        found.append(Dot(x, low_x, high_x, y, colours[r.method.split()[0]], text))
    names = [(float(scales.up(len(arms) - k - 0.5)), arm) for k, arm in enumerate(arms)]
    return scales, names, found


def to_terminal(results: Results, *, every: bool) -> str:
    """The headline, the lists, and which arms they are of; every table where that is asked."""
    grids = [*results.grids()][1:] if every else ()
    below = [*results.list_lines(), results.arms_line(), *results.marks()]
    head = terminal(results.headline()) + "".join(f"{line}\n" for line in below)
    return "\n".join([head, *map(terminal, grids)])


#: Name of a form → what it makes of the results.
FORMS: dict[str, Callable[[Results], str]] = {
    "csv": lambda results: csv_rows(rows := results.rows(), rows[0] if rows else ()),
    "markdown": lambda results: "\n".join(map(markdown, results.grids())),
    "latex": lambda results: "\n".join(map(latex, results.grids())),
}


def render_benchmark(results: Results, title: str, record: Mapping[str, Any]) -> str:
    """The page of a benchmark."""
    each = [(p, *dots(results, p)) for p in results.protocols if results.counted(p, "contact")]
    colours = colours_of_names([m.split()[0] for m in results.methods])
    keys = ("recording", "arm", "truth", "truth_error", "licence", "source")
    logs = keyed_grid(dict(zip(keys, words(*keys), strict=True)), record["logs"])
    return page(
        "benchmark.html",
        title,
        styles={m: (colours[m.split()[0]], "") for m in results.methods},
        results=results,
        plots=each,
        logs=logs,
        record=record,
    )
