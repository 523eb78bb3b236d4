"""What lists of contacts reach on simulated arms that no constant was chosen on: the bars.

A figure that falls short is expected to, with what it reaches; each is a strict expectation.
"""

from functools import cache

import numpy as np
import pytest
from score_lists import Figures, figures, scored

SEEDS = 61, 62, 63

NINE = "ur5-circle", "ur5-table1", "taps"


@cache
def reached(name: str) -> Figures:
    """The figures of three seeds of a scenario."""
    return figures([scored(name, seed) for seed in SEEDS])


@pytest.mark.statistical
def test_simulated_pushes_are_listed_one_by_one() -> None:
    nine = [reached(name) for name in NINE]
    true = sum(each.true for each in nine)
    assert sum(each.found for each in nine) >= 0.97 * true
    assert abs(sum(each.rows for each in nine) - true) <= 0.03 * true
    assert sum(each.false for each in nine) <= 1


@pytest.mark.statistical
def test_wrist_contacts_are_hardly_ever_placed_elsewhere() -> None:
    nine = [reached(name) for name in NINE]
    found = sum(each.found for each in nine)
    assert sum(each.wrong for each in nine) <= 0.02 * found
    assert sum(each.unsure for each in nine) <= 0.35 * found


@pytest.mark.statistical
@pytest.mark.parametrize(
    ("name", "figure", "bar"),
    [
        *((name, "onset", 0.2) for name in NINE),
        ("ur5-circle", "peak", 9.0),
        ("ur5-table1", "peak", 6.0),
        ("taps", "peak", 6.0),
        ("ur5-circle", "direction", 5.0),
        ("ur5-table1", "direction", 3.0),
        ("taps", "direction", 3.0),
        ("ur5-circle", "impulse", 0.15),
        ("ur5-table1", "impulse", 0.08),
        ("taps", "impulse", 0.08),
        ("ur5-circle", "width", 10.0),  # 9.6: what the places that fit differ by is in the band
        ("ur5-table1", "width", 10.5),  # 10.0 likewise; 8 and 9 held .76 and .90 of the peaks
        ("taps", "width", 10.5),
        ("ur5-sensor", "false", 1),
        ("ur5-drag", "false", 1),
    ],
)
def test_a_list_errs_by_no_more_than_its_bar(name: str, figure: str, bar: float) -> None:
    assert getattr(reached(name), figure) <= bar


@pytest.mark.statistical
@pytest.mark.parametrize(
    ("name", "bar"),
    [("ur5-circle", 0.93), ("ur5-table1", 0.95), ("taps", 0.88), ("panda-bearing", 0.80)],
)
def test_a_peak_lies_in_its_band(name: str, bar: float) -> None:
    assert reached(name).held >= bar


@pytest.mark.statistical
@pytest.mark.parametrize(
    ("name", "axes", "bar"),
    [
        *((name, slice(3), 0.88) for name in NINE),
        ("ur5-circle", slice(3, 6), 0.65),
        ("ur5-table1", slice(3, 6), 0.85),
        ("taps", slice(3, 6), 0.85),
        ("panda-bearing", slice(3), 0.88),
        ("ur5-sensor", slice(3), 0.80),
    ],
)
def test_bands_of_best_hold_in_contact(name: str, axes: slice, bar: float) -> None:
    assert np.all(reached(name).axes[axes] >= bar)


@cache
def knocked() -> Figures:
    """Knocks of 40 to 120 ms at 125 Hz."""
    return figures([scored("knocks", 51)])


@pytest.mark.statistical
def test_knocks_shorter_than_the_blocks_keep_most_of_their_peaks() -> None:
    """Blocks of 24 ms lost a fifth of the peak."""
    assert knocked().peak_mean > -13.0


@pytest.mark.statistical
def test_knocks_shorter_than_the_blocks_keep_a_band() -> None:
    """Blocks of 24 ms held one in five."""
    assert knocked().held >= 0.6


@pytest.mark.statistical
def test_drags_a_tenth_of_a_second_apart_are_rows_of_their_own() -> None:
    """Beside a free part at rest, from different sides: 12 of 15; they were six rows."""
    assert reached("ur5-sensor").found >= 12
