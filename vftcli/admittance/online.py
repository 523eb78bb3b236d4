"""The virtual sensor one sample at a time: what a controller has, with no future and no log."""

from typing import Any

import numpy as np

from vftcli.observers.paper import KalmanObserver
from vftcli.robots.robot import Robot
from vftcli.robots.running_friction import RunningFriction
from vftcli.signals.arrays import Array
from vftcli.virtual_sensor.solvers import wrench_of


class OnlineKalman:
    """A disturbance Kalman filter run sample by sample at a constant rate, from x̂⁰ = [p⁰; 0].

    A mean torque over the sampling interval enters as it is: the trapezoid over two is half a
    sample late, which turns every jerk of the arm into a false force. An instantaneous one enters
    by the trapezoid, as the rest of μ: the numbers are those of `KalmanObserver.estimate`.

    Attributes:
        tau: The estimate now. (n,) [N·m]
    """

    def __init__(
        self,
        observer: KalmanObserver,
        robot: Robot,
        step: float,
        *,
        averaged: bool,
    ) -> None:
        """Prepare for samples every `step` [s] whose torque is `averaged` over it, or not."""
        import pinocchio as pin

        n = robot.joints
        self.pin, self.model, self.robot, self.step = pin, robot.model, robot, step
        self.averaged = averaged
        self.friction = RunningFriction(robot.friction)
        self.data: Any = self.model.createData()
        model = observer.model(step, n)
        self.a12, self.a22 = model.a12, model.a22
        self.gains = observer.steady(step, n).gains
        self.p: Array | None = None
        self.mu = np.zeros(n)
        self.tau = np.zeros(n)

    def sample(self, q: Array, dq: Array, torque: Array) -> Array:
        """The external torque after one more sample [rad, rad/s, N·m]. (n,) [N·m]"""
        pin, model, data = self.pin, self.model, self.data
        C = pin.computeCoriolisMatrix(model, data, q, dq)
        p = pin.crba(model, data, q) @ dq
        gravity = pin.computeGeneralizedGravity(model, data, q)
        mu = C.T @ dq - gravity
        if self.robot.friction:  # presliding friction goes on from the sample before
            mu = mu - self.friction.torque(q[None], dq[None], gravity[None])[0]
        if not self.averaged:
            mu = mu + torque
        if self.p is None:
            self.p, self.mu = p, mu
            return self.tau
        gained = 0.5 * (mu + self.mu) + (torque if self.averaged else 0.0)
        ahead = self.p + self.a12 * self.tau + self.step * gained
        innovation = p - ahead
        self.p = ahead + self.gains.l1 * innovation
        self.tau = self.a22 * self.tau + self.gains.l2 * innovation
        self.mu = mu
        return self.tau

    def wrench(self, q: Array) -> Array:
        """F = pinv(J_Fᵀ) τ̂ (46) at the flange, base axes; zero where the pose cannot tell it. (6,)

        A controller that knows no force must not move by it.
        """
        pin, model, data = self.pin, self.model, self.data
        frame = model.getFrameId("flange")
        J = pin.computeFrameJacobian(model, data, q, frame, pin.LOCAL_WORLD_ALIGNED)
        found = wrench_of(self.tau[None], J[None])
        return found.values[0] if found.known[0] else np.zeros(6)
