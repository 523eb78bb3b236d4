"""Sections of the report of one log: errors and observers."""

from html import escape
from itertools import groupby
from operator import itemgetter
from typing import Any

import polars as pl

from vftcli.analysis import Analysis
from vftcli.observers.table import OBSERVERS
from vftcli.outputs.grid import Column, Grid, GridCell, html, signed, significant
from vftcli.outputs.log.rmse_tables import (
    blocks,
    detail_grids,
    marks_on_page,
    rmse_grid,
)
from vftcli.outputs.log.run_record import observer_record
from vftcli.outputs.log.wrench_tables import axis_grids, nothing_to_compare, paper_bounds
from vftcli.outputs.page.charts import legend, pictures_of
from vftcli.outputs.page.comparisons import selection_guide
from vftcli.outputs.page.shell import section, soft
from vftcli.outputs.page.torque_part import response_charts
from vftcli.signals.arrays import Array


def errors_section(analysis: Analysis) -> str:
    """The RMSE table with its floors and everything below it, or how to get one."""
    table, title = analysis.errors, "Errors against a reference"
    found = blocks(table) if table is not None else ()
    if table is None or not found:
        words = (
            "Nothing was given that measures the force. <code>--reference "
            "two-cycle|sensor|vendor|zero|file:PATH</code> adds the table."
        )
        return section(title, soft(words), "none given", name="errors")
    best = found[0]
    lead = best.means.least
    state = "no sample in common with the estimates"
    if lead is not None:
        state = f"{significant(lead[1])} N·m ({lead[0]}) against {best.reference}"
        state += best.means.left_out
    parts = [
        *(html(rmse_grid(block)) for block in found),
        soft(marks_on_page(found)),
        *map(html, axis_grids(table, paper_bounds([analysis]))),
        *(soft(escape(line)) for line in nothing_to_compare(table)),
        section(
            "Confidence intervals, lags and significance", "".join(map(html, detail_grids(table)))
        ),
        section("Bias, largest error and correlation", html(bias_grid(table))),
    ]
    return section(title, "".join(parts), state, name="errors")


def bias_grid(table: pl.DataFrame) -> Grid:
    """Bias, largest error and correlation of every estimate and joint."""
    heads = ("bias [N·m]", "largest error [N·m]", "correlation")
    keys = ("bias_Nm", "max_Nm", "correlation")
    rows = table.filter(pl.col("joint").is_not_null()).iter_rows(named=True)
    return Grid(
        title="Estimate − reference",
        columns=(
            Column("observer", words=True),
            Column("joint"),
            *(Column(head, form=signed) for head in heads),
            Column("samples"),
        ),
        rows=tuple(
            (r["observer"], f"J{r['joint']}", *(r[key] for key in keys), r["samples"]) for r in rows
        ),
    )


def observers_section(analysis: Analysis) -> str:
    """What each observer's parameters are and mean, and its frequency response."""
    heads = ("ω_n [rad/s]", "ζ", "delay [ms]", "−3 dB [Hz]", "to tune")
    grid = Grid(
        title="What the parameters mean at this log's sample time; one value a joint where they "
        "differ",
        columns=(
            Column("observer", words=True),
            Column("What", words=True),
            *map(Column, heads),
        ),
        rows=tuple(observer_row(analysis, observer.name) for observer in analysis.observers),
        swatches=True,
    )
    parameters = ""
    for observer in analysis.observers:
        # The record has parameters as JSON can hold them, also those of a wrapped observer.
        used = observer_record(observer, None)["parameters"]
        text = "; ".join(f"{key} = {value_text(value)}" for key, value in used.items())
        parameters += f"<dt>{escape(observer.name)}</dt><dd>{escape(text)}</dd>"
    responses = response_charts(analysis)
    legend_of_all = legend(responses[0]) if responses else ""
    pictures = "".join(pictures_of(chart) for chart in responses)
    parts = (
        html(grid),
        f'<h3>Frequency response</h3>{legend_of_all}<div class="multiples">{pictures}</div>',
        f'<h3>Parameters</h3><dl class="pairs">{parameters}</dl>',
        selection_guide(analysis),
    )
    names = ", ".join(observer.name for observer in analysis.observers)
    return section("Observers", "".join(parts), names, name="observers")


def observer_row(analysis: Analysis, name: str) -> tuple[GridCell | str | float | None, ...]:
    """One observer: what it is, and its tuning where that is known."""
    what = OBSERVERS[name].title if name in OBSERVERS else ""
    tuning = analysis.tunings.get(name)
    if tuning is None:
        return (name, what, *[None] * 5)
    columns = (tuning.omega_n, tuning.zeta, 1e3 * tuning.delay, tuning.bandwidth)
    shown = (GridCell("", html=joint_values(column)) for column in columns)
    return (name, what, *shown, tuning.parameter_count)


def joint_values(values: Array) -> str:
    """One number where all joints agree to three digits, else one line a run of equal joints."""
    texts = [significant(float(value)) for value in values]
    # Compared as printed: what cannot be told apart on the page is one value.
    if len(set(texts)) == 1:
        return texts[0]
    numbered = groupby(enumerate(texts, start=1), key=itemgetter(1))
    lines = []
    for text, members in numbered:
        joints = [f"J{j}" for j, _ in members]
        which = joints[0] if len(joints) == 1 else f"{joints[0]}–{joints[-1]}"
        lines.append(f'<span class="which">{which}</span> {text}')
    return "<br>".join(lines)


def value_text(value: Any) -> str:  # noqa: ANN401 - whatever JSON can hold
    """A parameter's value with six digits; of a list whose items are equal one is shown."""
    match value:
        case bool():
            return "yes" if value else "no"
        case None:
            return "–"
        case float():
            return f"{value:.6g}"
        case list() if value and all(entry == value[0] for entry in value):
            return value_text(value[0])
        case list():
            return ", ".join(value_text(entry) for entry in value)
        case dict():
            return ", ".join(f"{key} {value_text(entry)}" for key, entry in value.items())
    return str(value)
