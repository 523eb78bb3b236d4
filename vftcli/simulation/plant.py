"""The arm itself: rigid-body dynamics with rotor inertia and true friction, integrated in time.

Dry friction: in M̃ (v⁺ − v) = g − λ, |λ_j| ≤ ℓ_j, a sliding joint has λ_j = ℓ_j sign(v⁺_j), a
sticking one v⁺_j = 0. M̃ is positive definite: there is one solution. (J. J. Moreau, "Unilateral
contact and dry friction in finite freedom dynamics", 1988.)
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from vftcli.signals.arrays import Array
from vftcli.signals.errors import ParameterError
from vftcli.simulation.friction import TrueFriction

LARGEST_STEP = 1e-3  #: Largest inner step. [s]
GUESSES = 12  #: Active-set guesses before the slower sweeps that always converge take over.
SWEEPS = 2000
#: Torque of the contacts (n,) [N·m] from the Pinocchio model and data (joint Jacobians and
#: placements are current) and the velocities, at the middle of the step.
External = Callable[[Any, Any, Array], Array]


class Plant:
    """State of the arm and one step of its motion.

    Moreau's midpoint scheme: with q_m = q + h/2 v and v_m extrapolated half a step ahead,

    (M(q_m) + h/2 D) (v⁺ − v) = h (τ + τ_ext − C v_m − g − f_smooth(v)) − λ,   q⁺ = q + h/2 (v + v⁺)

    λ is the impulse of dry friction, D the slope of the smooth one; of second order in h while no
    joint begins to stick or slide. Presliding friction is evaluated at q_m. For q_mid, v_mid and a
    the last step's balance M a + C v + g = τ + τ_ext − τ_f holds exactly; `friction` is against
    positive motion, `centre` the c of the play operator.
    """

    def __init__(
        self,
        model: Any,  # noqa: ANN401 - Pinocchio is untyped
        friction: TrueFriction,
        q: Array,
        v: Array,
        step: float,
    ) -> None:
        import pinocchio as pin

        if not 0.0 < step <= LARGEST_STEP:
            raise ParameterError(
                f"step is {step:g} s; the inner step must be above 0, at most {LARGEST_STEP:g} s"
            )
        self.pin, self.model, self.data = pin, model, model.createData()
        self.true_friction, self.step = friction, step
        self.q, self.v = np.array(q, dtype=float), np.array(v, dtype=float)
        self.q_mid, self.v_mid, self.centre = self.q.copy(), self.v.copy(), self.q.copy()
        self.a, self.friction, self.external = np.zeros((3, len(self.q)))
        self.moved = False
        sticks = (friction.coulomb > 0.0) & (friction.presliding == 0.0)
        self.signs = np.where(sticks, np.sign(self.v), 1.0)

    def advance(self, tau: Array, external: External | None = None) -> None:
        """Move one step on under drive torques `tau` (n,) [N·m] and the contacts' torque."""
        # The midpoint velocity extrapolates the last acceleration; the first step has none yet.
        if not self.moved:
            signs = self.signs
            self.a = (self.impulses(tau, external) - self.v) / self.step
            self.signs, self.moved = signs, True
        after = self.impulses(tau, external)
        self.a = (after - self.v) / self.step
        self.q = self.q + 0.5 * self.step * (self.v + after)
        self.v = after

    def impulses(self, tau: Array, external: External | None) -> Array:
        """Velocities after the step, v_m extrapolated with the acceleration known so far. (n,)"""
        h, pin, model, data = self.step, self.pin, self.model, self.data
        q_mid = self.q + 0.5 * h * self.v
        v_mid = self.v + 0.5 * h * self.a
        v_mid[self.signs == 0.0] = 0.0
        bias = pin.nonLinearEffects(model, data, q_mid, v_mid)
        M = pin.crba(model, data, q_mid)
        true = self.true_friction
        smooth, slope = true.smooth(self.v)
        load = (
            pin.computeGeneralizedGravity(model, data, q_mid)
            if "load_coulomb" in true.present
            else None
        )
        dry = true.dry(self.v, load)
        if "presliding" in true.present:
            creeping, steep, dry = true.creep(self.v, dry)
            # The play operator's centre follows the positions.
            reach = true.presliding_length
            self.centre = np.minimum(np.maximum(self.centre, q_mid - reach), q_mid + reach)
            given = np.asarray(true.presliding * (q_mid - self.centre) / reach)
            smooth, slope = smooth + creeping + given, slope + steep
        torque = tau - bias - smooth
        if external is not None:
            pin.computeJointJacobians(model, data, q_mid)
            self.external = external(model, data, v_mid)
            torque = torque + self.external
        M.flat[:: len(slope) + 1] += 0.5 * h * slope
        after, impulse, self.signs = slide_or_stick(M, h * torque, self.v, h * dry, self.signs)
        self.friction = smooth + 0.5 * slope * (after - self.v) + impulse / h
        self.q_mid, self.v_mid = q_mid, v_mid
        return after


def slide_or_stick(
    M: Array, impulse: Array, v: Array, limit: Array, signs: Array
) -> tuple[Array, Array, Array]:
    """Velocities after the step, friction impulses, and the direction each joint slides in.

    M̃ (n, n) [kg·m²], impulse g of everything but dry friction, velocities v before the step,
    largest impulses ℓ of dry friction, directions of the step before as a guess, 0 sticks. (n,)
    """
    from scipy.linalg.lapack import dposv

    for _ in range(GUESSES):
        # While every joint slides, as mostly, one Cholesky solve settles the step.
        if signs.all():
            _, step, _ = dposv(M, impulse - limit * signs)
            after = v + step
            wrong = (after * signs < 0.0) & (limit > 0.0)
            if not wrong.any():
                return after, limit * signs, signs
            signs = np.where(wrong, 0.0, signs)
            continue
        # Else those with sign 0 stop.
        stuck, free = signs == 0.0, signs != 0.0
        stop, step = -v[stuck], np.zeros(np.count_nonzero(free))
        after, friction, better = np.zeros_like(v), limit * signs, signs.copy()
        if step.size:
            rows = M[free]
            right = impulse[free] - friction[free] - rows[:, stuck] @ stop
            step = np.linalg.solve(rows[:, free], right)
            after[free] = v[free] + step
        rows = M[stuck]
        friction[stuck] = impulse[stuck] - rows[:, free] @ step - rows[:, stuck] @ stop
        better[free & (after * signs < 0.0) & (limit > 0.0)] = 0.0
        breaks = stuck & (np.abs(friction) > limit)
        better[breaks] = np.where(friction[breaks] < 0.0, -1.0, 1.0)
        if np.array_equal(better, signs):
            return after, friction, signs
        signs = better
    return gauss_seidel(M, impulse, v, limit)


def gauss_seidel(M: Array, impulse: Array, v: Array, limit: Array) -> tuple[Array, Array, Array]:
    """The same step by projected Gauss–Seidel, which always converges."""
    A = np.linalg.inv(M)
    free = v + A @ impulse
    friction = np.zeros_like(v)
    for _ in range(SWEEPS):
        before = friction.copy()
        for j in range(len(v)):
            slip = free[j] - A[j] @ friction
            friction[j] = np.clip(friction[j] + slip / A[j, j], -limit[j], limit[j])
        if np.max(np.abs(friction - before)) <= 1e-14 * (1.0 + np.max(np.abs(friction))):
            break
    after = free - A @ friction
    after[np.abs(friction) < limit] = 0.0
    signs = np.where(np.abs(friction) < limit, 0.0, np.where(friction < 0.0, -1.0, 1.0))
    return after, friction, signs
