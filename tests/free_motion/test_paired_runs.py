"""What differs between a log and its free runs, against the plain sums over them."""

import numpy as np

from vftcli.free_motion.paired_runs import REPEATED, STUCK, PairedRuns, pair_with_run

T = 0.008 * np.arange(600)


def test_the_differences_are_those_of_the_mean_over_the_free_runs(drive_of) -> None:
    rng = np.random.default_rng(7)

    def run():
        torque, model = rng.standard_normal((2, len(T), 2))
        q = np.column_stack([np.sin(T), np.cos(T)])
        return drive_of(T, q, np.gradient(q, T, axis=0), drive_torque=torque, model_torque=model)

    log, frees = run(), [run(), run()]
    pairings = [
        pair_with_run(T, free, shift) for free, shift in zip(frees, (0.0, 0.5), strict=True)
    ]
    pair = PairedRuns(motion=log, pairings=pairings)
    differences = {"drive_torque": (pair.torque, -1), "model_torque": (pair.model_difference, 1)}
    for name, (made, sign) in differences.items():
        there = [p.there(getattr(p.free, name)) for p in pairings]
        # Where the second has ended the first stands alone.
        mean = np.where(np.isnan(there[1]), there[0], np.add(*there) / 2.0)
        np.testing.assert_array_equal(made, sign * (getattr(log, name) - mean))
    assert pair.torque is pair.torque  # made once, whatever rungs and cutoffs ask for it
    np.testing.assert_array_equal(pair.known, np.isfinite(pair.torque).all(axis=1))
    there = [p.there(p.free.standing.astype(float)) > 0 for p in pairings]
    np.testing.assert_array_equal(pair.standing, log.standing | there[0] | there[1])
    stops = [log.standstill, *(np.nan_to_num(p.there(p.free.standstill)) for p in pairings)]
    longest, shortest = np.max(stops, axis=0), np.min(stops, axis=0)
    share = np.minimum(longest / STUCK, 1) * (1 - REPEATED * shortest / np.maximum(longest, 1e-9))
    np.testing.assert_array_equal(pair.stopped, np.maximum(share, pair.standing))


def test_a_model_that_is_right_misses_nothing(drive_of) -> None:
    q = np.sin(T)[:, None]
    run = drive_of(T, q, np.cos(T)[:, None], drive_torque=5.0 * q, model_torque=5.0 * q)
    assert PairedRuns(motion=run, pairings=[pair_with_run(T, run, 0.0)]).misfit == 0.0
    wrong = drive_of(T, q, np.cos(T)[:, None], drive_torque=5.0 * q, model_torque=4.0 * q)
    found = PairedRuns(motion=wrong, pairings=[pair_with_run(T, wrong, 0.0)]).misfit
    np.testing.assert_allclose(found, 0.25, rtol=1e-9)  # one of four newton-metres
