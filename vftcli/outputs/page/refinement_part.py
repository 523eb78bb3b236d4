"""What the complete log told, on the page: free part, error budget, consistency, spectra."""

from collections.abc import Iterator
from html import escape

import numpy as np

from vftcli.analysis import Analysis
from vftcli.outputs.log.tables import significant
from vftcli.signals.arrays import Array

FREE, LOADED = "#3b7ea1", "#c2410c"
"""Colours of the two spectra."""


def workup(analysis: Analysis) -> str:
    """The section, empty where nothing asked for it."""
    found = analysis.workup
    if found is None:
        return ""
    notes = "".join(f"<li>{escape(note)}</li>" for note in found.notes)
    return (
        f'<h2>What the complete log tells</h2><ul class="plain">{notes}</ul>'
        f"{budget_table(analysis)}{consistency_table(analysis)}"
    )


def budget_table(analysis: Analysis) -> str:
    """Where every observer's error comes from, cause by cause."""
    found = analysis.workup
    if found is None or not found.budgets:
        return ""
    rows = []
    for budget in found.budgets:
        named = {**budget.parts, "all but stiction at rest": budget.total}
        rows += [row(budget.name, cause, values) for cause, values in named.items()]
    caption = "Error budget in N·m rms, estimated from the log itself"
    return table(caption, ("Observer", "cause"), analysis.recording.joints, rows)


def consistency_table(analysis: Analysis) -> str:
    """How the innovations of the Kalman filters look."""
    found = analysis.workup
    if found is None or not found.consistency:
        return ""
    rows = []
    for one in found.consistency:
        named = {
            "mean NIS (1)": one.nis,
            "NIS within its 95 % (0.95)": one.inside,
            "correlation, one sample (0)": one.correlation,
            "coloured lags of 20 (0.05)": one.coloured,
            "half of the free power below [Hz]": one.loudest,
        }
        rows += [row(one.name, what, values) for what, values in named.items()]
    caption = "Innovations; in brackets what a true model would give"
    return table(caption, ("Filter", "what"), analysis.recording.joints, rows)


def row(name: str, what: str, values: Array) -> str:
    """One line of numbers, one a joint."""
    cells = "".join(f"<td>{significant(float(x))}</td>" for x in values)
    head = f'<th scope="row">{escape(name)}</th><td class="text">{escape(what)}</td>'
    return f"<tr>{head}{cells}</tr>"


def table(caption: str, words: tuple[str, str], joints: int, rows: list[str]) -> str:
    """A table that scrolls by itself, folded away."""
    head = "".join(f'<th scope="col" class="text">{escape(word)}</th>' for word in words)
    head += "".join(f'<th scope="col">J{j + 1}</th>' for j in range(joints))
    return (
        f'<details><summary>{escape(caption)}</summary><div class="scroll"><table>'
        f"<thead><tr>{head}</tr></thead><tbody>{''.join(rows)}</tbody></table></div></details>"
    )


def spectra(analysis: Analysis) -> Iterator[tuple[str, str, Array, Array]]:
    """Name, colour, frequencies (F,) and level (F, n) of the raw disturbance's spectra.

    In decibels to 1 (N·m)²/Hz; 0 Hz is left out.
    """
    found = analysis.workup.survey.spectra if analysis.workup is not None else None
    if found is None:
        return
    for name, colour, power in (
        ("free part, S_n", FREE, found.free),
        ("loaded part, S_d", LOADED, found.loaded),
    ):
        level = 10.0 * np.log10(np.maximum(power[1:], np.finfo(float).tiny))
        yield name, colour, found.frequency[1:], level


def curves(analysis: Analysis) -> Iterator[tuple[str, Array, Array]]:
    """Name, natural frequencies in Hz and expected error (G, n) of every tuned observer."""
    if analysis.workup is None:
        return
    for name, curve in analysis.workup.curves.items():
        yield name, curve.omega_n / (2.0 * np.pi), curve.rmse
