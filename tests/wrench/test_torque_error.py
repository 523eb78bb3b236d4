"""The torque error behind a band: given, measured, brought along or unknown."""

from pathlib import Path

import numpy as np
import pytest
from made_runs import analyse_log, run_of

from vftcli.observers import MomentumObserver, ObserverChoice
from vftcli.pipeline import AnalysisChoice
from vftcli.robots import RobotChoice, load_robot
from vftcli.robots.friction import dry_friction
from vftcli.robots.run import Run
from vftcli.signals.errors import ParameterError
from vftcli.signals.external_torque import DynamicsTerms, ExternalTorque
from vftcli.signals.recording import Recording
from vftcli.wrench import WrenchChoice, ZeroChoice
from vftcli.wrench.sensing import (
    from_free_part,
    given_error,
    missed_torque,
    torque_error,
)

FIXTURE = Path(__file__).parents[2] / "fixtures" / "ur5_circle.csv"
T = np.arange(0.0, 40.0, 0.01)


def torque(name: str = "gmo", **more: np.ndarray) -> ExternalTorque:
    tau = np.random.default_rng(3).normal(0.0, [0.5, 2.0], (len(T), 2))
    return ExternalTorque(name=name, t=T, tau=tau, **more)


@pytest.mark.parametrize(("text", "sd"), [("0.4", [0.4, 0.4]), ("1,2.5", [1.0, 2.5])])
def test_a_given_error_is_one_for_all_or_one_a_joint(text: str, sd: list[float]) -> None:
    np.testing.assert_array_equal(given_error(text, [torque()])[0]["gmo"], sd)


def test_own_takes_the_covariance_of_those_that_have_one() -> None:
    own = torque("kfo-fe", sd=np.ones((len(T), 2)))
    deviations, remarks = given_error("own", [torque(), own])
    assert set(deviations) == {"kfo-fe"}
    assert [r.code for r in remarks] == ["band-of-observer", "no-covariance"]


@pytest.mark.parametrize("text", ["1,2,3", "0", "-1", "nan", "much"])
def test_what_is_no_error(text: str) -> None:
    with pytest.raises(ParameterError, match="one positive number, or one for each of 2 joints"):
        given_error(text, [torque()])


def test_a_measured_band_is_taken_as_it_is() -> None:
    run = log_run(np.zeros((len(T), 6)))
    varying = torque(error_sd=np.linspace(0.1, 0.2, 2 * len(T)).reshape(-1, 2))
    deviations, remarks = torque_error(None, run, (), [varying], T < 0.0)
    np.testing.assert_array_equal(deviations["gmo"], varying.error_sd)
    assert [r.code for r in remarks] == ["band-from-torques"]


def log_run(dq: np.ndarray) -> Run:
    """A UR5 log whose joints move as given."""
    recording = Recording(
        t=T, q=np.cumsum(dq, axis=0) * 0.01, dq=dq, current=np.zeros((len(T), 6))
    )
    return Run(recording=recording, robot=load_robot("ur5"))


@pytest.mark.parametrize("moves", [True, False])
def test_a_free_part_measures_the_spread_about_its_mean(moves: bool) -> None:
    """A free part at rest says nothing of friction in motion: a fifth of it is added."""
    rng = np.random.default_rng(3)
    one = ExternalTorque(name="gmo", t=T, tau=1.0 + rng.normal(0.0, 0.5, (len(T), 6)))
    free = T < 20.0
    speed = np.where(free & (not moves), 0.0, 0.5)
    run = log_run(np.tile(speed[:, None], 6))
    deviations, remarks = from_free_part(run, [one], free, {"gmo": np.full(6, 0.3**2)})
    friction = dry_friction(run.robot.friction, 6)
    spread = one.tau[free].std(axis=0)
    expected = spread**2 + 0.3**2 + (0.0 if moves else (0.2 * friction) ** 2)
    np.testing.assert_allclose(deviations["gmo"][-1], np.sqrt(expected))
    still = np.maximum(spread**2, (0.45 * friction) ** 2) + 0.3**2
    if not moves:
        np.testing.assert_allclose(deviations["gmo"][5], np.sqrt(still))
    codes = [r.code for r in remarks]
    assert codes == ["band-from-free-part", *(["band-of-free-rest"] if not moves else [])]


@pytest.mark.slow
def test_two_observers_of_one_response_have_one_band() -> None:
    """FE and ZOH read nearly the same and get nearly the same error, whatever P₂₂ each has."""
    choice = AnalysisChoice(
        robot=RobotChoice(name="ur5"),
        observers=ObserverChoice(names=("kfo-fe", "kfo-zoh")),
        wrench=WrenchChoice(zero=ZeroChoice(start=True)),
    )
    found = analyse_log(FIXTURE, choice).virtual_sensor
    one, other = (wrench.sd[~wrench.hidden] for wrench in found.wrenches)
    np.testing.assert_allclose(one, other, rtol=0.02)


def test_the_lag_adds_what_it_leaves_out_of_the_contacts() -> None:
    """A torque of .5 Hz after 20 s, GMO of 5 1/s: |1 − H| = ω/√(ω² + K²) of its rms."""
    tau = np.where(T < 20.0, 0.0, 8.0 * np.sin(2 * np.pi * 0.5 * T))[:, None]
    gained = 0.5 * (tau[1:] + tau[:-1]) * 0.01
    p = np.concatenate([np.zeros((1, 1)), np.cumsum(gained, axis=0)])
    terms = DynamicsTerms(t=T, p=p, mu=np.zeros_like(p))
    observers = (MomentumObserver(gain=5.0),)
    lag = np.sqrt(missed_torque(run_of(terms), observers, T < 20.0)["gmo"])
    omega = 2 * np.pi * 0.5
    expected = 8.0 / np.sqrt(2) * omega / np.hypot(omega, 5.0)
    # windows of a few seconds spread the line over ± .5 Hz, where |1 − H| bends
    assert lag[0] == pytest.approx(expected, rel=0.1)


def test_a_part_too_short_for_a_spectrum_is_no_part() -> None:
    terms = DynamicsTerms(t=T, p=np.zeros((len(T), 1)), mu=np.zeros((len(T), 1)))
    assert missed_torque(run_of(terms), (MomentumObserver(gain=5.0),), T < 0.05) is None
