"""The torque error behind a band: given, measured, brought along or assumed."""

import numpy as np
import pytest

from vftcli.observers import MomentumObserver
from vftcli.robots.terms import DynamicsTerms
from vftcli.signals.errors import ParameterError
from vftcli.signals.external_torque import ExternalTorque
from vftcli.virtual_sensor.solvers import TORQUE_SD
from vftcli.virtual_sensor.torque_error import (
    from_band,
    from_default,
    from_free_part,
    given_error,
    lag_sd,
)

T = np.arange(0.0, 40.0, 0.01)


def torque(name: str = "gmo", **more: np.ndarray) -> ExternalTorque:
    tau = np.random.default_rng(3).normal(0.0, [0.5, 2.0], (len(T), 2))
    return ExternalTorque(name=name, t=T, tau=tau, **more)


@pytest.mark.parametrize(("text", "sd"), [("0.4", [0.4, 0.4]), ("1,2.5", [1.0, 2.5])])
def test_a_given_error_is_one_for_all_or_one_a_joint(text: str, sd: list[float]) -> None:
    np.testing.assert_array_equal(given_error(text, [torque()]).sd["gmo"], sd)


def test_own_leaves_every_observer_its_covariance() -> None:
    assert given_error("own", [torque()]).sd == {}


@pytest.mark.parametrize("text", ["1,2,3", "0", "-1", "nan", "much"])
def test_what_is_no_error(text: str) -> None:
    with pytest.raises(ParameterError, match="one positive number, or one for each of 2 joints"):
        given_error(text, [torque()])


def test_a_band_that_is_constant_is_one_a_joint() -> None:
    constant = torque(error_sd=np.tile([[0.2, 0.3]], (len(T), 1)))
    varying = torque("kfo-fe", error_sd=np.linspace(0.1, 0.2, 2 * len(T)).reshape(-1, 2))
    found = from_band([constant, varying])
    np.testing.assert_array_equal(found.sd["gmo"], [0.2, 0.3])
    assert found.sd["kfo-fe"].shape == (len(T), 2)
    assert found.remark is not None
    assert found.remark.code == "band-from-torques"


def test_a_default_stands_for_a_covariance_only_under_a_prior() -> None:
    own = torque("kfo-fe", sd=np.ones((len(T), 2)))
    assert from_default([torque(), own], "pinv").sd == {}
    found = from_default([torque(), own], "map").sd
    np.testing.assert_array_equal(found["kfo-fe"], [TORQUE_SD, TORQUE_SD])


def test_a_free_part_measures_the_spread_about_its_mean() -> None:
    one = torque()
    free = T < 20.0
    found = from_free_part([one], free, None, {})
    np.testing.assert_allclose(found.sd["gmo"], one.tau[free].std(axis=0))
    rms = {"gmo": np.array([3.0, 4.0])}
    np.testing.assert_array_equal(from_free_part([one], free, rms, {}).sd["gmo"], [3.0, 4.0])


def test_the_lag_adds_what_it_leaves_out_of_the_contacts() -> None:
    """A torque of .5 Hz after 20 s, GMO of 5 1/s: |1 − H| = ω/√(ω² + K²) of its rms."""
    tau = np.where(T < 20.0, 0.0, 8.0 * np.sin(2 * np.pi * 0.5 * T))[:, None]
    gained = 0.5 * (tau[1:] + tau[:-1]) * 0.01
    p = np.concatenate([np.zeros((1, 1)), np.cumsum(gained, axis=0)])
    terms = DynamicsTerms(t=T, p=p, mu=np.zeros_like(p))
    observers = (MomentumObserver(gain=5.0),)
    lag = lag_sd(terms, observers, None, T < 20.0)["gmo"]
    omega = 2 * np.pi * 0.5
    expected = 8.0 / np.sqrt(2) * omega / np.hypot(omega, 5.0)
    # windows of a few seconds spread the line over ± .5 Hz, where |1 − H| bends
    assert lag[0] == pytest.approx(expected, rel=0.1)
    run = DynamicsTerms(t=T, p=np.zeros_like(p), mu=np.zeros_like(p))
    beside = lag_sd(terms, observers, run, T < 0.0)["gmo"]
    # over the whole log half of the samples are in contact: 1/√2 of it
    assert beside[0] == pytest.approx(expected / np.sqrt(2), rel=0.1)


def test_a_part_too_short_for_a_spectrum_adds_nothing() -> None:
    terms = DynamicsTerms(t=T, p=np.zeros((len(T), 1)), mu=np.zeros((len(T), 1)))
    lag = lag_sd(terms, (MomentumObserver(gain=5.0),), None, T < 0.05)
    np.testing.assert_array_equal(lag["gmo"], [0.0])
