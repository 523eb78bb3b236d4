"""Equal footing: gains that give every observer the same delay or the same bandwidth."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple, cast

import numpy as np

from vftcli.observers.filtered_dynamics import FilteredDynamicsObserver
from vftcli.observers.kalman import KalmanObserver
from vftcli.observers.momentum import MomentumObserver
from vftcli.observers.observer import Observer
from vftcli.observers.table import Setup
from vftcli.signals.arrays import Array
from vftcli.signals.errors import ParameterError
from vftcli.signals.remarks import Remark, fact

HALVINGS = 70  #: Bisections of a gain's logarithm: its last digits are those of float64.


class MatchTarget(NamedTuple):
    """What every observer is to have on every joint."""

    quantity: str  #: "delay" or "bandwidth".
    value: float  #: [s] or [Hz]


def parse_target(text: str) -> MatchTarget:
    """Read ``delay=S`` or ``bandwidth=HZ``."""
    quantity, _, number = text.partition("=")
    try:
        value = float(number)
    except ValueError:
        value = float("nan")
    if quantity.strip() not in MEASURES or not (np.isfinite(value) and value > 0):
        raise ParameterError(
            f"--match {text!r} is not delay=S (seconds) or bandwidth=HZ, a positive number"
        )
    return MatchTarget(quantity.strip(), value)


def match_observers(
    observers: Sequence[Observer], goal: MatchTarget, setup: Setup
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
    tuned = tuple(tune(observer, goal, setup) for observer in observers)
    remarks = [
        fact("delay-matched", delay_s=goal.value)
        if goal.quantity == "delay"
        else fact("bandwidth-matched", bandwidth_Hz=goal.value)
    ]
    if {"fdo", "gmo"} <= {observer.name for observer in tuned}:
        remarks.append(fact("first-order-observers-alike"))
    return tuned, tuple(remarks)


def tune(observer: Observer, goal: MatchTarget, setup: Setup) -> Observer:
    """One observer with the gain that reaches the goal on every joint."""
    if type(observer) not in KNOBS:
        raise ParameterError(
            f"--match cannot tune {observer.name}: it has no {goal.quantity} of its own to set; "
            "choose fdo, gmo, kfo-fe or kfo-zoh with --observer"
        )
    turn, low, high = KNOBS[type(observer)]
    measure = MEASURES[goal.quantity]
    rising = goal.quantity == "bandwidth"
    a, b = (np.full(setup.joints, np.log(limit)) for limit in (low, high))
    ends = [measure(turn(observer, np.exp(x)), goal.value, setup) for x in (a, b)]
    if not np.all((np.minimum(*ends) <= 0.0) & (np.maximum(*ends) >= 0.0)):
        raise ParameterError(out_of_reach(observer, goal, setup))
    # Both measures are monotonic in the gain, so that halving its logarithm finds the one crossing.
    for _ in range(HALVINGS):
        middle = 0.5 * (a + b)
        above = measure(turn(observer, np.exp(middle)), goal.value, setup) > 0.0
        a, b = np.where(above == rising, a, middle), np.where(above == rising, middle, b)
    return turn(observer, np.exp(0.5 * (a + b)))


def out_of_reach(observer: Observer, goal: MatchTarget, setup: Setup) -> str:
    """The message that no gain gives an observer the delay or bandwidth that is wanted."""
    limit = (
        f"a delay of more than half a sample ({0.5 * setup.step:g} s)"
        if goal.quantity == "delay"
        else f"a bandwidth well below half the sample rate ({0.5 / setup.step:.4g} Hz)"
    )
    unit = {"delay": "s", "bandwidth": "Hz"}[goal.quantity]
    return (
        f"--match {goal.quantity}={goal.value:g}: no gain gives {observer.name} a "
        f"{goal.quantity} of {goal.value:g} {unit} at {1.0 / setup.step:.4g} Hz; choose {limit}"
    )


def excess_response(observer: Observer, goal: float, setup: Setup) -> Array:
    """Gain at the wanted bandwidth, relative to that of a constant, less 1/√2. (n,)"""
    frequency = np.array([goal])
    response = np.abs(observer.frequency_response(frequency, setup.step, setup.joints)[0])
    constant = observer.tuning(setup.step, setup.joints).dc_gain
    excess: Array = response / constant - np.sqrt(0.5)
    return excess


#: Quantity of ``--match`` → how far an observer is above the goal.
MEASURES: dict[str, Callable[[Observer, float, Setup], Array]] = {
    "delay": lambda observer, goal, on: observer.tuning(on.step, on.joints).delay - goal,
    "bandwidth": excess_response,
}
#: Observer → what makes it anew with another cutoff ω [rad/s], gain K [1/s] or Q_τ on each joint,
#: and the least and the largest there is. A cutoff is one for all joints.
KNOBS: dict[type, tuple[Callable[[Observer, Array], Observer], float, float]] = {
    FilteredDynamicsObserver: (
        lambda _, value: FilteredDynamicsObserver(omega=float(value[0])),
        1e-3,
        1e6,
    ),
    MomentumObserver: (lambda _, value: MomentumObserver(gain=value), 1e-3, 1e6),
    # Q_τ is the one number that moves a Kalman filter's ω_n alone.
    KalmanObserver: (
        lambda kalman, value: replace(cast("KalmanObserver", kalman), q_tau_diag=value),
        1e-9,
        1e18,
    ),
}
