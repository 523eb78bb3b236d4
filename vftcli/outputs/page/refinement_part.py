"""What the complete log told, on the page: free part, error budget, consistency, spectra."""

from collections.abc import Iterable, Mapping

import numpy as np

from vftcli.analysis import Analysis
from vftcli.observers.spectra import Spectra
from vftcli.outputs.grid import Column, Entry, Grid, html, joint_columns
from vftcli.outputs.page.charts import Chart, ChartLine
from vftcli.outputs.page.shell import bullets, folded
from vftcli.refinement.refine import Refinement
from vftcli.signals.arrays import Array

FREE, LOADED = "#3b7ea1", "#c2410c"
"""Colours of the two spectra."""


def refinement_section(analysis: Analysis) -> str:
    """Remarks, error budget and innovations of a complete log, "" where nothing asked for it."""
    found = analysis.refinement
    if found is None:
        return ""
    tables = {
        "Error budget in N·m rms, estimated from the log itself": budget_grid(found),
        "Innovations; in brackets what a true model would give": consistency_grid(found),
    }
    shown = "".join(folded(caption, html(grid)) for caption, grid in tables.items() if grid.rows)
    return f"<h2>What the complete log tells</h2>{bullets(found.remarks)}{shown}"


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

    lines = (
        ChartLine("free part, S_n", level(found.free), FREE),
        ChartLine("loaded part, S_d", level(found.loaded), LOADED),
    )
    title = "Spectrum of d: free part (blue), loaded part (orange)"
    return Chart("spectra", title, "dB, 1 (N·m)²/Hz", lines)


def tuning_chart(found: Refinement, colours: Mapping[str, str]) -> Chart:
    """What was minimised for every observer that the log tuned."""
    lines = (ChartLine(name, curve.rmse, colours[name]) for name, curve in found.curves.items())
    title = "Expected error against natural frequency ω_n/2π"
    return Chart("curve", title, "N·m", tuple(lines))
