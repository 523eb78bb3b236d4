"""What the page's script draws: charts and their lines, as JSON with base64 float32 arrays."""

import base64
import json
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from vftcli.analysis import Analysis
from vftcli.outputs.decimation import Line, decimated
from vftcli.outputs.log.tables import blocks, joint_heads
from vftcli.outputs.palette import DASHED, colours_of
from vftcli.robots.drive import drive_torque
from vftcli.signals.arrays import Array
from vftcli.signals.external_torque import COVERS, ExternalTorque
from vftcli.signals.wrench import AXES

STRETCHES = 2000
"""Stretches a long log is cut into: two samples a stretch are about what a wide screen can show."""

RESTING = "#c2410c"
"""Colour of a reference that is not to be trusted."""

FREQUENCIES = 240
"""Points of a frequency response."""


class ChartLine(NamedTuple):
    """One line of a chart, for every joint.

    Attributes:
        name: What the legend calls it.
        values: One column a joint. (T, n)
        colour: ``#rrggbb``, or "ink" for the page's own text colour.
        dashed: Whether the line is dashed.
        half: Half the width of a ribbon about the line, one a joint, or None. (n,)
    """

    name: str
    values: Array
    colour: str = "ink"
    dashed: bool = False
    half: Array | None = None


class Chart(NamedTuple):
    """One chart, for the joint that is chosen.

    Attributes:
        key: Its name on the page.
        title: What it shows, in words.
        unit: Unit of its vertical axis.
        series: Its lines.
        band: Half the width of a band about zero, one a joint, or None. (n,)
        band_label: What the band is.
        height: Relative height.
    """

    key: str
    title: str
    unit: str
    series: tuple[ChartLine, ...]
    band: Array | None = None
    band_label: str = ""
    height: float = 1.0


def payload(analysis: Analysis) -> str:
    """JSON for a ``<script type="application/json">``: nothing in it can end the element."""
    t = analysis.t
    data = {
        "joints": analysis.recording.joints,
        "labels": joint_labels(analysis),
        "span": [float(t[0]), float(t[-1])],
        "charts": [packed(chart, t) for chart in time_charts(analysis)],
        "wrenches": [{**packed(chart, t), "at": 0} for chart in all_wrench_charts(analysis)],
        "responses": responses(analysis),
    }
    text = json.dumps(data, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace("\u2028", " ").replace("\u2029", " ")


def is_decimated(analysis: Analysis) -> bool:
    """Whether the page shows fewer samples than the log has."""
    return analysis.recording.samples > 2 * STRETCHES


def time_charts(analysis: Analysis) -> Iterator[Chart]:
    """The charts over time, top to bottom."""
    estimates = estimate_series(analysis)
    floor = analysis.reference.floor if analysis.reference is not None else None
    label = "± floor of the reference"
    reference = reference_series(analysis)
    yield Chart("tau", "External torque on the robot", "N·m", (*reference, *estimates), height=1.5)
    if analysis.reference is not None:
        truth = analysis.reference.tau
        errors = tuple(s._replace(values=s.values - truth, half=None) for s in estimates)
        yield Chart("error", "Estimate − reference", "N·m", errors, floor, label)
    yield from motion_charts(analysis)


def estimate_series(analysis: Analysis) -> tuple[ChartLine, ...]:
    """Every observer's torque in its colour."""
    colours = colours_of(analysis.estimates)
    return tuple(
        ChartLine(e.name, e.tau, colours[e.name], e.name in DASHED, half_band(e))
        for e in analysis.estimates
    )


def half_band(estimate: ExternalTorque) -> Array | None:
    """Half the width of the 95 % band, its root mean square over time. (n,)"""
    if estimate.error_sd is None:
        return None
    return np.asarray(COVERS * np.sqrt(np.mean(estimate.error_sd**2, axis=0)))


def reference_series(analysis: Analysis) -> tuple[ChartLine, ...]:
    """The reference in the page's ink, if there is one."""
    if analysis.reference is None:
        return ()
    tau, moving = analysis.reference.tau, analysis.reference.moving
    whole = ChartLine(legend_name(analysis, "reference"), tau)
    if moving is None or np.all(moving | ~np.isfinite(tau)):
        return (whole,)
    resting = np.where(moving, np.nan, tau)
    return (whole, ChartLine("reference while the joint rests", resting, RESTING))


def joint_labels(analysis: Analysis) -> list[str]:
    """J1, J2, …; a dagger where the reference is not to be trusted, as in the tables."""
    n, errors = analysis.recording.joints, analysis.errors
    found = blocks(errors) if errors is not None else ()
    return joint_heads(found[0]) if found else [f"J{j}" for j in range(1, n + 1)]


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
    colours = colours_of(analysis.estimates)
    found = sorted(analysis.wrenches, key=lambda wrench: wrench.name != "reference")
    for k, axis in enumerate(AXES if found else ()):
        series = tuple(
            ChartLine(
                legend_name(analysis, w.name),
                w.known[:, k : k + 1],
                colours.get(w.name, "ink"),
                w.name in DASHED,
            )
            for w in found
        )
        yield Chart(axis, f"{axis} in {found[0].frame} axes", "N" if k < 3 else "N·m", series)


def all_wrench_charts(analysis: Analysis) -> Iterator[Chart]:
    """The wrenches axis by axis, then what the pose and the null space say of them."""
    from vftcli.outputs.page.wrench_part import condition_charts

    yield from wrench_charts(analysis)
    yield from condition_charts(analysis)


def legend_name(analysis: Analysis, name: str) -> str:
    """A series' name in the legend: the reference's says which it is."""
    if name == "reference" and analysis.reference is not None:
        return f"reference ({analysis.reference.name})"
    return name


def packed(chart: Chart, t: Array) -> dict[str, Any]:
    """A chart as JSON can hold it."""
    return {
        "key": chart.key,
        "title": chart.title,
        "unit": chart.unit,
        "height": chart.height,
        "band": known(chart.band),
        "bandLabel": chart.band_label,
        "series": [
            {
                "name": series.name,
                "colour": series.colour,
                "dashed": series.dashed,
                "half": known(series.half),
                "lines": [packed_line(line) for line in decimated(t, series.values, STRETCHES)],
            }
            for series in chart.series
        ],
    }


def packed_line(line: Line) -> dict[str, str]:
    """A line's times and values."""
    return {"x": base64_float32(line.t), "y": base64_float32(line.y)}


def base64_float32(values: Array) -> str:
    """Little-endian float32 as base64: seven digits are more than a screen can show."""
    return base64.b64encode(np.asarray(values, dtype="<f4").tobytes()).decode("ascii")


def known(values: Array | None) -> list[float | None] | None:
    """Numbers for JSON, None where they are not known."""
    if values is None or not np.any(np.isfinite(values)):
        return None
    return [float(value) if np.isfinite(value) else None for value in values]


def responses(analysis: Analysis) -> list[dict[str, Any]]:
    """Gain, phase and delay of every observer over frequency, up to half the sample rate."""
    step, n = analysis.recording.median_step, analysis.recording.joints
    frequency = np.geomspace(1e-2, 0.5 / step, FREQUENCIES)
    gains, phases, delays = [], [], []
    colours = colours_of(analysis.estimates)
    for observer in analysis.observers:
        response = observer.frequency_response(frequency, step, n)
        style = {
            "name": observer.name,
            "colour": colours[observer.name],
            "dashed": observer.name in DASHED,
        }
        decibel = 20.0 * np.log10(np.maximum(np.abs(response), 1e-12))
        phase = np.degrees(np.unwrap(np.angle(response), axis=0))
        gains.append({**style, "lines": lines_over(frequency, decibel)})
        phases.append({**style, "lines": lines_over(frequency, phase)})
        delay = -1e3 * phase / (360.0 * frequency[:, None])
        delays.append({**style, "lines": lines_over(frequency, delay)})
    shape = {"band": None, "bandLabel": "", "height": 1.0, "log": True}
    return [
        {
            "key": "gain",
            "lowest": -80,
            "title": "Gain from torque to estimate",
            "unit": "dB",
            **shape,
            "series": gains,
        },
        {"key": "phase", "title": "Phase of the estimate", "unit": "°", **shape, "series": phases},
        {"key": "delay", "title": "Delay of the estimate", "unit": "ms", **shape, "series": delays},
        *tuning_curves(analysis, shape),
    ]


def tuning_curves(analysis: Analysis, shape: dict[str, Any]) -> list[dict[str, Any]]:
    """What was minimised for every observer that the log tuned, and the spectra behind it."""
    from vftcli.outputs.page.refinement_part import curves

    colours = colours_of(analysis.estimates)
    series = [
        {"name": name, "colour": colours[name], "dashed": False, "lines": lines_over(hertz, rmse)}
        for name, hertz, rmse in curves(analysis)
    ]
    title = "Expected error against natural frequency ω_n/2π"
    chart = {"key": "curve", "title": title, "unit": "N·m", **shape, "series": series}
    return [*([chart] if series else []), *spectra_charts(analysis, shape)]


def spectra_charts(analysis: Analysis, shape: dict[str, Any]) -> list[dict[str, Any]]:
    """The spectra of the raw disturbance over the free and the loaded part, if they are known."""
    from vftcli.outputs.page.refinement_part import spectra

    series = [
        {"name": name, "colour": colour, "dashed": False, "lines": lines_over(frequency, level)}
        for name, colour, frequency, level in spectra(analysis)
    ]
    title = "Spectrum of d: free part (blue), loaded part (orange)"
    unit = "dB, 1 (N·m)²/Hz"
    chart = {"key": "spectra", "title": title, "unit": unit, **shape, "series": series}
    return [chart] if series else []


def lines_over(frequency: Array, values: Array) -> list[dict[str, str]]:
    """One line a joint over frequency. (F, n)"""
    return [packed_line(Line(frequency, column)) for column in values.T]
