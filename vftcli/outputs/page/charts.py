"""Charts as the page's script takes them: JSON with base64 float32 arrays."""

import base64
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from vftcli.outputs.decimation import Line, decimated
from vftcli.signals.arrays import Array

STRETCHES = 2000
"""Stretches a long log is cut into: two samples a stretch are about what a wide screen can show."""


class ChartLine(NamedTuple):
    """One line of a chart, for every joint.

    Attributes:
        name: What the legend calls it.
        values: One column a joint. (T, n)
        colour: ``#rrggbb``, or "ink" for the page's own text colour.
        dashed: Whether the line is dashed.
        half: Half the width of a ribbon about the line, NaN where it is not known. (T, n)
        leads: Whether it is the line to look at: drawn thicker, and on top of the others.
    """

    name: str
    values: Array
    colour: str = "ink"
    dashed: bool = False
    half: Array | None = None
    leads: bool = False


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


def packed(chart: Chart, t: Array) -> dict[str, Any]:
    """A chart over time as JSON can hold it."""
    return {
        **frame_of(chart),
        "series": [
            {
                **style_of(line),
                "lines": [
                    {**packed_line(part), **ribbon_of(line, j, t, part.t)}
                    for j, part in enumerate(decimated(t, line.values, STRETCHES))
                ],
            }
            for line in chart.series
        ],
    }


def packed_over_frequency(
    chart: Chart, frequencies: Sequence[Array], extra: Mapping[str, Any] | None = None
) -> dict[str, Any]:
    """A chart over frequency as JSON can hold it, its horizontal axis logarithmic.

    Args:
        chart: Its lines hold one row a frequency. (F, n)
        frequencies: One array a line. (F,) [Hz]
        extra: Further settings of the chart.
    """
    series = [
        {**style_of(line), "lines": [packed_line(Line(f, column)) for column in line.values.T]}
        for line, f in zip(chart.series, frequencies, strict=True)
    ]
    return {**frame_of(chart), "log": True, **(extra or {}), "series": series}


def frame_of(chart: Chart) -> dict[str, Any]:
    """A chart's name, title, unit and band: what holds for all of its lines."""
    return {
        "key": chart.key,
        "title": chart.title,
        "unit": chart.unit,
        "height": chart.height,
        "band": known(chart.band),
        "bandLabel": chart.band_label,
    }


def style_of(line: ChartLine) -> dict[str, Any]:
    """A line's name, colour, dashes and rank, as the script takes them."""
    return {
        "name": line.name,
        "colour": line.colour,
        "dashed": line.dashed,
        "leads": line.leads,
    }


def packed_line(line: Line) -> dict[str, str]:
    """A line's points: both coordinates as base64 float32."""
    return {"x": base64_float32(line.t), "y": base64_float32(line.y)}


def ribbon_of(line: ChartLine, j: int, t: Array, drawn: Array) -> dict[str, str]:
    """Half the width of one column's ribbon at the times that are drawn; nothing without one.

    Args:
        line: The line.
        j: The column.
        t: Times of its samples. (T,) [s]
        drawn: Times that are drawn. (P,) [s]
    """
    if line.half is None:
        return {}
    return {"half": base64_float32(np.interp(drawn, t, line.half[:, j]))}


def base64_float32(values: Array) -> str:
    """Little-endian float32 as base64: seven digits are more than a screen can show."""
    # Text of numbers would be three times as long, and slower to read.
    return base64.b64encode(np.asarray(values, dtype="<f4").tobytes()).decode("ascii")


def known(values: Array | None) -> list[float | None] | None:
    """Numbers for JSON, None where they are not known."""
    # JSON has no NaN; a band of unknowns only is no band.
    if values is None or not np.any(np.isfinite(values)):
        return None
    return [float(value) if np.isfinite(value) else None for value in values]
