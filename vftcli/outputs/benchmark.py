"""A benchmark's results from its rows: headline, arms, lists, page."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cached_property
from itertools import product

import numpy as np
import polars as pl

from vftcli.evaluation.scores import LAGS, Score, rate_interval, share_interval
from vftcli.observers.table import BEST
from vftcli.outputs import Record, grid
from vftcli.outputs.charts import REFERENCE, Chart, ChartLine, Span, colours_of_names, paint
from vftcli.outputs.grid import (
    DASH,
    Column,
    Grid,
    GridCell,
    Rows,
    keyed_grid,
    percent,
    significant,
)
from vftcli.outputs.page.shell import Box, Scales, page

SILENT = 0.05  #: Share of time without an answer from which it is mentioned.
LISTS = {"list": "counted", "list with candidates": "all"}
COUNTS = ("found", "true_contacts", "false", "free_h")
BY = ("arm", "protocol", "method")
PLACE = (*BY, "part")
#: Pooling of several logs' lists: sums, all values, the largest.
POOLED = (
    pl.col(*COUNTS, "found_as_load", "split", "peaks_held").sum(),
    pl.col("onset_s", "peak_error_N", "true_peak_N").explode().drop_nulls(),
    pl.col("hardest_false_N").max(),
)
#: Key of a row → its column, for every table of rows below the headline.
ARM_COLUMNS = {
    "method": "method",
    "rmse": Column("RMSE", "N·m"),
    "interval": "95 %",
    "l1_Nm": Column("L1", "N·m"),
    "skill": Column("skill", form=".2f"),
    "coverage_95": Column("band holds", form=".2f"),
    "interval_score_Nm": Column("interval score", "N·m", seldom=True),
    "missing": Column("no answer", form=".2f", seldom=True),
    "lag": Column("lag", "s", words=True, seldom=True),
    "observer_us": Column("own CPU", "µs a sample", ".2f", seldom=True),
    "command_us": Column("whole CPU", "µs a sample", ".0f", seldom=True),
    "over_best": Column("over best, 95 %", words=True, seldom=True),
}
LIST_COLUMNS = {
    "arm": "arm",
    "rows": "rows",
    "share": "found",
    "rate": "false/h",
    "onset": Column("onset", "s", words=True),
    "split": Column("split", seldom=True),
    "found_as_load": Column("as load", seldom=True),
    "peaks": Column("peak error", "N", words=True, seldom=True),
    "hardest": Column("hardest false", "N", ".0f", seldom=True),
}
WRENCH_COLUMNS = {
    **dict(zip(BY, BY, strict=True)),
    "force": Column("force", "N", ".2f"),
    "true_force": Column("truth's rms", "N", ".2f"),
    "moment": Column("moment", "N·m", ".2f"),
    "true_moment": Column("truth's rms", "N·m", ".2f"),
    "missing": Column("no answer", form=".2f"),
}
WEIGHT_COLUMNS = {
    "log": "log",
    **dict(zip(BY[1:], BY[1:], strict=True)),
    "weight_N": Column("true weight", "N", ".1f"),
    "mean_N": Column("mean found", "N", ".1f"),
    "rms_error_N": Column("rms error", "N", ".1f"),
    "answered": Column("answered", form=".2f"),
}
#: Part of the headline → key of a row, its column.
HEADLINE = {
    "contact": ("skill", Column("skill", form=".2f")),
    "free": ("l1_Nm", Column("free L1", "N·m")),
}
#: Meaning of a mark behind an RMSE.
NEAR = "~: nearer to the least RMSE than the truth's own error"


class Results:
    """All results of a benchmark, pooled by arm and never across arms."""

    def __init__(self, table: pl.DataFrame) -> None:
        self.table = table
        self.methods, self.protocols = map(self.seen, ("method", "protocol"))
        #: Name → colour of every method but zero, which is grey.
        self.colours = colours_of_names([name for name in self.methods if name != "zero"])

    def seen(self, key: str, *rows: str) -> list[str]:
        """Values of a column in order, of all rows or those with a set flag."""
        return self.table.filter(*rows)[key].unique(maintain_order=True).to_list()

    def pooled(self, key: str) -> dict[tuple[str, ...], Score]:
        """Place → score of its logs together, of torques by "joint", of wrenches by "axis"."""
        rows = self.table.drop_nulls(key).group_by(*PLACE, key, maintain_order=True)
        places = rows.agg(pl.col(*Score._fields).explode()).partition_by(
            *PLACE, maintain_order=True, as_dict=True
        )
        return {place: Score.pooled(each.to_dicts()) for place, each in places.items()}

    @cached_property
    def rows(self) -> list[Record]:
        """One row an arm, protocol, method and part, for machines and tables."""
        scores, found = self.pooled("joint"), []
        facts = pl.col("exact_model").first(), pl.col("observer_us", "command_us").mean()
        shared = self.table.drop_nulls("joint").group_by(*PLACE, maintain_order=True).agg(*facts)
        shifts = self.table.drop_nulls("lag_squares")
        for about, score in zip(shared.to_dicts(), scores.values(), strict=True):
            place = {key: about[key] for key in PLACE}
            best = scores.get(tuple((place | {"method": BEST}).values()))
            over = np.nan if best is None or best is score else best.drawn
            row: Record = {**about, **score.numbers(over), "lag_s": np.nan, "rmse_at_lag": np.nan}
            if row["part"] == "free":
                row["skill"] = np.nan  # zero is perfect there: L1 and false rows speak
            if each := shifts.filter(**place)["lag_squares"].to_list():
                sums = np.sum(each, axis=0)
                share = np.sqrt(sums.min() / sums[abs(LAGS).argmin()])
                row |= {"lag_s": float(LAGS[sums.argmin()]), "rmse_at_lag": float(share)}
            found.append(row)
        return found

    def of(self, protocol: str, part: str, *, headline: bool = False) -> list[Record]:
        """Rows of a protocol and part; `headline`: exact models only if all are."""
        own = [row for row in self.rows if (row["protocol"], row["part"]) == (protocol, part)]
        return [row for row in own if headline and not row["exact_model"]] or own

    def arms(self, protocol: str, part: str) -> list[str]:
        """The arms in the headline of a protocol and part."""
        return list(dict.fromkeys(row["arm"] for row in self.of(protocol, part, headline=True)))

    def headline(self) -> Grid:
        """Skill in contact and L1 in free motion, by method and protocol."""
        columns, means = list[Column | str](["method"]), list[dict[str, float]]()
        for (part, (key, column)), protocol in product(HEADLINE.items(), self.protocols):
            if arms := self.arms(protocol, part):
                columns.append(column._replace(head=f"{column.head}, {protocol}"))
                own: dict[str, list[float]] = {}
                for row in self.of(protocol, part, headline=True):
                    own.setdefault(row["method"], []).append(row[key])
                # A method that lacks an arm has no mean.
                full = {name: each for name, each in own.items() if len(each) == len(arms)}
                means.append({name: float(np.mean(each)) for name, each in full.items()})
        names = [name for name in self.methods if any(name in mean for mean in means)]
        rows: Rows = [(name, *(mean.get(name) for mean in means)) for name in names]
        return Grid(columns, rows, "Skill in contact, and L1 in free motion", swatches=True)

    @cached_property
    def lists(self) -> list[pl.DataFrame]:
        """Counts of lists by arm, a frame a protocol and method."""
        lists = self.table.filter(pl.col("part").is_in([*LISTS]))
        pooled = lists.group_by(*BY, "part", maintain_order=True).agg(*POOLED)
        return pooled.partition_by("protocol", "method", maintain_order=True)

    def lines(self) -> Iterator[str]:
        """Lines below the headline: lists, arms, methods that use the future."""
        for rows in self.lists:
            _, protocol, method, *_ = rows.row(0)
            named = {arm for part in HEADLINE for arm in self.arms(protocol, part)}
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
        for p, method in product(self.protocols, self.methods):
            spoken = (row for part in HEADLINE for row in self.of(p, part, headline=True))
            each = [(row["missing"], row["seconds"]) for row in spoken if row["method"] == method]
            share = (
                np.average([x for x, _ in each], weights=[x for _, x in each]) if each else 0.0
            )
            if share > SILENT:
                yield f"{method}, {p}: no answer for {percent(share)} of the time, read as 0"
        for p in self.protocols:
            if arms := self.arms(p, "contact"):
                yield f"skill, {p}, is the mean of {'; '.join(arms)}"
        if free := dict.fromkeys(a for p in self.protocols for a in self.arms(p, "free")):
            yield f"free L1 is the mean of {'; '.join(free)}, where the protocol has them"
        if future := self.seen("method", "future"):
            yield f"with the whole log, its future too: {', '.join(future)}"
        if marked := self.seen("log", "marked"):
            yield f"in spite of a complaint (--anyway): {', '.join(marked)}"

    def grids(self) -> Iterator[Grid]:
        """Every table below the headline."""
        for rows in self.lists:
            texts = [list_texts(row) for row in rows.to_dicts()]
            title = "Contacts listed by {method}, {protocol}; onset: median (90 %)"
            yield keyed_grid(LIST_COLUMNS, texts, title.format(**texts[0]))
        for arm, protocol, part in dict.fromkeys(
            (row["arm"], row["protocol"], row["part"]) for row in self.rows
        ):
            own = [row for row in self.of(protocol, part) if row["arm"] == arm]
            logs = self.table.filter(arm=arm, protocol=protocol, part=part)
            texts = arm_texts(own, max(logs["truth_error_Nm"]))
            title = f"{arm}, {protocol}, {part} ({own[0]['seconds']:.0f} s)"
            marked = any(row["rmse"].mark for row in texts)
            shown = keyed_grid(ARM_COLUMNS, texts, title, swatches=True)
            yield replace(shown, notes=(NEAR,) * marked, marked=marked)
        wrench = []
        for place, score in self.pooled("axis").items():
            # Of force and moment, the estimate's error and the truth itself.
            sizes = (
                score.mean(x).reshape(2, 3).sum(axis=1) for x in (score.squares, score.truth)
            )
            (force, moment), (true_force, true_moment) = map(np.sqrt, sizes)
            numbers = (force, true_force, moment, true_moment, score.mean(score.missing)[0])
            wrench.append(dict(zip(WRENCH_COLUMNS, (*place[:3], *numbers), strict=True)))
        weight = self.table.filter(part="weight").to_dicts()
        for columns, each, title in (
            (WRENCH_COLUMNS, wrench, "Wrench in contact, rms error"),
            (WEIGHT_COLUMNS, weight, "A carried weight"),
        ):
            if each:
                yield keyed_grid(columns, each, title)


def arm_texts(rows: Sequence[Record], error: float) -> list[Record]:
    """A table's rows as texts, marked if the truth's error hides a difference."""
    least = min((row["rmse_Nm"] for row in rows if row["method"] != "zero"), default=0.0)
    found = []
    for row in rows:
        text, lag = significant(row["rmse_Nm"]), row["lag_s"]
        near = 0.0 < row["rmse_Nm"] - least < error
        soft = f'<span class="soft">{text}</span>'
        found.append({
            **row,
            "rmse": GridCell(text, mark="~" * near, html=soft * near),
            "interval": between(row["rmse_low_Nm"], row["rmse_high_Nm"]),
            "over_best": between(row["over_best_low_Nm"], row["over_best_high_Nm"], "+.3g", " to "),
            "lag": f"{lag:+.2f} (× {row['rmse_at_lag']:.2f})" if np.isfinite(lag) else DASH,
        })  # fmt: skip
    return found


def between(low: float, high: float, form: str = ".3g", to: str = "–") -> str:
    """An interval as text, a dash for none."""
    return f"{low:{form}}{to}{high:{form}}" if np.isfinite(low) else DASH


def list_texts(row: Record) -> Record:
    """Counts of one arm's lists with texts, with their intervals."""
    found, true, false, hours = (row[k] for k in COUNTS)
    texts = dict.fromkeys(("share", "rate", "onset", "peaks"), DASH)
    if true:
        texts["share"] = f"{found}/{true} ({between(*share_interval(found, true), '.2f')})"
    if hours:
        ends = between(*rate_interval(false, hours), ".0f")
        texts["rate"] = f"{false / hours:.0f} ({ends})"
    if late := row["onset_s"]:
        texts["onset"] = f"{np.median(late):.2f} ({np.quantile(late, 0.9):.2f})"
    if errors := row["peak_error_N"]:
        rms, mean = np.sqrt(np.mean(np.square(errors))), np.mean(row["true_peak_N"])
        peaks = f"{np.mean(errors):+.1f}, rms {rms:.1f} of {mean:.0f}, {row['peaks_held']} held"
        texts["peaks"] = peaks
    hardest = row["hardest_false_N"] if false else None
    return {**row, **texts, "rows": LISTS[row["part"]], "hardest": hardest}


def dots(results: Results, protocol: str) -> tuple[Scales, list[str], list[Record]]:
    """Skill in contact of every arm, with interval: scales, arms from above, dots.

    A dot has places of the skill and its interval's ends, NaN without one.
    """
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
            y = -arms.index(arm) - 0.4 - 0.55 * methods.index(method) / len(methods)
            found.append({
                "places": scales.inside([skill, *ends]).tolist(),
                "y": float(scales.up(y)),
                "colour": paint(colours[method]),
                "words": f"{arm}, {method}: {skill:.2f}",
            })  # fmt: skip
    return scales, arms, found


def text_of(results: Results, form: str, *, every: bool) -> str:
    """The results as text; on the terminal the headline, or `every` table."""
    headline, lines = results.headline(), tuple(results.lines())
    if form == "csv":
        return grid.csv_rows(results.rows, results.rows[0] if results.rows else ())
    if form == "terminal":
        head = grid.terminal(replace(headline, title="")) if results.rows else ""
        below = map(grid.terminal, results.grids() if every else ())
        return "\n".join([head + "".join(f"{line}\n" for line in lines), *below])
    write = grid.markdown if form == "markdown" else grid.latex
    return "\n".join(map(write, [replace(headline, notes=lines), *results.grids()]))


def render_benchmark(results: Results, title: str, record: Record) -> str:
    """The page of a benchmark."""
    keys, worst = ("recording", "arm", "truth", "truth_error", "licence", "source"), []
    # The worst 10 s of `best` in every log, by the log's first protocol.
    drawn = results.table.filter(part="worst").unique("log", keep="first", maintain_order=True)
    for row in drawn.iter_rows(named=True):
        t, truth, best = (np.array(row[f"worst_{k}"]) for k in ("t", "truth", "estimate"))
        lines = [
            ChartLine("truth", truth[:, None], REFERENCE),
            ChartLine(BEST, best[:, None], results.colours[BEST]),
        ]
        name = f"{row['log']}, {row['protocol']}, J{row['worst_joint']}"
        worst.append(Chart.of_one(row["log"], name, "N·m", t, lines))
    return page(
        "benchmark.html",
        title,
        styles={method: (colour, "") for method, colour in results.colours.items()},
        results=results,
        plots=[(p, *dots(results, p)) for p in results.protocols if results.arms(p, "contact")],
        worst=worst,
        logs=keyed_grid(dict(zip(keys, keys, strict=True)), record["logs"]),
        record=record,
    )
