"""Sections of the report as HTML text. Every word that comes from outside is escaped here."""

from collections.abc import Iterable, Mapping, Sequence
from html import escape
from itertools import groupby
from operator import itemgetter
from typing import Any

import numpy as np
import polars as pl

from vftcli.analysis import Analysis
from vftcli.observers import OBSERVERS
from vftcli.outputs.log.error_details import details
from vftcli.outputs.log.run_record import observer_record
from vftcli.outputs.log.tables import (
    AT_FLOOR,
    DAGGER,
    RESTS,
    Block,
    blocks,
    joint_heads,
    mean_of,
    significant,
    title,
)
from vftcli.outputs.log.wrench_tables import HEADER, AxisBlock, axis_blocks
from vftcli.outputs.page.payload import STRETCHES, is_decimated
from vftcli.outputs.page.wrench_part import story as wrench_story
from vftcli.signals.arrays import Array


def facts(analysis: Analysis) -> str:
    """Which log, which robot, how long, how fast."""
    recording, robot = analysis.recording, analysis.robot
    steps = np.diff(recording.t)
    pairs = {
        "Robot": robot.title or robot.name,
        "Log format": recording.source.format,
        "Span": f"{recording.t[0]:.3f} – {recording.t[-1]:.3f} s",
        "Samples": f"{recording.samples}",
        "Rate (median step)": f"{1.0 / recording.median_step:.4g} Hz",
        "Longest step": f"{1e3 * float(steps.max()):.4g} ms",
        "Reference": analysis.reference.name if analysis.reference else "none",
    }
    return f'<dl class="facts">{"".join(fact(*pair) for pair in pairs.items())}</dl>'


def fact(name: str, value: str) -> str:
    """A term and its description."""
    return f"<div><dt>{escape(name)}</dt><dd>{escape(value)}</dd></div>"


def remarks(lines: Sequence[str]) -> str:
    """What the reader should know before believing a number, or nothing."""
    if not lines:
        return ""
    return f'<section class="remarks"><h2>Read this first</h2>{bullets(lines)}</section>'


def bullets(lines: Iterable[str]) -> str:
    """A list."""
    return f'<ul class="plain">{"".join(f"<li>{escape(line)}</li>" for line in lines)}</ul>'


def errors(analysis: Analysis) -> str:
    """The RMSE table with its floors, or why there is none."""
    table = analysis.errors
    found = blocks(table) if table is not None else ()
    if table is None or not found:
        return (
            "<h2>Errors</h2><p>No reference was given, so no errors can be told. "
            "<code>--reference two-cycle|sensor|vendor|zero|file:PATH</code> gives one.</p>"
        )
    shown = "".join(rmse_table(block) for block in found)
    axes = "".join(axis_table(block) for block in axis_blocks(table))
    return f"<h2>Errors against the reference</h2>{shown}{meaning(found)}{axes}{further(table)}"


def rmse_table(block: Block) -> str:
    """Observers down, joints across; best values bold, values at the floor marked."""
    rows = []
    for k, name in enumerate(block.observers):
        numbers = zip(block.rmse[k], block.best[k], block.at_floor[k], strict=True)
        cells = "".join(rmse_cell(*entry) for entry in numbers)
        mean = number_cell(significant(mean_of(block.rmse[k])))
        rows.append(f"<tr>{observer_head(name)}{cells}{mean}</tr>")
    if np.any(np.isfinite(block.floor)):
        floors = "".join(number_cell(significant(value)) for value in block.floor)
        mean = number_cell(significant(mean_of(block.floor)))
        rows.append(f'<tr class="floor"><th scope="row">floor</th>{floors}{mean}</tr>')
    header = ["Observer", *joint_heads(block), "mean"]
    return html_table(f"RMSE in N·m: {title(block)}", header, rows)


def axis_table(block: AxisBlock) -> str:
    """RMSE of the wrenches: observers down, axes across."""
    rows = []
    for name, *numbers in block.rows:
        rows.append(f"<tr>{observer_head(name)}{''.join(map(number_cell, numbers))}</tr>")
    return html_table(f"RMSE: {block.title}", HEADER, rows)


def rmse_cell(value: float, best: bool, at_floor: bool) -> str:
    """One RMSE."""
    mark = '<span class="mark">at the floor</span>' if at_floor else ""
    kind = ' class="best"' if best else ""
    return f"<td{kind}>{significant(value)}{mark}</td>"


def number_cell(text: str) -> str:
    """A number in a table."""
    return f"<td>{escape(text)}</td>"


def observer_head(name: str) -> str:
    """A row's head: the observer with its colour."""
    return f'<th scope="row" data-swatch="{escape(name)}">{escape(name)}</th>'


def html_table(caption: str, header: Sequence[str], rows: Iterable[str], words: int = 1) -> str:
    """A table that scrolls by itself where the page is narrow; its first columns hold words."""
    kinds = [' class="text"'] * words + [""] * (len(header) - words)
    cells = zip(kinds, header, strict=True)
    head = "".join(f'<th scope="col"{kind}>{escape(name)}</th>' for kind, name in cells)
    return (
        f'<div class="scroll"><table><caption>{escape(caption)}</caption>'
        f"<thead><tr>{head}</tr></thead><tbody>{''.join(rows)}</tbody></table></div>"
    )


def meaning(found: Sequence[Block]) -> str:
    """What the marks of the RMSE table mean."""
    text = (
        "Torque on the robot about each joint's own axis; bold is the best of its joint; "
        "the mean is over the joints."
    )
    if any(np.any(np.isfinite(block.floor)) for block in found):
        text += (
            " The floor is the error the reference itself is known to have: an RMSE within "
            f"{AT_FLOOR:g} × the floor is <em>at the floor</em>; the reference can tell no more."
        )
    if any(block.untrusted for block in found):
        text += f" {DAGGER}: {RESTS}."
    return f'<p class="soft">{text}</p>'


def further(table: pl.DataFrame) -> str:
    """Bias, largest error and correlation of every estimate and joint, folded away."""
    names = {
        "observer": "Observer",
        "joint": "Joint",
        "bias_Nm": "bias [N·m]",
        "max_Nm": "largest error [N·m]",
        "correlation": "correlation",
        "samples": "samples",
    }
    rows = []
    for row in table.filter(pl.col("joint").is_not_null()).iter_rows(named=True):
        values = [row["bias_Nm"], row["max_Nm"], row["correlation"]]
        cells = "".join(number_cell(number_text(value)) for value in values)
        head = f'<th scope="row">{escape(str(row["observer"]))}</th><td>J{row["joint"]}</td>'
        rows.append(f"<tr>{head}{cells}<td>{row['samples']}</td></tr>")
    shown = html_table("Estimate − reference", list(names.values()), rows)
    folded = f"<details><summary>Bias, largest error and correlation</summary>{shown}</details>"
    return sureness(table) + folded


def sureness(table: pl.DataFrame) -> str:
    """Intervals, lags and the chance that the best is not the best, folded away."""
    shown = []
    for caption, header, lines in details(table):
        rows = [
            f"<tr>{observer_head(name)}{''.join(map(number_cell, cells))}</tr>"
            for name, *cells in lines
        ]
        shown.append(html_table(caption, header, rows))
    if not shown:
        return ""
    return (
        "<details><summary>Confidence intervals, lags and significance</summary>"
        f"{''.join(shown)}</details>"
    )


def number_text(value: float | None) -> str:
    """A number with three significant digits and a true minus sign."""
    return "–" if value is None else significant(value).replace("-", "−")


def series(analysis: Analysis) -> str:
    """The charts over time; the script fills them."""
    count = analysis.recording.samples
    if is_decimated(analysis):
        drawn = (
            f"The log has {count} samples. The page keeps the lowest and the highest sample of "
            f"each of {STRETCHES} equal stretches, at their own times, so that no spike is lost; "
            "every sample is in <code>estimates.parquet</code>."
        )
    else:
        drawn = f"All {count} samples are drawn."
    return (
        "<h2>Torques over time</h2>"
        f'<p class="soft">{drawn}</p>'
        '<p class="soft help">Drag to zoom in, double-click to see all, shift and drag to pan; '
        "keys + − ← → Home. Click a small chart to choose its joint.</p>"
        '<div id="toolbar"><div class="buttons" id="joints" role="group" aria-label="Joint">'
        '<span class="name">Joint</span></div>'
        '<div id="legend" role="group" aria-label="Series"><span class="name">Series</span></div>'
        '<div class="buttons"><button type="button" id="all">Whole span</button></div></div>'
        '<div id="overview"></div><div id="detail"></div>'
        "<noscript><p>The charts need JavaScript; the tables do not.</p></noscript>"
    )


def wrenches(analysis: Analysis) -> str:
    """The charts of the virtual sensor's wrenches, where they were asked for."""
    if not analysis.wrenches:
        return ""
    return (
        "<h2>Wrench over time</h2>"
        '<p class="soft">Force and moment on the robot, as the virtual sensor tells them; the line '
        "breaks where the pose cannot.</p>"
        f'{wrench_story(analysis)}<div class="responses" id="wrenches"></div>'
    )


def observers(analysis: Analysis) -> str:
    """What each observer's parameters are and mean, and its frequency response."""
    shown = "".join(
        f"<tr>{observer_head(o.name)}{observer_cells(analysis, o.name)}</tr>"
        for o in analysis.observers
    )
    header = ["Observer", "What", "ω_n [rad/s]", "ζ", "delay [ms]", "−3 dB [Hz]", "to tune"]
    table = html_table(
        "What the parameters mean at this log's sample time; one value a joint where they differ",
        header,
        [shown],
        words=2,
    )
    parameters = "".join(parameter_row(analysis, o.name) for o in analysis.observers)
    return (
        f'<h2>Observers</h2>{table}<h3>Frequency response</h3><div class="responses" '
        'id="responses"></div><h3>Parameters</h3>'
        f'<dl class="pairs">{parameters}</dl>'
    )


def observer_cells(analysis: Analysis, name: str) -> str:
    """One observer's row after its name."""
    what = OBSERVERS[name].title if name in OBSERVERS else ""
    tuning = analysis.tunings.get(name)
    cells = f'<td class="text">{escape(what)}</td>'
    if tuning is None:
        return cells + "<td>–</td>" * 5
    columns = (tuning.omega_n, tuning.zeta, 1e3 * tuning.delay, tuning.bandwidth)
    cells += "".join(f"<td>{joint_values(column)}</td>" for column in columns)
    return f"{cells}<td>{tuning.numbers}</td>"


def joint_values(values: Array) -> str:
    """One number where all joints agree to three digits, else one line a run of equal joints."""
    texts = [significant(float(value)) for value in values]
    if len(set(texts)) == 1:
        return texts[0]
    numbered = groupby(enumerate(texts, start=1), key=itemgetter(1))
    runs = [(text, [j for j, _ in members]) for text, members in numbered]
    return "<br>".join(f'<span class="which">{joint_range(js)}</span> {text}' for text, js in runs)


def joint_range(joints: Sequence[int]) -> str:
    """J2, or J1–J3."""
    return f"J{joints[0]}" if len(joints) == 1 else f"J{joints[0]}–J{joints[-1]}"


def parameter_row(analysis: Analysis, name: str) -> str:
    """One observer's parameters as they were used."""
    observer = next(o for o in analysis.observers if o.name == name)
    used = observer_record(observer, None)["parameters"]
    text = "; ".join(f"{key} = {value_text(value)}" for key, value in used.items())
    return f"<dt>{escape(name)}</dt><dd>{escape(text)}</dd>"


def value_text(value: Any) -> str:  # noqa: ANN401 - whatever JSON can hold
    """A parameter's value, short."""
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
    return str(value)


def conventions(record: Mapping[str, Any]) -> str:
    """Sign, frame and units."""
    return f"<h2>Conventions</h2>{pairs(record.get('conventions', {}))}"


def provenance(record: Mapping[str, Any]) -> str:
    """Command, versions, inputs, what was repaired: enough to make it again."""
    source, robot = record.get("input", {}), record.get("robot", {})
    versions = ", ".join(f"{name} {number}" for name, number in record.get("versions", {}).items())
    table = {
        "Log": f"{source.get('path') or 'in memory'} ({source.get('format')})",
        "Log sha256": source.get("sha256") or "–",
        "Clock": source.get("clock"),
        "Rows": f"{source.get('rows')} in the file, {source.get('duplicates')} repeated stamps "
        f"dropped, {source.get('samples')} used",
        "Robot": f"{robot.get('name')} ({robot.get('file') or 'built in'})",
        "Robot sha256": robot.get("sha256") or "–",
        "Versions": versions,
    }
    command = record.get("command") or "through the Python interface"
    parts = [f"<h2>Provenance</h2><pre>{escape(str(command))}</pre>", pairs(table)]
    for name in ("repairs", "warnings", "notes"):
        lines = record.get(name) or []
        parts.append(f"<h3>{name.capitalize()}</h3>")
        parts.append(bullets(lines) if lines else '<p class="soft">none</p>')
    notes = robot.get("notes") or []
    if notes:
        parts.append(f"<h3>Notes on the robot file</h3>{bullets(notes)}")
    return "".join(parts)


def pairs(table: Mapping[str, Any]) -> str:
    """Names and their values."""
    rows = "".join(f"<dt>{escape(str(k))}</dt><dd>{escape(str(v))}</dd>" for k, v in table.items())
    return f'<dl class="pairs">{rows}</dl>'
