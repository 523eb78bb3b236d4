"""The alignment ladder: what a difference is on each rung, and which one is taken."""

from collections.abc import Callable

import numpy as np
import pytest

from vftcli.free_motion.difference import (
    Difference,
    ErrorModel,
    PairedRuns,
    difference,
    most_certain,
    pair_with_run,
)
from vftcli.robots.run import Run
from vftcli.signals.errors import ReferenceTorqueError

Make = Callable[..., Run]
T = 0.008 * np.arange(1500)
RNG = np.random.default_rng(4)
PUSH = 5.0 * np.exp(-((T - 6.0) ** 2))[:, None]
MODEL, FREE_MODEL = RNG.standard_normal((2, len(T), 1))


@pytest.fixture
def drive(drive_of: Make) -> Make:
    """One joint that swings, with torques of its own."""
    q, dq = np.sin(T)[:, None], np.cos(T)[:, None]
    return lambda torque, model: drive_of(T, q, dq, drive_torque=torque, model_torque=model)


def test_a_difference_is_free_less_loaded_with_the_model_s_own_taken_off(drive: Make) -> None:
    """τ + τ_ext is what the model says of each motion: the push comes out exactly."""
    loaded, free = drive(MODEL - PUSH, MODEL), drive(FREE_MODEL, FREE_MODEL)
    laid = PairedRuns(motion=loaded, pairings=[pair_with_run(T, free, 0.0)])
    corrected = difference(laid, "model", None)
    np.testing.assert_allclose(corrected.tau, PUSH, atol=1e-9)
    plain = difference(laid, "period", None)
    np.testing.assert_allclose(plain.tau, FREE_MODEL - MODEL + PUSH, atol=1e-9)
    assert np.all(corrected.error.floor < plain.error.floor)


def test_too_few_partners_are_refused(drive: Make) -> None:
    loaded = drive(MODEL, MODEL)
    laid = PairedRuns(motion=loaded, pairings=[pair_with_run(T, loaded, T[-1] - T[14])])
    with pytest.raises(ReferenceTorqueError, match="only 15 samples have a partner"):
        difference(laid, "period", None)


def test_the_simpler_of_two_alike_is_taken() -> None:
    def made(rung: str, *floor: float, stands: bool = False) -> Difference:
        """A difference of two joints' floors, of which the second may stand."""
        standing = np.zeros((4, 2), dtype=bool) | [False, stands]
        error = ErrorModel(np.tile(floor, (4, 1)), standing)
        return Difference(rung, None, np.zeros((4, 2)), error)

    low = made("period", 1.0, 1.0)
    assert most_certain([low, made("phase", 0.98, 0.98)])[0].rung == "period"
    assert most_certain([low, made("phase", 0.96, 0.96)])[0].rung == "phase"
    better = [low, made("phase", 0.9, 0.9), made("model", 0.9 * 0.97 + 0.01, 0.88)]
    assert most_certain(better)[0].rung == "phase"
    # A joint that stands decides nothing.
    stood = [made("period", 1.0, 1.0, stands=True), made("model", 0.5, 9.0, stands=True)]
    assert most_certain(stood)[0].rung == "model"
