"""The list where no free motion is known."""

import numpy as np
from contact_logs import FIXTURES, motion, true_wrench
from contact_scores import score, true_contacts

from vftcli.contacts.threshold_list import (
    axes_told,
    flange_forces,
    split_at_valleys,
    threshold_rows,
)
from vftcli.readers import read


def test_a_wrench_with_its_prior_is_that_of_the_normal_equations() -> None:
    rng = np.random.default_rng(9)
    J, torque, sd = (
        rng.standard_normal((1, 6, 6)),
        rng.standard_normal((1, 6)),
        np.full((1, 6), 0.1),
    )
    values, covariance = flange_forces(J, torque, sd)
    precision = J[0] @ J[0].T / 0.01 + np.diag(np.repeat([1e-4, 1e-2], 3))
    np.testing.assert_allclose(covariance[0], np.linalg.inv(precision), rtol=1e-9)
    np.testing.assert_allclose(values[0], np.linalg.solve(precision, J[0] @ torque[0] / 0.01))


def test_a_valley_below_half_of_both_peaks_splits() -> None:
    size = np.concatenate([np.full(20, 40.0), np.full(6, 10.0), np.full(20, 60.0)])
    assert [stop for _, stop in split_at_valleys(size, 5, 8.0)] == [20, 46]
    assert split_at_valleys(size, 25, 8.0) == [(0, 46)]
    shallow = np.concatenate([np.full(20, 40.0), np.full(6, 25.0), np.full(20, 60.0)])
    assert split_at_valleys(shallow, 5, 8.0) == [(0, 46)]


def test_a_noisy_load_between_two_peaks_is_split_once() -> None:
    """9 N with dips to 7, below half of both peaks: no dip is a valley of the load itself."""
    load = np.where(np.arange(60) % 10 == 5, 7.0, 9.0)
    size = np.concatenate([np.full(20, 16.0), load, np.full(20, 26.0)])
    (_, valley), (again, end) = split_at_valleys(size, 5, 8.0)
    assert valley == again
    assert 20 <= valley < 80
    assert end == 100
    assert split_at_valleys(size, 5, 17.0) == [(0, 100)]  # the first peak cannot be told


def test_most_pushes_are_told_by_the_drives_friction_alone() -> None:
    run = motion(read(FIXTURES / "ur5_table1.csv"), "ur5").log
    rows = threshold_rows(run)
    scored = score(rows, true_contacts(*true_wrench("ur5_table1.csv")))
    assert len(scored.pairs) >= 11
    # Where the model errs by more than .2 F_c, it shows as rows.
    assert len(scored.false) <= 8
    error = np.array([row.peak_force - met.size for row, met in scored.pairs])
    # An observer of 1/30 s lags behind taps of .2 s, and a row before one may be credited for it.
    assert np.median(np.abs(error)) < 10.0
    assert [row.number for row in rows] == list(range(1, len(rows) + 1))
    off = []
    for row in rows:
        assert row.course is not None
        assert row.peak_force is not None
        assert (row.course.t[0], row.course.t[-1]) == (row.start, row.stop)
        at_peak = float(np.interp(row.peak, row.course.t, row.course.force))
        off.append(at_peak / row.peak_force - 1.0)
    # The row's torque is the mean over .03 s about the peak, the course's that of the sample.
    assert np.median(np.abs(off)) < 0.1
    assert 5.0 < float(axes_told(run)[2]) < 60.0


def test_a_force_within_its_band_is_no_row() -> None:
    """A load, a guide and two knocks; friction at reversals reads as less than its own band."""
    run = motion(read(FIXTURES / "panda_bearing.csv"), "panda").log
    rows = threshold_rows(run)
    scored = score(rows, true_contacts(*true_wrench("panda_bearing.csv")))
    assert len(scored.pairs) == 3
    assert not scored.false
    assert all(row.has_size for row in rows)
