"""|F| over time as text: heights are the list's, seconds and numbers stand below."""

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
    seconds,
)
from vftcli.signals.arrays import Array

T = np.linspace(0.0, 18.0, 1801)


def pushed(*pushes: tuple[float, float, float]) -> tuple[Array, Array]:
    """Time and forces that are constant from and to a time."""
    force = np.zeros(len(T))
    for begin, end, size in pushes:
        force[(begin <= T) & (end >= T)] = size
    return T, force


def test_the_bars_are_as_high_as_the_force_and_stand_where_it_is() -> None:
    canvas = Canvas(width=72)
    lines = force_bars(*pushed((3.0, 6.0, 45.0), (9.0, 12.0, 90.0)), [], canvas)
    unit, top, middle, bottom, axis = lines
    assert unit.split() == ["N"]
    assert [line.split()[0] for line in (top, middle, bottom)] == ["90", "45", "0"]
    bars = [line.partition("┤")[2] for line in (top, middle, bottom)]
    columns = canvas.width - 2 - 8

    def at(row: str, time: float) -> str:
        return row.ljust(columns)[round(time / 18.0 * columns)]

    # Half of the largest force fills one and a half of the three lines.
    assert [at(row, 10.5) for row in bars] == ["█", "█", "█"]
    assert [at(row, 4.5) for row in bars] == [" ", "▄", "█"]
    assert [at(row, 15.0) for row in bars] == [" ", " ", "▁"]
    assert axis.split()[-1] == "s"
    assert max(map(len, lines)) <= canvas.width


def test_a_terminal_of_ascii_gets_ascii() -> None:
    lines = force_bars(*pushed((3.0, 6.0, 45.0)), [], Canvas(unicode=False))
    assert "".join(lines).isascii()
    assert "#" in lines[1]


def test_every_sample_counts_in_a_column_and_a_gap_is_bridged() -> None:
    one = pushed((5.0, 5.001, 70.0))  # a single sample
    assert column_peaks(*one, 60).max() == 70.0
    few = np.array([0.0, 10.0]), np.array([0.0, 20.0])
    assert np.all(np.diff(column_peaks(*few, 8)[:-1]) > 0)


def test_seconds_count_in_round_steps() -> None:
    assert seconds(T, 60).split() == ["0", "2", "4", "6", "8", "10", "12", "14", "16", "18", "s"]
    assert seconds(np.array([0.0, 0.9]), 60).split()[:3] == ["0", "0.1", "0.2"]


def test_numbers_stand_below_the_peaks_where_there_is_room() -> None:
    rows = [contact(number=1, peak=0.0), contact(number=2, peak=9.0), contact(number=3, peak=9.1)]
    line = force_bars(*pushed((8.0, 10.0, 5.0)), rows, Canvas(width=69))[-1]
    assert line.split() == ["#", "1", "2"]  # the third would touch the second
    assert line.index("2") - line.index("1") == 30


def test_the_forces_are_those_of_the_list(without_reference: Analysis) -> None:
    rows = [
        contact(start=1.0, stop=1.5, course=risen(1.0, 1.5, 30.0)),
        contact(start=2.0, stop=2.2, number=2, course=risen(2.0, 2.2, 12.0)),
    ]
    made = replace(without_reference, contacts=contact_list(*rows))
    force, t = forces_of_list(made), made.t
    assert force is not None
    assert np.isclose(force[(t >= 1.0) & (t <= 1.5)].max(), 30.0, rtol=0.05)  # between samples
    assert np.isclose(force[(t >= 2.0) & (t <= 2.2)].max(), 12.0, rtol=0.1)
    assert not force[(t < 1.0) | (t > 2.2) | ((t > 1.5) & (t < 2.0))].any()


def risen(start: float, stop: float, peak: float) -> ForceCourse:
    """A force that rises to a peak and falls."""
    force = np.array([0.0, peak, 0.0])
    return ForceCourse(np.array([start, (start + stop) / 2, stop]), force, 0.1 * force)


def test_without_forces_there_are_no_bars(without_reference: Analysis) -> None:
    assert forces_of_list(replace(without_reference, contacts=None)) is None
    assert forces_of_list(replace(without_reference, contacts=contact_list())) is None
