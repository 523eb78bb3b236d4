"""What the complete log told, on the page: free part, error budget, spectra."""

from collections.abc import Mapping, Sequence
from html import escape

import numpy as np

from vftcli.analysis import Analysis
from vftcli.observers.auto_tuning import Curve
from vftcli.observers.spectra import Spectra
from vftcli.outputs.grid import Column, Entry, Grid, html, joint_columns
from vftcli.outputs.page.charts import Chart, ChartLine, LineStyle, multiples, observer_lines
from vftcli.outputs.page.shell import section
from vftcli.outputs.page.torque_part import joint_panels
from vftcli.refinement.limits import Budget
from vftcli.signals.arrays import Array

#: Colours of the two spectra.
FREE, LOADED = "#3b7ea1", "#c2410c"


def refinement_section(analysis: Analysis) -> str:
    """Error budget, spectra and tuning of a complete log, "" without one."""
    found = analysis.refinement
    if found is None:
        return ""
    shown = ""
    if found.budgets:
        caption = "Error budget in N·m rms, estimated from the log itself"
        shown = f"<h3>{caption}</h3>{html(budget_grid(found.budgets))}"
    charts = []
    if (spectra := found.baselines.plain.spectra) is not None:
        charts.append(spectra_chart(spectra))
    if found.curves:
        charts.append(tuning_chart(found.curves, observer_lines(analysis.estimates)))
    drawn = "".join(f"<h3>{escape(c.title)}</h3>{multiples(c)}" for c in charts)
    return section("What the complete log tells", shown + drawn, name="complete-log")


def budget_grid(budgets: Sequence[Budget]) -> Grid:
    """Where every observer's error comes from, cause by cause. [N·m]"""
    rows: list[tuple[Entry, ...]] = [
        (budget.name, cause, *map(float, values))
        for budget in budgets
        # Stiction at rest is a bound, not a cause that adds up: the sum leaves it out.
        for cause, values in (*budget.parts.items(), ("all but stiction at rest", budget.total))
    ]
    words = (Column("observer", words=True), Column("cause", words=True))
    return Grid(columns=(*words, *joint_columns(len(budgets[0].total))), rows=tuple(rows))


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
