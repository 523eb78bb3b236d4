"""|F| over time as text: heights are the list's, seconds and numbers stand below."""

from dataclasses import replace

import numpy as np
from contact_rows import contact, contact_list

from vftcli.analysis import Analysis
from vftcli.outputs.canvas import Canvas
from vftcli.outputs.force_bars import (
    ForceCourse,
    column_peaks,
    contact_numbers,
    force_bars,
    force_course,
    seconds,
)

T = np.linspace(0.0, 18.0, 1801)


def course(*pushes: tuple[float, float, float]) -> ForceCourse:
    """Forces that are constant from and to a time."""
    force = np.zeros(len(T))
    for begin, end, size in pushes:
        force[(begin <= T) & (end >= T)] = size
    return ForceCourse(T, force)


def test_the_bars_are_as_high_as_the_force_and_stand_where_it_is() -> None:
    canvas = Canvas(width=72)
    lines = force_bars(course((3.0, 6.0, 45.0), (9.0, 12.0, 90.0)), [], canvas)
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
    lines = force_bars(course((3.0, 6.0, 45.0)), [], Canvas(unicode=False))
    assert "".join(lines).isascii()
    assert "#" in lines[1]


def test_every_sample_counts_in_a_column_and_a_gap_is_bridged() -> None:
    one = course((5.0, 5.001, 70.0))  # a single sample
    assert column_peaks(one, 60).max() == 70.0
    few = ForceCourse(np.array([0.0, 10.0]), np.array([0.0, 20.0]))
    assert np.all(np.diff(column_peaks(few, 8)[:-1]) > 0)


def test_seconds_count_in_round_steps() -> None:
    assert seconds(T, 60).split() == ["0", "2", "4", "6", "8", "10", "12", "14", "16", "18", "s"]
    assert seconds(np.array([0.0, 0.9]), 60).split()[:3] == ["0", "0.1", "0.2"]


def test_numbers_stand_below_the_peaks_where_there_is_room() -> None:
    rows = [contact(number=1, peak=0.0), contact(number=2, peak=9.0), contact(number=3, peak=9.1)]
    line = contact_numbers(T, rows, 60)
    assert line.split() == ["1", "2"]  # the third would touch the second
    assert line.index("2") == 30


def test_the_course_has_the_heights_of_the_list(without_reference: Analysis) -> None:
    rows = (contact(start=1.0, stop=1.5, peak_force=30.0), contact(start=2.0, stop=2.2,
            number=2, peak_force=12.0))  # fmt: skip
    made = replace(without_reference, contacts=contact_list(*rows))
    found = force_course(made)
    assert found is not None
    t, force = found
    assert np.isclose(force[(t >= 1.0) & (t <= 1.5)].max(), 30.0)
    assert np.isclose(force[(t >= 2.0) & (t <= 2.2)].max(), 12.0)
    assert not force[(t < 1.0) | (t > 2.2) | ((t > 1.5) & (t < 2.0))].any()


def test_a_load_has_the_course_of_best_else_its_mean(
    without_reference: Analysis, with_wrench: Analysis
) -> None:
    load = contact_list(contact(start=0.5, stop=4.0, is_load=True, peak_force=27.0))
    bare = replace(without_reference, contacts=load, virtual_sensor=None)
    found = force_course(bare)
    assert found is not None
    assert set(np.unique(found.force)) == {0.0, 27.0}
    own = force_course(replace(with_wrench, contacts=load))
    best = next(w for w in with_wrench.wrenches if w.name == "best")
    assert own is not None
    inside = (own.t >= 0.5) & (own.t <= 4.0)
    expected = np.linalg.norm(best.values[:, :3], axis=1)
    np.testing.assert_allclose(own.force[inside], expected[inside])


def test_without_forces_there_are_no_bars(without_reference: Analysis) -> None:
    assert force_course(replace(without_reference, contacts=None)) is None
    assert force_course(replace(without_reference, contacts=contact_list())) is None
