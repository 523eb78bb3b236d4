"""The true friction of the joints: dry friction that can stick, and a smooth part.

τ_f = λ + smooth(q̇), with λ ∈ F_c(q̇)·Sgn(q̇) set-valued at rest (Coulomb and Stribeck) and
smooth(q̇) = offset + f_v q̇ + f_2 q̇|q̇| + a ln(1 + |q̇|/b) sign(q̇) + sigmoid(q̇).
"""

from dataclasses import dataclass, replace

import numpy as np

from vftcli.robots import JointFriction, Robot
from vftcli.signals.arrays import Array
from vftcli.simulation.scenario import FrictionSpec

SHAPES = (
    *("coulomb", "viscous", "quadratic", "offset", "logarithmic", "logarithmic_velocity"),
    *("amplitude", "slope", "shift"),
)


@dataclass(frozen=True, kw_only=True)
class TrueFriction:
    """Friction parameters of an n-joint arm. (n,) each

    Attributes:
        coulomb: Dry friction while sliding. [N·m]
        viscous: Viscous coefficient. [N·m·s/rad]
        quadratic: Signed quadratic coefficient. [N·m·s²/rad²]
        offset: Torque independent of motion. [N·m]
        logarithmic: Logarithmic rise a. [N·m]
        logarithmic_velocity: Velocity b from which it flattens. [rad/s]
        amplitude: Amplitude of the sigmoid. [N·m]
        slope: Slope of the sigmoid. [s/rad]
        shift: Shift of the sigmoid. [rad/s]
        stribeck: Excess of the breakaway torque, as a share of `coulomb`.
        stribeck_velocity: Velocity over which it fades. [rad/s]
    """

    coulomb: Array
    viscous: Array
    quadratic: Array
    offset: Array
    logarithmic: Array
    logarithmic_velocity: Array
    amplitude: Array
    slope: Array
    shift: Array
    stribeck: float = 0.0
    stribeck_velocity: float = 0.05

    def dry(self, dq: Array) -> Array:
        """Largest dry friction torque at velocities `dq` (n,) [rad/s]. (n,) [N·m]

        F_c (1 + s exp(−(q̇/v_s)²)), the Stribeck curve of Armstrong-Hélouvry, Dupont and Canudas
        de Wit, Automatica 30 (1994).
        """
        if self.stribeck == 0.0:
            return self.coulomb
        fade: Array = np.exp(-((dq / self.stribeck_velocity) ** 2))
        return self.coulomb * (1.0 + self.stribeck * fade)

    def smooth(self, dq: Array) -> tuple[Array, Array]:
        """The smooth part and its derivative at `dq` (n,) [rad/s]. (n,) [N·m], (n,) [N·m·s/rad]"""
        speed = np.abs(dq)
        torque = self.offset + (self.viscous + self.quadratic * speed) * dq
        slope = self.viscous + 2.0 * self.quadratic * speed
        if self.logarithmic.any():
            bend = self.logarithmic_velocity
            torque = torque + self.logarithmic * np.log1p(speed / bend) * np.sign(dq)
            slope = slope + self.logarithmic / (bend + speed)
        if self.has_sigmoid:
            bell = 1.0 / (1.0 + np.exp(-self.slope * (dq + self.shift)))
            rest = 1.0 / (1.0 + np.exp(-self.slope * self.shift))
            torque = torque + self.amplitude * (bell - rest)
            slope = slope + self.amplitude * self.slope * bell * (1.0 - bell)
        # The step treats the slope implicitly; a negative one would pump energy into the joint.
        return torque, np.maximum(slope, 0.0)

    @property
    def has_sigmoid(self) -> bool:
        """Whether any joint has sigmoid friction; exponentials are left out where none has."""
        return bool(self.amplitude.any())

    def with_viscous_factor(self, factor: float) -> "TrueFriction":
        """The friction with its rise multiplied by `factor`; warm oil is thinner."""
        return replace(self, viscous=self.viscous * factor, logarithmic=self.logarithmic * factor)


def true_friction(robot: Robot, spec: FrictionSpec) -> TrueFriction:
    """The profile's friction curve with what it leaves out: stiction and the Stribeck peak.

    The profile's tanh(q̇/smoothing) becomes a real dry friction. Of a sigmoid, the share
    `spec.sticking` becomes dry friction of the same plateau, half the amplitude to each side.
    """
    n = robot.joints
    table = {name: np.zeros(n) for name in SHAPES}
    table["logarithmic_velocity"] += 1.0  # where there is no rise, any velocity will do
    joints = robot.friction or (JointFriction(),) * n
    if spec.enabled:
        for j, joint in enumerate(joints):
            for name, value in joint.parameters.items():
                if name in table:
                    table[name][j] = value
    dry = spec.sticking * table["amplitude"]
    table["amplitude"] = table["amplitude"] - dry
    table["coulomb"] = table["coulomb"] + 0.5 * dry
    return TrueFriction(**table, stribeck=spec.stribeck, stribeck_velocity=spec.stribeck_velocity)
