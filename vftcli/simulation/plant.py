"""The arm itself: rigid-body dynamics with rotor inertia and true friction, integrated in time."""

from collections.abc import Callable
from typing import Any

import numpy as np

from vftcli.signals.arrays import Array
from vftcli.signals.errors import ParameterError
from vftcli.signals.packages import needed
from vftcli.simulation.friction import TrueFriction
from vftcli.simulation.stiction import slide_or_stick

LARGEST_STEP = 1e-3  #: Largest inner step. [s]
#: Torque of the contacts (n,) [N·m] from the Pinocchio model and data (joint Jacobians and
#: placements are current) and the velocities, at the middle of the step.
External = Callable[[Any, Any, Array], Array]


class Plant:
    """State of the arm and one step of its motion.

    Moreau's midpoint scheme: with q_m = q + h/2 v and v_m extrapolated half a step ahead,

    (M(q_m) + h/2 D) (v⁺ − v) = h (τ + τ_ext − C v_m − g − f_smooth(v)) − λ,   q⁺ = q + h/2 (v + v⁺)

    where λ is the impulse of dry friction (`stiction`) and D the slope of the smooth friction. It
    is of second order in h while no joint changes between sticking and sliding. Presliding
    friction, a spring that yields, is taken at q_m like gravity.

    Attributes:
        q, v: Positions and velocities now. (n,) [rad, rad/s]
        q_mid, v_mid, a: Positions, velocities and accelerations for which the last step's balance M
            a + C v + g = τ + τ_ext − τ_f holds exactly. (n,)
        friction: Friction torque over the last step, against positive motion. (n,) [N·m]
        external: Torque of the contacts over the last step. (n,) [N·m]
        centre: c of the play operator. (n,) [rad]
    """

    def __init__(
        self,
        model: Any,  # noqa: ANN401 - Pinocchio is untyped
        friction: TrueFriction,
        q: Array,
        v: Array,
        step: float,
    ) -> None:
        pin = needed("pinocchio", "a simulation")

        if not 0.0 < step <= LARGEST_STEP:
            raise ParameterError(
                f"step is {step:g} s; the inner step must be above 0, at most {LARGEST_STEP:g} s"
            )
        self.pin = pin
        self.model, self.data = model, model.createData()
        self.true_friction = friction
        self.step = step
        self.q, self.v = np.array(q, dtype=float), np.array(v, dtype=float)
        self.q_mid, self.v_mid = self.q.copy(), self.v.copy()
        self.a = np.zeros_like(self.q)
        self.moved = False
        self.centre = self.q.copy()
        self.friction = np.zeros_like(self.q)
        self.external = np.zeros_like(self.q)
        self.gives = bool(friction.presliding.any())
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
        load = pin.computeGeneralizedGravity(model, data, q_mid) if true.is_loaded else None
        dry = true.dry(self.v, load)
        if self.gives:
            creeping, steep, dry = true.creep(self.v, dry)
            smooth, slope = smooth + creeping + self.presliding(q_mid), slope + steep
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

    def presliding(self, q: Array) -> Array:
        """Presliding friction at positions `q` (n,) [rad], which the play follows. (n,) [N·m]"""
        true = self.true_friction
        reach = true.presliding_length
        self.centre = np.minimum(np.maximum(self.centre, q - reach), q + reach)
        torque: Array = true.presliding * (q - self.centre) / reach
        return torque
