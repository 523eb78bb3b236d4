"""Gains from a log's own spectra: the natural frequency with the smallest expected error.

A Kalman filter's ω_n trades what its lag leaves out of the external torque against what it lets
through of the noise. Both follow from the spectra of the free and the loaded part of the log, so
that nobody has to guess:

    ω_n = argmin ∫ |1 − H(ω_n)|² S_τ + |H(ω_n)|² S_n df,  joint by joint, ζ = 1/√2

with H the filter's exact complex response, or the smoother's real one.
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
from vftcli.signals.external_torque import ExternalTorque
from vftcli.signals.remarks import Remark, Where, warning
from vftcli.signals.shown import Shown
from vftcli.signals.terms import DynamicsTerms

SLOWEST = 1.0  #: Smallest natural frequency that is tried. [rad/s]
#: The same for `best`: it keeps 84 % of the peak of a push of .6 s, a half sine, as the smoother
#: lets 1/(1 + (ω/ω_n)⁴) through. A joint that nothing pushed may be pushed next. [rad/s]
SLOWEST_BEST = 9.0
FASTEST = 2.0  #: Largest natural frequency that is tried, times the sample time. [rad]
TRIED = 96  #: Natural frequencies tried, on a logarithmic scale.
LEAST_SHARE = 1e-3  #: R stands for at least this share of the noise in the free part. [1]
#: And for at least this torque: a log in single precision keeps 1e-5 of 100 N·m. [N·m]
FINEST = 1e-6


class Curve(NamedTuple):
    """The expected error of one kind of filter against its natural frequency."""

    omega_n: Array  #: Natural frequencies tried. (G,) [rad/s]
    rmse: Array  #: Expected error. (G, n) [N·m]
    best: Array  #: The natural frequency with the smallest. (n,) [rad/s]

    @property
    def least(self) -> Array:
        """The expected error at the best. (n,) [N·m]"""
        return np.asarray(self.rmse.min(axis=0))


def kalman_filter(omega_n: Array, r: Array | float = 1.0) -> KalmanObserver:
    """A Kalman observer with natural frequencies, ζ = 1/√2: Q_τ = R ω_n⁴ and Q_p = 0. (n,)"""
    density = np.broadcast_to(np.asarray(r, dtype=np.float64), omega_n.shape)
    return KalmanObserver(
        discretisation="zoh", r_diag=density, q_p_diag=0.0, q_tau_diag=density * omega_n**4
    )


def kalman_smoother(omega_n: Array, r: Array | float = 1.0) -> KalmanSmoother:
    """A smoother on the Kalman filter with these natural frequencies and ζ = 1/√2. (n,) [rad/s]"""
    return KalmanSmoother(filter=kalman_filter(omega_n, r))


#: Natural frequencies (n,) [rad/s], and R if it is not 1 → the observer.
Kind = Callable[..., Observer]
#: Name at the command line → what is tuned.
KINDS: dict[str, Kind] = {
    "best": kalman_smoother,
    "kfo-auto": kalman_filter,
    "rts-auto": kalman_smoother,
}


def natural_frequencies(step: float, slowest: float = SLOWEST) -> Array:
    """Natural frequencies worth trying at a sample time. (G,) [rad/s]"""
    found: Array = np.geomspace(SLOWEST, FASTEST / step, TRIED)
    fast: Array = found[found >= min(slowest, found[-1])]
    return fast


def expected_error(kind: Kind, omega_n: Array, spectra: Spectra) -> Array:
    """Expected rmse of every joint at every natural frequency. (G, n) [N·m]"""
    # Every natural frequency is a joint of one observer: one call gives all responses.
    response = kind(omega_n).frequency_response(spectra.frequency, spectra.step, len(omega_n))
    missed = (np.abs(1.0 - response) ** 2).T @ spectra.external
    passed = (np.abs(response) ** 2).T @ spectra.noise
    return np.asarray(np.sqrt((missed + passed) * spectra.width))


def error_curve(kind: Kind, spectra: Spectra, slowest: float = SLOWEST) -> Curve:
    """The expected error over all natural frequencies, and where it is smallest."""
    omega_n = natural_frequencies(spectra.step, slowest)
    rmse = expected_error(kind, omega_n, spectra)
    return Curve(omega_n, rmse, omega_n[np.argmin(rmse, axis=0)])


def bound_remarks(name: str, rate: Array, grid: Array) -> tuple[Remark, ...]:
    """A warning on the joints whose natural frequency ran to a bound of what is tried, if any.

    At the slowest the spectra tell no external torque from the noise there; at the fastest, no
    noise from the external torque.

    Args:
        name: The observer.
        rate: What was chosen of the grid. (n,) [rad/s]
        grid: What was tried, as by `natural_frequencies`. (G,) [rad/s]
    """
    reached = {
        "gain-at-slowest": (rate <= grid[0], grid[0]),
        "gain-at-fastest": (rate >= grid[-1], grid[-1]),
    }
    return tuple(
        warning(
            code,
            Where(name, tuple(int(j) + 1 for j in np.flatnonzero(joints))),
            rate_rad_s=float(bound),
        )
        for code, (joints, bound) in reached.items()
        if joints.any()
    )


def noise_level(omega_n: Array, spectra: Spectra) -> Array:
    """R with which the filter's innovations have the variance that it expects. (n,)

    Gains depend on Q/R alone; R sets the scale of the covariance. The innovation is what the
    estimate jumps by, ν = (τ̂ᵗ − τ̂ᵗ⁻¹)/L₂, so its variance follows from S_d. That may come out as
    nothing, or as less where S_d was extrapolated from a few impacts, and no filter runs on R = 0:
    R is held above `LEAST_SHARE` of what S_n makes of it and above the noise of `FINEST`, a torque
    that is constant over a sample.
    """
    n = len(omega_n)
    unit = kalman_filter(omega_n)
    settled, model = unit.steady(spectra.step, n), unit.model(spectra.step, n)
    response = unit.frequency_response(spectra.frequency, spectra.step, n)
    jump = 2.0 * np.sin(np.pi * spectra.frequency * spectra.step)[:, None]
    share = (np.abs(response) * jump / settled.gains.l2) ** 2
    both, noise = (
        np.sum(share * density, axis=0) * spectra.width
        for density in (spectra.loaded, spectra.free)
    )
    scale = np.maximum(both, LEAST_SHARE**2 * noise) / (settled.prior.p11 + model.r)
    return np.asarray(np.maximum(scale, FINEST**2 * spectra.step**3))


@dataclass(frozen=True, kw_only=True, repr=False)
class AutoTuned(Shown):
    """An observer with gains from the log, or with hand-set ones where there are none."""

    name: str  #: Name at the command line.
    observer: Observer  #: The observer itself.
    #: What was minimised, None where it fell back.
    curve: Curve | None = field(default=None, repr=False)

    def estimate(self, terms: DynamicsTerms) -> ExternalTorque:
        """Run over a whole log; a joint of which gains and log make no number is not finite."""
        with np.errstate(all="ignore"):
            return replace(self.observer.estimate(terms), name=self.name)

    def tuning(self, step: float, joints: int) -> Tuning:
        """What the gains mean at a sample time; where the log tuned them, none is left to. [s]"""
        meaning = self.observer.tuning(step, joints)
        return replace(meaning, parameter_count=0) if self.curve is not None else meaning

    def frequency_response(self, frequency: Array, step: float, joints: int) -> Complex:
        """Complex gain from external torque to estimate at `frequency` [Hz]. (F, n)"""
        return self.observer.frequency_response(frequency, step, joints)


def tune_to_spectra(name: str, spectra: Spectra) -> AutoTuned:
    """The observer `name` with the natural frequencies its spectra call for."""
    found = error_curve(KINDS[name], spectra, SLOWEST_BEST if name == "best" else SLOWEST)
    best = frozen(found.best)
    observer = KINDS[name](best, noise_level(best, spectra))
    return AutoTuned(name=name, observer=observer, curve=found)
