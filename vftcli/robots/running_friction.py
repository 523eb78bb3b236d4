"""Friction along a log: what it remembers of the motion so far, and the temperature it follows."""

from collections.abc import Sequence

import numpy as np

from vftcli.robots.friction import friction_torque
from vftcli.robots.presliding import play
from vftcli.robots.robot import JointFriction
from vftcli.signals.arrays import Array


class RunningFriction:
    """The friction of an arm's joints, stretch after stretch of a motion, or sample by sample.

    Presliding friction depends on where the joint came from. Stretches that follow each other give
    the torque of the whole in one piece, to the last bit.

    Attributes:
        friction: One model a joint; empty for a frictionless arm.
        centre: c of the play operator after the last sample, of the joints that have presliding
            friction; None before the first. (m,) [rad]
    """

    def __init__(self, friction: Sequence[JointFriction]) -> None:
        self.friction = friction
        self.centre: Array | None = None
        presliding = [joint.parameters.get("presliding", 0.0) for joint in friction]
        self._joints = [j for j, torque in enumerate(presliding) if torque > 0.0]
        lengths = [friction[j].parameters["presliding_length"] for j in self._joints]
        self._length = np.array(lengths)

    def torque(
        self,
        q: Array,
        dq: Array,
        load: Array | None = None,
        temperature: Array | None = None,
    ) -> Array:
        """Friction torque of the next samples, opposing motion when subtracted. (T, n) [N·m]

        Args:
            q: Joint angles. (T, n) [rad]
            dq: Joint velocities. (T, n) [rad/s]
            load: Gravity torques of the loaded arm. (T, n) [N·m]
            temperature: Joint temperatures, NaN where not measured; None for those at which the
                models were taken. (T, n) [°C]
        """
        return friction_torque(
            self.friction, dq, load, deflection=self.deflection(q), temperature=temperature
        )

    @property
    def takes_load(self) -> bool:
        """Whether the torque grows with what the gears carry, so that `load` matters."""
        return any(joint.parameters.get("load_coulomb", 0.0) for joint in self.friction)

    def deflection(self, q: Array) -> Array | None:
        """State s of the play operator along the next samples; None without one. (T, n)

        Args:
            q: Angles of the joints. (T, n) [rad]
        """
        if not self._joints:
            return None
        found = play(q[:, self._joints], self._length, self.centre)
        self.centre = found.centre
        state = np.zeros(q.shape, order="F")
        state[:, self._joints] = found.state
        return state
