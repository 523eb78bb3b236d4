"""What the script draws on the page of one log: charts over time, and over frequency."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from vftcli.analysis import Analysis
from vftcli.observers.table import BEST
from vftcli.outputs.log.rmse_tables import blocks
from vftcli.outputs.page.charts import Chart, ChartLine, packed, packed_over_frequency
from vftcli.outputs.page.refinement_part import spectra_chart, tuning_chart
from vftcli.outputs.page.wrench_part import condition_charts
from vftcli.outputs.palette import colours_of, styles_of
from vftcli.robots.drive import drive_torque
from vftcli.signals.external_torque import COVERS
from vftcli.signals.wrench import AXES, unit_of

RESTING = "#c2410c"
"""Colour of a reference that is not to be trusted."""

FREQUENCIES = 240
"""Points of a frequency response."""

QUIETEST = 1e-12
"""Gain below which a response is drawn as -240 dB, so that its logarithm is finite."""


def payload(analysis: Analysis) -> dict[str, Any]:
    """Charts, their labels and their common span, as the page's script takes them."""
    t, n = analysis.t, analysis.recording.joints
    found = blocks(analysis.errors) if analysis.errors is not None else ()
    wrenches = [*wrench_charts(analysis), *condition_charts(analysis)]
    return {
        "joints": n,
        # A dagger where the reference is not to be trusted, as in the tables.
        "labels": found[0].joint_heads if found else [f"J{j}" for j in range(1, n + 1)],
        "span": [float(t[0]), float(t[-1])],
        "charts": [packed(chart, t) for chart in time_charts(analysis)],
        "wrenches": [{**packed(chart, t), "at": 0} for chart in wrenches],
        "responses": [*responses(analysis), *refinement_charts(analysis)],
    }


def time_charts(analysis: Analysis) -> Iterator[Chart]:
    """The charts over time, top to bottom: torque, its error, what the log measured."""
    estimates = estimate_series(analysis)
    floor = analysis.reference.floor if analysis.reference is not None else None
    label = "± floor of the reference"
    reference = reference_series(analysis)
    yield Chart("tau", "External torque on the robot", "N·m", (*reference, *estimates), height=1.5)
    if analysis.reference is not None:
        truth = analysis.reference.tau
        # The ribbon is about the estimate; about its error it would say nothing new.
        errors = tuple(s._replace(values=s.values - truth, half=None) for s in estimates)
        yield Chart("error", "Estimate − reference", "N·m", errors, floor, label)
    yield from motion_charts(analysis)


def estimate_series(analysis: Analysis) -> tuple[ChartLine, ...]:
    """Every observer's torque in its colour, the leading one within its 95 % band.

    Where `best` ran it leads, and its band is the one that is drawn: five would hide one another.
    """
    styles = styles_of(analysis.estimates)
    alone = BEST not in styles
    return tuple(
        ChartLine(
            e.name,
            e.tau,
            *styles[e.name],
            half=COVERS * e.error_sd
            if e.error_sd is not None and (alone or e.name == BEST)
            else None,
            leads=e.name == BEST,
        )
        for e in analysis.estimates
    )


def reference_series(analysis: Analysis) -> tuple[ChartLine, ...]:
    """The reference in the page's ink, if there is one."""
    if analysis.reference is None:
        return ()
    tau, moving = analysis.reference.tau, analysis.reference.moving
    whole = ChartLine(legend_name(analysis, "reference"), tau)
    if moving is None or np.all(moving | ~np.isfinite(tau)):
        return (whole,)
    # Drawn once more on top, so that the untrusted part stands out and the line stays whole.
    resting = np.where(moving, np.nan, tau)
    return (whole, ChartLine("reference while the joint rests", resting, RESTING))


def motion_charts(analysis: Analysis) -> Iterator[Chart]:
    """What the log measured: drive torque, positions, velocities."""
    recording = analysis.recording
    torque = drive_torque(recording, analysis.robot)
    yield Chart("drive", "Drive torque at the joint", "N·m", (ChartLine("measured", torque),))
    yield Chart("q", "Position", "rad", (ChartLine("measured", recording.q),))
    if recording.dq is not None:
        yield Chart("dq", "Velocity", "rad/s", (ChartLine("measured", recording.dq),))


def wrench_charts(analysis: Analysis) -> Iterator[Chart]:
    """One chart an axis of the wrench, where wrenches were asked for."""
    styles = styles_of(analysis.estimates)
    found = sorted(analysis.wrenches, key=lambda wrench: wrench.name != "reference")
    for k, axis in enumerate(AXES if found else ()):
        lines = tuple(
            ChartLine(
                legend_name(analysis, w.name),
                w.known[:, [k]],
                *styles.get(w.name, ("ink", False)),
                leads=w.name == BEST,
            )
            for w in found
        )
        yield Chart(axis, f"{axis} in {found[0].frame} axes", unit_of(axis), lines)


def legend_name(analysis: Analysis, name: str) -> str:
    """A series' name in the legend: the reference's says which it is."""
    if name == "reference" and analysis.reference is not None:
        return f"reference ({analysis.reference.name})"
    return name


def responses(analysis: Analysis) -> list[dict[str, Any]]:
    """Gain, phase and delay of every observer over frequency, up to half the sample rate."""
    step, n = analysis.recording.median_step, analysis.recording.joints
    frequency = np.geomspace(1e-2, 0.5 / step, FREQUENCIES)
    styles = styles_of(analysis.estimates)
    gains, phases, delays = [], [], []
    for observer in analysis.observers:
        response = observer.frequency_response(frequency, step, n)
        # Unwrapped, or a delay would jump by a period wherever the phase passes −180°.
        phase = np.degrees(np.unwrap(np.angle(response), axis=0))
        style = styles[observer.name]
        decibel = 20.0 * np.log10(np.maximum(np.abs(response), QUIETEST))
        gains.append(ChartLine(observer.name, decibel, *style))
        phases.append(ChartLine(observer.name, phase, *style))
        # A phase of −φ degrees at f is a delay of φ / (360 f).
        delays.append(ChartLine(observer.name, -1e3 * phase / (360.0 * frequency[:, None]), *style))
    charts = (
        Chart("gain", "Gain from torque to estimate", "dB", tuple(gains)),
        Chart("phase", "Phase of the estimate", "°", tuple(phases)),
        Chart("delay", "Delay of the estimate", "ms", tuple(delays)),
    )
    over = [frequency] * len(gains)
    lowest = {"gain": {"lowest": -80}}
    return [packed_over_frequency(chart, over, lowest.get(chart.key)) for chart in charts]


def refinement_charts(analysis: Analysis) -> list[dict[str, Any]]:
    """What was minimised for every observer that the log tuned, and the spectra behind it."""
    found = analysis.refinement
    if found is None:
        return []
    shown = []
    if found.curves:
        over = [curve.omega_n / (2.0 * np.pi) for curve in found.curves.values()]
        colours = colours_of(analysis.estimates)
        shown.append(packed_over_frequency(tuning_chart(found, colours), over))
    if (spectra := found.baseline.spectra) is not None:
        chart = spectra_chart(spectra)
        shown.append(packed_over_frequency(chart, [spectra.frequency[1:]] * len(chart.series)))
    return shown
