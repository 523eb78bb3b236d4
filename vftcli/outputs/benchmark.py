"""What a benchmark says, of its table of rows: the headline, each arm, the lists, the page."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property, reduce
from operator import add
from typing import Any, NamedTuple

import numpy as np
import polars as pl

from vftcli.evaluation.detection import rate_interval, share_interval
from vftcli.evaluation.scores import LAGS, Score, percentiles
from vftcli.observers.table import BEST
from vftcli.outputs.charts import REFERENCE, Chart, ChartLine, Span, colours_of_names, paint
from vftcli.outputs.grid import (
    Column,
    Grid,
    GridCell,
    Rows,
    csv_rows,
    keyed_grid,
    latex,
    markdown,
    terminal,
    words,
)
from vftcli.outputs.page.shell import Box, Scales, page
from vftcli.outputs.quantity import DASH, percent, significant

SILENT = 0.05  #: Share of time without an answer from which it is said.
LISTS = {"list": "counted", "list with candidates": "all"}
COUNTS = ("found", "true_contacts", "false", "free_h")
#: What lists of several logs are pooled by: sums, all of these, the largest.
POOLED = (
    pl.col(*COUNTS, "found_as_load", "split", "peaks_held").sum(),
    pl.col("onset_s", "peak_error_N", "true_peak_N").explode().drop_nulls(),
    pl.col("hardest_false_N").max(),
)
#: Columns of an arm's table; `keyed_grid` fills them.
ARM_COLUMNS = {
    "method": Column("method", words=True),
    "rmse": Column("RMSE", "N·m"),
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
BY = ("arm", "protocol", "method")
WRENCH_COLUMNS = dict(zip(BY, words(*BY), strict=True)) | {
    "force_squares": Column("force", "N", ".2f"),
    "true_force_squares": Column("truth's rms", "N", ".2f"),
    "moment_squares": Column("moment", "N·m", ".2f"),
    "true_moment_squares": Column("truth's rms", "N·m", ".2f"),
    "wrench_missing_s": Column("no answer", form=".2f"),
}
WEIGHT_COLUMNS = dict(zip(("log", *BY[1:]), words("log", *BY[1:]), strict=True)) | {
    "weight_N": Column("true weight", "N", ".1f"),
    "mean_N": Column("mean found", "N", ".1f"),
    "rms_error_N": Column("rms error", "N", ".1f"),
    "answered": Column("answered", form=".2f"),
}


class Results:
    """Everything that a benchmark found, pooled by arm and never across arms."""

    def __init__(self, table: pl.DataFrame) -> None:
        self.table = table
        self.methods = table["method"].unique(maintain_order=True).to_list()
        self.protocols = table["protocol"].unique(maintain_order=True).to_list()
        #: Name → colour of every method but zero, which is grey.
        self.colours = colours_of_names([name for name in self.methods if name != "zero"])

    @cached_property
    def rows(self) -> list[dict[str, Any]]:
        """One row an arm, protocol, method and part, for machines and tables."""
        joints, places = self.table.drop_nulls("joint"), (*BY, "part")
        found = joints.partition_by(*places, maintain_order=True, as_dict=True)
        scores = {}
        for place, rows in found.items():
            logs = rows.partition_by("log", maintain_order=True)
            scores[place] = reduce(add, (Score.joined(log.to_dicts()) for log in logs))
        return [
            {
                **dict(zip(places, place, strict=True)),
                "exact_model": found[place]["exact_model"][0],
                **numbers_of(score, scores.get((*place[:2], BEST, place[3]))),
                # Zero is perfect in free motion: there L1 and false rows speak.
                **({"skill": np.nan} if place[3] == "free" else {}),
                **self.lag(place),
            }
            for place, score in scores.items()
        ]

    def lag(self, place: Sequence[object]) -> dict[str, float]:
        """Shift of an estimate with the least error [s], and its RMSE over that at 0."""
        own = self.table.drop_nulls("lag_squares").filter(**dict(zip(BY, place, strict=False)))
        if place[3] != "all" or own.is_empty():
            return {"lag_s": np.nan, "rmse_at_lag": np.nan}
        sums = np.sum(own["lag_squares"].to_list(), axis=0)
        share = np.sqrt(sums.min() / sums[abs(LAGS).argmin()])
        return {"lag_s": float(LAGS[sums.argmin()]), "rmse_at_lag": float(share)}

    def of(self, protocol: str, part: str) -> list[dict[str, Any]]:
        """The rows of a protocol and part."""
        return [row for row in self.rows if (row["protocol"], row["part"]) == (protocol, part)]

    def counted(self, protocol: str, part: str) -> list[str]:
        """The arms in the headline of a part: those of an exact model only if all are."""
        own = self.of(protocol, part)
        real = [row["arm"] for row in own if not row["exact_model"]]
        return list(dict.fromkeys(real or [row["arm"] for row in own]))

    def mean(self, protocol: str, method: str, part: str) -> float | None:
        """Mean over the arms of skill in contact, of L1 elsewhere; None unless it has all."""
        arms, key = self.counted(protocol, part), "skill" if part == "contact" else "l1_Nm"
        own = self.of(protocol, part)
        found = {row["arm"]: row[key] for row in own if row["method"] == method}
        return float(np.mean([found[arm] for arm in arms])) if found.keys() >= {*arms} else None

    def headline(self) -> Grid:
        """Methods down; skill in contact and L1 in free motion of each protocol across."""
        heads = {"contact": Column("skill", form=".2f"), "free": Column("free L1", "N·m")}
        asked = [(p, part) for part in heads for p in self.protocols if self.counted(p, part)]
        columns = [heads[part]._replace(head=f"{heads[part].head}, {p}") for p, part in asked]
        rows: Rows = [(m, *(self.mean(p, m, part) for p, part in asked)) for m in self.methods]
        known = [row for row in rows if any(value is not None for value in row[1:])]
        title = "Skill in contact, and L1 in free motion"
        return Grid((*words("method"), *columns), known, title, swatches=True)

    @cached_property
    def lists(self) -> list[pl.DataFrame]:
        """Counts of lists against the true contacts by arm, a frame a protocol and method."""
        lists = self.table.filter(pl.col("part").is_in([*LISTS]))
        pooled = lists.group_by(*BY, "part", maintain_order=True).agg(*POOLED)
        return pooled.partition_by("protocol", "method", maintain_order=True)

    def lines(self) -> Iterator[str]:
        """Below the headline: the lists in short, the arms, which methods use the future."""
        for rows in self.lists:
            _, protocol, method, *_ = rows.row(0)
            named = {*self.counted(protocol, "contact"), *self.counted(protocol, "free")}
            own = rows.filter(pl.col("arm").is_in(named), part="list")
            found, true, false, hours = own.select(*COUNTS).sum().row(0)
            low, high = rate_interval(false, hours)
            yield (
                f"{method} lists, {protocol}: {found} of {true} true contacts; {false} false, "
                f"{false / hours if hours else 0:.0f} an hour ({low:.0f} to {high:.0f})"
            )
        shown = {row[0] for row in self.headline().rows}
        if rest := [method for method in self.methods if shown and method not in shown]:
            why = "in no mean, as some arm lacks them (-v and page have their rows)"
            yield f"{why}: {', '.join(rest)}"
        yield from self.silences()
        for p in self.protocols:
            if arms := self.counted(p, "contact"):
                yield f"skill, {p}, is the mean of {'; '.join(arms)}"
        if free := dict.fromkeys(a for p in self.protocols for a in self.counted(p, "free")):
            yield f"free L1 is the mean of {'; '.join(free)}, where the protocol has them"
        if future := self.table.filter("future")["method"].unique(maintain_order=True).to_list():
            yield f"with the whole log, its future too: {', '.join(future)}"
        if marked := self.table.filter("marked")["log"].unique(maintain_order=True).to_list():
            yield f"in spite of a complaint (--anyway): {', '.join(marked)}"

    def silences(self) -> Iterator[str]:
        """Of each protocol and method the share of time without an answer, from `SILENT` on."""
        own: dict[tuple[str, str], list[tuple[float, float]]] = {}
        for p in self.protocols:
            for row in (*self.of(p, "contact"), *self.of(p, "free")):
                if row["arm"] in self.counted(p, row["part"]):
                    own.setdefault((row["method"], p), []).append((row["missing"], row["seconds"]))
        for (method, p), pairs in own.items():
            shares, seconds = zip(*pairs, strict=True)
            if (share := float(np.average(shares, weights=seconds))) > SILENT:
                yield f"{method}, {p}: no answer for {percent(share)} of the time, read as 0"

    def grids(self) -> Iterator[Grid]:
        """Every table below the headline."""
        for rows in self.lists:
            each = rows.to_dicts()
            title = "Contacts listed by {method}, {protocol}; onset: median (90 %)"
            yield Grid(LIST_COLUMNS, list(map(list_row, each)), title.format(**each[0]))
        for place in dict.fromkeys((r["arm"], r["protocol"], r["part"]) for r in self.rows):
            arm, protocol, part = place
            own = [row for row in self.of(protocol, part) if row["arm"] == arm]
            logs = self.table.filter(arm=arm, protocol=protocol, part=part)
            error = max(logs["truth_error_Nm"])
            title = f"{arm}, {protocol}, {part} ({own[0]['seconds']:.0f} s)"
            texts = [*shown_rows(own, error)]
            marked = any(text["rmse"].mark for text in texts)
            shown = keyed_grid(ARM_COLUMNS, texts, title, swatches=True)
            yield replace(shown, notes=(NEAR,) * marked, marked=marked)
        wrench = self.table.filter(part="wrench").group_by(*BY, maintain_order=True)
        squares, second = pl.col("^.*_squares$"), pl.col("wrench_s")
        pooled = wrench.agg(pl.col(*[*WRENCH_COLUMNS][3:], "wrench_s").sum())
        shares = pooled.with_columns((squares / second).sqrt(), pl.col("wrench_missing_s") / second)
        if len(shares):
            rows_of = shares.iter_rows(named=True)
            yield keyed_grid(WRENCH_COLUMNS, rows_of, "Wrench in contact, rms error")
        if len(weight := self.table.filter(part="weight")):
            yield keyed_grid(WEIGHT_COLUMNS, weight.iter_rows(named=True), "A carried weight")


#: What a mark behind an RMSE means.
NEAR = "~: nearer to the least RMSE than the truth's own error"


def numbers_of(score: Score, best: Score | None) -> dict[str, float]:
    """Numbers of a score, compared with that of `best` draw by draw."""
    drawn, less = score.drawn, None
    if best is not None and best is not score and drawn is not None and best.drawn is not None:
        less = drawn - best.drawn
    ends = {"rmse": percentiles(drawn), "over_best": percentiles(less)}
    return {
        "seconds": float(score.seconds.sum()),
        "rmse_Nm": float(score.rmse.mean()),
        **{f"{name}_low_Nm": low for name, (low, _) in ends.items()},
        **{f"{name}_high_Nm": high for name, (_, high) in ends.items()},
        "l1_Nm": float(score.l1.mean()),
        "skill": score.skill,
        "coverage_95": score.coverage,
        "interval_score_Nm": score.interval_score,
        "missing": score.missed,
    }


def shown_rows(rows: Sequence[dict[str, Any]], error: float) -> Iterator[dict[str, Any]]:
    """Rows of one table as texts; marked where the truth's own error hides a difference."""
    least = min((row["rmse_Nm"] for row in rows if row["method"] != "zero"), default=0.0)
    for row in rows:
        near = "~" * (0.0 < row["rmse_Nm"] - least < error)
        lag = f"{row['lag_s']:+.2f} (× {row['rmse_at_lag']:.2f})"
        text = significant(row["rmse_Nm"])
        yield {
            **row,
            "rmse": GridCell(
                text, mark=near, html=f'<span class="soft">{text}</span>' * bool(near)
            ),
            "interval": between(row["rmse_low_Nm"], row["rmse_high_Nm"]),
            "over_best": between(row["over_best_low_Nm"], row["over_best_high_Nm"], "+.3g", " to "),
            "lag": lag if np.isfinite(row["lag_s"]) else DASH,
        }


def between(low: float, high: float, form: str = ".3g", to: str = "–") -> str:
    """An interval as text, a dash for none."""
    return f"{low:{form}}{to}{high:{form}}" if np.isfinite(low) else DASH


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

    places: list[float]  #: Of the skill and of the ends of its interval, NaN without one.
    y: float
    colour: str
    words: str


def dots(results: Results, protocol: str) -> tuple[Scales, list[str], list[Dot]]:
    """Skill in contact of every arm, with its interval: scales, names from above, dots."""
    own, colours = results.of(protocol, "contact"), results.colours
    arms, methods = list(dict.fromkeys(row["arm"] for row in own)), [*colours]
    low = max(min([0.0, *(row["skill"] for row in own)]), -1.0) - 0.05
    box = Box(height=46.0 * len(arms) + 26.0, width=400.0, left=8.0)
    scales = Scales(box, Span(low, 1.05), Span(-float(len(arms)), 0.0))
    found = []
    for row in own:
        arm, method, skill = row["arm"], row["method"], row["skill"]
        if method in colours:
            # Skill falls as RMSE rises: the interval's ends change places.
            level = row["rmse_Nm"] / max(1.0 - skill, 1e-12)
            ends = (1.0 - row[f"rmse_{end}_Nm"] / level for end in ("high", "low"))
            places = scales.inside([skill, *ends]).tolist()
            y = -arms.index(arm) - 0.4 - 0.55 * methods.index(method) / len(methods)
            text = f"{arm}, {method}: {skill:.2f}"
            found.append(Dot(places, float(scales.up(y)), paint(colours[method]), text))
    return scales, arms, found


def worst_charts(results: Results) -> Iterator[Chart]:
    """The worst 10 s of `best` in every log, by the first protocol that it is scored by."""
    drawn = results.table.filter(part="worst").unique("log", keep="first", maintain_order=True)
    for row in drawn.iter_rows(named=True):
        t, *values = (np.array(row[f"worst_{k}"]) for k in ("t", "truth", "estimate"))
        styles = (("truth", REFERENCE), ("best", results.colours["best"]))
        named = zip(styles, values, strict=True)
        lines = [ChartLine(name, x[:, None], colour) for (name, colour), x in named]
        title = f"{row['log']}, {row['protocol']}, J{row['worst_joint']}"
        yield Chart.of_one(row["log"], title, "N·m", t, lines)


def to_terminal(results: Results, *, every: bool) -> str:
    """The headline, the lists, and which arms they are of; every table where that is asked."""
    head = terminal(replace(results.headline(), title="")) if results.rows else ""
    grids = results.grids() if every else ()
    return "\n".join([head + "".join(f"{x}\n" for x in results.lines()), *map(terminal, grids)])


def every_grid(results: Results, form: Callable[[Grid], str]) -> str:
    """All tables in a form, what the headline is about below it."""
    headline = replace(results.headline(), notes=(*results.lines(),))
    return "\n".join(map(form, [headline, *results.grids()]))


#: Name of a form → what it makes of the results.
FORMS: dict[str, Callable[[Results], str]] = {
    "csv": lambda results: csv_rows(results.rows, results.rows[0] if results.rows else ()),
    "markdown": lambda results: every_grid(results, markdown),
    "latex": lambda results: every_grid(results, latex),
}


def render_benchmark(results: Results, title: str, record: Mapping[str, Any]) -> str:
    """The page of a benchmark."""
    each = [(p, *dots(results, p)) for p in results.protocols if results.counted(p, "contact")]
    keys = ("recording", "arm", "truth", "truth_error", "licence", "source")
    logs = keyed_grid(dict(zip(keys, words(*keys), strict=True)), record["logs"])
    return page(
        "benchmark.html",
        title,
        styles={method: (colour, "") for method, colour in results.colours.items()},
        results=results,
        plots=each,
        worst=list(worst_charts(results)),
        logs=logs,
        record=record,
    )
