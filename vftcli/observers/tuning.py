"""Gains for a goal: least error, one delay or bandwidth, few false alarms."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple, cast

import numpy as np

from vftcli.observers.auto_tuning import (
    Curve,
    Kind,
    bound_remarks,
    error_curve,
    expected_error,
    kalman_filter,
    kalman_smoother,
    natural_frequencies,
    noise_level,
)
from vftcli.observers.observer import Complex, Observer
from vftcli.observers.paper import FilteredDynamicsObserver, KalmanObserver, MomentumObserver
from vftcli.observers.spectra import Spectra
from vftcli.observers.table import Setup
from vftcli.signals.arrays import Array, Mask
from vftcli.signals.errors import ParameterError
from vftcli.signals.parsing import numbers
from vftcli.signals.remarks import Remark, fact

#: Kalman filter and smoother, of which R and Q_τ follow from the natural frequencies.
KALMAN: dict[str, Kind] = {"kfo-zoh": kalman_filter, "kfo-rts": kalman_smoother}
HALVINGS = 70  #: Bisections of a gain's logarithm: its last digits are those of float64.
#: Name of a goal → how a user writes it. A delay is that behind a slow ramp, a bandwidth at −3 dB.
GOALS = {
    "auto": "auto",
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
    """A goal of gains."""

    name: str  #: A key of `GOALS`.
    value: float = float("nan")  #: Its number, NaN for the smallest error. [s], [Hz] or [1/h]
    #: Torque beyond which an estimate raises an alarm. (n,) or (1,) [N·m]
    threshold: Array | None = None


def parse_target(text: str, allowed: Iterable[str] = ("delay", "bandwidth")) -> Goal:
    """Read one of some goals of ``--gains``: ``auto``, the others as ``delay=S``."""
    name, equals, number = text.partition("=")
    name = name.strip()
    try:
        value = float(number)
    except ValueError:
        value = float("nan")
    if name not in allowed or not (0.0 < value < np.inf if name != "auto" else not equals):
        forms = " or ".join(GOALS[each] for each in allowed)
        raise ParameterError(f"--gains {text!r} is not {forms}, a positive number")
    return Goal(name, value)


def match_observers(
    observers: Sequence[Observer], goal: Goal, setup: Setup
) -> tuple[tuple[Observer, ...], tuple[Remark, ...]]:
    """Re-tune observers to one delay or −3 dB bandwidth per joint, with remarks on it.

    A Kalman filter keeps R and Q_p and moves Q_τ. Delay is that behind a slow ramp, 1/K or L₁/L₂ −
    Ts/2; bandwidth is where the exact response has fallen to 1/√2 of that to a constant.
    """
    if setup.as_printed:
        raise ParameterError(
            "--gains tunes the corrected observers; the printed ones have another response. Leave "
            "--gains or --as-printed away"
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
            f"--gains cannot tune {observer.name}: it has no {goal.name} of its own to set; "
            "choose fdo, gmo, kfo-fe or kfo-zoh with --observer"
        )
    knob, low, high = KNOBS[type(observer)]

    def turned(x: Array) -> Observer:
        value = np.exp(x)
        # A cutoff is one for all joints.
        changed: dict[str, Any] = {knob: float(value[0]) if knob == "omega" else value}
        return replace(cast("MomentumObserver", observer), **changed)

    def excess(x: Array) -> Array:
        """Delay [s], or share of a sinusoid at a bandwidth, over the goal. (n,)"""
        tuning = turned(x).tuning(step, joints)
        if goal.name == "delay":
            return tuning.delay - goal.value
        gain = turned(x).frequency_response(np.array([goal.value]), step, joints)[0]
        return np.asarray(np.abs(gain) / tuning.dc_gain - np.sqrt(0.5))

    rising = goal.name == "bandwidth"
    a, b = (np.full(joints, np.log(limit)) for limit in (low, high))
    ends = excess(a), excess(b)
    if not np.all((np.minimum(*ends) <= 0.0) & (np.maximum(*ends) >= 0.0)):
        unit, limit = "s", f"a delay of more than half a sample ({0.5 * step:g} s)"
        if rising:
            unit = "Hz"
            limit = f"a bandwidth well below half the sample rate ({0.5 / step:.4g} Hz)"
        raise ParameterError(
            f"no gain gives {observer.name} a {goal.name} of {goal.value:g} {unit} at "
            f"{1.0 / step:.4g} Hz; choose {limit}"
        )
    # Both measures are monotonic in the gain, so that halving its logarithm finds the one crossing.
    for _ in range(HALVINGS):
        middle = 0.5 * (a + b)
        above = (excess(middle) > 0.0) == rising
        a, b = np.where(above, a, middle), np.where(above, middle, b)
    return turned(0.5 * (a + b))


class Tuned(NamedTuple):
    """One observer's gains and what to expect of them."""

    observer: str  #: Its name at the command line.
    section: str  #: Where its gains stand in a gains file.
    gains: Mapping[str, Any]  #: Parameter → number or one a joint.
    rate: Array  #: Natural frequency, cutoff or K. (n,) [rad/s]
    delay: Array  #: Lag behind a slow ramp. (n,) [s]
    rmse: Array  #: Expected error. (n,) [N·m]
    #: Expected false alarms an hour beyond the goal's threshold; None without one. (n,)
    alarms: Array | None = None
    running: Observer | None = None  #: The observer with these gains.

    @property
    def record(self) -> dict[str, Any]:
        """Everything but the observer itself, for machines."""
        return {key: value for key, value in self._asdict().items() if key != "running"}


def parse_goal(text: str, threshold: str | None = None) -> Goal:
    """What ``--gains`` asks for, any of `GOALS`, and ``alarm.threshold``, positive. [N·m]"""
    goal = parse_target(text, GOALS)
    level = None
    if threshold is not None:
        level = np.array(numbers(threshold) or [np.nan])
        if not (np.all(np.isfinite(level)) and np.all(level > 0.0)):
            raise ParameterError(
                f"alarm.threshold={threshold} is not a positive number or one a joint [N·m]"
            )
    if goal.name == "false-alarms" and level is None:
        raise ParameterError(
            "--gains false-alarms needs to know what raises an alarm: add --set "
            "alarm.threshold=N·m, one number or one a joint"
        )
    return goal._replace(threshold=level)


def momentum(rate: Array) -> Observer:
    """A momentum observer. Its response is the filtered dynamics observer's too."""
    return MomentumObserver(gain=rate)


def tune_all(spectra: Spectra, goal: Goal) -> tuple[Tuned, ...]:
    """Gains of FDO, GMO, KFO and smoother for a goal, one line an observer.

    The smoother has no delay: for a delay it gets the gains with the smallest error.
    """
    threshold, n, step = goal.threshold, spectra.joints, spectra.step
    if threshold is not None and len(threshold) not in {1, n}:
        raise ParameterError(
            f"alarm.threshold has {len(threshold)} values; give one, or one for each of {n} joints"
        )
    first_order = rates(momentum, spectra, goal)
    # FDO has one rate for all joints: the smallest mean error, or what the slowest joint allows.
    shared = float(np.min(first_order))
    if goal.name == "auto":
        grid = natural_frequencies(step)
        shared = float(grid[np.argmin(expected_error(momentum, grid, spectra).mean(axis=1))])
    lines: dict[str, tuple[Observer, Array, dict[str, Any]]] = {
        "fdo": (FilteredDynamicsObserver(omega=shared), np.full(n, shared), {"omega": shared}),
        "gmo": (momentum(first_order), first_order, {"gain": first_order.tolist()}),
    }
    for name, kind in KALMAN.items():
        rate = rates(kind, spectra, goal)
        r = noise_level(rate, spectra)
        gains = {"r_diag": r.tolist(), "q_p_diag": 0.0, "q_tau_diag": (r * rate**4).tolist()}
        lines[name] = kind(rate), rate, {**gains, "noise_convention": "density"}
    tuned = []
    for name, (observer, rate, gains) in lines.items():
        response = observer.frequency_response(spectra.frequency, step, n)
        line = Tuned(
            observer=name,
            section="kfo" if name == "kfo-zoh" else name,
            gains=gains,
            rate=rate,
            delay=np.asarray(observer.tuning(step, n).delay),
            rmse=np.sqrt(spectra.missed(response) + spectra.passed(response)),
            alarms=None if threshold is None else alarms(response, spectra, threshold),
            running=observer,
        )
        tuned.append(line)
    return tuple(tuned)


def tuning_curves(spectra: Spectra) -> dict[str, Curve]:
    """Observer → expected error over rate; both first-order ones share a curve."""
    kinds = {"fdo, gmo": momentum, **KALMAN}
    return {name: error_curve(kind, spectra) for name, kind in kinds.items()}


def bounds_reached(tuned: Sequence[Tuned], spectra: Spectra, goal: Goal) -> tuple[Remark, ...]:
    """A warning on every gain that reached a bound of the search."""
    if goal.name not in {"auto", "false-alarms"}:
        return ()
    grid = natural_frequencies(spectra.step)
    return tuple(r for line in tuned for r in bound_remarks(line.observer, line.rate, grid))


def rates(kind: Kind, spectra: Spectra, goal: Goal) -> Array:
    """The rate of each joint that reaches the goal. (n,) [rad/s]"""
    grid = natural_frequencies(spectra.step)
    if goal.name == "false-alarms" and goal.threshold is not None:
        few = few_alarms(kind, grid, spectra, goal.threshold, goal.value)
        # The fastest that still raises few alarms: of the run of rates that do, its last.
        fastest = len(grid) - 1 - np.argmax(few[::-1], axis=0)
        best = np.argmin(expected_error(kind, grid, spectra), axis=0)
        return np.asarray(grid[np.where(few[best, np.arange(spectra.joints)], best, fastest)])
    if goal.name == "bandwidth" and kind is kalman_smoother:
        fraction = float(kalman_smoother(np.ones(1)).tuning(spectra.step, 1).bandwidth[0])
        return np.full(spectra.joints, goal.value / fraction)
    if goal.name == "auto" or kind is kalman_smoother:
        return np.asarray(grid[np.argmin(expected_error(kind, grid, spectra), axis=0)])
    n, start = spectra.joints, kind(np.full(spectra.joints, 10.0))
    return np.array(tune(start, goal, spectra.step, n).tuning(spectra.step, n).omega_n)


def few_alarms(kind: Kind, grid: Array, spectra: Spectra, threshold: Array, most: float) -> Mask:
    """Whether a rate raises at most so many false alarms an hour. (G, n)"""
    response = kind(grid).frequency_response(spectra.frequency, spectra.step, len(grid))
    columns = range(len(grid))
    few = np.array([alarms(response[:, [g]], spectra, threshold) <= most for g in columns])
    never = np.flatnonzero(~np.any(few, axis=0))
    if len(never):
        read = np.sqrt(np.sum(spectra.noise, axis=0) * spectra.width)
        listed = ", ".join(f"J{j + 1} ({read[j]:.2g} N·m rms)" for j in never)
        raise ParameterError(
            f"no gain keeps the false alarms at {most:g} an hour: the free part itself is "
            f"too loud for the threshold on {listed}; raise --set alarm.threshold=N·m or remove "
            "the bias"
        )
    return few


def alarms(response: Complex, spectra: Spectra, threshold: Array) -> Array:
    """Expected false alarms an hour beyond a threshold [N·m], of H (F, n) or (F, 1). (n,)"""
    power = np.abs(response) ** 2 * spectra.noise * spectra.width
    return crossings(power, spectra.frequency, threshold)


def crossings(power: Array, frequency: Array, threshold: Array) -> Array:
    """Crossings of ±threshold an hour by a Gaussian signal of this spectrum. (n,)

    Rice's formula, ν = (σ̇/2πσ) e^{−(h∓m)²/2σ²} for each side, the power at 0 Hz a constant offset
    m: an estimate, as friction is no Gaussian noise.

    References:
        S. O. Rice, "Mathematical analysis of random noise", Bell Syst. Tech. J. 23–24, 1944–45.
    """
    offset = np.sqrt(power[0])
    variance = np.maximum(np.sum(power[1:], axis=0), np.finfo(float).tiny)
    moved = np.sum(power[1:] * frequency[1:, None] ** 2, axis=0)
    often = np.sqrt(moved / variance)
    sides = [np.exp(-((threshold - m) ** 2) / (2.0 * variance)) for m in (offset, -offset)]
    beyond = np.where(offset >= threshold, np.inf, 0.0)
    return np.asarray(3600.0 * often * (sides[0] + sides[1]) + beyond)
