"""A benchmark's results from its rows: headline, arms, lists, page."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import product

import numpy as np
import polars as pl

from vftcli.evaluation.scores import LAGS, Score, rate_interval, share_interval
from vftcli.observers.table import BEST
from vftcli.outputs import Record, grid
from vftcli.outputs.charts import REFERENCE, Chart, ChartLine, Span, colours_of_names
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
#: Of all logs together.
FACTS = (
    pl.col(*PLACE, "exact_model").first(),
    pl.col("observer_us", "command_us").mean(),
    pl.col("truth_error_Nm").max(),
)
#: Key of a row → its column, in the tables below the headline.
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
    "free": ("l1_Nm", Column("L1", "N·m")),
}
#: Meaning of a mark behind an RMSE.
NEAR = "~: nearer to the least RMSE than the truth's own error"


class Results:
    """All results of a benchmark, pooled by arm."""

    def __init__(self, table: pl.DataFrame) -> None:
        self.table = table
        self.methods, self.protocols = seen(table, "method"), seen(table, "protocol")
        #: Name → colour of every method but zero, which is grey.
        self.colours = colours_of_names([name for name in self.methods if name != "zero"])
        #: One row an arm, protocol, method and part.
        self.rows = [*self.torques()]
        # The columns of the headline are there without a row, too.
        floats = (pl.col("l1_Nm").alias(x) for x in ("l1_Nm", "skill", "missing", "seconds"))
        empty = table.clear().select(*PLACE, "exact_model", *floats)
        self.numbers = pl.concat([empty, pl.DataFrame(self.rows)], how="diagonal")
        exact = pl.col("exact_model")
        #: Rows of the headline: those of exact models only where all are.
        self.spoken = self.numbers.filter(
            pl.col("part").is_in([*HEADLINE]), ~exact | exact.all().over("part", "protocol")
        )

    def pooled(self, key: str) -> Iterator[tuple[Record, Score]]:
        """Place and score of pooled logs, by "joint" or "axis"."""
        for _, own in self.table.drop_nulls(key).group_by(*PLACE, maintain_order=True):
            sums = own.group_by(key, maintain_order=True).agg(pl.col(*Score._fields).explode())
            yield own.select(*FACTS).row(0, named=True), Score.pooled(sums.to_dicts())

    def torques(self) -> Iterator[Record]:
        """The rows of torques."""
        shifts = self.table.drop_nulls("lag_squares")
        each = [*self.pooled("joint")]
        scores = {tuple(about[key] for key in PLACE): score for about, score in each}
        for about, score in each:
            place = {key: about[key] for key in PLACE}
            best = scores.get(tuple((place | {"method": BEST}).values()), score)
            row: Record = about | score.numbers(np.nan if best is score else best.drawn)
            if row["part"] == "free":
                # Zero is perfect there: L1 and false rows speak.
                row |= dict.fromkeys(("skill", "skill_low", "skill_high"), np.nan)
            row |= {"lag_s": np.nan, "rmse_at_lag": np.nan}
            if squares := shifts.filter(**place)["lag_squares"].to_list():
                sums = np.sum(squares, axis=0)
                share = np.sqrt(sums.min() / sums[abs(LAGS).argmin()])
                row |= {"lag_s": float(LAGS[sums.argmin()]), "rmse_at_lag": float(share)}
            yield row

    def lists(self) -> list[pl.DataFrame]:
        """Counts of lists by arm, a frame a protocol and method."""
        lists = self.table.filter(pl.col("part").is_in([*LISTS]))
        pooled = lists.group_by(*BY, "part", maintain_order=True).agg(*POOLED)
        return pooled.partition_by("protocol", "method", maintain_order=True)

    def headline(self) -> Grid:
        """Skill in contact, L1 in free motion, by method and protocol."""
        columns, means = list[Column | str](["method"]), list[dict[str, float]]()
        for (part, (key, column)), protocol in product(HEADLINE.items(), self.protocols):
            own = self.spoken.filter(part=part, protocol=protocol)
            if own.height:
                columns.append(column._replace(head=f"{column.head}, {protocol}"))
                each = own.group_by("method").agg(pl.col(key).mean(), pl.len())
                # A method that lacks an arm has no mean.
                full = each.filter(len=own["arm"].n_unique())
                means.append(dict(full.select("method", key).iter_rows()))
        names = [name for name in self.methods if any(name in mean for mean in means)]
        rows: Rows = [(name, *(mean.get(name) for mean in means)) for name in names]
        return Grid(columns, rows, "Skill in contact, and L1 in free motion", swatches=True)

    def list_lines(self) -> Iterator[str]:
        """Lines on the lists of contacts of the headline's arms."""
        for rows in self.lists():
            _, protocol, method, *_ = rows.row(0)
            arms = seen(self.spoken.filter(protocol=protocol), "arm")
            own = rows.filter(pl.col("arm").is_in(arms), part="list")
            found, true, false, hours = own.select(*COUNTS).sum().row(0)
            low, high = rate_interval(false, hours)
            if own.height:
                yield (
                    f"{method} lists, {protocol}: {found} of {true} true contacts; {false} false, "
                    f"{false / hours if hours else 0:.0f} per hour (95 %: {low:.0f} to {high:.0f})"
                )

    def lines(self) -> Iterator[str]:
        """Lines below the headline."""
        yield from self.list_lines()
        shown = {row[0] for row in self.headline().rows}
        if rest := [method for method in self.methods if shown and method not in shown]:
            why = "in no mean, as some arm lacks them (-v and page have their rows)"
            yield f"{why}: {', '.join(rest)}"
        silent = (pl.col("missing") * pl.col("seconds")).sum() / pl.col("seconds").sum()
        shares = self.spoken.group_by("method", "protocol", maintain_order=True).agg(silent)
        for method, protocol, share in shares.iter_rows():
            if share > SILENT:
                yield f"{method}, {protocol}: no answer for {percent(share)} of the time, read as 0"
        yield "skill: 1 exact, 0 as an estimate of zero; L1: mean |error| without contact"
        yield "alone: built-in profile; free: and contact-free motion; identified: own file"
        for protocol in self.protocols:
            if arms := seen(self.spoken.filter(protocol=protocol, part="contact"), "arm"):
                yield f"skill, {protocol}, is the mean of {'; '.join(arms)}"
        if free := seen(self.spoken.filter(part="free"), "arm"):
            yield f"L1 is the mean of {'; '.join(free)}, where the protocol has them"
        if future := seen(self.table.filter("future"), "method"):
            yield f"uses the whole log, the future too: {', '.join(future)}"
        if marked := seen(self.table.filter("marked"), "log"):
            yield f"scored despite a complaint (--anyway): {', '.join(marked)}"

    def grids(self) -> Iterator[Grid]:
        """Every table below the headline."""
        for lists in self.lists():
            texts = [*map(list_texts, lists.to_dicts())]
            title = "Contacts listed by {method}, {protocol}; onset: median (90 %)"
            yield keyed_grid(LIST_COLUMNS, texts, title.format(**texts[0]))
        for own in self.numbers.partition_by("arm", "protocol", "part", maintain_order=True):
            texts = arm_texts(own.to_dicts())
            title = "{arm}, {protocol}, {part} ({seconds:.0f} s)".format(**texts[0])
            marked = any(row["rmse"].mark for row in texts)
            shown = keyed_grid(ARM_COLUMNS, texts, title, swatches=True)
            yield replace(shown, notes=(NEAR,) * marked, marked=marked)
        wrench = list[Record]()
        for about, score in self.pooled("axis"):
            wrench.append(about | {"missing": score.mean(score.missing)[0]})
            for name, sums in (("", score.squares), ("true_", score.truth)):
                force, moment = np.sqrt(score.mean(sums).reshape(2, 3).sum(axis=1))
                wrench[-1] |= {f"{name}force": force, f"{name}moment": moment}
        weight = self.table.filter(part="weight").to_dicts()
        if wrench:
            yield keyed_grid(WRENCH_COLUMNS, wrench, "Wrench in contact, rms error")
        if weight:
            yield keyed_grid(WEIGHT_COLUMNS, weight, "A carried weight")


def seen(rows: pl.DataFrame, key: str) -> list[str]:
    """The values of a column in order."""
    return rows[key].unique(maintain_order=True).to_list()


def arm_texts(rows: Sequence[Record]) -> list[Record]:
    """A table's rows as texts, some marked `NEAR`."""
    least = min((row["rmse_Nm"] for row in rows if row["method"] != "zero"), default=0.0)
    error = max(row["truth_error_Nm"] for row in rows)
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
    """Counts of one arm's lists as texts, with intervals."""
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


def dots(rows: pl.DataFrame, methods: Sequence[str]) -> tuple[Scales, list[str], list[Record]]:
    """Skill in contact by arm: scales, arms from above, rows."""
    arms, own = seen(rows, "arm"), rows.filter(pl.col("method").is_in(methods)).to_dicts()
    low = max(min([0.0, *(row["skill"] for row in own)]), -1.0) - 0.05
    box = Box(height=46.0 * len(arms) + 26.0, width=400.0, left=8.0)
    return Scales(box, Span(low, 1.05), Span(-float(len(arms)), 0.0)), arms, own


def text_of(results: Results, form: str, *, every: bool) -> str:
    """The results as text; on the terminal the headline, or all."""
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
    keys = ("recording", "arm", "truth", "truth_error", "licence", "source")
    contact = results.numbers.filter(part="contact").partition_by("protocol", maintain_order=True)
    # The worst 10 s of `best` in a log, by its first protocol.
    drawn = results.table.filter(part="worst").unique("log", keep="first", maintain_order=True)
    charts = list[Chart]()
    for row in drawn.to_dicts():
        t, truth, estimate = (np.array(row[f"worst_{x}"]) for x in ("t", "truth", "estimate"))
        lines = [
            ChartLine("truth", truth[:, None], REFERENCE),
            ChartLine(BEST, estimate[:, None], results.colours[BEST]),
        ]
        name = f"{row['log']}, {row['protocol']}, J{row['worst_joint']}"
        charts.append(Chart.of_one(row["log"], name, "N·m", t, lines))
    return page(
        "benchmark.html",
        title,
        styles={method: (colour, "") for method, colour in results.colours.items()},
        results=results,
        methods=[*results.colours],
        plots=[dots(own, [*results.colours]) for own in contact],
        worst=charts,
        logs=keyed_grid({key: key.replace("_", " ") for key in keys}, record["logs"]),
        record=record,
    )
