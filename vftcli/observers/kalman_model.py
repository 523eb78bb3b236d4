r"""Disturbance Kalman filter: A, B, Q, R and L (36)–(44), settled or at every step.

For one joint: state x = [p; τ_ext], input μ, output p, ẋ = A_c x + B_c μ + w with
A_c = [[0, 1], [0, −a]]. With diagonal R and Q an n-joint filter is n such filters.

On a clock that jitters the gains follow every step. The covariance recursion runs over
all blocks of a piece side by side. The exact start of a block follows from the answer to
any other start: if the posterior P it starts from changes by Δ, its end changes by

    Φ Δ (I + O Δ)⁻¹ Φᵀ,  Φ ← (I − LC)A Φ,  O ← O + uuᵀ/S,  u = (CAΦ)ᵀ

with Φ and O from one pass from any start (the closed-loop transition, and the block's
information on its start). One pass from a guess, some rounds over the blocks' ends, and
one pass from the right starts equal the plain loop.

References:
    B. D. O. Anderson, J. B. Moore, "Optimal Filtering", Prentice-Hall, 1979, Sec. 4.5, for the
    difference of two solutions of a Riccati equation.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from vftcli.signals.arrays import Array, empty_series
from vftcli.signals.errors import ParameterError
from vftcli.signals.external_torque import DynamicsTerms
from vftcli.signals.steady_filter import Fold, moved, run_blocks, spans

#: Below this a·Ts the integrals are series: their closed forms cancel there.
SERIES = 1e-2
#: Relative change of the blocks' starts at which the rounds end.
SETTLED = 1e-15


class Densities(NamedTuple):
    """The filter's parameters, one a joint."""

    r: Array  #: Measurement noise of the momentum, R. (n,)
    q_p: Array  #: Process noise of the momentum, Q_p. (n,)
    q_tau: Array  #: Process noise of the external torque, Q_τ. (n,)
    decay: Array  #: a in A_τ = −a. (n,) [1/s]


class Discrete(NamedTuple):
    """A discrete two-state model, each entry (Ts, joint).

    A = [[1, a12], [0, a22]], B = [Ts; 0], process noise q11, q12, q22, measurement noise r.
    """

    step: Array
    a12: Array
    a22: Array
    q11: Array
    q12: Array
    q22: Array
    r: Array


def zero_order_hold(step: Array, d: Densities) -> Discrete:
    r"""Exact discretisation (43), (44), corrected lower-right block −A_cᵀ (Van Loan).

    Written out, with E(s) = (1 − e^{−as})/a and a → 0 in brackets:

        A₁₂ = E(Ts) [Ts],  A₂₂ = e^{−aTs} [1]
        Q̂₁₁ = Q_p Ts + Q_τ ∫E² ds [Q_τ Ts³/3],  Q̂₁₂ = Q_τ E²/2 [Q_τ Ts²/2],
        Q̂₂₂ = Q_τ (1 − e^{−2aTs})/(2a) [Q_τ Ts]
    """
    step, r, q_p, q_tau, a = np.broadcast_arrays(step, *d)
    reach, squared, integral = step, step, step * step * step / 3.0
    decay = np.ones_like(integral)
    if a.any():
        x = a * step
        some = np.where(x > 0.0, a, 1.0)
        reach = np.where(x > 0.0, -np.expm1(-x) / some, step)
        squared = np.where(x > 0.0, -np.expm1(-2.0 * x) / (2.0 * some), step)
        # ∫E² ds = (Ts − 2E + ∫e^{−2as})/a², as a series for small aTs.
        series = step**3 * (1 / 3 - x / 4 + 7 * x**2 / 60 - x**3 / 24 + 31 * x**4 / 2520)
        large = np.where(x > SERIES, a, 1.0)
        integral = np.where(x > SERIES, (step - 2.0 * reach + squared) / large**2, series)
        decay = np.exp(-x)
    q11, q12 = step * q_p + q_tau * integral, 0.5 * q_tau * reach * reach
    return Discrete(step, reach, decay, q11, q12, q_tau * squared, r)


SCHEMES = ("fe", "zoh")  #: Discretisations: forward Euler and zero-order hold.
#: Reading of R and Q; (42) as printed counts Ts twice, (44) does not.
NOISE_CONVENTIONS = {
    "density": "Q = Q̂, R = R/Ts: densities, the same filter at every rate",
    "discrete": "Q = Q̂, R = R: R is the variance of one sample (default of a file's gains)",
    "literal": "fe: Q = Ts·Q̂, R = R/Ts as (42) prints it; zoh: as density",
}


def discretise(scheme: str, convention: str, step: Array, d: Densities) -> Discrete:
    """The model of one of `SCHEMES` and one of `NOISE_CONVENTIONS`.

    For sample times [s], one or a column (T, 1). Forward Euler (41) is A = I + Ts·A_c,
    Q̂ = Ts·diag(Q_p, Q_τ), stable for aTs ≤ 2.
    """
    if scheme == "zoh":
        model = zero_order_hold(step, d)
    elif (worst := np.max(step * d.decay)) > 2.0:
        raise ParameterError(
            f"kfo-fe is unstable: decay·Ts = {worst:.3g} is above 2; "
            "choose a smaller kfo.decay or the observer kfo-zoh"
        )
    else:
        step, r, q_p, q_tau, a = np.broadcast_arrays(step, *d)
        twice = step if convention == "literal" else 1.0
        q11, q22 = twice * step * q_p, twice * step * q_tau
        model = Discrete(step, step, 1.0 - step * a, q11, 0.0 * q11, q22, r)
    return model if convention == "discrete" else model._replace(r=model.r / model.step)


class Covariance(NamedTuple):
    """Entries of a symmetric covariance of [p; τ_ext], as of `Gains`."""

    p11: Array
    p12: Array
    p22: Array


class Gains(NamedTuple):
    """Filtered gains and their covariances, one a joint (and sample)."""

    l1: Array  #: L₁ of the momentum.
    l2: Array  #: L₂ of the torque. [1/s]
    p11: Array  #: Covariance after the update, entry by entry.
    p12: Array
    p22: Array
    S: Array  #: Variance of the innovation.

    @property
    def posterior(self) -> Covariance:
        """Covariance after the update."""
        return Covariance(self.p11, self.p12, self.p22)


class KalmanState(NamedTuple):
    """State of a Kalman observer after a block of a log."""

    error: Array  #: e = p − p̂ [kg·m²/s] and τ̂ [N·m]. (2, n)
    posterior: Array  #: Their covariance's entries. (3, n); (2, 2, n) of (44) as printed


def steady(model: Discrete, decay: Array) -> Gains:
    """Gains of the stationary filter, by the discrete Riccati equation.

    The stabilising solution. For A_τ = 0 in closed form, λ = Ts√(Q₂₂/R),
    β = (Q₁₁ − TsQ₁₂)/R, y = ½(λ + √(λ² + 16 + 4β)), r = ½(y − √(y² − 4)), L₁ = 1 − r²,
    L₂ = λr/Ts; for A_τ ≠ 0 by SciPy's solver, joint by joint. The prior follows from the
    gains: P₁₁ = R L₁/(1−L₁), P₁₂ = R L₂/(1−L₁).
    """
    step, a12, a22, q11, q12, q22, R = model
    if np.any(decay > 0.0):
        from scipy.linalg import solve_discrete_are

        Ps = []
        for j in range(len(step)):
            A, Q = [[1.0, a12[j]], [0.0, a22[j]]], [[q11[j], q12[j]], [q12[j], q22[j]]]
            Ps.append(solve_discrete_are(np.transpose(A), [[1.0], [0.0]], Q, [[R[j]]]))
        (p11, p12), (_, p22) = np.transpose(Ps, (1, 2, 0))
    else:
        lam, beta = step * np.sqrt(q22 / R), (q11 - step * q12) / R
        y = 0.5 * (lam + np.sqrt(lam**2 + 16.0 + 4.0 * beta))
        # Near r = 1 the plain forms lose digits.
        root = np.sqrt(np.maximum((y - 2.0) * (y + 2.0), 0.0))
        r = 2.0 / (y + root)
        l1, l2 = r * root, lam * r / step
        p11, p12 = R * l1 / r**2, R * l2 / r**2
        p22 = (R * l2 * root / r - q12) / step + q22
    return update(Covariance(p11, p12, p22), R)


def predict(P: Covariance, model: Discrete) -> Covariance:
    """Covariance before the next measurement, P⁻ = A P Aᵀ + Q."""
    carried = P.p12 + model.a12 * P.p22
    return Covariance(
        P.p11 + model.a12 * (P.p12 + carried) + model.q11,
        model.a22 * carried + model.q12,
        model.a22 * model.a22 * P.p22 + model.q22,
    )


def update(prior: Covariance, r: Array) -> Gains:
    """Gains for a measured momentum, and the covariance after it."""
    S = prior.p11 + r
    l1, l2 = prior.p11 / S, prior.p12 / S
    # Joseph's form: an error of L₂ counts squared. R L₁ = (1 − L₁)P₁₁ in every digit.
    p22 = prior.p22 - l2 * (2.0 * prior.p12 - l2 * S)
    return Gains(l1, l2, r * l1, r * l2, p22, S)


def closed_loop(gains: Gains, model: Discrete) -> Array:
    """Transition F = (I − LC)A of the filtered state, entry by entry. (2, 2, …)"""
    rest = 1.0 - gains.l1
    return np.array([[rest, rest * model.a12], [-gains.l2, model.a22 - gains.l2 * model.a12]])


def error_filter(gains: Gains, model: Discrete) -> tuple[Array, Array]:
    """Transition (2, 2, …) and input (2, …) of the filter on its error e = p − p̂.

    Subtracting p from x̂ᵗ = (I−LC)(A x̂ᵗ⁻¹ + B u) + L pᵗ leaves the input `DynamicsTerms.d`:

        eᵗ = (1−L₁)(eᵗ⁻¹ + dᵗ − A₁₂τ̂ᵗ⁻¹),  τ̂ᵗ = A₂₂τ̂ᵗ⁻¹ + L₂(eᵗ⁻¹ + dᵗ − A₁₂τ̂ᵗ⁻¹)

    from e⁰ = 0, τ̂⁰ = 0, hence x̂⁰ = [p⁰; 0]: the same filter without large momenta.
    """
    (f11, f12), (f21, f22) = closed_loop(gains, model)
    return np.array([[f11, -f12], [-f21, f22]]), np.array([f11, gains.l2])


def settle(model: Discrete, entering: Covariance, guess: Covariance) -> Gains:
    """Gains of one piece, with its models in blocks. (length, n, blocks) each

    `entering` is the covariance before the piece, `guess` the blocks' first start. (n,)
    """
    blocks = model.r.shape[2]
    starts = np.stack(guess)[..., None].repeat(blocks, axis=2)
    starts[..., 0] = entering
    if blocks > 1:
        guessed, P = starts.copy(), Covariance(*starts)
        information, phi = np.zeros((2, 2, 2, *P.p11.shape))
        phi[0, 0] = phi[1, 1] = 1.0
        for step in map(Discrete._make, zip(*model, strict=True)):
            gains = update(predict(P, step), step.r)
            P = gains.posterior
            u = phi[0] + step.a12 * phi[1]
            information += u[:, None] * u / gains.S
            phi[0] = step.r / gains.S * u
            phi[1] = step.a22 * phi[1] - gains.l2 * u
        end, ((o11, o12), (_, o22)) = np.stack(P), information
        # After k rounds the first k blocks are exact.
        for _ in range(blocks):
            # A start changed by Δ: X = Δ(I + OΔ)⁻¹ in full.
            a, b, c = starts - guessed
            delta = a * c - b * b
            whole = 1.0 + o11 * a + 2.0 * o12 * b + o22 * c + (o11 * o22 - o12 * o12) * delta
            cross = b - o12 * delta
            X = np.array([[a + o22 * delta, cross], [cross, c + o11 * delta]]) / whole
            gained = moved(phi, moved(phi, X).swapaxes(0, 1))
            new = (end + gained[(0, 0, 1), (0, 1, 1)])[..., :-1]
            change = abs(new - starts[..., 1:]) / np.maximum(abs(new), np.finfo(float).tiny)
            starts[..., 1:] = new
            if change.max() <= SETTLED:
                break
    each, P = list[Gains](), Covariance(*starts)
    for step in map(Discrete._make, zip(*model, strict=True)):
        each.append(update(predict(P, step), step.r))
        P = each[-1].posterior
    return Gains(*map(np.stack, zip(*each, strict=True)))


def kalman_steps(
    terms: DynamicsTerms,
    d: Array,
    model_of: Callable[[Array, Densities], Discrete],
    densities: Densities,
    guess: Covariance,
    state: KalmanState,
    *,
    begins: bool,
) -> tuple[Array, Array, KalmanState]:
    """τ̂ and √P₂₂ of a block with the input d [N·m·s], gains step by step. (T, n)

    `guess` is the stationary posterior (n,), `state` that before the block.
    """
    samples, n = d.shape
    tau, sd = empty_series(samples, n), empty_series(samples, n)
    error, posterior = state
    if begins:
        tau[0], sd[0] = 0.0, np.sqrt(posterior[2])
    # One of each kind: joints with equal numbers have equal gains.
    numbers = np.stack([*densities, *posterior])
    _, kept, kind = np.unique(numbers, axis=1, return_index=True, return_inverse=True)
    kind = kind.ravel()
    own = Densities(*(x[kept, None] for x in densities))
    guess, entering = (Covariance(*(p[kept] for p in each)) for each in (guess, posterior))
    for span in spans(samples, begins=begins):
        fold = Fold.of(span.stop - span.start)
        # Rows of one size need no iterator.
        model = model_of(fold.fold(terms.dt[span]), own)
        model = Discrete(model.step, *map(np.ascontiguousarray, model[1:]))
        gains = settle(model, entering, guess)
        entering = Covariance(*map(fold.last, gains.posterior))
        F, g = error_filter(gains, model)
        states = run_blocks(F, g[:, :, kind] * fold.fold(d[span]), error, kind)
        error = fold.last(states)
        tau[span] = fold.unfold(states[1])
        sd.T[:, span] = fold.unfold(np.sqrt(gains.p22)).T[kind]
    return tau, sd, KalmanState(error, np.stack([p[kind] for p in entering]))
