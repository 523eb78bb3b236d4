"""The true friction of the joints: dry friction that can stick, presliding, and a smooth part.

τ_f = λ + a·s(q) + smooth(q̇), with λ ∈ F_c(q̇, g)·Sgn(q̇) set-valued at rest (Coulomb, load and
Stribeck), s the state of the play operator (`vftcli.robots.running_friction`) and
λ = F_c(q̇, g) tanh(q̇/v₀) where a > 0: at rest a joint that gives holds a·s, v₀ is `CREEP`;
smooth(q̇) = offset + f_v q̇ + f_2 q̇|q̇| + a ln(1 + |q̇|/b) sign(q̇)
+ sign(q̇) Σ_k m_k max(|q̇| − v_k, 0) + sigmoid(q̇).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from vftcli.robots import JointFriction, Robot
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
#: Speed below which the dry friction of a joint that gives fades: of forms tried on a UR10e, a·s
#: beside a sign smoothed over 3 mrad/s leaves a momentum observer least on unseen logs. [rad/s]
CREEP = 3e-3


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
    load_coulomb: Array  #: Growth of the dry friction with the gravity torque carried. [1]
    presliding: Array  #: Presliding friction at full deflection. [N·m]
    presliding_length: Array  #: Deflection s₀ at which it is full. [rad]
    bends: Array  #: Speeds v_k at which the rise of a bent line changes. (K, n) [rad/s]
    bend_slopes: Array  #: By how much it changes there, m_k. (K, n) [N·m·s/rad]
    stribeck: float = 0.0  #: Excess of the breakaway torque, as a share of `coulomb`.
    stribeck_velocity: float = 0.05  #: Velocity over which it fades. [rad/s]

    def dry(self, dq: Array, load: Array | None = None) -> Array:
        """Largest dry friction at velocities (n,) [rad/s] and loads (n,) [N·m]. (n,) [N·m]

        F_c (1 + s exp(−(q̇/v_s)²)), the Stribeck curve of Armstrong-Hélouvry, Dupont and Canudas
        de Wit, Automatica 30 (1994), and f_l |load| with the gravity torque that the gears carry.
        """
        dry = self.coulomb
        if self.stribeck != 0.0:
            fade: Array = np.exp(-((dq / self.stribeck_velocity) ** 2))
            dry = dry * (1.0 + self.stribeck * fade)
        if load is not None:
            dry = dry + self.load_coulomb * np.abs(load)
        return dry

    def creep(self, dq: Array, dry: Array) -> tuple[Array, Array, Array]:
        """Fading dry friction of joints that give, its slope, what sticks. (n,) each"""
        gives = self.presliding > 0.0
        fading, sign = np.where(gives, dry, 0.0), np.tanh(dq / CREEP)
        return fading * sign, fading * (1.0 - sign**2) / CREEP, np.where(gives, 0.0, dry)

    def smooth(self, dq: Array) -> tuple[Array, Array]:
        """The smooth part and its derivative at `dq` (n,) [rad/s]. (n,) [N·m], (n,) [N·m·s/rad]"""
        speed = np.abs(dq)
        torque = self.offset + (self.viscous + self.quadratic * speed) * dq
        slope = self.viscous + 2.0 * self.quadratic * speed
        if "logarithmic" in self.present:
            bend = self.logarithmic_velocity
            torque = torque + self.logarithmic * np.log1p(speed / bend) * np.sign(dq)
            slope = slope + self.logarithmic / (bend + speed)
        if len(self.bends):
            beyond = np.maximum(speed - self.bends, 0.0)
            torque = torque + np.add.reduce(self.bend_slopes * beyond) * np.sign(dq)
            slope = slope + np.add.reduce(np.where(beyond > 0.0, self.bend_slopes, 0.0))
        if "amplitude" in self.present:
            bell = 1.0 / (1.0 + np.exp(-self.slope * (dq + self.shift)))
            rest = 1.0 / (1.0 + np.exp(-self.slope * self.shift))
            torque = torque + self.amplitude * (bell - rest)
            slope = slope + self.amplitude * self.slope * bell * (1.0 - bell)
        # The slope is implicit: a negative one would pump energy into the joint.
        return torque, np.maximum(slope, 0.0)

    @cached_property
    def present(self) -> frozenset[str]:
        """Names of what any joint has; what none has is left out of a step."""
        return frozenset(name for name in SHAPES if getattr(self, name).any())

    def times(self, dry: Array, wet: Array) -> "TrueFriction":
        """Friction of other dry and viscous levels; the offset stays. (n,) each [1]"""
        levels = {**dict.fromkeys(DRY, dry), **dict.fromkeys(WET, wet)}
        return replace(self, **{name: getattr(self, name) * k for name, k in levels.items()})


def true_friction(robot: Robot, spec: FrictionSpec) -> TrueFriction:
    """The profile's friction curve with what it leaves out: stiction and the Stribeck peak.

    The profile's tanh(q̇/smoothing) becomes a real dry friction. Of a sigmoid, the share
    `spec.sticking` becomes dry friction of the same plateau, half the amplitude to each side; of
    the Coulomb torque the share `spec.presliding` becomes presliding friction.
    """
    if not 0.0 <= spec.presliding <= 1.0:
        raise ParameterError(f"friction.presliding is {spec.presliding:g}; it is a share, 0 to 1")
    for name in ("presliding_length", "stribeck_velocity"):
        if why := out_of_bounds(name, [getattr(spec, name)]):
            raise ParameterError(f"friction.{why}")
    n = robot.joints
    table = {name: np.zeros(n) for name in SHAPES}
    table |= stated_friction(robot, spec)
    table["logarithmic_velocity"] += 1.0  # where there is no rise, any velocity will do
    table["presliding_length"] += spec.presliding_length
    joints = (robot.friction if spec.enabled else ()) or (JointFriction(),) * n
    for j, joint in enumerate(joints):
        for name, value in joint.parameters.items():
            if name in table:
                table[name][j] = value
        table["coulomb"][j] += sum(joint.torques[:1])
    dry = spec.sticking * table["amplitude"]
    table["amplitude"] = table["amplitude"] - dry
    table["coulomb"] = table["coulomb"] + 0.5 * dry
    giving = spec.presliding * table["coulomb"]
    table["coulomb"] = table["coulomb"] - giving
    table["presliding"] = table["presliding"] + giving
    table["bends"], table["bend_slopes"] = bends_of(joints)
    return TrueFriction(**table, stribeck=spec.stribeck, stribeck_velocity=spec.stribeck_velocity)


def stated_friction(robot: Robot, spec: FrictionSpec) -> dict[str, Array]:
    """The friction that the scenario gives an arm whose robot file has none. (n,) each"""
    given = {"coulomb": spec.coulomb, "viscous": spec.viscous}
    table = {name: np.array(values) for name, values in given.items() if values is not None}
    for name, values in table.items():
        if robot.friction:
            raise ParameterError(
                f"friction.{name} is for an arm whose file has no friction; {robot.name!r} has some"
            )
        low = len(values) != robot.joints or np.any(values < 0)
        if low or out_of_bounds(name, values.tolist()):
            raise ParameterError(
                f"friction.{name} must have one number a joint, {robot.joints} of them, none "
                "negative or beyond what robots have"
            )
    return table if spec.enabled else {}


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
