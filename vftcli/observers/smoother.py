"""Rauch–Tung–Striebel smoother on the disturbance Kalman filter: `kfo-rts`, for complete logs.

A log is complete, so an estimate at t may use what came after t. The smoother is the Kalman
filter's fixed-interval answer, run backwards in the form of Bryson and Frazier, which needs the
innovations ν only and inverts nothing but a number:

    λ̃ᵗ = Aᵀ[(I − LC)ᵀ λ̃ᵗ⁺¹ − Cᵀ νᵗ⁺¹/Sᵗ⁺¹],  λ̃ = 0 at the last sample,  x̂ₛᵗ = x̂ᵗ − Pᵗ λ̃ᵗ

with P the filter's posterior and S its innovation variance. In the long run it is the two-sided
filter |H|² = Q_τ/(Q_τ + Q_p ω² + R ω⁴): no delay, but it leads before a tap, because it knows that
one is coming.

References:
    H. E. Rauch, F. Tung, C. T. Striebel, "Maximum likelihood estimates of linear dynamic systems",
    AIAA Journal 3(8), 1965; G. J. Bierman, "Fixed interval smoothing with discrete measurements",
    Int. J. Control 18(1), 1973, for the form used here.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from vftcli.observers.kalman_model import Covariance, Gains, closed_loop, error_filter
from vftcli.observers.observer import BlockObserver, Complex, Observer, Tuning
from vftcli.observers.paper import TORQUE, KalmanObserver
from vftcli.observers.uneven import gain_sequence, recursion
from vftcli.signals.arrays import Array, empty_series, handed_over
from vftcli.signals.external_torque import ExternalTorque
from vftcli.signals.series import Clock
from vftcli.signals.shown import Shown
from vftcli.signals.steady_filter import steady_filter
from vftcli.signals.terms import DynamicsTerms

#: Share of the smoother's settled information that may be missing where it counts as settled.
SETTLED = 1e-16


@dataclass(frozen=True, kw_only=True, repr=False)
class KalmanSmoother(Shown):
    """Fixed-interval smoother on a disturbance Kalman filter, with the filter's own parameters.

    Exact at uneven clocks; memory grows with the log, time too.
    """

    filter: KalmanObserver  #: The Kalman observer that it smooths.
    name: str = "kfo-rts"  #: Name at the command line.

    def estimate(self, terms: DynamicsTerms) -> ExternalTorque:
        """Smooth a whole log; `sd` is the smoother's own √P₂₂."""
        if self.filter.is_steady(terms.clock):
            run = SteadyRun(self, terms.clock.step, terms.joints)
            (whole,) = (*run.take(terms), *run.end())
            return whole
        tau, sd = self._step_by_step(terms)
        return ExternalTorque(name=self.name, t=terms.t, tau=handed_over(tau), sd=handed_over(sd))

    def _step_by_step(self, terms: DynamicsTerms) -> tuple[Array, Array]:
        """Smooth with gains that follow each step's own sample time. (T, n) each"""
        samples, n = terms.p.shape
        settled = self.filter.steady(terms.clock.step, n)
        model = self.filter.model(np.broadcast_to(terms.dt, (samples, 1)), n)
        gains = gain_sequence(model, self.filter.first_prior(settled), settled.gains.posterior)
        # L₁ = P⁻₁₁/S and R = S − P⁻₁₁, so S = R/(1 − L₁).
        with np.errstate(divide="ignore"):  # a gap of days leaves nothing known: L₁ = 1, S = ∞
            S = model.r / (1.0 - gains.l1)
        (F, g), d = error_filter(gains, model.a12, model.a22), self.filter.unexplained(terms)
        states = recursion(F, g * d, np.zeros((2, n)))
        e, tau = np.concatenate([np.zeros((2, 1, n)), states[:, :-1]], axis=1)
        innovation = e + d - model.a12 * tau
        backward, b = backward_filter(gains, model.a12, model.a22)
        lam, P = from_the_end(backward, b * (innovation / S)), gains.posterior
        step, gain = information_step(gains, model.a12, model.a22), information_gain(model.a12, S)
        variance = smoothed_variance(P, from_the_end(step, gain))
        return states[1] - (P.p12 * lam[0] + P.p22 * lam[1]), np.sqrt(variance)

    def tuning(self, step: float, joints: int) -> Tuning:
        """What the parameters mean: no delay, −3 dB where |H_KFO|² has fallen to 1/√2.

        Q_τ/(Q_τ + Q_pω² + Rω⁴) = 1/√2 at the effective densities, ω_n and ζ those of the filter.
        """
        causal = self.filter.tuning(step, joints)
        # In units of ω_n: x⁴ + c x² + 1 = √2 with c = Q_p/√(Q_τR) = 4ζ² − 2.
        c = 4.0 * causal.zeta**2 - 2.0
        x = np.sqrt(0.5 * (-c + np.sqrt(c**2 + 4.0 * (np.sqrt(2.0) - 1.0))))
        return Tuning(
            omega_n=causal.omega_n,
            zeta=causal.zeta,
            delay=np.zeros(joints),
            bandwidth=causal.omega_n * x / (2.0 * np.pi),
            dc_gain=causal.dc_gain,
            parameter_count=causal.parameter_count,
        )

    def frequency_response(self, frequency: Array, step: float, joints: int) -> Complex:
        """Gain of the two-sided filter in the middle of a log: real, without delay. (F, n)"""
        causal = self.filter.tuning(step, joints)
        x = 2.0 * np.pi * np.asarray(frequency, dtype=np.float64)[:, None] / causal.omega_n
        c = 4.0 * causal.zeta**2 - 2.0
        response: Complex = (1.0 / (1.0 + c * x**2 + x**4)).astype(np.complex128)
        return response


class SteadyRun:
    """The smoother with settled gains, block by block of a log; a whole log is one block.

    The backward recursion forgets: started from zero `look_ahead` samples behind a sample it errs
    there by `SETTLED`. So it goes along in one pass, as many samples behind.

    Args:
        smoother: The smoother.
        step: Sample time. [s]
        joints: Number of joints n.
    """

    def __init__(self, smoother: KalmanSmoother, step: float, joints: int) -> None:
        self._smoother, self._model = smoother, smoother.filter.model(step, joints)
        settled = smoother.filter.steady(step, joints)
        self._gains, self._S = settled.gains, settled.prior.p11 + self._model.r
        self._ahead = look_ahead(smoother, step, joints)
        self._state = np.zeros((2, joints))
        self._blocks: list[tuple[Array, Array, Array]] = []

    def take(self, terms: DynamicsTerms) -> Iterator[ExternalTorque]:
        """Take up the next block; the estimates of earlier blocks that are known by it."""
        gains, (a12, a22) = self._gains, (self._model.a12, self._model.a22)
        (F, g), d = error_filter(gains, a12, a22), self._smoother.filter.unexplained(terms)
        before = self._state[1]
        tau, self._state = steady_filter(F, g, d, self._state, wanted=TORQUE)
        driving = innovations(tau, gains.l2 * self._S, a22, before)  # ν/S
        self._blocks.append((terms.t, tau, driving))
        while sum(len(t) for t, _, _ in self._blocks[1:]) > self._ahead:
            yield self._smoothed()

    def end(self) -> Iterator[ExternalTorque]:
        """The estimates of the blocks that are left, up to the log's end."""
        while self._blocks:
            yield self._smoothed()

    def _smoothed(self) -> ExternalTorque:
        """The estimate of the first block that waits, by those behind it."""
        gains, model = self._gains, self._model
        waiting = [nu for _, _, nu in self._blocks]
        nu = np.concatenate(waiting) if waiting[1:] else waiting[0]
        t, tau, _ = self._blocks.pop(0)
        known, seen = len(nu), int(min(len(nu), len(t) + self._ahead + 1))
        backward, b = backward_filter(gains, model.a12, model.a22)
        # λ̃ᵗ is driven by νᵗ⁺¹: turned round, by the sample before.
        driven = np.zeros_like(nu[:seen])
        driven[1:] = nu[seen - 1 : 0 : -1]
        weights = np.stack([gains.posterior.p12, gains.posterior.p22])
        correction, _ = steady_filter(backward, b, driven, 0.0 * weights, wanted=weights)
        tau -= correction[::-1][: len(t)]
        # √P₂₂ from the log's last sample backwards, until it has settled.
        step = information_step(gains, model.a12, model.a22)
        missing = missing_information(step, information_gain(model.a12, self._S), known)
        information = (missing[0] - missing).transpose(1, 0, 2)
        deviation = np.sqrt(smoothed_variance(gains.posterior, information))
        sd = empty_series(*tau.shape)
        sd[:] = deviation[-1]
        near = deviation[known - len(t) : known]
        sd[len(t) - len(near) :] = near[::-1]
        return ExternalTorque(
            name=self._smoother.name, t=t, tau=handed_over(tau), sd=handed_over(sd)
        )


def look_ahead(smoother: KalmanSmoother, step: float, joints: int) -> float:
    """Samples after which the backward recursion has forgotten where it began, L.

    Args:
        smoother: The smoother.
        step: Sample time. [s]
        joints: Number of joints n.
    """
    gains, model = smoother.filter.steady(step, joints).gains, smoother.filter.model(step, joints)
    F = np.moveaxis(closed_loop(gains, model.a12, model.a22), -1, 0)
    pole = float(np.max(np.abs(np.linalg.eigvals(F))))
    return float(np.ceil(np.log(SETTLED) / np.log(pole))) if pole < 1.0 else np.inf


def innovations(tau: Array, l2: Array, a22: Array, before: Array | float = 0.0) -> Array:
    """ν of the steady filter, read off its estimate: τ̂ᵗ = A₂₂τ̂ᵗ⁻¹ + L₂νᵗ. (T, n)

    Args:
        tau: τ̂. (T, n)
        l2: Its gain L₂. (n,)
        a22: A₂₂ of its model. (n,)
        before: τ̂ before the first sample. (n,)
    """
    nu = tau.copy(order="K")
    nu[1:] -= a22 * tau[:-1]
    nu[0] -= a22 * before
    nu /= l2
    return nu


def backward_filter(gains: Gains, a12: Array, a22: Array) -> tuple[Array, Array]:
    """Transition ((I − LC)A)ᵀ and input −AᵀCᵀ of the backward recursion. (2, 2, …), (2, …)"""
    return closed_loop(gains, a12, a22).swapaxes(0, 1), np.array([-np.ones_like(a12), -a12])


def information_step(gains: Gains, a12: Array, a22: Array) -> Array:
    """Λ̃ ← FᵀΛ̃F with F = (I − LC)A, as a matrix on (Λ₁₁, Λ₁₂, Λ₂₂). (3, 3, …)"""
    (f11, f12), (f21, f22) = closed_loop(gains, a12, a22)
    return np.array(
        [
            [f11 * f11, 2.0 * f11 * f21, f21 * f21],
            [f11 * f12, f11 * f22 + f12 * f21, f21 * f22],
            [f12 * f12, 2.0 * f12 * f22, f22 * f22],
        ]
    )


def information_gain(a12: Array, S: Array) -> Array:
    """AᵀCᵀCA/S, what one sample tells of the one before, as (Λ₁₁, Λ₁₂, Λ₂₂). (3, …)"""
    return np.array([1.0 / S, a12 / S, a12**2 / S])


def smoothed_variance(P: Covariance, information: Array) -> Array:
    """Variance of the smoothed torque, P₂₂ − [P₁₂ P₂₂] Λ̃ [P₁₂ P₂₂]ᵀ. Like P₂₂ [(N·m)²]"""
    l11, l12, l22 = information
    gained = P.p12**2 * l11 + 2.0 * P.p12 * P.p22 * l12 + P.p22**2 * l22
    variance: Array = P.p22 - gained
    return variance


def missing_information(step: Array, gain: Array, samples: int) -> Array:
    """What Λ̃ lacks of its settled value, 0, 1, 2 … samples from the end of a log. (N, 3, n)

    Λ̃ ← SΛ̃ + g settles at Λ̃∞ = (I − S)⁻¹g, from which it is Sᵏ Λ̃∞ away after k samples. The
    powers come by doubling, until nothing is missing or the log ends.
    """
    S, g = np.moveaxis(step, -1, 0), np.moveaxis(gain, -1, 0)
    settled = np.linalg.solve(np.eye(3) - S, g[..., None])[..., 0]
    missing, power = settled.T[None], S
    while len(missing) < samples:
        missing = np.concatenate([missing, np.einsum("jab,kbj->kaj", power, missing)])
        power = power @ power
        if np.all(np.abs(missing[-1]) <= SETTLED * np.abs(settled.T)):
            break
    kept: Array = np.asarray(missing[:samples], dtype=np.float64)
    return kept


def from_the_end(F: Array, x: Array) -> Array:
    """Run y_t = F_t y_{t+1} + x_t from a log's end; what comes of the samples behind each one."""
    y = recursion(F[:, :, ::-1], x[:, ::-1], np.zeros_like(x[:, 0]))[:, ::-1]
    return np.concatenate([y[:, 1:], np.zeros_like(y[:, :1])], axis=1)


#: Samples that the smoother looks ahead at most; one that forgets more slowly has the whole log.
FARTHEST = 1 << 17


def runs_in_blocks(observer: Observer, clock: Clock, joints: int) -> bool:
    """Whether an observer's estimate of a log can be made block by block."""
    if not isinstance(observer, KalmanSmoother):
        return isinstance(observer, BlockObserver)
    steady = observer.filter.is_steady(clock)
    return steady and look_ahead(observer, clock.step, joints) <= FARTHEST


def block_run(observer: Observer, clock: Clock, joints: int) -> "CausalRun | SteadyRun":
    """An observer at the beginning of a log of which `runs_in_blocks` holds.

    It takes up block after block, and gives the estimates that are known by then, in order.
    """
    if isinstance(observer, KalmanSmoother):
        return SteadyRun(observer, clock.step, joints)
    assert isinstance(observer, BlockObserver)
    return CausalRun(observer)


class CausalRun:
    """An observer that needs nothing of what follows."""

    def __init__(self, observer: BlockObserver) -> None:
        self._observer, self._state = observer, None

    def take(self, terms: DynamicsTerms) -> Iterator[ExternalTorque]:
        """The estimate of the block."""
        estimate, self._state = self._observer.run(terms, self._state)
        yield estimate

    def end(self) -> Iterator[ExternalTorque]:
        """Nothing is left."""
        return iter(())
