"""The closed loop in simulation: hand, arm, servo, sensing, observer and law.

The servo holds a command for a control period. Latencies are from the true force; Figs 6
and 9 time them from detection to motion, and from the estimate's fall to the turn.
"""

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from vftcli.admittance import ControlChoice
from vftcli.admittance.law import Controller, check_stable
from vftcli.admittance.motion import Recursion, check_start, phases
from vftcli.admittance.replay import Replay, deviation_of
from vftcli.doctor.examination import Examination
from vftcli.observers import ObserverChoice
from vftcli.observers.paper import KalmanObserver
from vftcli.robots import load_robot
from vftcli.robots.friction import RunningFriction
from vftcli.robots.robot import FlangeSolver, Robot
from vftcli.signals.arrays import Array, Mask, resample_columns
from vftcli.signals.errors import ParameterError
from vftcli.signals.pose import exp_matrix
from vftcli.signals.progress import stage, steps
from vftcli.signals.recording import Recording
from vftcli.signals.wrench import Wrench
from vftcli.simulation.arm import Arm
from vftcli.simulation.experiment import Simulation, observe
from vftcli.simulation.scenario import Scenario, load_scenario
from vftcli.simulation.sensing import drive_constants, log_rate, noise_sizes, rounded
from vftcli.simulation.trajectories import Reference, plan
from vftcli.wrench.solvers import wrench_of

FARTHEST = 3.0  #: A flange this far from its start has run away. [m]
STARTED = 5e-3  #: A flange has moved from this displacement on. [m]
TURNED = 0.02  #: A flange has turned from this rotation on. [rad]
#: Speeds below which the flange is at rest. [m/s, rad/s]
STILL = (0.005, 0.05)
REST = 1.0  #: A contact begins after this time below the threshold. [s]


class ClosedLoop(NamedTuple):
    """A finished run."""

    controller: Controller  #: The controller in the loop.
    t: Array  #: Control instants. (T,) [s]
    #: Wrench that the controller saw, zero removed, base axes. (T, 6) [N, N·m]
    estimate: Array
    #: Wrench of the contacts about the flange, base axes. (T, 6) [N, N·m]
    truth: Array
    dragged: Mask  #: Phases. (T, 6)
    commanded: Array  #: Deviation X̃ that was commanded. (T, 6) [m, rad]
    q: Array  #: Joint positions. (T, n) [rad]
    moved: Array  #: Deviation of the flange itself. (T, 6) [m, rad]
    reached: Mask  #: Whether the commanded pose was found. (T,)
    zero: Array  #: Zero of the wrench that was removed. (6,) [N, N·m]
    simulation: Simulation | None  #: Log and truth, None if the arm ran away.

    @property
    def stable(self) -> bool:
        """Whether the arm stayed within `FARTHEST` of its start to the end."""
        return self.simulation is not None

    @property
    def wrench(self) -> Wrench:
        """Wrench of the controller, for a replay as in Figs 7 and 10."""
        return Wrench(name="controller", t=self.t, values=self.estimate, frame="base")


class OnlineKalman:
    """Disturbance Kalman filter, sample by sample at a constant rate, x̂⁰ = [p⁰; 0].

    An averaged torque enters as it is: the trapezoid is half a sample late, and makes a false
    force of every jerk. An instantaneous one enters by it, like the rest of μ.
    """

    def __init__(
        self, observer: KalmanObserver, robot: Robot, step: float, *, averaged: bool
    ) -> None:
        """Samples come every `step` [s]; `averaged`: torque is the mean over a step."""
        import pinocchio as pin

        n = robot.joints
        self.pin, self.model, self.step = pin, robot.model, step
        self.averaged, self.friction = averaged, RunningFriction(robot.friction)
        self.data: Any = self.model.createData()
        self.system, self.gains = observer.model(step, n), observer.steady(step, n)
        self.p: Array | None = None
        self.mu, self.tau = np.zeros(n), np.zeros(n)

    def sample(self, q: Array, dq: Array, torque: Array) -> Array:
        """The external torque after a sample [rad, rad/s, N·m]. (n,) [N·m]"""
        pin, model, data = self.pin, self.model, self.data
        C = pin.computeCoriolisMatrix(model, data, q, dq)
        p = pin.crba(model, data, q) @ dq
        gravity = pin.computeGeneralizedGravity(model, data, q)
        # Presliding friction goes on from the sample before.
        mu = C.T @ dq - gravity - self.friction.torque(q[None], dq[None], gravity[None])[0]
        mean = torque if self.averaged else 0.0
        mu += torque - mean
        if self.p is None:
            self.p, self.mu = p, mu
            return self.tau
        ahead = self.p + self.system.a12 * self.tau
        ahead += self.step * (0.5 * (mu + self.mu) + mean)
        innovation = p - ahead
        self.p, self.mu = ahead + self.gains.l1 * innovation, mu
        self.tau = self.system.a22 * self.tau + self.gains.l2 * innovation
        return self.tau

    def wrench(self, q: Array) -> Array:
        """Base-axes force pinv(J_Fᵀ) τ̂ of (46), or zero. (6,) [N, N·m]"""
        pin, frame = self.pin, self.model.getFrameId("flange")
        J = pin.computeFrameJacobian(self.model, self.data, q, frame, pin.LOCAL_WORLD_ALIGNED)
        (wrench,), (known,) = wrench_of(self.tau[None], J[None])
        # An unknown force must not move the arm.
        return wrench if known else np.zeros(6)


class Loop:
    """The controller's side: sensors, observer, phases, law, kinematics."""

    def __init__(
        self, arm: Arm, controller: Controller, observer: KalmanObserver, *, averaged: bool
    ) -> None:
        self.arm, self.controller = arm, controller
        nominal, self.interval = arm.true.nominal, 1.0 / log_rate(arm.scenario.sensing, arm.robot)
        self.span = self.interval if averaged else arm.scenario.step
        self.rng = np.random.default_rng(arm.seeds["sensing"])
        *sizes, effort = noise_sizes(arm)
        K = drive_constants(arm.robot)
        self.noise = *sizes, effort if K is None else effort * K
        self.sensor = OnlineKalman(observer, nominal, self.interval, averaged=averaged)
        self.solver = FlangeSolver(nominal)
        self.start = check_start(nominal, arm.q.copy())
        self.rotation, self.translation = self.solver.pose(self.start)
        self.law = Recursion([controller])
        self.dragged = np.zeros(6, bool)
        self.q_measured = self.q_command = self.q_before = self.start
        self.reach_step = np.fmin(arm.robot.limits.qd_max, np.inf) * controller.parameters.period
        self.reached, self.zeros, self.zero = True, list[Array](), np.zeros(6)

    def sample(self) -> None:
        """Run the observer on one noisy sample."""
        arm = self.arm
        q, dq, torque = (size * self.rng.standard_normal(len(size)) for size in self.noise)
        self.q_measured = rounded(arm.q + q, arm.scenario.sensing.position_step)
        self.sensor.sample(self.q_measured, arm.v + dq, arm.mean_torque(self.span) + torque)

    def act(self, zero: tuple[float, float] | None) -> dict[str, Any]:
        """One control period, as a row: Algorithm 1, or rest."""
        t, wrench = self.arm.t, self.sensor.wrench(self.q_measured)
        # Following its own drift it would never find a still arm's zero.
        first, last = zero or (np.inf, -np.inf)
        if first <= t <= last:
            self.zeros.append(wrench)
            self.zero = np.mean(self.zeros, axis=0)
        wrench = wrench - self.zero
        if t > last:
            self.control(wrench)
        return {
            "t": t,
            "estimate": wrench,
            "dragged": self.dragged.copy(),
            "commanded": self.law.x[0].copy(),
            "q": self.arm.q.copy(),
            "reached": self.reached,
        }

    def control(self, wrench: Array) -> None:
        """One control period of Algorithm 1 under a wrench. (6,) [N, N·m]"""
        (self.dragged,), (force,) = phases(wrench[None], self.controller.parameters, self.dragged)
        law, last = self.law, self.q_command
        x, v, turn = law.x, law.v, law.turn
        law.step(force, self.dragged)
        self.reached, wanted = False, law.x[0]
        if np.isfinite(wanted).all():
            goal, point = exp_matrix(wanted[3:]) @ self.rotation, self.translation + wanted[:3]
            q, good = self.solver.reach(goal, point, 2.0 * last - self.q_before)
            self.reached = bool(good and np.max(abs(q - last) / self.reach_step) <= 1.0)
        self.q_before = last
        if self.reached:
            self.q_command = q
        else:  # out of reach or too fast for a joint: wait at rest, as at a wall
            law.x, law.v, law.turn = x, 0.0 * v, turn


#: No built-in closed-loop scenario touches the arm in this span. [s]
UNLOADED = (0.5, 3.0)


def loop_of(
    name: str,
    control: ControlChoice,
    observers: ObserverChoice,
    **how: Any,  # noqa: ANN401 - of `run_closed_loop`
) -> tuple[ClosedLoop, Robot]:
    """A run of the last controller on the first observer, and its arm."""
    scenario = load_scenario(name, ())
    arm = load_robot(scenario.robot)
    observer = observers.build(arm, 1.0 / log_rate(scenario.sensing, arm))[0][0]
    if not isinstance(observer, KalmanObserver):
        raise ParameterError("the closed loop runs kfo-fe or kfo-zoh; choose one with --observer")
    law, how = control.controllers(arm)[-1], {"zero": UNLOADED, **how}
    return run_closed_loop(scenario, law, observer, torque=control.loop_torque, **how), arm


def run_closed_loop(
    scenario: Scenario,
    controller: Controller,
    observer: KalmanObserver,
    *,
    seed: int | None = None,
    torque: str = "average",
    zero: tuple[float, float] | None = None,
    anyway: bool = False,
) -> ClosedLoop:
    """A closed-loop run: a scenario's contacts on an arm under admittance control.

    The torque is the "average" over the sampling interval, or the last "instant". In the
    span `zero` [s] the arm holds still, and its mean wrench is removed.
    """
    if torque not in {"average", "instant"}:
        raise ParameterError(f"torque is {torque!r}; it is average or instant")
    check_stable([controller], anyway=anyway)
    period = controller.parameters.period
    arm = still_arm(scenario, period, seed)
    loop = Loop(arm, controller, observer, averaged=torque == "average")
    log = list[dict[str, Any]]()
    step = arm.scenario.step
    every_sample = steps_in(loop.interval, step, "sampling interval")
    every_control = steps_in(period, step, "control period")
    stage("simulating")
    for k in steps(range(arm.steps)):
        if k % every_sample == 0:
            loop.sample()
        if k % every_control == 0:
            log.append(loop.act(zero))
            # The servo holds it until the next one.
            speed = (loop.q_command - loop.q_before) / period
            reference = Reference(loop.q_command[None], speed[None], np.zeros_like(speed)[None])
            forward = arm.servo.feed_forward(reference)[0]
            x = loop.law.x[0]
            near = np.isfinite(x).all() and np.linalg.norm(x[:3]) <= FARTHEST
            if not near or abs(arm.v).max() > 50.0:  # the arm has run away
                break
        arm.command(reference.q[0], reference.dq[0], reference.ddq[0], forward)
    columns = {name: np.array([row[name] for row in log]) for name in log[0]}
    t, simulation = columns["t"], observe(arm) if arm.made == arm.steps else None
    truth = np.full((len(t), 6), np.nan)
    if simulation is not None:
        truth = resample_columns(t, simulation.truth.t, simulation.truth.wrench)
    if zero is not None:
        columns["estimate"][t < zero[0]] = np.nan
    return ClosedLoop(
        controller=controller,
        truth=truth,
        moved=deviation_of(arm.true.nominal, loop.start, columns["q"]),
        zero=loop.zero,
        simulation=simulation,
        **columns,
    )


def still_arm(scenario: Scenario, period: float, seed: int | None) -> Arm:
    """The scenario's arm at rest; its inner step divides the period."""
    robot = load_robot(scenario.robot)
    count = period / scenario.step
    if abs(count - round(count)) >= 1e-9:
        scenario = replace(scenario, step=float(period / np.ceil(count + 2)))
    duration = scenario.duration or scenario.trajectory.motion(robot).duration
    q = plan(scenario.trajectory, robot, np.array([0.0])).q
    still = Reference(q, 0.0 * q, 0.0 * q)
    return Arm(scenario, scenario.seed if seed is None else seed, still, duration)


def steps_in(interval: float, step: float, what: str) -> int:
    """Number of inner steps of an interval."""
    count = round(interval / step)
    if count < 1 or abs(interval / step - count) > 1e-6:
        raise ParameterError(
            f"the {what} of {1e3 * interval:g} ms is no multiple of the inner step of "
            f"{1e3 * step:g} ms; set step to one that divides it"
        )
    return count


class Replayed(NamedTuple):
    """A force through admittance controllers, and its source."""

    replay: Replay  #: The comparison.
    recording: Recording | None = None  #: The log, None without one.
    run: ClosedLoop | None = None  #: A closed-loop run, or None.
    examinations: tuple[Examination, ...] = ()  #: Findings on the log.


class Latency(NamedTuple):
    """Times of one application of a force [s], or None."""

    axis: int  #: Index of the axis that passes its threshold first.
    force: float  #: When it passes.
    detection: float | None  #: Time from then until the estimate passes it.
    #: Time from `force` until the flange has moved by `STARTED` (or `TURNED`).
    motion: float | None
    #: Time from the true force's fall below the threshold to the estimate's.
    withdrawal: float | None
    #: From detection until the flange has moved as far again. [s]
    reaction: float | None
    #: From the estimate's fall below the threshold to the turn. [s]
    turn: float | None
    #: Whether the flange was at rest before; else `motion` says nothing.
    rested: bool


def latencies(run: ClosedLoop) -> tuple[Latency, ...]:
    """One entry for each application of a force above a threshold."""
    threshold = run.controller.parameters.threshold
    rows = np.flatnonzero(np.any(abs(run.truth) > threshold, axis=1))
    quiet = max(round(REST / run.controller.parameters.period), 1)
    first = rows[np.diff(rows, prepend=-quiet) >= quiet]
    return tuple(latency_of(run, k, threshold) for k in first.tolist())


def latency_of(run: ClosedLoop, k: int, threshold: Array) -> Latency:
    """The latencies of the contact that begins in row `k`."""
    axis = int(np.argmax(abs(run.truth[k]) / threshold))
    limit, t = threshold[axis], run.t
    felt, there = abs(run.estimate[:, axis]) > limit, abs(run.truth[:, axis]) > limit
    rotates = axis >= 3
    moved = run.moved[:, 3:] if rotates else run.moved[:, :3]
    start = TURNED if rotates else STARTED

    def far(since: int) -> Mask:
        return np.asarray(np.linalg.norm(moved - moved[since], axis=1) > start)

    def until(flags: Mask, row: int | None) -> float | None:
        """Time from a row to the first set from there on, or None. [s]"""
        found = first_true(flags, row)
        return None if row is None or found is None else (t[found] - t[row])

    before = max(k - 3, 0)
    speed = np.linalg.norm(moved[k] - moved[before]) / max(t[k] - t[before], 1e-9)
    seen, ends = first_true(felt, k), first_true(~there, k)
    turned = np.append(np.diff(np.linalg.norm(moved, axis=1)) <= 0.0, False)
    return Latency(
        axis=axis,
        force=t[k],
        detection=until(felt, k),
        motion=until(far(k), k),
        withdrawal=until(~felt, ends),
        reaction=None if seen is None else until(far(seen), seen),
        turn=until(turned, first_true(~felt, ends)),
        rested=speed < STILL[rotates],
    )


def first_true(flags: Mask, start: int | None) -> int | None:
    """First row from `start` on that is set, or None."""
    if start is None or not flags[start:].any():
        return None
    return start + int(flags[start:].argmax())
