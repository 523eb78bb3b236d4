"""The virtual sensor on the page: drift, what the pose can tell, and contacts."""

from collections.abc import Iterator
from html import escape

import numpy as np

from vftcli.analysis import Analysis
from vftcli.observers.table import BEST
from vftcli.outputs.grid import html
from vftcli.outputs.log.wrench_tables import contact_grids, drift_grid
from vftcli.outputs.page.charts import (
    REFERENCE,
    Chart,
    ChartLine,
    large,
    multiples,
    observer_lines,
)
from vftcli.outputs.page.shell import section, soft
from vftcli.outputs.page.torque_part import contact_spans, legend_name
from vftcli.signals.arrays import Array, Mask
from vftcli.signals.external_torque import COVERS
from vftcli.signals.wrench import AXES, unit_of
from vftcli.virtual_sensor.frames import FRAMES
from vftcli.virtual_sensor.sensor_reading import SensorReading


def wrench_chart(analysis: Analysis) -> Chart | None:
    """Force and moment axis by axis: the first wrench with its band, the reference below it."""
    found = [wrench for wrench in analysis.wrenches if wrench.name != "reference"]
    if not found:
        return None
    styles = observer_lines(analysis.estimates)
    first = next((w.name for w in found if w.name == BEST), found[0].name)
    lines = [
        ChartLine(
            w.name,
            w.known,
            *styles[w.name],
            half=COVERS * w.sd if w.sd is not None and w.name == first else None,
            leads=w.name == first,
            shown=w.name == first,
            quiet=quiet_samples(analysis, w.name),
        )
        for w in sorted(found, key=lambda wrench: wrench.name == first)
    ]
    reference = [w for w in analysis.wrenches if w.name == "reference"]
    below = [ChartLine(legend_name(analysis, w.name), w.known, REFERENCE) for w in reference]
    return Chart(
        "wrench",
        f"Wrench in {found[0].frame} axes",
        tuple(map(unit_of, AXES)),
        AXES,
        analysis.t,
        (*below, *lines),
        families=(1, 1, 1, 2, 2, 2),
        spans=contact_spans(analysis),
    )


def quiet_samples(analysis: Analysis, name: str) -> Mask | None:
    """Samples of a wrench outside of every listed contact, None where it asks no list. (T,)"""
    sensed = analysis.virtual_sensor
    found = None if sensed is None else sensed.smoothed.get(name)
    return found.unlisted(analysis.t) if found is not None and found.gate else None


def condition_charts(analysis: Analysis) -> Iterator[Chart]:
    """σ_min with the masked zone, what the solver says there, and the null-space channel."""
    sensed = analysis.virtual_sensor
    if sensed is None or not sensed.wrenches:
        return
    # σ_min and the mask follow from the pose, so that every observer has the same.
    first, t = sensed.wrenches[0], analysis.t
    styles = observer_lines(analysis.estimates)
    if first.sigma_min is not None:
        least = np.array([sensed.sensor.least_sigma])
        sigma = (ChartLine("σ_min of J", column(first.sigma_min)),)
        title = "What the pose can tell: σ_min"
        yield Chart(
            "sigma_min",
            title,
            ("m",),
            (title,),
            t,
            sigma,
            band=least,
            band_label="masked below",
            lowest=0.0,
        )
    if sensed.hides:
        blown = tuple(
            ChartLine(w.name, masked_force(w.values, w.hidden), *styles[w.name])
            for w in sensed.wrenches
            if w.hidden.any()
        )
        title = f"|force| by {sensed.sensor.solver} in the masked samples, not to be believed"
        yield Chart("blow-up", title, ("N",), (title,), t, blown)
    if first.null_space is not None:
        left = tuple(
            ChartLine(w.name, column(w.null_space), *styles[w.name])
            for w in sensed.wrenches
            if w.null_space is not None
        )
        limit = np.array([e.threshold for e in sensed.elsewhere[:1]])
        band = limit if limit.size else None
        title = "Torque that no wrench at the flange explains"
        yield Chart(
            "null_space", title, ("N·m",), (title,), t, left, band=band, band_label="free part"
        )


def column(values: Array) -> Array:
    """One series as a chart's only column. (T, 1)"""
    return values[:, None]


def masked_force(values: Array, hidden: Mask) -> Array:
    """Norm of the force in masked samples, NaN elsewhere. (T, 1) [N]"""
    norm = np.linalg.norm(values[:, :3], axis=1)
    return column(np.where(hidden, norm, np.nan))


def wrench_section(analysis: Analysis, chart: Chart | None) -> str:
    """Words, charts and tables, "" without a wrench."""
    sensed = analysis.virtual_sensor
    if sensed is None or chart is None:
        return ""
    grids = [drift_grid(sensed.drifts, spans=True)] if sensed.drifts else []
    if analysis.errors is not None:
        grids += contact_grids(analysis.errors)
    axes, solver = FRAMES[sensed.sensor.frame], sensed.solver
    parts = (
        multiples(chart),
        soft(
            f"Force and moment ON the robot in {escape(axes)}; solver {escape(solver)}. The three "
            "forces share a scale, and so do the three moments."
        ),
        large(chart),
        masked_words(sensed),
        *map(html, grids),
        *map(multiples, condition_charts(analysis)),
    )
    shown = next(line.name for line in chart.series if line.leads)
    state = f"{shown}, {sensed.sensor.frame} axes"
    return section("Wrench axes", "".join(parts), state, name="wrench")


def masked_words(sensed: SensorReading) -> str:
    """How much is masked and why the line breaks there."""
    if not sensed.hides:
        return ""
    return (
        f"<p>{sensed.masked_share:.1%} of the samples are masked: near a singularity some "
        "direction of force moves no joint, so its torque says nothing of it. Least squares "
        "divides the torque error by σ_min there and blows up; below "
        f"{sensed.sensor.least_sigma:g} m an error of 1 N·m is more than "
        f"{1 / sensed.sensor.least_sigma:.0f} N. The chart of the masked samples shows what the "
        "solver says; no table and no column contains it.</p>"
    )
