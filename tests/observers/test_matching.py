"""Equal footing: what --gains promises, read back from the observers themselves."""

import numpy as np
import pytest

from vftcli.observers import ObserverChoice
from vftcli.observers.observer import Observer
from vftcli.observers.table import PAPER, Setup, build_observers
from vftcli.observers.tuning import match_observers, parse_goal
from vftcli.robots import load_robot
from vftcli.signals.errors import ParameterError
from vftcli.signals.external_torque import DynamicsTerms

GAINS = {
    "fdo": {"omega": 10.0},
    "gmo": {"gain": [5.0, 3.0, 4.0]},
    "kfo": {"r_diag": [0.5, 0.5, 1.3], "q_p_diag": [0.01, 0.01, 0.02], "q_tau_diag": 5000.0},
}


def setup(step: float = 0.008, **changed: object) -> Setup:
    given = {"gains": GAINS, "settings": {}, "joints": 3, "step": step, "as_printed": False}
    return Setup(**(given | changed))  # type: ignore[arg-type]


def tuned(goal: str, step: float = 0.008, convention: str | None = None) -> list[Observer]:
    settings = {"kfo": {"noise_convention": convention}} if convention else {}
    how = setup(step, settings=settings)
    asked = parse_goal(goal, allowed=("delay", "bandwidth"))
    return list(match_observers(build_observers(PAPER, how)[0], asked, step, 3)[0])


@pytest.mark.parametrize("step", [0.001, 0.008])
@pytest.mark.parametrize("convention", ["density", "discrete", "literal"])
@pytest.mark.parametrize("delay", [0.02, 0.1, 0.5])
def test_the_same_delay_on_every_joint(delay: float, convention: str, step: float) -> None:
    for observer in tuned(f"delay={delay}", step, convention):
        found = observer.tuning(step, 3).delay
        assert found == pytest.approx(np.full(3, delay), rel=1e-9), observer.name


@pytest.mark.parametrize("step", [0.001, 0.008])
@pytest.mark.parametrize("hertz", [0.5, 5.0, 20.0])
def test_the_same_bandwidth_on_every_joint(hertz: float, step: float) -> None:
    for observer in tuned(f"bandwidth={hertz}", step):
        gain = np.abs(observer.frequency_response(np.array([hertz]), step, 3))
        assert gain[0] == pytest.approx(np.full(3, np.sqrt(0.5)), rel=1e-9), observer.name


def test_frequency_responses_are_those_of_the_filters() -> None:
    """Amplitude and lag of the answer to a sine of 2 Hz, long after the transient."""
    t, w = 0.008 * np.arange(5000), 4 * np.pi
    p = -np.cos(w * t)[:, None] / w * np.ones(3)
    basis = np.column_stack([np.sin(w * t), np.cos(w * t)])[2500:]
    for observer in build_observers(PAPER, setup())[0]:
        answer = observer.estimate(DynamicsTerms(t=t, p=p, mu=np.zeros_like(p))).tau[2500:]
        sine, cosine = np.linalg.lstsq(basis, answer, rcond=None)[0]
        response = observer.frequency_response(np.array([2.0]), 0.008, 3)[0]
        np.testing.assert_allclose(sine + 1j * cosine, response, atol=1e-9)


def test_a_ramp_lags_by_the_matched_delay() -> None:
    """τ_ext = t: after the transient every estimate is t − delay."""
    t = np.arange(0.0, 6.0, 0.008)
    p = np.repeat(0.5 * t[:, None] ** 2, 3, axis=1)
    terms = DynamicsTerms(t=t, p=p, mu=np.zeros_like(p))
    for observer in tuned("delay=0.08"):
        lag = t[-1] - observer.estimate(terms).tau[-1]
        # 6 s are 75 time constants; what is left is rounding of p ≈ 18.
        assert lag == pytest.approx(np.full(3, 0.08), abs=1e-9), observer.name


NO_GOAL = r"delay=S \(seconds\) or bandwidth=HZ, a positive"


@pytest.mark.parametrize(
    ("goal", "message"),
    [
        ("delay", NO_GOAL),
        ("speed=3", NO_GOAL),
        ("delay=-1", NO_GOAL),
        ("delay=nan", NO_GOAL),
        ("delay=0.002", "more than half a sample"),
        ("bandwidth=200", "half the sample rate"),
    ],
)
def test_goals_that_are_none_or_out_of_reach(goal: str, message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        tuned(goal)


def test_one_joint_out_of_reach_is_refused() -> None:
    """Two joints could have the delay; on the third R = 1e12 and the largest Q_τ, 1e18, make
    ω_n = (Q_τ/R)^¼ = 32 rad/s and so √2/ω_n = 45 ms."""
    density = {"r_diag": [0.5, 0.5, 1e12], "noise_convention": "density"}
    gains = {**GAINS, "kfo": {**GAINS["kfo"], **density}}
    how = setup(gains=gains)
    observers, _ = build_observers(["kfo-zoh"], how)
    with pytest.raises(ParameterError, match=r"no gain gives kfo-zoh a delay of 0\.02 s"):
        match_observers(observers, parse_goal("delay=0.02"), 0.008, 3)


def test_printed_formulas_are_not_matched() -> None:
    choice = ObserverChoice.parsed(gains="delay=0.05", as_printed=True)
    with pytest.raises(ParameterError, match="--as-printed"):
        choice.build(load_robot("ur5"), 0.008)


def test_first_order_observers_are_called_alike_only_where_both_run() -> None:
    observers, _ = build_observers(["fdo", "kfo-zoh"], setup())
    _, (remark,) = match_observers(observers, parse_goal("bandwidth=3"), 0.008, 3)
    assert (remark.code, remark.values) == ("bandwidth-matched", {"bandwidth_Hz": 3.0})
    observers, _ = build_observers(PAPER, setup())
    _, (matched, alike) = match_observers(observers, parse_goal("delay=0.05"), 0.008, 3)
    assert (matched.code, matched.values) == ("delay-matched", {"delay_s": 0.05})
    assert alike.code == "first-order-observers-alike"
