"""Gains for a goal: least error, one delay or bandwidth, few false alarms.

A Kalman filter's ω_n trades the loss by its lag against the noise that passes. Both follow
from the spectra of the free and loaded part:

    ω_n = argmin ∫ |1 − H(ω_n)|² S_τ + |H(ω_n)|² S_n df,  joint by joint, ζ = 1/√2

with the filter's exact complex response H, or the smoother's real one.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import field, replace
from typing import Any, NamedTuple, cast

import numpy as np

from vftcli.observers.observer import Complex, Observer, Tuning
from vftcli.observers.paper import FilteredDynamicsObserver, KalmanObserver, MomentumObserver
from vftcli.observers.smoother import KalmanSmoother
from vftcli.observers.spectra import Spectra
from vftcli.signals.arrays import Array, frozen
from vftcli.signals.errors import ParameterError
from vftcli.signals.external_torque import DynamicsTerms, ExternalTorque
from vftcli.signals.option import numbers
from vftcli.signals.remarks import Remark, fact, on_joints, warning
from vftcli.signals.shown import Shown, record

SLOWEST = 1.0  #: Least natural frequency to try. [rad/s]
#: That of `best`: as the smoother passes 1/(1 + (ω/ω_n)⁴), it keeps 84 % of the peak of a
#: half sine of .6 s. A joint without a push may be pushed next. [rad/s]
SLOWEST_BEST = 9.0
FASTEST = 2.0  #: Largest ω_n to try, times the sample time. [rad]
TRIED = 96  #: Natural frequencies to try, evenly in logarithm.
LEAST_SHARE = 1e-3  #: Least R as a share of the noise in the free part. [1]
FINEST = 1e-6  #: Least torque of R: single precision keeps 1e-5 of 100 N·m. [N·m]
HALVINGS = 70  #: Bisections of a gain's logarithm: to the digits of float64.
#: Goal → as typed; a delay behind a ramp, a bandwidth at −3 dB.
GOALS = {
    "auto": "auto",
    "delay": "delay=S (seconds)",
    "bandwidth": "bandwidth=HZ",
    "false-alarms": "false-alarms=PER_HOUR",
}
#: Observer → the parameter of its ω_n, its least and largest value.
KNOBS: dict[type, tuple[str, float, float]] = {
    FilteredDynamicsObserver: ("omega", 1e-3, 1e6),
    MomentumObserver: ("gain", 1e-3, 1e6),
    KalmanObserver: ("q_tau_diag", 1e-9, 1e18),
}


def momentum(rate: Array) -> Observer:
    """A momentum observer; the filtered dynamics observer responds alike."""
    return MomentumObserver(gain=rate)


def kalman_filter(omega_n: Array, r: Array | float = 1.0) -> KalmanObserver:
    """Kalman observer of ω_n at ζ = 1/√2: Q_τ = R ω_n⁴, Q_p = 0. (n,)"""
    q_tau = r * omega_n**4
    return KalmanObserver(discretisation="zoh", r_diag=r, q_p_diag=0.0, q_tau_diag=q_tau)


def kalman_smoother(omega_n: Array, r: Array | float = 1.0) -> KalmanSmoother:
    """Smoother of these ω_n at ζ = 1/√2. (n,) [rad/s]"""
    return KalmanSmoother(filter=kalman_filter(omega_n, r))


#: Natural frequencies (n,) [rad/s], and R if not 1 → observer.
Kind = Callable[..., Observer]
#: Name of an observer with gains from a log → its kind.
KINDS: dict[str, Kind] = {
    "best": kalman_smoother,
    "kfo-auto": kalman_filter,
    "rts-auto": kalman_smoother,
}
#: Kalman filter and smoother: R and Q_τ follow from the natural frequencies.
KALMAN: dict[str, Kind] = {"kfo-zoh": kalman_filter, "kfo-rts": kalman_smoother}


class Curve(NamedTuple):
    """Expected error of a kind of filter by its natural frequency."""

    omega_n: Array  #: Natural frequencies tried. (G,) [rad/s]
    rmse: Array  #: Expected error. (G, n) [N·m]
    best: Array  #: The best natural frequency. (n,) [rad/s]
    least: Array  #: The expected error at the best. (n,) [N·m]


def natural_frequencies(step: float, slowest: float = SLOWEST) -> Array:
    """Natural frequencies to try at a sample time. (G,) [rad/s]"""
    found = np.geomspace(SLOWEST, FASTEST / step, TRIED)
    return np.asarray(found[found >= min(slowest, found[-1])])


def error_curve(kind: Kind, spectra: Spectra, slowest: float = SLOWEST) -> Curve:
    """Expected errors of natural frequencies, and the best."""
    omega_n = natural_frequencies(spectra.step, slowest)
    # Each natural frequency is a joint of one observer: one call for all.
    response = kind(omega_n).frequency_response(spectra.frequency, spectra.step, len(omega_n))
    missed = (abs(1.0 - response) ** 2).T @ spectra.external
    passed = (abs(response) ** 2).T @ spectra.noise
    rmse = np.sqrt((missed + passed) * spectra.width)
    return Curve(omega_n, rmse, omega_n[rmse.argmin(axis=0)], rmse.min(axis=0))


def bound_remarks(name: str, rate: Array, grid: Array) -> tuple[Remark, ...]:
    """A warning on joints (n,) at a bound of the natural frequencies (G,). [rad/s]"""
    # There the spectra do not separate external torque and noise.
    low, high = grid[0], grid[-1]
    reached = (("slowest", rate <= low, low), ("fastest", rate >= high, high))
    return tuple(
        warning(f"gain-at-{end}", on_joints(joints, name), rate_rad_s=bound)
        for end, joints, bound in reached
        if joints.any()
    )


def noise_level(omega_n: Array, spectra: Spectra) -> Array:
    """R at which the innovations have their expected variance. (n,)

    Gains depend on Q/R alone. The innovation is the estimate's jump, ν = (τ̂ᵗ − τ̂ᵗ⁻¹)/L₂:
    its variance follows from S_d. No filter runs on R = 0: it is at least `LEAST_SHARE` of
    S_n's R and the noise of `FINEST`, a torque constant over a sample.
    """
    n, unit = len(omega_n), kalman_filter(omega_n)
    settled = unit.steady(spectra.step, n)
    response = unit.frequency_response(spectra.frequency, spectra.step, n)
    jump = 2.0 * np.sin(np.pi * spectra.frequency * spectra.step)[:, None]
    share = (abs(response) * jump / settled.l2) ** 2
    both, noise = (
        np.sum(share * density, axis=0) * spectra.width
        for density in (spectra.loaded, spectra.free)
    )
    scale = np.maximum(both, LEAST_SHARE**2 * noise) / settled.S
    return np.asarray(np.maximum(scale, FINEST**2 * spectra.step**3))


@record
class AutoTuned(Shown):
    """An observer with gains from the log, or set by hand."""

    name: str  #: Command-line name.
    observer: Observer  #: The observer.
    #: The expected error; None for set gains.
    curve: Curve | None = field(default=None, repr=False)

    def estimate(self, terms: DynamicsTerms) -> ExternalTorque:
        """Estimate of a log; joints without a number are not finite."""
        with np.errstate(all="ignore"):
            return replace(self.observer.estimate(terms), name=self.name)

    def tuning(self, step: float, joints: int) -> Tuning:
        """Meaning of the gains at a sample time. [s]"""
        meaning = self.observer.tuning(step, joints)
        return meaning if self.curve is None else replace(meaning, parameter_count=0)

    def frequency_response(self, frequency: Array, step: float, joints: int) -> Complex:
        """Complex gain from torque to estimate at `frequency` [Hz]. (F, n)"""
        return self.observer.frequency_response(frequency, step, joints)


def tune_to_spectra(name: str, spectra: Spectra) -> AutoTuned:
    """The observer `name` with the spectra's natural frequencies."""
    found = error_curve(KINDS[name], spectra, SLOWEST_BEST if name == "best" else SLOWEST)
    best = frozen(found.best)
    observer = KINDS[name](best, noise_level(best, spectra))
    return AutoTuned(name=name, observer=observer, curve=found)


class Goal(NamedTuple):
    """A goal of gains."""

    name: str  #: A key of `GOALS`.
    value: float = float("nan")  #: Its number, or NaN. [s], [Hz] or [1/h]
    #: Torque beyond which an estimate raises an alarm. (n,) or (1,) [N·m]
    threshold: Array | None = None


def parse_goal(
    text: str, threshold: str | None = None, allowed: Iterable[str] = tuple(GOALS)
) -> Goal:
    """The goal in ``--gains``, of some `GOALS`, and ``alarm.threshold``. [N·m]"""
    name, equals, number = text.partition("=")
    name, level, values = name.strip(), None, numbers(number) or ()
    value = values[0] if len(values) == 1 else float("nan")
    if name not in allowed or not (0.0 < value < np.inf if name != "auto" else not equals):
        forms = " or ".join(GOALS[each] for each in allowed)
        raise ParameterError(f"--gains {text!r} is not {forms}, a positive number")
    if threshold is not None:
        level = np.array(numbers(threshold) or [np.nan])
        if not (np.isfinite(level).all() and np.all(level > 0.0)):
            raise ParameterError(
                f"alarm.threshold={threshold} is not a positive number or one per joint [N·m]"
            )
    if name == "false-alarms" and level is None:
        raise ParameterError(
            "--gains false-alarms needs to know what raises an alarm: add --set "
            "alarm.threshold=N·m, one number or one per joint"
        )
    return Goal(name, value, level)


def match_observers(
    observers: Sequence[Observer], goal: Goal, step: float, joints: int
) -> tuple[tuple[Observer, ...], tuple[Remark, ...]]:
    """Observers with one delay to a slow ramp, or one bandwidth; remarks."""
    tuned = tuple(tune(observer, goal, step, joints) for observer in observers)
    remarks: tuple[Remark, ...] = (fact("bandwidth-matched", bandwidth_Hz=goal.value),)
    if goal.name == "delay":
        remarks = (fact("delay-matched", delay_s=goal.value),)
    if {"fdo", "gmo"} <= {observer.name for observer in tuned}:
        remarks += (fact("first-order-observers-alike"),)
    return tuned, remarks


def tune(observer: Observer, goal: Goal, step: float, joints: int) -> Observer:
    """One observer with the gain that reaches a goal on every joint."""
    if type(observer) not in KNOBS:
        raise ParameterError(
            f"--gains cannot tune {observer.name}: it has no {goal.name} of its own to set; "
            "choose fdo, gmo, kfo-fe or kfo-zoh with --observer"
        )
    knob, low, high = KNOBS[type(observer)]

    def turned(x: Array) -> Observer:
        value = np.exp(x)
        # All joints share the cutoff.
        changed: dict[str, Any] = {knob: float(value[0]) if knob == "omega" else value}
        return replace(cast("MomentumObserver", observer), **changed)

    def excess(x: Array) -> Array:
        """Delay [s], or share of a sinusoid at a bandwidth, less the goal. (n,)"""
        tuning = turned(x).tuning(step, joints)
        if goal.name == "delay":
            return tuning.delay - goal.value
        gain = turned(x).frequency_response(np.array([goal.value]), step, joints)[0]
        return np.asarray(abs(gain) / tuning.dc_gain - np.sqrt(0.5))

    rising = goal.name == "bandwidth"
    a, b = (np.full(joints, np.log(limit)) for limit in (low, high))
    if not np.all(excess(a) * excess(b) <= 0.0):
        unit, limit = "s", f"a delay of more than half a sample ({0.5 * step:g} s)"
        if rising:
            unit, limit = (
                "Hz",
                f"a bandwidth well below half the sample rate ({0.5 / step:.4g} Hz)",
            )
        raise ParameterError(
            f"no gain gives {observer.name} a {goal.name} of {goal.value:g} {unit} at "
            f"{1.0 / step:.4g} Hz; choose {limit}"
        )
    # Monotonic in the gain: halve its logarithm.
    for _ in range(HALVINGS):
        middle = 0.5 * (a + b)
        above = (excess(middle) > 0.0) == rising
        a, b = np.where(above, a, middle), np.where(above, middle, b)
    return turned(0.5 * (a + b))


class Tuned(NamedTuple):
    """One observer's gains and its expected errors."""

    observer: str  #: Its name at the command line.
    section: str  #: Section of its gains in a gains file.
    gains: Mapping[str, Any]  #: Parameter → number or one a joint.
    rate: Array  #: Natural frequency, cutoff or K. (n,) [rad/s]
    delay: Array  #: Lag behind a slow ramp. (n,) [s]
    rmse: Array  #: Expected error. (n,) [N·m]
    #: Expected false alarms an hour, None without a threshold. (n,)
    alarms: Array | None = None


def tune_all(spectra: Spectra, goal: Goal) -> tuple[Tuned, ...]:
    """Gains of FDO, GMO, KFO and smoother for a goal, one line an observer."""
    threshold, n, step = goal.threshold, spectra.joints, spectra.step
    if threshold is not None and len(threshold) not in {1, n}:
        raise ParameterError(
            f"alarm.threshold has {len(threshold)} values; give one, or one for each of {n} joints"
        )
    first_order = rates(momentum, spectra, goal)
    # FDO's one rate: the least mean error, or the slowest joint's.
    shared = float(first_order.min())
    if goal.name == "auto":
        curve = error_curve(momentum, spectra)
        shared = float(curve.omega_n[curve.rmse.mean(axis=1).argmin()])
    lines = {
        "fdo": (FilteredDynamicsObserver(omega=shared), np.full(n, shared), {"omega": shared}),
        "gmo": (momentum(first_order), first_order, {"gain": first_order.tolist()}),
    }
    # For a delay the smoother, which has none, gets the smallest error.
    for name, kind in KALMAN.items():
        rate = rates(kind, spectra, goal)
        r = noise_level(rate, spectra)
        gains = {"r_diag": r.tolist(), "q_p_diag": 0.0, "q_tau_diag": (r * rate**4).tolist()}
        lines[name] = kind(rate), rate, {**gains, "noise_convention": "density"}
    tuned = []
    for name, (observer, rate, gains) in lines.items():
        response = observer.frequency_response(spectra.frequency, step, n)
        rmse = np.sqrt(spectra.missed(response) + spectra.passed(response))
        power = abs(response) ** 2 * spectra.noise * spectra.width
        alarms = None if threshold is None else crossings(power, spectra.frequency, threshold)
        section, delay = "kfo" if name == "kfo-zoh" else name, observer.tuning(step, n).delay
        tuned.append(Tuned(name, section, gains, rate, delay, rmse, alarms))
    return tuple(tuned)


def bounds_reached(tuned: Sequence[Tuned], spectra: Spectra, goal: Goal) -> tuple[Remark, ...]:
    """A warning on every gain that reached a bound of the search."""
    if goal.name not in {"auto", "false-alarms"}:
        return ()
    grid = natural_frequencies(spectra.step)
    return tuple(r for line in tuned for r in bound_remarks(line.observer, line.rate, grid))


def rates(kind: Kind, spectra: Spectra, goal: Goal) -> Array:
    """The rate of each joint that reaches the goal. (n,) [rad/s]"""
    n, step = spectra.joints, spectra.step
    if goal.name == "false-alarms" and goal.threshold is not None:
        curve = error_curve(kind, spectra)
        grid, noise = curve.omega_n, spectra.noise * spectra.width
        response = kind(grid).frequency_response(spectra.frequency, step, len(grid))
        powers = (abs(column[:, None]) ** 2 * noise for column in response.T)
        # Whether a rate raises at most so many false alarms an hour. (G, n)
        few = np.array(
            [crossings(x, spectra.frequency, goal.threshold) <= goal.value for x in powers]
        )
        if len(never := np.flatnonzero(~few.any(axis=0))):
            read = np.sqrt(noise.sum(axis=0))
            listed = ", ".join(f"J{j + 1} ({read[j]:.2g} N·m rms)" for j in never)
            raise ParameterError(
                f"no gain keeps the false alarms at {goal.value:g} an hour: the free part itself "
                f"is too loud for the threshold on {listed}; raise --set alarm.threshold=N·m or "
                "remove the bias"
            )
        # The fastest that still raises few alarms: the last of their run.
        fastest = curve.omega_n[len(few) - 1 - few[::-1].argmax(axis=0)]
        best_is_one = few[curve.rmse.argmin(axis=0), np.arange(n)]
        return np.where(best_is_one, curve.best, fastest)
    if goal.name == "bandwidth" and kind is kalman_smoother:
        fraction = kalman_smoother(np.ones(1)).tuning(step, 1).bandwidth[0]
        return np.full(n, goal.value / fraction)
    if goal.name == "auto" or kind is kalman_smoother:
        return error_curve(kind, spectra).best
    return tune(kind(np.full(n, 10.0)), goal, step, n).tuning(step, n).omega_n


def crossings(power: Array, frequency: Array, threshold: Array) -> Array:
    """Crossings of ±threshold an hour by a Gaussian signal of this spectrum. (n,)

    Rice's formula, ν = (σ̇/2πσ) e^{−(h∓m)²/2σ²} for each side, the power at 0 Hz a
    constant offset m: an estimate, as friction is no Gaussian noise.

    References:
        S. O. Rice, "Mathematical analysis of random noise", Bell Syst. Tech. J. 23–24, 1944–45.
    """
    offset = np.sqrt(power[0])
    variance = np.maximum(power[1:].sum(axis=0), np.finfo(float).tiny)
    moved = np.sum(power[1:] * frequency[1:, None] ** 2, axis=0)
    often = np.sqrt(moved / variance)
    sides = [np.exp(-((threshold - m) ** 2) / (2.0 * variance)) for m in (offset, -offset)]
    beyond = np.where(offset >= threshold, np.inf, 0.0)
    return np.asarray(3600.0 * often * (sides[0] + sides[1]) + beyond)
