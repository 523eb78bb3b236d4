"""The joint position controller: computed torque about the reference with the nominal model."""

from typing import Any

import numpy as np

from vftcli.robots import Robot
from vftcli.robots.friction import friction_torque
from vftcli.signals.arrays import Array
from vftcli.signals.errors import ParameterError
from vftcli.signals.parsing import check_known
from vftcli.simulation.motion import Reference
from vftcli.simulation.scenario import ServoSpec

#: Natural frequency of the position loop by name. [rad/s]
STIFFNESS = {"stiff": 90.0, "soft": 28.0}
#: Largest natural frequency times step: beyond it the sampled loop is badly damped or unstable.
FASTEST_LOOP = 0.4


class Servo:
    """τ = τ_ff + M(q) (ω² (q_d − q) + 2ζω (q̇_d − q̇)), saturated at the drives' limits.

    With the nominal inertia as gain one number sets the stiffness, and every mode of the arm has
    the same bandwidth; gains joint by joint would leave a redundant arm a mode that chatters.

    Attributes:
        omega: Natural frequency ω of the loop. [rad/s]
        limit: Torque limits; infinite where unknown. (n,) [N·m]
        q_min, q_max: Joint limits, likewise. (n,) [rad]
    """

    def __init__(self, spec: ServoSpec, robot: Robot, step: float) -> None:
        import pinocchio as pin

        self.inertia = pin.crba
        omega = spec.stiffness
        if isinstance(omega, str):
            check_known(omega, STIFFNESS, f"no servo.stiffness {omega!r}")
            omega = STIFFNESS[omega]
        if omega <= 0 or spec.damping < 0:
            raise ParameterError("servo.stiffness must be positive and damping not negative")
        if omega * step > FASTEST_LOOP:
            raise ParameterError(
                f"servo.stiffness {omega:g} rad/s chatters at a step of {step:g} s; it can be at "
                f"most {FASTEST_LOOP / step:g}, or choose a smaller step"
            )
        self.spec, self.robot = spec, robot
        self.model, self.data = robot.model, robot.model.createData()
        self.omega, self.rate = omega, 2.0 * spec.damping * omega
        limits = robot.limits
        self.limit = np.fmin(limits.tau_max if spec.torque_limits else np.inf, np.inf)
        self.q_min, self.q_max = np.fmax(limits.q_min, -np.inf), np.fmin(limits.q_max, np.inf)

    def feed_forward(self, reference: Reference) -> Array:
        """Nominal torque along a reference; gravity only if so asked. (T, n) [N·m]"""
        rest = np.zeros_like(reference.q)
        full = self.spec.feed_forward
        dq, ddq = (reference.dq, reference.ddq) if full else (rest, rest)
        rigid = rigid_torque(self.model, Reference(reference.q, dq, ddq))
        return rigid + friction_torque(self.robot.friction, dq)

    def torque(self, forward: Array, q_d: Array, dq_d: Array, q: Array, dq: Array) -> Array:
        """The commanded torque at a state (q, dq) for a target, within the limits. (n,) [N·m]"""
        pull = self.omega**2 * (q_d - q) + self.rate * (dq_d - dq)
        tau: Array = forward + self.inertia(self.model, self.data, q) @ pull
        return np.minimum(np.maximum(tau, -self.limit), self.limit)


def rigid_torque(model: Any, reference: Reference) -> Array:  # noqa: ANN401
    """Inverse dynamics of a Pinocchio model along a motion. (T, n) [N·m]"""
    import pinocchio as pin

    data, out = model.createData(), np.empty_like(reference.q)
    for k, (q, dq, ddq) in enumerate(zip(*reference, strict=True)):
        out[k] = pin.rnea(model, data, q, dq, ddq)
    return out
