"""Lists of contacts against the true ones, and the intervals of what is counted."""

import pytest

from vftcli.evaluation.scores import ListedRow, rate_interval, score_list, share_interval

NAN = float("nan")


def test_found_split_false_onset_and_peak() -> None:
    true = [(2.0, 3.0, 20.0), (5.0, 6.0, NAN), (8.0, 9.0, 10.0), (9.5, 9.8, 33.0)]
    rows = [
        ListedRow(2.1, 2.4, 15.0, 6.0),  # finds the first, its band holds the peak
        ListedRow(2.6, 3.05, 18.0, 1.0),  # a second row on it
        ListedRow(6.08, 6.5, 5.0, 1.0, is_load=True),  # within the slack of the second
        ListedRow(6.9, 7.1, 30.0, 1.0),  # nothing there
        ListedRow(7.5, 7.92, 11.0, 1.0),  # within the slack before the third
        ListedRow(10.0, 11.8, 20.0, 1.0),  # beyond the slack, most of it nearer than 11 s
        ListedRow(10.8, 11.4, 80.0, 1.0),  # where, by its middle, nobody vouches
        ListedRow(12.0, 13.0, 90.0, 1.0),
    ]
    found = score_list(rows, true, [(-5.0, 11.0)], duration=20.0)
    whole = ("true_contacts", "found", "found_as_load", "split", "false", "hardest_false_N")
    assert [found[name] for name in whole] == [4, 3, 1, 1, 2, 30.0]
    assert found["free_h"] == pytest.approx((11.0 - 3.3) / 3600.0)
    assert found["onset_s"] == pytest.approx([0.1, 1.08, -0.5])
    # Of the rows on a contact the hardest counts: 18 N of 20, with a band of 1 N; 11 of 10.
    assert found["peak_error_N"] == pytest.approx([-2.0, 1.0])
    assert found["true_peak_N"] == [20.0, 10.0]
    assert found["peaks_held"] == 1


def test_a_vouched_span_ends_with_the_log() -> None:
    assert score_list([], [], [(0.0, 1e9)], duration=36.0)["free_h"] == pytest.approx(0.01)
    # A true contact that is longer than what is vouched for leaves no time, not less than none.
    assert score_list([], [(0.0, 9.0, NAN)], [(1.0, 2.0)], duration=36.0)["free_h"] == 0.0


@pytest.mark.parametrize(
    ("count", "low", "high"),
    # Exact 95 % limits of a Poisson mean: Garwood (1936), table as in any handbook.
    [(0, 0.0, 3.6889), (1, 0.02532, 5.5716), (3, 0.6187, 8.7673), (10, 4.7954, 18.3904)],
)
def test_a_rate_has_its_exact_poisson_interval(count: int, low: float, high: float) -> None:
    assert rate_interval(count, 1.0) == pytest.approx((low, high), abs=1e-4)
    assert rate_interval(count, 2.0) == pytest.approx((low / 2, high / 2), abs=1e-4)
    assert rate_interval(count, 0.0) == pytest.approx((NAN, NAN), nan_ok=True)


@pytest.mark.parametrize(
    ("part", "whole", "low", "high"),
    # Roots of (p̂ − p)² = z² p (1 − p)/n, solved by hand: 7/14 is symmetric about a half.
    [(7, 14, 0.26799, 0.73201), (0, 6, 0.0, 0.39033), (6, 6, 0.60967, 1.0), (0, 0, NAN, NAN)],
)
def test_a_share_has_its_wilson_interval(part: int, whole: int, low: float, high: float) -> None:
    found = share_interval(part, whole)
    assert found == pytest.approx((low, high), abs=1e-5, nan_ok=True)
    assert not found[0] < 0.0
