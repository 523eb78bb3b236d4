"""Gains from a log's spectra: natural frequencies of least expected error.

A Kalman filter's ω_n trades the external torque that its lag leaves out against the noise that
passes. Both follow from the spectra of the log's free and loaded part, without a guess:

    ω_n = argmin ∫ |1 − H(ω_n)|² S_τ + |H(ω_n)|² S_n df,  joint by joint, ζ = 1/√2

with the filter's exact complex response H, or the smoother's real one.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from vftcli.observers.observer import Complex, Observer, Tuning
from vftcli.observers.paper import KalmanObserver
from vftcli.observers.smoother import KalmanSmoother
from vftcli.observers.spectra import Spectra
from vftcli.signals.arrays import Array, frozen
from vftcli.signals.external_torque import DynamicsTerms, ExternalTorque
from vftcli.signals.remarks import Remark, Where, warning
from vftcli.signals.shown import Shown

SLOWEST = 1.0  #: Least natural frequency to try. [rad/s]
#: That of `best`: it keeps 84 % of the peak of a push of .6 s, a half sine, as the smoother
#: passes 1/(1 + (ω/ω_n)⁴). A joint without a push may be pushed next. [rad/s]
SLOWEST_BEST = 9.0
FASTEST = 2.0  #: Largest natural frequency to try, times the sample time. [rad]
TRIED = 96  #: Natural frequencies to try, evenly in logarithm.
LEAST_SHARE = 1e-3  #: Least R as a share of the noise in the free part. [1]
#: Least torque of R: single precision keeps 1e-5 of 100 N·m. [N·m]
FINEST = 1e-6


class Curve(NamedTuple):
    """Expected error of a kind of filter by its natural frequency."""

    omega_n: Array  #: Natural frequencies tried. (G,) [rad/s]
    rmse: Array  #: Expected error. (G, n) [N·m]
    best: Array  #: The best natural frequency. (n,) [rad/s]

    @property
    def least(self) -> Array:
        """The expected error at the best. (n,) [N·m]"""
        return np.asarray(self.rmse.min(axis=0))


def kalman_filter(omega_n: Array, r: Array | float = 1.0) -> KalmanObserver:
    """Kalman observer of ω_n at ζ = 1/√2: Q_τ = R ω_n⁴, Q_p = 0. (n,)"""
    density = np.broadcast_to(np.asarray(r, dtype=np.float64), omega_n.shape)
    return KalmanObserver(
        discretisation="zoh", r_diag=density, q_p_diag=0.0, q_tau_diag=density * omega_n**4
    )


def kalman_smoother(omega_n: Array, r: Array | float = 1.0) -> KalmanSmoother:
    """Smoother of these ω_n at ζ = 1/√2. (n,) [rad/s]"""
    return KalmanSmoother(filter=kalman_filter(omega_n, r))


#: Natural frequencies (n,) [rad/s], and R if not 1 → observer.
Kind = Callable[..., Observer]
#: Command-line name → what is tuned.
KINDS: dict[str, Kind] = {
    "best": kalman_smoother,
    "kfo-auto": kalman_filter,
    "rts-auto": kalman_smoother,
}


def natural_frequencies(step: float, slowest: float = SLOWEST) -> Array:
    """Natural frequencies to try at a sample time. (G,) [rad/s]"""
    found: Array = np.geomspace(SLOWEST, FASTEST / step, TRIED)
    return np.asarray(found[found >= min(slowest, found[-1])])


def expected_error(kind: Kind, omega_n: Array, spectra: Spectra) -> Array:
    """Expected rmse of joints at natural frequencies. (G, n) [N·m]"""
    # Each natural frequency is a joint of one observer: one call gives all responses.
    response = kind(omega_n).frequency_response(spectra.frequency, spectra.step, len(omega_n))
    missed = (np.abs(1.0 - response) ** 2).T @ spectra.external
    passed = (np.abs(response) ** 2).T @ spectra.noise
    return np.asarray(np.sqrt((missed + passed) * spectra.width))


def error_curve(kind: Kind, spectra: Spectra, slowest: float = SLOWEST) -> Curve:
    """Expected errors of natural frequencies, and the best."""
    omega_n = natural_frequencies(spectra.step, slowest)
    rmse = expected_error(kind, omega_n, spectra)
    return Curve(omega_n, rmse, omega_n[np.argmin(rmse, axis=0)])


def bound_remarks(name: str, rate: Array, grid: Array) -> tuple[Remark, ...]:
    """A warning on joints (n,) at a bound of the natural frequencies tried (G,), if any. [rad/s]

    At the slowest the spectra do not separate external torque from noise; at the fastest, not
    noise from external torque.
    """
    found = []
    reached = {"slowest": (rate <= grid[0], grid[0]), "fastest": (rate >= grid[-1], grid[-1])}
    for end, (joints, bound) in reached.items():
        if joints.any():
            where = Where(name, tuple(int(j) + 1 for j in np.flatnonzero(joints)))
            found.append(warning(f"gain-at-{end}", where, rate_rad_s=float(bound)))
    return tuple(found)


def noise_level(omega_n: Array, spectra: Spectra) -> Array:
    """R at which the innovations have the variance the filter expects. (n,)

    Gains depend on Q/R alone; R scales the covariance. The innovation is the estimate's jump,
    ν = (τ̂ᵗ − τ̂ᵗ⁻¹)/L₂, so its variance follows from S_d. That may be zero, or too small where few
    impacts extrapolate S_d, and no filter runs on R = 0: R is at least `LEAST_SHARE` of S_n's R and
    the noise of `FINEST`, a torque that is constant over a sample.
    """
    n, unit = len(omega_n), kalman_filter(omega_n)
    settled = unit.steady(spectra.step, n)
    response = unit.frequency_response(spectra.frequency, spectra.step, n)
    jump = 2.0 * np.sin(np.pi * spectra.frequency * spectra.step)[:, None]
    share = (np.abs(response) * jump / settled.l2) ** 2
    both, noise = (
        np.sum(share * density, axis=0) * spectra.width
        for density in (spectra.loaded, spectra.free)
    )
    scale = np.maximum(both, LEAST_SHARE**2 * noise) / settled.S
    return np.asarray(np.maximum(scale, FINEST**2 * spectra.step**3))


@dataclass(frozen=True, kw_only=True, repr=False)
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
        """Meaning of the gains at a sample time; none to set if the log set them. [s]"""
        meaning = self.observer.tuning(step, joints)
        return replace(meaning, parameter_count=0) if self.curve is not None else meaning

    def frequency_response(self, frequency: Array, step: float, joints: int) -> Complex:
        """Complex gain from torque to estimate at `frequency` [Hz]. (F, n)"""
        return self.observer.frequency_response(frequency, step, joints)


def tune_to_spectra(name: str, spectra: Spectra) -> AutoTuned:
    """The observer `name` with the spectra's natural frequencies."""
    found = error_curve(KINDS[name], spectra, SLOWEST_BEST if name == "best" else SLOWEST)
    best = frozen(found.best)
    observer = KINDS[name](best, noise_level(best, spectra))
    return AutoTuned(name=name, observer=observer, curve=found)
