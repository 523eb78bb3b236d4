"""The virtual sensor on the page: drift, what the pose can tell, contacts and their trade-off."""

from collections.abc import Iterator, Sequence
from html import escape

import numpy as np

from vftcli.analysis import Analysis
from vftcli.outputs.log.tables import significant
from vftcli.outputs.page.payload import Chart, ChartLine
from vftcli.outputs.palette import DASHED, colours_of
from vftcli.signals.arrays import Array, Mask
from vftcli.signals.wrench import AXES
from vftcli.virtual_sensor.detection import ContactScore
from vftcli.virtual_sensor.frames import FRAMES
from vftcli.virtual_sensor.sensor_reading import SensorReading

SHOWN = (0.3, 0.5, 0.7, 1.0, 1.5, 2.0, 3.0, 5.0)
"""Thresholds of the operating curve that the table lists, in half widths of the free band."""


def condition_charts(analysis: Analysis) -> Iterator[Chart]:
    """σ_min with the masked zone, what the solver says there, and the null-space channel."""
    sensed = analysis.virtual_sensor
    if sensed is None or not sensed.wrenches:
        return
    first, colours = sensed.wrenches[0], colours_of(analysis.estimates)
    if first.sigma_min is not None:
        least = np.array([sensed.sensor.least_sigma])
        sigma = (ChartLine("σ_min of J", column(first.sigma_min)),)
        yield Chart("sigma_min", "What the pose can tell: σ_min", "m", sigma, least, "masked below")
    if first.hidden.any():
        blown = tuple(
            ChartLine(w.name, masked_force(w.values, w.hidden), colours[w.name], w.name in DASHED)
            for w in sensed.wrenches
        )
        title = f"|force| by {sensed.sensor.solver} in the masked samples, not to be believed"
        yield Chart("blow-up", title, "N", blown)
    if first.null_space is not None:
        left = tuple(
            ChartLine(w.name, column(w.null_space), colours[w.name], w.name in DASHED)
            for w in sensed.wrenches
            if w.null_space is not None
        )
        limit = np.array([e.threshold for e in sensed.elsewhere[:1]])
        band = limit if limit.size else None
        title = "Torque that no wrench at the flange explains"
        yield Chart("null_space", title, "N·m", left, band, "free part")


def column(values: Array) -> Array:
    """One series as a chart's only column. (T, 1)"""
    return values[:, None]


def masked_force(values: Array, hidden: Mask) -> Array:
    """Norm of the force in masked samples, NaN elsewhere. (T, 1) [N]"""
    norm = np.linalg.norm(values[:, :3], axis=1)
    return column(np.where(hidden, norm, np.nan))


def story(analysis: Analysis) -> str:
    """Words and tables of the virtual sensor, where it was asked for."""
    sensed = analysis.virtual_sensor
    if sensed is None:
        return ""
    frame = escape(FRAMES[sensed.sensor.frame])
    return "".join(
        (
            f'<p class="soft">Force and moment ON the robot in {frame}; '
            f"solver {escape(sensed.sensor.solver)}.</p>",
            masked_words(sensed),
            drift_table(sensed),
            contact_table(analysis.contacts),
            trade_off(analysis.contacts),
        )
    )


def masked_words(sensed: SensorReading) -> str:
    """How much is masked and why the line breaks there."""
    if not sensed.masked_share:
        return ""
    return (
        f"<p>{sensed.masked_share:.1%} of the samples are masked: near a singularity some "
        "direction of force moves no joint, so its torque says nothing of it. Least squares "
        "divides the torque error by σ_min there and blows up; below "
        f"{sensed.sensor.least_sigma:g} m an error of 1 N·m is more than "
        f"{1 / sensed.sensor.least_sigma:.0f} N. The chart of the masked samples shows what the "
        "solver says; no table and no column contains it.</p>"
    )


def table(caption: str, header: tuple[str, ...], rows: Sequence[tuple[str, ...]]) -> str:
    """A table whose first column is words."""
    from vftcli.outputs.page.sections import html_table, number_cell, observer_head

    body = [f"<tr>{observer_head(row[0])}{''.join(map(number_cell, row[1:]))}</tr>" for row in rows]
    return html_table(caption, header, body)


def drift_table(sensed: SensorReading) -> str:
    """Zero drift per observer and axis, one row a span."""
    if not sensed.drifts:
        return ""
    units = ["N"] * 3 + ["N·m"] * 3
    header = ("Observer", "span [s]", *(f"{a} [{u}]" for a, u in zip(AXES, units, strict=True)))
    rows = [
        (d.name, f"{d.span[0]:g}–{d.span[1]:g}", *(f"{value:.5f}" for value in d.mean))
        for d in sensed.drifts
    ]
    return table("Zero drift; the first span's is removed", header, rows)


def contact_table(contacts: tuple[ContactScore, ...]) -> str:
    """How each observer tells contacts."""
    if not contacts:
        return ""
    header = ("Observer", "contacts", "missed", "false alarms/h", "mean delay [s]", "longest [s]")
    rows = [
        (
            told.name,
            str(told.detection.contacts),
            str(told.detection.missed),
            significant(told.detection.false_alarms_per_h),
            significant(told.detection.mean_delay),
            significant(told.detection.longest_delay),
        )
        for told in contacts
    ]
    return table("Contacts against the reference, told at the free band", header, rows)


def trade_off(contacts: tuple[ContactScore, ...]) -> str:
    """The operating curve (ROC): contacts found against false alarms, by threshold."""
    if not contacts:
        return ""
    header = ("Observer", *(f"× {threshold:g}" for threshold in SHOWN))
    rows = []
    for told in contacts:
        marks = np.array([point.threshold for point in told.curve])
        points = [told.curve[int(np.argmin(np.abs(np.log(marks / at))))] for at in SHOWN]
        cells = (f"{p.found:.0%} at {significant(p.false_alarms_per_h)}/h" for p in points)
        rows.append((told.name, *cells))
    caption = "Contacts found, and false alarms per hour, over the threshold in free bands (ROC)"
    return table(caption, header, rows)
