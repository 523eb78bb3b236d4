"""What the complete log told, on the page: free part, error budget, consistency, spectra."""

from collections.abc import Iterable, Mapping
from html import escape

import numpy as np

from vftcli.analysis import Analysis
from vftcli.observers.auto_tuning import Curve
from vftcli.observers.spectra import Spectra
from vftcli.outputs.grid import Column, Entry, Grid, html, joint_columns
from vftcli.outputs.page.charts import Chart, ChartLine, LineStyle, multiples, observer_lines
from vftcli.outputs.page.shell import section
from vftcli.outputs.page.torque_part import joint_panels
from vftcli.refinement.refine import Refinement
from vftcli.signals.arrays import Array

FREE, LOADED = "#3b7ea1", "#c2410c"
"""Colours of the two spectra."""


def refinement_section(analysis: Analysis) -> str:
    """Error budget, innovations, spectra and tuning of a complete log, "" without one."""
    found = analysis.refinement
    if found is None:
        return ""
    tables = {
        "Error budget in N·m rms, estimated from the log itself": budget_grid(found),
        "Innovations; in brackets what a true model would give": consistency_grid(found),
    }
    shown = "".join(
        f"<h3>{escape(caption)}</h3>{html(grid)}" for caption, grid in tables.items() if grid.rows
    )
    charts = []
    if (spectra := found.baseline.spectra) is not None:
        charts.append(spectra_chart(spectra))
    if found.curves:
        charts.append(tuning_chart(found.curves, observer_lines(analysis.estimates)))
    drawn = "".join(f"<h3>{escape(c.title)}</h3>{multiples(c)}" for c in charts)
    return section("What the complete log tells", shown + drawn, name="complete-log")


def budget_grid(found: Refinement) -> Grid:
    """Where every observer's error comes from, cause by cause. [N·m]"""
    rows = [
        (budget.name, cause, values)
        for budget in found.budgets
        # Stiction at rest is a bound, not a cause that adds up: the sum leaves it out.
        for cause, values in (*budget.parts.items(), ("all but stiction at rest", budget.total))
    ]
    return joint_grid("observer", "cause", rows)


def consistency_grid(found: Refinement) -> Grid:
    """How the innovations of the Kalman filters look."""
    rows = [
        (one.name, what, values)
        for one in found.consistency
        for what, values in (
            ("mean NIS (1)", one.nis),
            ("NIS within its 95 % (0.95)", one.inside),
            ("correlation, one sample (0)", one.correlation),
            ("coloured lags of 20 (0.05)", one.coloured),
            ("half of the free power below [Hz]", one.loudest),
        )
    ]
    return joint_grid("filter", "what", rows)


def joint_grid(first: str, second: str, rows: Iterable[tuple[str, str, Array]]) -> Grid:
    """Two columns of words, then a number a joint."""
    lines: list[tuple[Entry, ...]] = [
        (name, what, *map(float, values)) for name, what, values in rows
    ]
    joints = joint_columns(len(lines[0]) - 2 if lines else 0)
    words = (Column(first, words=True), Column(second, words=True))
    return Grid(columns=(*words, *joints), rows=tuple(lines))


def spectra_chart(found: Spectra) -> Chart:
    """Spectra of the raw disturbance over both parts of the log; 0 Hz is left out."""

    def level(power: Array) -> Array:
        """Power in decibels; the least number above 0 stands for none at all."""
        decibels: Array = 10.0 * np.log10(np.maximum(power[1:], np.finfo(float).tiny))
        return decibels

    free = level(found.free)
    lines = (
        ChartLine("free part, S_n", free, FREE),
        ChartLine("loaded part, S_d", level(found.loaded), LOADED, "5 2"),
    )
    n = free.shape[1]
    return Chart(
        "spectra",
        "Spectrum of the disturbance, dB of 1 (N·m)²/Hz",
        ("dB",) * n,
        joint_panels(free),
        found.frequency[1:],
        lines,
        families=(1,) * n,
        unit="Hz",
        log=True,
    )


def tuning_chart(curves: Mapping[str, Curve], styles: Mapping[str, LineStyle]) -> Chart:
    """What was minimised for every observer that the log tuned."""
    lines = tuple(
        ChartLine(name, curve.rmse, *styles[name], x=curve.omega_n / (2.0 * np.pi))
        for name, curve in curves.items()
    )
    values = lines[0].values
    x = [line.x for line in lines if line.x is not None]
    ends = np.array([min(float(v.min()) for v in x), max(float(v.max()) for v in x)])
    return Chart(
        "curve",
        "Expected error against natural frequency ω_n/2π",
        ("N·m",) * values.shape[1],
        joint_panels(values),
        ends,
        lines,
        unit="Hz",
        log=True,
    )
