"""What differs between a log and its free runs, against the plain sums over them."""

import numpy as np

from vftcli.repetition.laid_over import REPEATED, STUCK, LaidOver
from vftcli.repetition.pairing import pair_with_run

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
    laid = LaidOver(motion=log, pairings=pairings)
    for made, name, sign in ((laid.torque, "drive_torque", -1), (laid.change, "model_torque", 1)):
        there = [p.there(getattr(p.free, name)) for p in pairings]
        # Where the second has ended the first stands alone.
        mean = np.where(np.isnan(there[1]), there[0], np.add(*there) / 2.0)
        np.testing.assert_array_equal(made, sign * (getattr(log, name) - mean))
    assert laid.torque is laid.torque  # made once, whatever rungs and cutoffs ask for it
    np.testing.assert_array_equal(laid.known, np.isfinite(laid.torque).all(axis=1))
    there = [p.there(p.free.standing.astype(float)) > 0 for p in pairings]
    np.testing.assert_array_equal(laid.standing, log.standing | there[0] | there[1])
    stops = [log.standstill, *(np.nan_to_num(p.there(p.free.standstill)) for p in pairings)]
    longest, shortest = np.max(stops, axis=0), np.min(stops, axis=0)
    share = np.minimum(longest / STUCK, 1) * (1 - REPEATED * shortest / np.maximum(longest, 1e-9))
    np.testing.assert_array_equal(laid.stopped, np.maximum(share, laid.standing))


def test_a_model_that_is_right_misses_nothing(drive_of) -> None:
    q = np.sin(T)[:, None]
    run = drive_of(T, q, np.cos(T)[:, None], drive_torque=5.0 * q, model_torque=5.0 * q)
    assert LaidOver(motion=run, pairings=[pair_with_run(T, run, 0.0)]).misfit == 0.0
    wrong = drive_of(T, q, np.cos(T)[:, None], drive_torque=5.0 * q, model_torque=4.0 * q)
    found = LaidOver(motion=wrong, pairings=[pair_with_run(T, wrong, 0.0)]).misfit
    np.testing.assert_allclose(found, 0.25, rtol=1e-9)  # one of four newton-metres
