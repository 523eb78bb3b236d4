"""The simulated arm with its servo and its contacts, one inner step at a time."""

from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from vftcli.robots import Robot, load_robot
from vftcli.robots.robot import REFERENCE
from vftcli.robots.temperature import COLDEST, WARMEST, friction_factor
from vftcli.signals.arrays import Array
from vftcli.signals.errors import ParameterError
from vftcli.simulation.mismatch import TrueArm, build_arm
from vftcli.simulation.motion import Reference
from vftcli.simulation.plant import Plant
from vftcli.simulation.scenario import Scenario
from vftcli.simulation.servo import Servo
from vftcli.simulation.touch import Touching

WARMING_STEPS = 250  #: Inner steps between two updates of the friction's temperature.
CHECK_STEPS = 10  #: Inner steps between two looks at whether the arm still moves like an arm.
RUNAWAY = 200.0  #: Joint velocity no arm reaches. [rad/s]


@dataclass(frozen=True, kw_only=True)
class JointSignals:
    """What the joints truly did, one row an instant."""

    q: Array  #: Positions, velocities, accelerations. (N, n) [rad, rad/s, rad/s²]
    v: Array
    a: Array
    tau: Array  #: Drive torque. (N, n) [N·m]
    friction: Array  #: Friction torque. (N, n) [N·m]
    target_q: Array  #: The reference. (N, n)
    target_dq: Array
    target_ddq: Array


@dataclass(frozen=True, kw_only=True)
class History(JointSignals):
    """What happened, one row an inner step; row k covers the time from k·step to (k+1)·step.

    State and reference are those at the start of a step, all else holds over it.
    """

    step: float  #: Inner step. [s]
    wrenches: Array  #: Wrench of each contact at the middle of the step. (N, C, 6) [N, N·m]
    walk: Array  #: Joint torque of the random walks. (N, n) [N·m]

    @classmethod
    def room(cls, step: float, steps: int, joints: int, contacts: int) -> "History":
        """Return room for `steps` steps, and one more for the state after the last."""
        rows = steps + 1
        arrays = {field.name: np.zeros((rows, joints)) for field in fields(JointSignals)}
        walk, wrenches = np.zeros((rows, joints)), np.zeros((rows, contacts, 6))
        return cls(step=step, wrenches=wrenches, walk=walk, **arrays)

    def until(self, rows: int) -> "History":
        """The first rows alone."""
        names = [field.name for field in fields(self) if field.name != "step"]
        return replace(self, **{name: getattr(self, name)[:rows] for name in names})


class Arm:
    """An arm under its servo, touched by its scenario's contacts.

    A controller in the loop calls `step` with its command and reads `q`, `v` and the mean torque of
    the last interval; `vftcli.simulation.simulate` does so with the scenario's own trajectory.

    Attributes:
        scenario: The experiment.
        robot: The profile.
        true: The arm as it is.
        plant: Its dynamics.
        servo: Its position controller.
        touching: Its contacts.
        history: What happened so far, room for the rest.
        steps, made: Inner steps of the run, and those made so far.
    """

    def __init__(self, scenario: Scenario, seed: int, start: Reference, duration: float) -> None:
        """Prepare a run.

        Args:
            scenario: The experiment.
            seed: Seed of everything drawn.
            start: The reference at the start, one row; the arm starts on it.
            duration: Length of the run. [s]
        """
        if seed < 0:
            raise ParameterError(f"the seed is {seed}; it must be zero or positive")
        for name in ("temperature_begin", "temperature_end"):
            value = getattr(scenario.friction, name)
            if value is not None and not COLDEST <= value <= WARMEST:
                raise ParameterError(
                    f"friction.{name} is {value:g} °C; a joint has {COLDEST:g} to {WARMEST:g} °C"
                )
        self.scenario, self.seed = scenario, seed
        self.robot: Robot = load_robot(scenario.robot)
        self.seeds: dict[str, Any] = dict(
            zip(("arm", "contacts", "sensing"), np.random.SeedSequence(seed).spawn(3), strict=True)
        )
        rng = np.random.default_rng(self.seeds["arm"])
        self.true: TrueArm = build_arm(scenario, self.robot, rng)
        h = scenario.step
        q, v = start.q[0], start.dq[0]
        self.plant = Plant(self.true.chain.to_pinocchio(), self.true.friction, q, v, h)
        self.servo = Servo(scenario.servo, self.true.nominal, h)
        self.steps, self.made = int(np.ceil(duration / h - 1e-9)), 0
        self.touching = Touching(
            scenario.contacts, self.robot.chain, self.steps, h, self.seeds["contacts"]
        )
        contacts = len(self.touching.mounted)
        self.history = History.room(h, self.steps, self.robot.joints, contacts)

    @property
    def t(self) -> float:
        """True time since the start of the run. [s]"""
        return self.made * self.scenario.step

    @property
    def q(self) -> Array:
        """True positions now. (n,) [rad]"""
        return self.plant.q

    @property
    def v(self) -> Array:
        """True velocities now. (n,) [rad/s]"""
        return self.plant.v

    def command(self, q_d: Array, dq_d: Array | None = None, ddq_d: Array | None = None) -> None:
        """Make one inner step towards a commanded position, with the servo's own feed-forward.

        A position outside the joint limits is brought to them.

        Args:
            q_d: Commanded positions. (n,) [rad]
            dq_d: Commanded velocities, zero if not given. (n,) [rad/s]
            ddq_d: Commanded accelerations, zero if not given. (n,) [rad/s²]
        """
        q_d = self.servo.clip_to_limits(np.asarray(q_d, dtype=float))
        nothing = np.zeros_like(q_d)
        rows = [q_d, nothing if dq_d is None else dq_d, nothing if ddq_d is None else ddq_d]
        reference = Reference(*(np.asarray(row, dtype=float)[None] for row in rows))
        forward = self.servo.feed_forward(reference)[0]
        self.step(reference.q[0], reference.dq[0], reference.ddq[0], forward)

    def step(self, q_d: Array, dq_d: Array, ddq_d: Array, forward: Array) -> None:
        """Make one inner step with a feed-forward torque `forward` (n,) [N·m] already known."""
        history, plant, k = self.history, self.plant, self.made
        if k >= self.steps:
            raise ParameterError(f"the run was prepared for {self.steps} steps and has made them")
        tau = self.servo.torque(forward, q_d, dq_d, plant.q, plant.v)
        history.q[k], history.v[k], history.tau[k] = plant.q, plant.v, tau
        history.target_q[k], history.target_dq[k], history.target_ddq[k] = q_d, dq_d, ddq_d
        t = (k + 0.5) * plant.step
        if k % WARMING_STEPS == 0:
            self.warm_up(t)
        # Contacts cost Jacobians; most steps have none.
        if self.touching.anything(t):
            plant.advance(tau, lambda m, data, v: self.touching.torque(t, m, data, v))
            history.wrenches[k] = self.touching.wrenches
        else:
            plant.advance(tau)
        history.a[k], history.friction[k] = plant.a, plant.friction
        self.made = k + 1
        if k % CHECK_STEPS == 0:
            self.check_motion()

    def check_motion(self) -> None:
        """Raise a ParameterError if the loop has become unstable."""
        fastest = float(np.max(np.abs(self.plant.v)))
        if not fastest < RUNAWAY:
            raise ParameterError(
                f"the arm runs away at {self.t:.3f} s: servo or contacts are too stiff for a step "
                f"of {self.scenario.step:g} s; lower servo.stiffness, a contact's stiffness or step"
            )

    def temperature(self, t: Array) -> Array:
        """The joints' temperature at some times of the run. (N, n) [°C]

        Args:
            t: True times. (N,) [s]
        """
        spec, friction = self.scenario.friction, self.robot.friction
        references = [joint.reference_temperature for joint in friction]
        begin = np.array(references or [REFERENCE] * len(self.q))
        if spec.temperature_begin is not None:
            begin[:] = spec.temperature_begin
        end = begin if spec.temperature_end is None else np.full_like(begin, spec.temperature_end)
        share = (t / (self.steps * self.scenario.step))[:, None]
        found: Array = begin + (end - begin) * share
        return found

    def warm_up(self, t: float) -> None:
        """Let the friction follow the joints' temperature."""
        factor = friction_factor(self.robot.friction, self.temperature(np.array([t])))
        if factor is not None:
            self.plant.true_friction = self.true.friction.warmed(factor[0])

    def close(self) -> History:
        """The history so far, with the state after the last step as its closing row.

        What has no value after the last step keeps its last one.
        """
        self.check_motion()
        history, k = self.history, self.made
        history.q[k], history.v[k] = self.plant.q, self.plant.v
        for name in ("target_q", "target_dq", "target_ddq", "tau", "friction", "a"):
            array = getattr(history, name)
            array[k] = array[k - 1]
        for walk in self.touching.walks:
            history.walk[:k] += walk.torque[:k]
        return history.until(k + 1)

    def mean_torque(self, interval: float) -> Array:
        """Mean drive torque over the last `interval` [s], as the log measures it. (n,) [N·m]"""
        rows = max(round(interval / self.scenario.step), 1)
        mean: Array = self.history.tau[max(self.made - rows, 0) : max(self.made, 1)].mean(axis=0)
        return mean / self.true.gain + self.true.offset
