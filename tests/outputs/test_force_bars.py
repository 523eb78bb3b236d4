"""|F| over time as bars of text: heights, seconds and numbers where they belong."""

from dataclasses import replace

import numpy as np
from contact_rows import contact, contact_list

from vftcli.analysis import Analysis
from vftcli.contacts.contact_list import ForceCourse
from vftcli.outputs.screen import (
    Canvas,
    column_peaks,
    force_bars,
    forces_of_list,
    log_screen,
)
from vftcli.signals.arrays import Array

T = np.linspace(2.0, 20.0, 1801)


def pushed(*pushes: tuple[float, float, float]) -> tuple[Array, Array]:
    """Time and forces that are constant from and to a time."""
    force = np.zeros(len(T))
    for begin, end, size in pushes:
        force[(begin <= T) & (end >= T)] = size
    return T, force


BARS = """\
    N
  130 ┤                              ▁▁▁▁▁▁▁▁▁▁▁      ████████
   65 ┤          ▁▁▁▁▁▁▁▁▁▁▁         ███████████      ████████
    0 ┤▁▁▁▁▁▁▁▁▁▁███████████▁▁▁▁▁▁▁▁▁███████████▁▁▁▁▁▁████████▁▁▁▁▁▁
       2      4      6     8      10     12     14    16     18     20 s
    #            1                          2  14                   15"""
"""|F| over 18 s in 61 columns of .295 s: what is pushed from 5 s on begins in column 10.16.

Of 130.4 N in three lines of eight steps, 45 N are 8.3 and 90 N 16.6 steps, rounded up. Number 13,
at 13.3 s, lies beside that of 13 s.
"""


def test_bars_are_as_high_as_the_force_and_stand_where_it_is() -> None:
    force = pushed((5.0, 8.0, 45.0), (11.0, 14.0, 90.0), (16.0, 18.0, 130.4), (18.5, 18.6, 1.0))
    peaks = {1: 5.0, 2: 13.0, 13: 13.3, 14: 14.0, 15: 20.0}
    rows = [contact(number=number, peak=peak) for number, peak in peaks.items()]
    assert force_bars(*force, rows, Canvas(width=72)) == BARS.splitlines()
    plain = BARS.replace("┤", "|").replace("▁", ".").replace("█", "#")
    assert force_bars(*force, rows, Canvas(width=72, unicode=False)) == plain.splitlines()
    assert force_bars(*force, [], Canvas(width=72)) == BARS.splitlines()[:-1]


def test_every_sample_counts_in_a_column_and_a_gap_is_bridged() -> None:
    one = pushed((5.0, 5.001, 70.0))  # a single sample
    assert column_peaks(*one, 60).max() == 70.0
    few = np.array([0.0, 10.0]), np.array([0.0, 20.0])
    assert np.all(np.diff(column_peaks(*few, 8)[:-1]) > 0)


def test_the_forces_are_those_of_the_list(without_reference: Analysis) -> None:
    rows = [
        contact(start=1.0, stop=1.5, course=risen(1.0, 1.5, 30.0)),
        contact(start=2.0, stop=2.2, number=2, course=risen(2.0, 2.2, 12.0)),
    ]
    t = without_reference.t
    force = forces_of_list(contact_list(*rows), t)
    assert np.isclose(force[(t >= 1.0) & (t <= 1.5)].max(), 30.0, rtol=0.05)  # between samples
    assert np.isclose(force[(t >= 2.0) & (t <= 2.2)].max(), 12.0, rtol=0.1)
    assert not force[(t < 1.0) | (t > 2.2) | ((t > 1.5) & (t < 2.0))].any()


def risen(start: float, stop: float, peak: float) -> ForceCourse:
    """A force that rises to a peak and falls."""
    force = np.array([0.0, peak, 0.0])
    return ForceCourse(np.array([start, (start + stop) / 2, stop]), force, 0.1 * force)


def test_without_forces_there_are_no_bars(without_reference: Analysis) -> None:
    for found in (None, contact_list()):
        assert "┤" not in log_screen(replace(without_reference, contacts=found), Canvas())
