"""Bias removal: what is taken off, and what is left where nothing touches the arm."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from vftcli.observers import MomentumObserver
from vftcli.readers import read
from vftcli.refinement.baseline import baseline_of, free_reading
from vftcli.refinement.bias import (
    RANGE,
    Scale,
    features,
    fitted,
    remove_modelled,
    remove_nothing,
    ridge,
)
from vftcli.repetition.choice import FreeChoice
from vftcli.repetition.free_motion import FreeMotion
from vftcli.repetition.free_run import ModelledRun
from vftcli.robots import load_robot
from vftcli.signals.errors import ParameterError

FIXTURE = Path(__file__).parents[2] / "fixtures" / "ur5_circle.csv"
GMO = MomentumObserver(gain=np.full(6, 20.0))


@pytest.fixture(scope="module")
def log() -> ModelledRun:
    return ModelledRun(recording=read(FIXTURE), robot=load_robot("ur5"))


def test_a_bias_without_a_free_part_is_not_removed(log: ModelledRun) -> None:
    found = replace(baseline_of(FreeMotion(log=log)), part=None)
    reading = free_reading(found, GMO, GMO.estimate(found.terms))
    with pytest.raises(ParameterError, match="--free"):
        remove_modelled(found, [reading])
    assert remove_nothing(found, [reading]).readings == (reading,)


def test_the_model_finds_a_friction_that_was_left_out(log: ModelledRun) -> None:
    """A bias of sign and speed, planted in what the observer reads, is predicted unseen."""
    found = baseline_of(FreeMotion(log=log, choice=FreeChoice(spans=((0.0, 12.0),))))
    dq = log.recording.dq
    planted = 3.0 * np.tanh(dq / 0.05) + 2.0 * dq
    noise = 0.1 * np.random.default_rng(5).standard_normal(dq.shape)
    estimate = replace(GMO.estimate(found.terms), tau=planted + noise)
    removal = remove_modelled(found, [free_reading(found, GMO, estimate)])
    (after,) = removal.readings
    moving = [0, 1, 2, 3, 5]
    left = np.sqrt(np.mean(after.estimate.tau[:, moving] ** 2, axis=0))
    assert np.all(left < 0.15)  # the noise of 0.1 and what 1501 samples do not tell
    assert removal.remarks[0].code == "bias-modelled"
    assert set(removal.remarks[0].where.joints) >= {1, 2, 3, 4, 6}
    # what is left of the free samples is what the model leaves of those it has not seen
    assert np.all((after.rms[moving] > 0.09) & (after.rms[moving] < 0.2))


def test_ridge_without_penalty_is_least_squares() -> None:
    rng = np.random.default_rng(6)
    X, y = rng.standard_normal((50, 3)), rng.standard_normal(50)
    exact, *_ = np.linalg.lstsq(np.column_stack([np.ones(50), X]), y, rcond=None)
    np.testing.assert_allclose(ridge(X, y, 0.0), exact, atol=1e-12)
    stiff = ridge(X, y, 1e9)
    np.testing.assert_allclose(stiff, [y.mean(), 0.0, 0.0, 0.0], atol=1e-6)


def test_noise_is_not_believed_to_be_a_bias() -> None:
    rng = np.random.default_rng(7)
    _, share = fitted(rng.standard_normal((200, 12)), rng.standard_normal((200, 2)))
    assert np.all(share > 0.95)


def test_features_are_held_within_what_the_free_part_showed(log: ModelledRun) -> None:
    X = features(log.recording)
    scale = Scale(X.mean(axis=0), X.std(axis=0), X.min(axis=0), X.max(axis=0))
    middle, half = 0.5 * (scale.most + scale.least), 0.5 * (scale.most - scale.least)
    beyond = np.vstack([middle + 10.0 * half, middle - 10.0 * half])
    held = np.vstack([middle + RANGE * half, middle - RANGE * half])
    np.testing.assert_allclose(scale.applied(beyond), scale.applied(held))
    np.testing.assert_allclose(scale.applied(X), (X - scale.mean) / scale.sd)


def test_a_joint_that_hardly_moves_in_the_free_part_says_nothing_of_its_motion() -> None:
    """Its angle varies evenly by 1e-5 about 1 rad there, √3 of its standard deviation."""
    angle = 1.0 + 1e-5 * np.linspace(-1.0, 1.0, 100)[:, None]
    scale = Scale(angle.mean(axis=0), angle.std(axis=0), angle.min(axis=0), angle.max(axis=0))
    assert np.abs(scale.applied(np.array([[0.5], [1.05]]))).max() < RANGE * np.sqrt(3.0)
