r"""The paper's four observers: filtered dynamics, momentum, two Kalman filters.

All rest on :math:`\dot p = \mu + \tau_{ext}` (33) with p = M q̇ and
μ = τ + Cᵀq̇ − g − F_f. Their one input is a sample's momentum beyond the model:

    dᵗ = pᵗ − pᵗ⁻¹ − ½Ts(μᵗ + μᵗ⁻¹).

    FDO, GMO   τ̂ᵗ = [(1−a)τ̂ᵗ⁻¹ + K dᵗ]/(1+a),  a = ½K Ts
    KFO        νᵗ = eᵗ⁻¹ + dᵗ − A₁₂τ̂ᵗ⁻¹,  eᵗ = (1−L₁)νᵗ,  τ̂ᵗ = A₂₂τ̂ᵗ⁻¹ + L₂νᵗ

from zero at the log's first sample. `kalman_model` holds A, Q, R and L, `as_printed` errata.
"""

from abc import abstractmethod
from collections.abc import Callable
from functools import cached_property, partial
from typing import Any, ClassVar, NamedTuple

import numpy as np

from vftcli.observers.as_printed import (
    printed_dynamics_input,
    printed_momentum,
    printed_steady,
)
from vftcli.observers.kalman_model import (
    NOISE_CONVENTIONS,
    SCHEMES,
    Covariance,
    Densities,
    Discrete,
    Gains,
    KalmanState,
    closed_loop,
    discretise,
    error_filter,
    kalman_steps,
    predict,
    steady,
    update,
)
from vftcli.observers.observer import Complex, Tuning
from vftcli.signals.arrays import Array, frozen, handed_over, number_array, one_each
from vftcli.signals.errors import ParameterError, ShapeError
from vftcli.signals.external_torque import DynamicsTerms, ExternalTorque, one_sample_earlier
from vftcli.signals.parsing import check_kind, check_known
from vftcli.signals.remarks import caution, on_joints, warning
from vftcli.signals.shown import Shown, record
from vftcli.signals.steady_filter import recursion, steady_filter

GAP = 3.0  #: A step of more than this many nominal ones is a gap.
#: Weights of the external torque in a Kalman filter's two states. (2, 1)
TORQUE = np.array([[0.0], [1.0]])


class BlockObserver(Shown):
    """An observer that continues after the last block; a log is one block."""

    @property
    @abstractmethod
    def name(self) -> str:
        """Its name at the command line."""

    @abstractmethod
    def run(self, terms: DynamicsTerms, state: Any = None) -> tuple[ExternalTorque, Any]:  # noqa: ANN401
        """Estimate of a block, and the observer's state; None at a log's start."""

    def estimate(self, terms: Any) -> ExternalTorque:  # noqa: ANN401 - DynamicsTerms, or a Run
        """The estimate of a whole log, from rest, by its terms or its run."""
        found = getattr(terms, "terms", terms)
        check_kind(found, DynamicsTerms, "run", "Run(recording=…, robot=…)")
        return self.run(found)[0]

    def estimated(self, terms: DynamicsTerms, tau: Array, **more: Any) -> ExternalTorque:  # noqa: ANN401
        """An estimate (T, n) [N·m] under the observer's name."""
        return ExternalTorque(name=self.name, t=terms.t, tau=handed_over(tau), **more)


def angular(frequency: Array) -> Array:
    """ω of frequencies [Hz], nearly zero at 0 Hz, for limits. (F, 1) [rad/s]"""
    omega = 2.0 * np.pi * np.asarray(frequency, float)[:, None]
    return np.where(omega == 0.0, 1e-9, omega)


class FirstOrderState(NamedTuple):
    """State of a first-order observer after a block of a log."""

    states: Array  #: Its states, the estimate first. (m, n) [N·m]
    gaps: int = 0  #: Number of gaps with a restart.
    longest: float = 0.0  #: The longest of them. [s]


class FirstOrderObserver(BlockObserver):
    """τ̂ᵗ = [(1−a)τ̂ᵗ⁻¹ + K dᵗ]/(1+a), a = K·Ts/2, common to FDO and GMO.

    Past a gap (`GAP` nominal steps) with a > 1 the state would change its sign: there the
    filter starts afresh, with a remark, unless a > 1 at the nominal step.
    """

    @abstractmethod
    def rates(self, joints: int) -> Array:
        """K, or ω, of every joint. (n,) [1/s]"""

    def run_corrected(
        self,
        terms: DynamicsTerms,
        state: FirstOrderState | None,
        d: Array,
        afresh: Array | None = None,
    ) -> tuple[ExternalTorque, FirstOrderState]:
        """Estimate by an input (T, n) [N·m·s], after a gap `afresh` (T, n) [N·m]."""
        before, gaps, longest = state or FirstOrderState(np.zeros((1, terms.joints)))
        rate, clock = self.rates(terms.joints), terms.clock
        a = 0.5 * (rate[:, None] * terms.dt[:, 0]).T  # columns whole
        decay, gain = ((1.0 - a) / (1.0 + a))[None], (rate / (1.0 + a))[None]
        if clock.uniform:
            tau, end = steady_filter(decay, gain[0], d, before, wanted=np.ones((1, 1)))
        else:
            x = gain * d
            late = (terms.dt > GAP * clock.step) & (a > 1.0) & (0.5 * clock.step * rate <= 1.0)
            if late.any():
                decay[0, late], x[0, late] = 0.0, 0.0 if afresh is None else afresh[late]
                rows = late.any(axis=1)
                gaps, longest = gaps + int(rows.sum()), max(longest, float(terms.dt[rows].max()))
            tau = recursion(decay[None], x, before)[0]
            end = tau[-1:]
        said = caution("restarted-after-gaps", gaps=gaps, longest_s=longest)
        remarks = (said,) if gaps else ()
        return self.estimated(terms, tau, remarks=remarks), FirstOrderState(end, gaps, longest)

    def tuning(self, step: float, joints: int) -> Tuning:
        """Cutoff, delay 1/K and −3 dB frequency at a sample time. [s]

        The bilinear transform warps frequency: tan(ωTs/2) = K·Ts/2 at the −3 dB point of
        the filter alone; `frequency_response` has sampled momentum exactly.
        """
        rate = self.rates(joints)
        return Tuning(
            omega_n=rate,
            zeta=np.full(joints, np.nan),
            delay=1.0 / rate,
            bandwidth=np.arctan(rate * step / 2.0) / (np.pi * step),
            dc_gain=np.ones(joints),
            parameter_count=1 if self.name == "fdo" else joints,
        )

    def frequency_response(self, frequency: Array, step: float, joints: int) -> Complex:
        """Exact gain to τ_ext = e^{jωt} from its sampled integral. (F, n) of [Hz]"""
        rate, omega = self.rates(joints), angular(frequency)
        back, a = np.exp(-1j * omega * step), 0.5 * step * rate
        response: Complex = rate * (1.0 - back) / ((1.0 + a) - (1.0 - a) * back) / (1j * omega)
        return response


@record
class FilteredDynamicsObserver(FirstOrderObserver):
    r"""FDO (19)–(29): low-pass filtered :math:`\dot p - \mu`, no derivative.

    τ̂ = F₁{−μ} + F₂{p} + ωp with F₁ = ω/(s+ω) and F₂ = −ω²/(s+ω), discretised by the
    bilinear transform with a = ωTs/2 (27)–(29):

        Y₁ᵗ = k₁Y₁ᵗ⁻¹ − k₂(μᵗ + μᵗ⁻¹),  Y₂ᵗ = k₁Y₂ᵗ⁻¹ + k₃(pᵗ + pᵗ⁻¹),  τ̂ = Y₁ + Y₂ + ωp

    k₁ = (1−a)/(1+a), k₂ = a/(1+a), k₃ = −ωa/(1+a), from Y₁⁰ = 0 and Y₂⁰ = −ωp⁰, so that
    τ̂⁰ = 0. With k₃ + ω = ω/(1+a) and k₃ − k₁ω = −ω/(1+a) they are the momentum observer
    with K = ω, at every sample time. The printed k₃ and start are errata: `as_printed`.

    Raises:
        ParameterError: If the cutoff is not positive.
    """

    name: ClassVar[str] = "fdo"
    omega: float = 10.0  #: Cutoff ω of all joints. [rad/s]
    as_printed: bool = False  #: Use the printed k₃ and start.

    def __post_init__(self) -> None:
        if np.size(number_array(self.omega, "omega", self.name)) != 1:
            raise ShapeError(f"fdo.omega is {self.omega!r}; expected one number for all joints")
        if not (np.isfinite(self.omega) and self.omega > 0):
            raise ParameterError(f"fdo.omega is {self.omega:g} rad/s; it must be positive")

    def rates(self, joints: int) -> Array:
        """ω of every joint. (n,) [rad/s]"""
        return np.full(joints, self.omega)

    def run(
        self, terms: DynamicsTerms, state: FirstOrderState | None = None
    ) -> tuple[ExternalTorque, FirstOrderState]:
        """A block's estimate after a state; None at the log's start."""
        if not self.as_printed:
            return self.run_corrected(terms, state, terms.d)
        d = printed_dynamics_input(terms, self.omega, begins=state is None)
        return self.run_corrected(terms, state, d, afresh=self.omega * terms.p)


@record
class MomentumObserver(FirstOrderObserver):
    r"""GMO (30)–(35): residual of the momentum balance.

    With :math:`\dot r = K(\dot p - \mu - r)`, discretised by the implicit trapezoidal rule,
    a = K·Ts/2, stable for every gain:

        rᵗ = [(1−a)rᵗ⁻¹ + K(pᵗ − pᵗ⁻¹) − a(μᵗ + μᵗ⁻¹)]/(1+a) = [(1−a)rᵗ⁻¹ + K dᵗ]/(1+a),  r⁰ = 0

    (35) as printed feeds back a sample late, unstable from K·Ts = 2: `as_printed`.

    Raises:
        ParameterError: If a gain is not positive.
    """

    name: ClassVar[str] = "gmo"
    gain: Array | float = 10.0  #: Bandwidth K, one or one a joint. (n,) [1/s]
    as_printed: bool = False  #: Feed back a sample late, as (35) is printed.

    def __post_init__(self) -> None:
        gain = np.atleast_1d(number_array(self.gain, "gain", self.name))
        object.__setattr__(self, "gain", frozen(gain))
        if not (np.isfinite(gain) & (gain > 0)).all():
            raise ParameterError(f"gmo.gain is {gain.tolist()} 1/s; every gain must be positive")

    def rates(self, joints: int) -> Array:
        """K of every joint. (n,) [1/s]"""
        return one_each(self.gain, joints, "gmo.gain")

    def run(
        self, terms: DynamicsTerms, state: FirstOrderState | None = None
    ) -> tuple[ExternalTorque, FirstOrderState]:
        """A block's estimate after a state; None at the log's start."""
        if not self.as_printed:
            return self.run_corrected(terms, state, terms.d)
        gain = self.rates(terms.joints)
        start = np.zeros((2, terms.joints)) if state is None else state.states
        tau, end = printed_momentum(terms, gain, start)
        unstable = 0.5 * terms.clock.step * gain >= 1.0
        said = warning("unstable-as-printed", on_joints(unstable))
        remarks = (said,) if unstable.any() else ()
        return self.estimated(terms, tau, remarks=remarks), FirstOrderState(end)


@record
class KalmanObserver(BlockObserver):
    r"""KFO (36)–(44): Kalman filter on x = [p; τ_ext].

    ṗ = μ + τ_ext + w_p, τ̇_ext = A_ττ_ext + w_τ.

    With diagonal R, Q_p and Q_τ it is n two-state filters with gains independent of data.
    The input is the trapezoid ½(μᵗ + μᵗ⁻¹). The first sample is x̂⁰ = [p⁰; 0] with the
    stationary prior: no transient of the gains at a constant sample time. On an uneven
    clock each step has its own A, B, Q and R, but by (44) as printed. The estimate's `sd` is
    the filter's √P₂₂.

    For A_τ = 0, A_c² = 0 and both discretisations share A and B; only Q differs.

    Raises:
        ParameterError: If a variance is not positive, or a name is unknown.
    """

    discretisation: str = "fe"  #: "fe" (41), (42) or "zoh" (43), (44).
    r_diag: Array | float = 0.5  #: R, one or one a joint. (n,) [(N·m·s)²·s under "density"]
    q_p_diag: Array | float = 0.01  #: Q_p. (n,) [(N·m)²·s]
    q_tau_diag: Array | float = 5000.0  #: Q_τ. (n,) [(N·m)²/s]
    decay: Array | float = 0.0  #: a in A_τ = −a, of either sign. (n,) [1/s]
    noise_convention: str = "density"  #: A key of `NOISE_CONVENTIONS`.
    #: Use μᵗ alone (40), the literal noise convention, (44)'s printed block.
    as_printed: bool = False

    def __post_init__(self) -> None:
        scheme, convention = self.discretisation, self.noise_convention
        check_known(scheme, SCHEMES, f"discretisation {scheme!r}")
        check_known(convention, NOISE_CONVENTIONS, f"kfo.noise_convention is {convention!r}")
        for name in ("r_diag", "q_p_diag", "q_tau_diag", "decay"):
            value = np.atleast_1d(number_array(getattr(self, name), name, self.name))
            # The paper gives A_τ = −a, its tables a: either sign is this decay.
            value = abs(value) if name == "decay" else value
            object.__setattr__(self, name, frozen(value))
            allowed = (value > 0) | ((value == 0) & (name in {"q_p_diag", "decay"}))
            if not (np.isfinite(value) & allowed).all():
                raise ParameterError(
                    f"kfo.{name} is {value.tolist()}; R and Q_τ must be positive, Q_p and "
                    "decay must not be negative"
                )

    @cached_property
    def name(self) -> str:
        """kfo-fe or kfo-zoh."""
        return f"kfo-{self.discretisation}"

    def run(
        self, terms: DynamicsTerms, state: KalmanState | None = None
    ) -> tuple[ExternalTorque, KalmanState]:
        """A block's estimate after a state; None at the log's start."""
        n, step, begins = terms.joints, terms.clock.step, state is None
        d = self.unexplained(terms)
        zero, densities, settled = np.zeros((2, n)), self.densities(n), self.steady(step, n)
        if terms.clock.uniform or self.prints_hold:
            F, g = error_filter(settled, self.model(step, n))
            start = zero if state is None else state.error
            tau, end = steady_filter(F, g, d, start, wanted=TORQUE)
            sd = np.broadcast_to(handed_over(np.sqrt(settled.p22)), tau.shape)
            state = KalmanState(end, np.stack(settled.posterior))
        else:
            if state is None:
                prior, first = self.first_prior(step, n), self.model(terms.dt[:1], n).r[0]
                state = KalmanState(zero, np.stack(update(prior, first).posterior))
            guess = settled.posterior
            tau, sd, state = kalman_steps(
                terms, d, self._discretise, densities, guess, state, begins=begins
            )
        return self.estimated(terms, tau, sd=handed_over(sd)), state

    def densities(self, joints: int) -> Densities:
        """The parameters, one a joint."""
        names = ("r_diag", "q_p_diag", "q_tau_diag", "decay")
        return Densities(*(one_each(getattr(self, k), joints, f"kfo.{k}") for k in names))

    def model(self, step: Array | float, joints: int) -> Discrete:
        """Discrete model at one sample time, or at each as a column (T, 1). [s]"""
        return self._discretise(np.asarray(step, float), self.densities(joints))

    @property
    def _discretise(self) -> Callable[[Array, Densities], Discrete]:
        """The discrete model of sample times and joints."""
        convention = "literal" if self.as_printed else self.noise_convention
        return partial(discretise, self.discretisation, convention)

    def steady(self, step: float, joints: int) -> Gains:
        """Stationary gains and covariances at a sample time. [s]"""
        model, densities = self.model(step, joints), self.densities(joints)
        if self.prints_hold:
            return printed_steady(model, densities)
        return steady(model, densities.decay)

    @property
    def prints_hold(self) -> bool:
        """Whether its noise is (44)'s as printed."""
        return self.as_printed and self.discretisation == "zoh"

    def unexplained(self, terms: DynamicsTerms) -> Array:
        """Input pᵗ − pᵗ⁻¹ − Ts·u: `DynamicsTerms.d`, or u = μᵗ (40). (T, n)"""
        if not self.as_printed:
            return terms.d
        return terms.d + 0.5 * terms.dt * (one_sample_earlier(terms, "mu") - terms.mu)

    def first_prior(self, step: float, joints: int) -> Covariance:
        """Stationary covariance before the first update. [s] → (n,)"""
        return predict(self.steady(step, joints).posterior, self.model(step, joints))

    def tuning(self, step: float, joints: int) -> Tuning:
        """ω_n = (Q_τ/R)^¼, ζ = ½√(2 + Q_p/√(Q_τR)), exact delay.

        Q and R are the convention's effective densities at this sample time; the delay to
        a ramp is L₁/L₂ − Ts/2 with the discrete gains, exact for A_τ = 0.
        """
        d, model = self.densities(joints), self.model(step, joints)
        gains = self.steady(step, joints)
        # The convention scales Q: Q₂₂/Ts (with A_τ = 0) is the effective density.
        literal = self.as_printed or self.noise_convention == "literal"
        scale = step if literal and self.discretisation == "fe" else 1.0
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
        """Exact response to τ_ext = e^{jωt} from its sampled integral. (F, n) of [Hz]"""
        model, omega = self.model(step, joints), angular(frequency)
        gains = self.steady(step, joints)
        back = np.exp(-1j * omega * step)
        (f11, f12), (f21, f22) = closed_loop(gains, model)
        # (I − F z⁻¹) x = L p: the inverse's second row times L.
        determinant = (1.0 - f11 * back) * (1.0 - f22 * back) - f12 * f21 * back**2
        second = (f21 * back * gains.l1 + (1.0 - f11 * back) * gains.l2) / determinant
        return np.asarray(second / (1j * omega))
