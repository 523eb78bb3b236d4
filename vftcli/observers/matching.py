"""Goals for gains, and the gains that give every observer one delay or one bandwidth."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple, cast

import numpy as np

from vftcli.observers.observer import Observer
from vftcli.observers.paper import FilteredDynamicsObserver, KalmanObserver, MomentumObserver
from vftcli.observers.table import Setup
from vftcli.signals.arrays import Array
from vftcli.signals.errors import ParameterError
from vftcli.signals.remarks import Remark, fact

HALVINGS = 70  #: Bisections of a gain's logarithm: its last digits are those of float64.
#: Name of a goal → how a user writes it. A delay is that behind a slow ramp, a bandwidth at −3 dB.
GOALS = {
    "rmse": "rmse",
    "delay": "delay=S (seconds)",
    "bandwidth": "bandwidth=HZ",
    "false-alarms": "false-alarms=PER_HOUR",
}
#: Observer → the parameter that is moved, the least value and the largest. [rad/s], [1/s] or Q_τ,
#: the one number that moves a Kalman filter's ω_n alone.
KNOBS: dict[type, tuple[str, float, float]] = {
    FilteredDynamicsObserver: ("omega", 1e-3, 1e6),
    MomentumObserver: ("gain", 1e-3, 1e6),
    KalmanObserver: ("q_tau_diag", 1e-9, 1e18),
}


class Goal(NamedTuple):
    """What gains are for."""

    name: str  #: A key of `GOALS`.
    value: float = float("nan")  #: Its number, NaN for the smallest error. [s], [Hz] or [1/h]
    #: Torque beyond which an estimate raises an alarm. (n,) or (1,) [N·m]
    threshold: Array | None = None


def parse_target(
    text: str, option: str = "--match", allowed: Iterable[str] = ("delay", "bandwidth")
) -> Goal:
    """Read one of some goals as an option has it: ``rmse``, the others as ``delay=S``."""
    name, equals, number = text.partition("=")
    name = name.strip()
    try:
        value = float(number)
    except ValueError:
        value = float("nan")
    if name not in allowed or not (0.0 < value < np.inf if name != "rmse" else not equals):
        forms = " or ".join(GOALS[each] for each in allowed)
        raise ParameterError(f"{option} {text!r} is not {forms}, a positive number")
    return Goal(name, value)


def match_observers(
    observers: Sequence[Observer], goal: Goal, setup: Setup
) -> tuple[tuple[Observer, ...], tuple[Remark, ...]]:
    """Re-tune observers to one delay or −3 dB bandwidth per joint, with remarks on it.

    A first-order observer has one gain to move. A Kalman filter keeps R and Q_p and moves Q_τ,
    which sets its natural frequency. Delay is that behind a slow ramp, 1/K or L₁/L₂ − Ts/2;
    bandwidth is where the exact response to a sinusoid has fallen to 1/√2 of that to a constant.
    """
    if setup.as_printed:
        raise ParameterError(
            "--match tunes the corrected observers; the printed ones have another response. Leave "
            "--match or --as-printed away"
        )
    tuned = tuple(tune(observer, goal, setup.step, setup.joints) for observer in observers)
    remarks = [
        fact("delay-matched", delay_s=goal.value)
        if goal.name == "delay"
        else fact("bandwidth-matched", bandwidth_Hz=goal.value)
    ]
    if {"fdo", "gmo"} <= {observer.name for observer in tuned}:
        remarks.append(fact("first-order-observers-alike"))
    return tuned, tuple(remarks)


def tune(observer: Observer, goal: Goal, step: float, joints: int) -> Observer:
    """One observer with the gain that reaches a delay or bandwidth on every joint."""
    if type(observer) not in KNOBS:
        raise ParameterError(
            f"--match cannot tune {observer.name}: it has no {goal.name} of its own to set; "
            "choose fdo, gmo, kfo-fe or kfo-zoh with --observer"
        )
    knob, low, high = KNOBS[type(observer)]

    def turned(x: Array) -> Observer:
        value = np.exp(x)
        # A cutoff is one for all joints.
        changed: dict[str, Any] = {knob: float(value[0]) if knob == "omega" else value}
        return replace(cast("MomentumObserver", observer), **changed)

    rising = goal.name == "bandwidth"
    a, b = (np.full(joints, np.log(limit)) for limit in (low, high))
    ends = [excess(turned(x), goal, step, joints) for x in (a, b)]
    if not np.all((np.minimum(*ends) <= 0.0) & (np.maximum(*ends) >= 0.0)):
        unit, limit = (
            ("Hz", f"a bandwidth well below half the sample rate ({0.5 / step:.4g} Hz)")
            if rising
            else ("s", f"a delay of more than half a sample ({0.5 * step:g} s)")
        )
        raise ParameterError(
            f"no gain gives {observer.name} a {goal.name} of {goal.value:g} {unit} at "
            f"{1.0 / step:.4g} Hz; choose {limit}"
        )
    # Both measures are monotonic in the gain, so that halving its logarithm finds the one crossing.
    for _ in range(HALVINGS):
        middle = 0.5 * (a + b)
        above = excess(turned(middle), goal, step, joints) > 0.0
        a, b = np.where(above == rising, a, middle), np.where(above == rising, middle, b)
    return turned(0.5 * (a + b))


def excess(observer: Observer, goal: Goal, step: float, joints: int) -> Array:
    """How far an observer's delay, or its share of a sinusoid at a bandwidth, is above the goal.

    (n,) [s] or [1]
    """
    tuning = observer.tuning(step, joints)
    if goal.name == "delay":
        return tuning.delay - goal.value
    gain = np.abs(observer.frequency_response(np.array([goal.value]), step, joints)[0])
    return np.asarray(gain / tuning.dc_gain - np.sqrt(0.5))
