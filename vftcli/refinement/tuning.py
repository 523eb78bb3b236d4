"""Gains for a stated goal: smallest error, one delay or bandwidth, or few false alarms."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from vftcli.observers import FilteredDynamicsObserver, MomentumObserver, Observer, Setup
from vftcli.observers.auto_tuning import (
    Kind,
    expected_error,
    kalman_filter,
    kalman_smoother,
    natural_frequencies,
    noise_level,
)
from vftcli.observers.matching import MatchTarget, tune
from vftcli.observers.spectra import Spectra
from vftcli.signals.arrays import Array, Mask
from vftcli.signals.errors import ParameterError
from vftcli.signals.parsing import numbers

GOALS = {
    "rmse": "the smallest expected error",
    "delay": "a delay behind a slow ramp [s]",
    "bandwidth": "a −3 dB bandwidth [Hz]",
    "false-alarms": "at most so many false alarms an hour on each joint, beyond --threshold",
}
"""Goal → what it asks for."""


class TuningGoal(NamedTuple):
    """What the gains are for.

    Attributes:
        name: A key of `GOALS`.
        value: Its number, NaN for the smallest error.
        threshold: Torque beyond which an estimate raises an alarm. (n,) or (1,) [N·m]
    """

    name: str
    value: float = float("nan")
    threshold: Array | None = None


class Tuned(NamedTuple):
    """One observer's gains and what to expect of them.

    Attributes:
        observer: Its name at the command line.
        section: Where its gains stand in a gains file.
        gains: Parameter → number or one a joint.
        rate: Natural frequency, cutoff or K. (n,) [rad/s]
        delay: Lag behind a slow ramp. (n,) [s]
        rmse: Expected error. (n,) [N·m]
        alarms: Expected false alarms an hour beyond the goal's threshold; None without one. (n,)
    """

    observer: str
    section: str
    gains: Mapping[str, Any]
    rate: Array
    delay: Array
    rmse: Array
    alarms: Array | None = None


def parse_goal(text: str, threshold: str | None = None) -> TuningGoal:
    """Read ``rmse``, ``delay=S``, ``bandwidth=HZ`` or ``false-alarms=PER_HOUR``.

    Raises:
        ParameterError: If it is none of these, or a threshold is missing.
    """
    name, equals, number = text.partition("=")
    name = name.strip()
    try:
        value = float(number) if equals else float("nan")
    except ValueError:
        value = -1.0
    if name not in GOALS or (name == "rmse") == bool(equals) or value <= 0.0 or np.isinf(value):
        raise ParameterError(
            f"--goal {text!r} is not rmse, delay=S, bandwidth=HZ or false-alarms=PER_HOUR with a "
            "positive number"
        )
    level = parse_threshold(threshold)
    if name == "false-alarms" and level is None:
        raise ParameterError(
            "--goal false-alarms needs to know what raises an alarm: add --threshold N·m, one "
            "number or one a joint"
        )
    return TuningGoal(name, value, level)


def parse_threshold(text: str | None) -> Array | None:
    """One number or one a joint, positive. [N·m]

    Raises:
        ParameterError: If it is something else.
    """
    if text is None:
        return None
    level = np.array(numbers(text) or [np.nan])
    if not (np.all(np.isfinite(level)) and np.all(level > 0.0)):
        raise ParameterError(f"--threshold {text!r} is not a positive number or one a joint [N·m]")
    return level


def momentum(rate: Array) -> Observer:
    """A momentum observer. Its response is the filtered dynamics observer's too."""
    return MomentumObserver(gain=rate)


def tune_all(spectra: Spectra, goal: TuningGoal) -> tuple[Tuned, ...]:
    """Gains of FDO, GMO, KFO and smoother for a goal, one line an observer.

    The smoother has no delay: for a delay it gets the gains with the smallest error.

    Raises:
        ParameterError: If the goal cannot be reached.
    """
    if goal.threshold is not None and len(goal.threshold) not in {1, spectra.joints}:
        raise ParameterError(
            f"--threshold has {len(goal.threshold)} values; give one, or one for each of "
            f"{spectra.joints} joints"
        )
    first_order = rates(momentum, spectra, goal)
    single = np.full(spectra.joints, shared_rate(momentum, spectra, goal))
    causal = rates(kalman_filter, spectra, goal)
    smooth = rates(kalman_smoother, spectra, goal)
    cutoff = {"omega": float(single[0])}
    lines = [
        ("fdo", "fdo", cutoff, FilteredDynamicsObserver(omega=float(single[0])), single),
        ("gmo", "gmo", {"gain": first_order.tolist()}, momentum(first_order), first_order),
        ("kfo-zoh", "kfo", densities(causal, spectra), kalman_filter(causal), causal),
        ("kfo-rts", "kfo-rts", densities(smooth, spectra), kalman_smoother(smooth), smooth),
    ]
    return tuple(
        Tuned(
            observer=name,
            section=section,
            gains=gains,
            rate=rate,
            delay=np.asarray(observer.tuning(spectra.step, spectra.joints).delay),
            rmse=error_of(observer, spectra),
            alarms=None if goal.threshold is None else alarms_of(observer, spectra, goal.threshold),
        )
        for name, section, gains, observer, rate in lines
    )


def densities(omega_n: Array, spectra: Spectra) -> dict[str, Any]:
    """R, Q_p and Q_τ of natural frequencies, under ``density``, R to the log's scale."""
    r = noise_level(omega_n, spectra)
    return {
        "r_diag": r.tolist(),
        "q_p_diag": 0.0,
        "q_tau_diag": (r * omega_n**4).tolist(),
        "noise_convention": "density",
    }


def rates(kind: Kind, spectra: Spectra, goal: TuningGoal) -> Array:
    """The rate of each joint that reaches the goal. (n,) [rad/s]"""
    grid = natural_frequencies(spectra.step)
    if goal.name == "false-alarms" and goal.threshold is not None:
        few = alarms(kind, grid, spectra, goal.threshold) <= goal.value
        check_reachable(few, spectra, goal)
        # The fastest that still raises few alarms: of the run of rates that do, its last.
        fastest = len(grid) - 1 - np.argmax(few[::-1], axis=0)
        best = np.argmin(expected_error(kind, grid, spectra), axis=0)
        return np.asarray(grid[np.where(few[best, np.arange(spectra.joints)], best, fastest)])
    if goal.name == "bandwidth" and kind is kalman_smoother:
        fraction = float(kalman_smoother(np.ones(1)).tuning(spectra.step, 1).bandwidth[0])
        return np.full(spectra.joints, goal.value / fraction)
    if goal.name == "rmse" or kind is kalman_smoother:
        return np.asarray(grid[np.argmin(expected_error(kind, grid, spectra), axis=0)])
    return matched_rate(kind, spectra, goal)


def matched_rate(kind: Kind, spectra: Spectra, goal: TuningGoal) -> Array:
    """The rate with a delay or bandwidth. (n,) [rad/s]"""
    n = spectra.joints
    setup = Setup(gains={}, settings={}, joints=n, step=spectra.step, as_printed=False)
    observer = tune(kind(np.full(n, 10.0)), MatchTarget(goal.name, goal.value), setup)
    return np.array(observer.tuning(spectra.step, n).omega_n)


def shared_rate(kind: Kind, spectra: Spectra, goal: TuningGoal) -> float:
    """One rate for all joints: the smallest mean error, or what the slowest joint allows."""
    if goal.name != "rmse":
        return float(np.min(rates(kind, spectra, goal)))
    grid = natural_frequencies(spectra.step)
    return float(grid[np.argmin(expected_error(kind, grid, spectra).mean(axis=1))])


def check_reachable(few: Mask, spectra: Spectra, goal: TuningGoal) -> None:
    """Raise unless every joint has a rate with few enough false alarms."""
    never = np.flatnonzero(~np.any(few, axis=0))
    if not len(never):
        return
    read = np.sqrt(np.sum(spectra.free, axis=0) * spectra.width)
    listed = ", ".join(f"J{j + 1} ({read[j]:.2g} N·m rms)" for j in never)
    raise ParameterError(
        f"no gain keeps the false alarms at {goal.value:g} an hour: the free part itself is too "
        f"loud for the threshold on {listed}; raise --threshold or remove the bias"
    )


def error_of(observer: Observer, spectra: Spectra) -> Array:
    """Expected error of one observer. (n,) [N·m]"""
    response = observer.frequency_response(spectra.frequency, spectra.step, spectra.joints)
    return np.sqrt(spectra.missed(response) + spectra.passed(response))


def alarms_of(observer: Observer, spectra: Spectra, threshold: Array) -> Array:
    """Expected false alarms an hour of one observer. (n,)"""
    response = observer.frequency_response(spectra.frequency, spectra.step, spectra.joints)
    power = np.abs(response) ** 2 * spectra.free * spectra.width
    return crossings(power, spectra.frequency, threshold)


def alarms(kind: Kind, grid: Array, spectra: Spectra, threshold: Array) -> Array:
    """Expected false alarms an hour at every rate. (G, n)"""
    response = kind(grid).frequency_response(spectra.frequency, spectra.step, len(grid))
    share = np.abs(response) ** 2
    levels = [
        crossings(share[:, [g]] * spectra.free * spectra.width, spectra.frequency, threshold)
        for g in range(len(grid))
    ]
    return np.array(levels)


def crossings(power: Array, frequency: Array, threshold: Array) -> Array:
    """How often an hour a Gaussian signal of this power spectrum leaves ±threshold. (n,)

    Rice's formula, ν = (σ̇/2πσ) e^{−(h∓m)²/2σ²} for each side, with the power at 0 Hz as a constant
    offset m. Friction is no Gaussian noise, so this is an estimate.

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


def gains_document(lines: tuple[Tuned, ...]) -> dict[str, Any]:
    """The ``[observers.*]`` tables of a gains file."""
    return {"observers": {line.section: dict(line.gains) for line in lines}}
