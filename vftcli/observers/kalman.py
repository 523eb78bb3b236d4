"""Disturbance Kalman filters, KFO (36)–(44): forward Euler and zero-order hold."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from vftcli.observers.kalman_gains import Covariance, Gains, Steady, steady, update
from vftcli.observers.kalman_model import (
    DISCRETISATIONS,
    NOISE_CONVENTIONS,
    Densities,
    Discrete,
    discretise,
)
from vftcli.observers.observer import Complex, Tuning, check_terms, numbers_of, per_joint
from vftcli.observers.printed_hold import (
    as_covariance,
    predicted,
    printed_noise,
    printed_steady,
    settled_prior,
    updated,
)
from vftcli.observers.recursion import Fold, run_blocks, spans
from vftcli.observers.uneven_kalman import settle
from vftcli.robots.terms import DynamicsTerms, one_sample_earlier
from vftcli.signals.arrays import Array, empty_series, frozen, handed_over
from vftcli.signals.errors import ParameterError, ShapeError
from vftcli.signals.external_torque import ExternalTorque
from vftcli.signals.parsing import check_known
from vftcli.signals.series import Clock
from vftcli.signals.shown import Shown
from vftcli.signals.steady_filter import steady_filter

#: Weights that pick the external torque out of a filter's two states. (2, 1)
TORQUE = np.array([[0.0], [1.0]])


class KalmanState(NamedTuple):
    """Where a Kalman observer stands after a block of a log."""

    error: Array  #: e = p − p̂ [kg·m²/s] and τ̂ [N·m]. (2, n)
    posterior: Covariance  #: Their covariance. (n,) each
    #: Its lower-left entry less its upper-right one, which only (44) as printed has. (n,)
    skew: Array | float = 0.0


@dataclass(frozen=True, kw_only=True, repr=False)
class KalmanObserver(Shown):
    r"""Kalman filter on x = [p; τ_ext] with ṗ = μ + τ_ext + w_p, τ̇_ext = A_τ τ_ext + w_τ.

    With diagonal R, Q_p and Q_τ it is n two-state filters whose gains do not depend on the data.
    The input is the trapezoid ½(μᵗ + μᵗ⁻¹). The first sample is x̂⁰ = [p⁰; 0] with the stationary
    prior, so that at a constant sample time there is no transient of the gains; on an uneven clock
    the covariance is propagated with every step's own A, B, Q and R.

    For A_τ = 0, A_c² = 0 and both discretisations have the same A and B; they differ in Q only.

    Raises:
        ParameterError: If a variance is not positive, or a name is unknown.
    """

    discretisation: str = "fe"  #: "fe" (41), (42) or "zoh" (43), (44).
    r_diag: Array | float = 0.5  #: R, one number or one a joint. (n,) [(N·m·s)²·s under "density"]
    q_p_diag: Array | float = 0.01  #: Q_p. (n,) [(N·m)²·s]
    q_tau_diag: Array | float = 5000.0  #: Q_τ. (n,) [(N·m)²/s]
    #: a in A_τ = −a; a number with its sign turned means the same. (n,) [1/s]
    decay: Array | float = 0.0
    noise_convention: str = "density"  #: A key of `NOISE_CONVENTIONS`.
    #: P⁻ of the first sample as (P₁₁, P₁₂, P₂₂), one a joint, or None for the stationary one. (3,
    #: n)
    initial_covariance: Array | None = None
    #: Use μᵗ alone (40), the literal noise convention, and (44)'s printed block.
    as_printed: bool = False

    def __post_init__(self) -> None:
        scheme, convention = self.discretisation, self.noise_convention
        check_known(scheme, DISCRETISATIONS, f"discretisation {scheme!r}")
        check_known(convention, NOISE_CONVENTIONS, f"kfo.noise_convention is {convention!r}")
        for name in ("r_diag", "q_p_diag", "q_tau_diag", "decay"):
            value = numbers_of(getattr(self, name), name, self.name)
            # The paper gives A_τ = −a, its tables a: either sign means the same decay.
            value = frozen(np.abs(value)) if name == "decay" else value
            object.__setattr__(self, name, value)
            least_allowed = value > 0 if name in {"r_diag", "q_tau_diag"} else value >= 0
            if not (np.all(np.isfinite(value)) and np.all(least_allowed)):
                raise ParameterError(
                    f"kfo.{name} is {value.tolist()}; R and Q_τ must be positive, Q_p and "
                    "decay must not be negative"
                )

    @property
    def name(self) -> str:
        """kfo-fe or kfo-zoh."""
        return f"kfo-{self.discretisation}"

    def densities(self, joints: int) -> Densities:
        """The parameters, one a joint."""
        values = (self.r_diag, self.q_p_diag, self.q_tau_diag, self.decay)
        return Densities(*(per_joint(value, joints) for value in values))

    def model(self, step: Array | float, joints: int) -> Discrete:
        """The discrete model at one sample time, or one a sample as a column (T, 1). [s]"""
        return self._model_of(self.densities(joints), step)

    def _model_of(self, densities: Densities, step: Array | float) -> Discrete:
        """The discrete model of some joints."""
        convention = "literal" if self.as_printed else self.noise_convention
        step = np.asarray(step, dtype=np.float64)
        return discretise(self.discretisation, convention, step, densities)

    def steady(self, step: float, joints: int) -> Steady:
        """Stationary gains and prior at a sample time. [s]"""
        return self._settled(self.model(step, joints), self.densities(joints))

    @property
    def prints_hold(self) -> bool:
        """Whether its noise is that of (44) as printed."""
        return self.as_printed and self.discretisation == "zoh"

    def _settled(self, model: Discrete, densities: Densities) -> Steady:
        """What a model of one sample time settles to."""
        if self.prints_hold:
            return printed_steady(model, densities)
        return steady(model, densities.decay)

    def is_steady(self, clock: Clock) -> bool:
        """Whether the gains along a log of this clock are the stationary ones from its start on."""
        return clock.uniform and self.initial_covariance is None

    def estimate(self, terms: DynamicsTerms) -> ExternalTorque:
        """Run over a whole log; `sd` is √P₂₂, the filter's own account of its error."""
        return self.run(terms)[0]

    def run(
        self, terms: DynamicsTerms, state: KalmanState | None = None
    ) -> tuple[ExternalTorque, KalmanState]:
        """Run over a block of a log from where the block before ended; None where it begins."""
        check_terms(terms)
        n, clock = terms.joints, terms.clock
        densities, d = self.densities(n), self.unexplained(terms)
        model = self._model_of(densities, clock.step)
        settled = self._settled(model, densities)
        if self.is_steady(clock):
            F, g = error_filter(settled.gains, model.a12, model.a22)
            start = np.zeros((2, n)) if state is None else state.error
            tau, end = steady_filter(F, g, d, start, wanted=TORQUE)
            row = handed_over(np.sqrt(settled.gains.posterior.p22))
            sd = np.broadcast_to(row, tau.shape)
            state = KalmanState(end, settled.gains.posterior)
        elif self.prints_hold:
            tau, sd, state = self._printed_steps(terms, d, model, state)
        else:
            tau, sd, state = self._step_by_step(terms, d, settled, state)
        estimate = ExternalTorque(
            name=self.name, t=terms.t, tau=handed_over(tau), sd=handed_over(sd)
        )
        return estimate, state

    def _step_by_step(
        self, terms: DynamicsTerms, d: Array, settled: Steady, state: KalmanState | None
    ) -> tuple[Array, Array, KalmanState]:
        """τ̂ and √P₂₂ with gains that follow each step's own sample time. (T, n) each"""
        samples, n = d.shape
        tau, sd = empty_series(samples, n), empty_series(samples, n)
        dt, begins = np.broadcast_to(terms.dt, (samples, 1)), state is None
        if state is None:
            first = update(self.first_prior(settled), self.model(dt[:1], n).r[0]).posterior
            state = KalmanState(np.zeros((2, n)), first)
            tau[0], sd[0] = 0.0, np.sqrt(first.p22)
        error, densities = state.error, self.densities(n)
        # Joints with the same numbers have the same gains: one of each kind is computed.
        numbers = np.stack([*densities, *state.posterior])
        _, kept, kind = np.unique(numbers, axis=1, return_index=True, return_inverse=True)
        kind = kind.ravel()
        densities = Densities(*(x[kept, None] for x in densities))
        guess, entering = (
            Covariance(*(p[kept] for p in each))
            for each in (settled.gains.posterior, state.posterior)
        )
        for span in spans(samples, begins=begins):
            fold = Fold.of(span.stop - span.start)
            # What is one for all joints is written out: rows of one size need no iterator.
            model = self._model_of(densities, fold.fold(dt[span]))
            model = Discrete(model.step, *map(np.ascontiguousarray, model[1:]))
            gains = settle(model, entering, guess)
            entering = Covariance(*map(fold.last, gains.posterior))
            F, g = error_filter(gains, model.a12, model.a22)
            driven = g[:, :, kind] * fold.fold(d[span])
            states = run_blocks(F, driven, error, kind)
            error = fold.last(states)
            tau[span] = fold.unfold(states[1])
            sd.T[:, span] = fold.unfold(np.sqrt(gains.posterior.p22)).T[kind]
        return tau, sd, KalmanState(error, Covariance(*(p[kind] for p in entering)))

    def _printed_steps(
        self, terms: DynamicsTerms, d: Array, usual: Discrete, state: KalmanState | None
    ) -> tuple[Array, Array, KalmanState]:
        """τ̂ and √P₂₂ with the noise of (44) as printed, sample by sample. (T, n) each"""
        densities, n = self.densities(terms.joints), terms.joints
        tau, sd = np.zeros((2, *d.shape))
        begins = state is None
        if state is None:
            P = settled_prior(usual, printed_noise(usual, densities))
            if self.initial_covariance is not None:
                p11, p12, p22 = self.first_prior(self._settled(usual, densities))
                P = np.array([[p11, p12], [p12, p22]])
            state = KalmanState(np.zeros((2, n)), as_covariance(P), P[1, 0] - P[0, 1])
        (error, torque), (p11, p12, p22) = state.error, state.posterior
        P = np.array([[p11, p12], [p12 + state.skew, p22]])
        model = self._model_of(densities, np.broadcast_to(terms.dt, (len(d), 1)))
        noise = np.moveaxis(printed_noise(model, densities), 2, 0)
        for k, (a12, a22, r) in enumerate(zip(model.a12, model.a22, model.r, strict=True)):
            if k or not begins:
                P = predicted(P, a12, a22, noise[k])
            (l1, l2), P = updated(P, r)
            error = error + d[k] - a12 * torque
            torque = a22 * torque + l2 * error
            error = (1.0 - l1) * error
            tau[k], sd[k] = torque, np.sqrt(P[1, 1])
        return tau, sd, KalmanState(np.array([error, torque]), as_covariance(P), P[1, 0] - P[0, 1])

    def unexplained(self, terms: DynamicsTerms) -> Array:
        """The filter's input pᵗ − pᵗ⁻¹ − Ts·u: `DynamicsTerms.d`, or with u = μᵗ (40). (T, n)"""
        if not self.as_printed:
            return terms.d
        return terms.d + 0.5 * terms.dt * (one_sample_earlier(terms, "mu") - terms.mu)

    def first_prior(self, settled: Steady) -> Covariance:
        """Covariance before the first update: the user's, or the stationary one. (n,)"""
        if self.initial_covariance is None:
            return settled.prior
        given, joints = np.asarray(self.initial_covariance, np.float64), len(settled.prior.p11)
        if given.shape not in {(3,), (3, 1), (3, joints)}:
            told = f"initial_covariance of {self.name} has shape {given.shape}"
            raise ShapeError(f"{told}; expected (3, {joints}): P₁₁, P₁₂, P₂₂ of each joint")
        return Covariance(*np.broadcast_to(given.reshape(3, -1), (3, joints)))

    def tuning(self, step: float, joints: int) -> Tuning:
        """ω_n = (Q_τ/R)^¼, ζ = ½√(2 + Q_p/√(Q_τR)) of the effective densities, and the exact delay.

        Q and R are taken as the convention makes them at this sample time; the delay to a ramp is
        L₁/L₂ − Ts/2 with the discrete gains, exact for A_τ = 0.
        """
        d, model = self.densities(joints), self.model(step, joints)
        gains = self.steady(step, joints).gains
        # The convention scales all of Q alike, so Q₂₂/Ts (with A_τ = 0) is the effective density.
        literal = self.as_printed or self.noise_convention == "literal"
        scale = model.step if literal and self.discretisation == "fe" else np.ones(joints)
        r, q_p, q_tau = model.r * step, d.q_p * scale, d.q_tau * scale
        omega = (q_tau / r) ** 0.25
        zeta = 0.5 * np.sqrt(2.0 + q_p / np.sqrt(q_tau * r))
        bend = 1.0 - 2.0 * zeta**2
        ratio = gains.l1 / gains.l2
        return Tuning(
            omega_n=omega,
            zeta=zeta,
            delay=ratio - step / 2.0,
            bandwidth=omega * np.sqrt(bend + np.sqrt(bend**2 + 1.0)) / (2.0 * np.pi),
            dc_gain=step / (model.a12 + (1.0 - model.a22) * ratio),
            parameter_count=3 * joints,
        )

    def frequency_response(self, frequency: Array, step: float, joints: int) -> Complex:
        """Exact response to τ_ext = e^{jωt} whose integral, the momentum, is sampled. (F, n)"""
        model, gains = self.model(step, joints), self.steady(step, joints).gains
        omega = 2.0 * np.pi * np.asarray(frequency, dtype=np.float64)[:, None]
        omega = np.where(omega == 0.0, 1e-9, omega)
        back = np.exp(-1j * omega * step)
        (f11, f12), (f21, f22) = closed_loop(gains, model.a12, model.a22)
        # (I − F z⁻¹) x = L p: the second row of the inverse times L.
        determinant = (1.0 - f11 * back) * (1.0 - f22 * back) - f12 * f21 * back**2
        second = (f21 * back * gains.l1 + (1.0 - f11 * back) * gains.l2) / determinant
        response: Complex = second / (1j * omega)
        return response


def closed_loop(gains: Gains, a12: Array, a22: Array) -> Array:
    """Transition F = (I − LC)A of the filtered state, entry by entry. (2, 2, …)"""
    rest = 1.0 - gains.l1
    return np.array([[rest, rest * a12], [-gains.l2, a22 - gains.l2 * a12]])


def error_filter(gains: Gains, a12: Array, a22: Array) -> tuple[Array, Array]:
    """Transition (2, 2, …) and input (2, …) of the filter on its error e = p − p̂.

    Subtracting p from x̂ᵗ = (I−LC)(A x̂ᵗ⁻¹ + B u) + L pᵗ leaves one input, `DynamicsTerms.d`:

        eᵗ = (1−L₁)(eᵗ⁻¹ + dᵗ − A₁₂τ̂ᵗ⁻¹),  τ̂ᵗ = A₂₂τ̂ᵗ⁻¹ + L₂(eᵗ⁻¹ + dᵗ − A₁₂τ̂ᵗ⁻¹)

    from e⁰ = 0, τ̂⁰ = 0, which is x̂⁰ = [p⁰; 0]. It is the same filter without the cancellation of
    two large momenta.
    """
    (f11, f12), (f21, f22) = closed_loop(gains, a12, a22)
    return np.array([[f11, -f12], [-f21, f22]]), np.array([f11, gains.l2])
