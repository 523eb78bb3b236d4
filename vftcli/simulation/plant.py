"""The arm itself: rigid-body dynamics, rotor inertia, true friction, integrated.

Friction is τ_f = λ + a·s(q) + smooth(q̇), with λ ∈ F_c(q̇, g)·Sgn(q̇) set-valued at rest
(Coulomb, load and Stribeck), s the state of the play operator
(`vftcli.robots.friction`) and λ = F_c(q̇, g) tanh(q̇/v₀) where a > 0: such a
joint holds a·s at rest, v₀ is `CREEP`; smooth(q̇) = offset + f_v q̇ + f_2 q̇|q̇| + a ln(1
+ |q̇|/b) sign(q̇) + sign(q̇) Σ_k m_k max(|q̇| − v_k, 0) + sigmoid(q̇).

Dry friction: in M̃ (v⁺ − v) = g − λ, |λ_j| ≤ ℓ_j, a sliding joint has λ_j = ℓ_j
sign(v⁺_j), a sticking one v⁺_j = 0. M̃ is positive definite: there is one solution. (J.
J. Moreau, "Unilateral contact and dry friction in finite freedom dynamics", 1988.)
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from vftcli.robots.robot import JointFriction, Robot
from vftcli.robots.robot_file import out_of_bounds
from vftcli.signals.arrays import Array
from vftcli.signals.errors import ParameterError
from vftcli.simulation.scenario import FrictionSpec

SHAPES = (
    *("coulomb", "viscous", "quadratic", "offset", "logarithmic", "logarithmic_velocity"),
    *("amplitude", "slope", "shift", "load_coulomb", "presliding", "presliding_length"),
)

#: What does not grow with the speed for ever.
DRY = ("coulomb", "load_coulomb", "presliding", "amplitude")
WET = ("viscous", "quadratic", "logarithmic", "bend_slopes")  #: What does: the film of oil.
#: Below it a soft joint's dry friction fades: on a UR10e 3 mrad/s leave least. [rad/s]
CREEP = 3e-3
LARGEST_STEP = 1e-3  #: Largest inner step. [s]
GUESSES = 12  #: Active-set guesses before the slower way that always converges.
#: Torque of the contacts (n,) [N·m] amid a step, of current Pinocchio data and velocities.
External = Callable[[Any, Any, Array], Array]


@dataclass(frozen=True, kw_only=True)
class TrueFriction:
    """Friction parameters of an n-joint arm. (n,) each"""

    coulomb: Array  #: Dry friction while sliding. [N·m]
    viscous: Array  #: Viscous coefficient. [N·m·s/rad]
    quadratic: Array  #: Signed quadratic coefficient. [N·m·s²/rad²]
    offset: Array  #: Torque independent of motion. [N·m]
    logarithmic: Array  #: Logarithmic rise a. [N·m]
    logarithmic_velocity: Array  #: Velocity b from which it flattens. [rad/s]
    amplitude: Array  #: Amplitude of the sigmoid. [N·m]
    slope: Array  #: Slope of the sigmoid. [s/rad]
    shift: Array  #: Shift of the sigmoid. [rad/s]
    load_coulomb: Array  #: Growth of the dry friction with the load. [1]
    presliding: Array  #: Presliding friction at full deflection. [N·m]
    presliding_length: Array  #: Deflection s₀ at which it is full. [rad]
    bends: Array  #: Speeds v_k of a bent line's bends. (K, n) [rad/s]
    bend_slopes: Array  #: Changes of slope there, m_k. (K, n) [N·m·s/rad]
    stribeck: float = 0.0  #: Excess of the breakaway torque, as a share of `coulomb`.
    stribeck_velocity: float = 0.05  #: Velocity over which it fades. [rad/s]

    def dry(self, dq: Array, load: Array | None = None) -> Array:
        """Largest dry friction at velocities (n,) [rad/s] and loads (n,) [N·m]. (n,) [N·m]

        F_c (1 + s exp(−(q̇/v_s)²)), the Stribeck curve of Armstrong-Hélouvry, Dupont and
        Canudas de Wit, Automatica 30 (1994), and f_l |load| with the gravity torque that
        the gears carry.
        """
        dry = self.coulomb
        if self.stribeck != 0.0:
            fade = np.exp(-((dq / self.stribeck_velocity) ** 2))
            dry = dry * (1.0 + self.stribeck * fade)
        if load is not None:
            dry = dry + self.load_coulomb * abs(load)
        return dry

    def creep(self, dq: Array, dry: Array) -> tuple[Array, Array, Array]:
        """Fading dry friction of joints that give, its slope, what sticks. (n,) each"""
        gives = self.presliding > 0.0
        fading, sign = np.where(gives, dry, 0.0), np.tanh(dq / CREEP)
        return fading * sign, fading * (1.0 - sign**2) / CREEP, np.where(gives, 0.0, dry)

    def smooth(self, dq: Array) -> tuple[Array, Array]:
        """The smooth part and its slope at `dq` (n,) [rad/s]: (n,) [N·m], [N·m·s/rad]"""
        speed = abs(dq)
        torque = self.offset + (self.viscous + self.quadratic * speed) * dq
        slope = self.viscous + 2.0 * self.quadratic * speed
        if "logarithmic" in self.present:
            bend = self.logarithmic_velocity
            torque += self.logarithmic * np.log1p(speed / bend) * np.sign(dq)
            slope += self.logarithmic / (bend + speed)
        if len(self.bends):
            beyond = np.maximum(speed - self.bends, 0.0)
            torque += np.add.reduce(self.bend_slopes * beyond) * np.sign(dq)
            slope += np.add.reduce(np.where(beyond > 0.0, self.bend_slopes, 0.0))
        if "amplitude" in self.present:
            bell = 1.0 / (1.0 + np.exp(-self.slope * (dq + self.shift)))
            rest = 1.0 / (1.0 + np.exp(-self.slope * self.shift))
            torque += self.amplitude * (bell - rest)
            slope += self.amplitude * self.slope * bell * (1.0 - bell)
        # The slope is implicit: a negative one would pump energy into the joint.
        return torque, np.maximum(slope, 0.0)

    @cached_property
    def present(self) -> frozenset[str]:
        """Parameters that any joint has."""
        return frozenset(name for name in SHAPES if getattr(self, name).any())

    def times(self, dry: Array, wet: Array) -> "TrueFriction":
        """Friction of other dry and viscous levels; the offset stays. (n,) each [1]"""
        levels = {**dict.fromkeys(DRY, dry), **dict.fromkeys(WET, wet)}
        return replace(self, **{name: getattr(self, name) * k for name, k in levels.items()})


def true_friction(robot: Robot, spec: FrictionSpec) -> TrueFriction:
    """The profile's friction, with the stiction and Stribeck peak that it lacks.

    The profile's tanh(q̇/smoothing) becomes a real dry friction. Of a sigmoid, the share
    `spec.sticking` becomes dry friction of the same plateau, half the amplitude to each
    side; of the Coulomb torque the share `spec.presliding` becomes presliding friction.
    """
    if not 0.0 <= spec.presliding <= 1.0:
        raise ParameterError(f"friction.presliding is {spec.presliding:g}; it is a share, 0 to 1")
    for name in ("presliding_length", "stribeck_velocity"):
        if why := out_of_bounds(name, [getattr(spec, name)]):
            raise ParameterError(f"friction.{why}")
    n = robot.joints
    table = {name: np.zeros(n) for name in SHAPES}
    # What the scenario states, for an arm without any in its robot file.
    for name, own in {"coulomb": spec.coulomb, "viscous": spec.viscous}.items():
        if own is None:
            continue
        if robot.friction:
            raise ParameterError(
                f"friction.{name} is for an arm file without friction; {robot.name!r} has some"
            )
        if len(own) != n or min(own) < 0 or out_of_bounds(name, own):
            raise ParameterError(
                f"friction.{name} must have one number per joint, {n} of them, none negative or "
                "beyond what robots have"
            )
        table[name] += own if spec.enabled else 0.0
    table["logarithmic_velocity"] += 1.0  # where there is no rise, any velocity will do
    table["presliding_length"] += spec.presliding_length
    joints = (robot.friction if spec.enabled else ()) or (JointFriction(),) * n
    for j, joint in enumerate(joints):
        for name in table.keys() & joint.parameters.keys():
            table[name][j] = joint.parameters[name]
        table["coulomb"][j] += sum(joint.torques[:1])
    dry = spec.sticking * table["amplitude"]
    table["amplitude"] -= dry
    table["coulomb"] += 0.5 * dry
    giving = spec.presliding * table["coulomb"]
    table["coulomb"] -= giving
    table["presliding"] += giving
    table["bends"], table["bend_slopes"] = bends_of(joints)
    return TrueFriction(**table, stribeck=spec.stribeck, stribeck_velocity=spec.stribeck_velocity)


def bends_of(joints: Sequence[JointFriction]) -> tuple[Array, Array]:
    """Speeds at which lines bend, their change of slope, or nothing. (K, n) each"""
    most = max(max(len(joint.speeds) for joint in joints) - 1, 0)
    bends, changes = np.zeros((2, most, len(joints)))
    for j, joint in enumerate(joints):
        if joint.speeds:
            slopes = np.diff(joint.torques) / np.diff(joint.speeds)
            bends[: len(slopes), j] = joint.speeds[:-1]
            changes[: len(slopes), j] = np.diff(slopes, prepend=0.0)
    return bends, changes


class Plant:
    """State of the arm and one step of its motion.

    Moreau's midpoint scheme: with q_m = q + h/2 v and v_m extrapolated half a step ahead,

    (M(q_m) + h/2 D) (v⁺ − v) = h (τ + τ_ext − C v_m − g − f_smooth(v)) − λ,
    q⁺ = q + h/2 (v + v⁺)

    λ is the impulse of dry friction, D the slope of the smooth one; of second order in h
    while no joint begins to stick or slide. Presliding friction is evaluated at q_m. For
    q_mid, v_mid and a the last step's balance M a + C v + g = τ + τ_ext − τ_f is exact;
    `friction` is against positive motion, `centre` the c of the play operator.
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
        self.q, self.v = np.array(q, float), np.array(v, float)
        self.q_mid, self.v_mid, self.centre = self.q.copy(), self.v.copy(), self.q.copy()
        self.a, self.friction = np.zeros((2, len(self.q)))
        self.moved = False
        sticks = (friction.coulomb > 0.0) & (friction.presliding == 0.0)
        self.signs = np.where(sticks, np.sign(self.v), 1.0)

    def advance(self, tau: Array, external: External | None = None) -> None:
        """Move one step under drive torques `tau` (n,) [N·m] and contacts."""
        # The midpoint velocity needs an acceleration before it.
        if not self.moved:
            signs = self.signs
            self.a = (self.velocity_after(tau, external) - self.v) / self.step
            self.signs, self.moved = signs, True
        after = self.velocity_after(tau, external)
        self.a = (after - self.v) / self.step
        self.q = self.q + 0.5 * self.step * (self.v + after)
        self.v = after

    def velocity_after(self, tau: Array, external: External | None) -> Array:
        """Velocities after the step, v_m by the acceleration known so far. (n,) [rad/s]"""
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
            given = true.presliding * (q_mid - self.centre) / reach
            smooth, slope = smooth + creeping + given, slope + steep
        torque = tau - bias - smooth
        if external is not None:
            pin.computeJointJacobians(model, data, q_mid)
            torque += external(model, data, v_mid)
        M.flat[:: len(slope) + 1] += 0.5 * h * slope
        after, impulse, self.signs = slide_or_stick(M, h * torque, self.v, h * dry, self.signs)
        self.friction = smooth + 0.5 * slope * (after - self.v) + impulse / h
        self.q_mid, self.v_mid = q_mid, v_mid
        return after


def slide_or_stick(
    M: Array, impulse: Array, v: Array, limit: Array, signs: Array
) -> tuple[Array, Array, Array]:
    """Velocities after the step, friction impulses, and directions of sliding.

    M̃ (n, n) [kg·m²], impulse g of everything but dry friction, velocities v before the
    step, largest impulses ℓ of dry friction, directions of the step before as a guess, 0
    sticks. (n,)
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
        breaks = stuck & (abs(friction) > limit)
        better[breaks] = np.where(friction[breaks] < 0.0, -1.0, 1.0)
        if np.array_equal(better, signs):
            return after, friction, signs
        signs = better
    return bounded_step(M, impulse, v, limit)


def bounded_step(M: Array, impulse: Array, v: Array, limit: Array) -> tuple[Array, Array, Array]:
    """A step by least squares in bounds, which always converges.

    With M̃ = L Lᵀ, λ minimises ‖L⁻¹(g − λ) + Lᵀ v‖, |λ_j| ≤ ℓ_j: the gradient is v⁺.
    """
    from scipy.optimize import lsq_linear

    L = np.linalg.cholesky(M)
    C, rubs, friction = np.linalg.inv(L), limit > 0.0, np.zeros_like(v)
    bounds = -limit[rubs], limit[rubs]
    friction[rubs] = lsq_linear(C[:, rubs], C @ impulse + L.T @ v, bounds, "bvls", 1e-14).x
    sticks = abs(friction) < limit * (1.0 - 1e-12)  # at a bound to rounding
    after = np.where(sticks, 0.0, v + np.linalg.solve(M, impulse - friction))
    return after, friction, np.where(sticks, 0.0, np.where(friction < 0.0, -1.0, 1.0))
