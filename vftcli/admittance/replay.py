"""Replay: one force record or one release through several controllers.

The wrench that drives it is an observer's, the log's own sensor's, or a truth file's.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from vftcli.admittance.law import (
    AXES,
    Admittance,
    Controller,
    check_stable,
    energy,
    printed_energy,
)
from vftcli.admittance.motion import (
    AxisMotion,
    Drag,
    JointPath,
    Phases,
    check_start,
    drags_of,
    follow,
    phases,
    release,
    rows_of,
    run,
)
from vftcli.robots.chain import link_poses
from vftcli.robots.robot import Robot
from vftcli.signals.arrays import Array, Indices, median_step
from vftcli.signals.errors import ParameterError, ReferenceTorqueError
from vftcli.signals.external_torque import ExternalTorque
from vftcli.signals.filters import refuse_mostly_gap
from vftcli.signals.option import assignment, numbers
from vftcli.signals.pose import log_matrix
from vftcli.signals.recording import Recording
from vftcli.signals.remarks import Remark, Where, caution, fact, warning
from vftcli.signals.wrench import Wrench
from vftcli.wrench import SMOOTHER, WrenchChoice
from vftcli.wrench.sensor import without_zero
from vftcli.wrench.solvers import VirtualSensor, logged_wrench

LONGEST = 600.0  #: Longest release that is computed. [s]
#: A flange that stays this near to its first pose is at rest. [m]
LEAST_TRAVEL = 0.01


@dataclass(frozen=True, kw_only=True)
class Replay:
    """Motions of all controllers under one force record, or one release."""

    robot: Robot  #: The arm.
    controllers: tuple[Controller, ...]  #: The controllers.
    #: Where the force comes from.
    source: Remark = field(default_factory=lambda: fact("force-of-release"))
    start: Array  #: Joint positions of the target pose X_d. (n,) [rad]
    #: Wrench on the robot each period, base axes. (T, 6) [N, N·m]
    wrench: Array
    motion: AxisMotion  #: Its motion, row 0 before the first force.
    drags: tuple[Drag, ...]  #: The drags of every axis.
    #: Logged flange less X_d, None for a release. (T, 6) [m, rad]
    logged: Array | None = None
    force_remarks: tuple[Remark, ...] = ()  #: Of the force and of stability.

    @property
    def parameters(self) -> Admittance:
        """The admittance parameters, those of all controllers."""
        return self.controllers[0].parameters

    @cached_property
    def phases(self) -> Phases:
        """Algorithm 1's phases, the same for all controllers."""
        return phases(self.wrench, self.parameters)

    @cached_property
    def path(self) -> JointPath:
        """Joint positions along the motion."""
        return follow(self.robot, self.start, self.motion.x, self.parameters.period)

    @cached_property
    def rows(self) -> tuple[dict[str, Any], ...]:
        """The comparison, one row a controller, axis and drag."""
        force = np.nan_to_num(self.wrench)
        return tuple(rows_of(self.controllers, self.motion, self.drags, force))

    @cached_property
    def lyapunov(self) -> tuple[Array, Array]:
        """Energies along the run, NaN in a drag phase. (T+1, N, 6) each [J]

        W must not rise in a recovery phase into which no force enters; V is that of (52).
        """
        dragged, motion = self.phases.dragged, self.motion
        # Row k + 1 is in the phase of the force before it.
        hidden = np.concatenate([dragged[:1], dragged])
        W, V = np.full((2, *motion.x.shape), np.nan)
        with np.errstate(over="ignore", invalid="ignore"):
            for n, one in enumerate(self.controllers):
                state = one, motion.x[:, n], motion.v[:, n]
                W[:, n] = np.where(hidden, np.nan, energy(*state))
                V[:, n] = np.where(hidden, np.nan, printed_energy(*state))
        return W, V

    @property
    def remarks(self) -> tuple[Remark, ...]:
        """Remarks for the reader."""
        return (*self.force_remarks, *drag_remarks(self), *trouble(self))


def replay(
    wrench: Wrench,
    q: Array,
    robot: Robot,
    controllers: Sequence[Controller],
    *,
    source: Remark,
    anyway: bool = False,
) -> Replay:
    """Motions of controllers that hold a log's first pose, driven by its wrench.

    The wrench is in base axes about the flange point; q (T, n) [rad] is on its clock.
    """
    if len(wrench.t) > 1:
        refuse_mostly_gap(wrench.t, median_step(wrench.t))
    complaints, parameters = check_stable(controllers, anyway=anyway), controllers[0].parameters
    clock, newest = on_control_clock(wrench.t, parameters.period)
    force, q = wrench.known[newest], q[newest]
    start = check_start(robot, q[0])
    split = phases(force, parameters)
    motion = run(controllers, split.force, split.dragged)
    unknown = np.count_nonzero(~np.isfinite(wrench.known).all(axis=1))
    missing = (caution("force-unknown", samples=unknown),) if unknown else ()
    return Replay(
        robot=robot,
        controllers=tuple(controllers),
        source=source,
        start=start,
        wrench=force,
        motion=motion._replace(t=motion.t + clock[0]),
        drags=drags_of(split, parameters.period),
        logged=deviation_of(robot, start, q),
        force_remarks=(*wrench.remarks, *missing, *complaints),
    )


def replay_release(
    x: Array,
    robot: Robot,
    controllers: Sequence[Controller],
    *,
    start: Array,
    duration: float | None = None,
    anyway: bool = False,
) -> Replay:
    """Motions after release at `x` (6,) [m, rad] from pose `start` (n,) [rad]."""
    if not x.any():
        raise ParameterError(
            "a release needs a deviation, as --release x=0.3 [m] or --release rz=0.5 [rad]"
        )
    complaints = check_stable(controllers, anyway=anyway, release=x)
    motion = release(controllers, x, duration or settling(controllers, x))
    rows = len(motion.t)
    return Replay(
        robot=robot,
        controllers=tuple(controllers),
        start=check_start(robot, start),
        wrench=np.zeros((rows - 1, 6)),
        motion=motion,
        # Each released axis as a drag that ended at row 0.
        drags=tuple(Drag(axis, 1, 0, 0, rows) for axis in np.flatnonzero(x).tolist()),
        force_remarks=complaints,
    )


def release_deviation(assignments: Sequence[str]) -> Array:
    """Deviation of a release from ``axis=value`` assignments. (6,) [m, rad]"""
    x = np.zeros(6)
    form = f"AXIS=VALUE with an axis of {', '.join(AXES)}, as x=0.3 [m] or rz=0.5 [rad]"
    for part in ",".join(assignments).split(","):
        axis, text = assignment(part, "--release", form)
        value = numbers(text)
        if axis not in AXES or not value or not np.isfinite(value[0]):
            raise ParameterError(f"--release {part!r} is not {form}")
        x[AXES.index(axis)] = value[0]
    moved, turned = np.linalg.norm(x.reshape(2, 3), axis=1)
    if moved >= 10.0 or turned >= np.pi:
        raise ParameterError(
            f"--release moves by {moved:.3g} m and turns by {turned:.3g} rad; it must be less "
            "than 10 m and π"
        )
    return x


def settling(controllers: Sequence[Controller], x: Array) -> float:
    """Time after which every controller is within 1 % of a release. [s]"""
    rates = []
    for controller in controllers:
        p, xi = controller.parameters, np.maximum(controller.xi, 1e-3)
        omega = controller.alpha * np.sqrt(p.stiffness / p.mass)
        rates.append(omega * (xi - np.sqrt(np.maximum(xi**2 - 1.0, 0.0))))
    return float(np.clip(6.0 / np.min(rates, axis=0)[x != 0.0].min(), 1.0, LONGEST))


def on_control_clock(t: Array, period: float) -> tuple[Array, Indices]:
    """Times a period apart (S,) [s], and the newest sample's number then. (S,)"""
    clock = t[0] + np.arange(np.floor((t[-1] - t[0]) / period + 1e-6) + 1) * period
    # Half a microsecond of slack, as stamps are printed.
    newest = t.searchsorted(clock + 5e-7 + 1e-3 * period, side="right") - 1
    return clock, np.maximum(newest, 0)


def deviation_of(robot: Robot, start: Array, q: Array) -> Array:
    """The log's flange, as a deviation from a pose. (T, 6) [m, rad]"""
    R, p = (part[:, -1] for part in link_poses(robot.chain, np.vstack([start, q])))
    return np.hstack([p[1:] - p[0], log_matrix(R[1:] @ R[0].T)])


def drag_remarks(found: Replay) -> Iterator[Remark]:
    """The log's axis nearest to its threshold, if none was dragged."""
    if found.logged is not None and not found.drags and len(found.wrench):
        threshold = found.parameters.threshold
        share = abs(np.nan_to_num(found.wrench)).max(axis=0) / np.maximum(threshold, 1e-12)
        k = share.argmax()
        yield caution("no-drag", axis=AXES[k], share=share[k], threshold=threshold[k])


def trouble(found: Replay) -> Iterator[Remark]:
    """Remarks on errors, limits and impossible travel."""
    motion, path, travel = found.motion, found.path, []
    for n, controller in enumerate(found.controllers):
        where = Where(controller.name)
        if motion.escaped[n]:
            k = np.isfinite(motion.x[:, n]).all(axis=1).argmin()
            yield warning("motion-escaped", where, time_s=motion.t[k])
        v = motion.v[1:, n]
        at_limit = np.isfinite(v) & (abs(v) == controller.parameters.speed_limit)
        if acted := np.count_nonzero(at_limit.any(axis=1)):
            yield fact("speed-limit-acted", where, periods=acted)
        reached = path.reached[:, n]
        if lost := np.count_nonzero(~reached):
            rows = {"lost": lost, "poses": len(reached), "first_s": motion.t[reached.argmin()]}
            yield caution("poses-out-of-reach", where, **rows)
            way = np.linalg.norm(motion.x[:, n, :3], axis=1)
            travel.append(np.nan_to_num(way, nan=np.inf).max())
        if path.speed[n] > 1.0:
            yield caution("joint-too-fast", where, share=path.speed[n])
    # Where every pose is reached the travel is plausible, however long.
    if travel:
        hard = "-hard" if found.parameters.threshold_mode == "hard" else ""
        yield caution(f"travel-implausible{hard}", travel_m=max(travel))
    if found.logged is not None:
        far = np.linalg.norm(found.logged[:, :3], axis=1).max()
        if far >= LEAST_TRAVEL:
            yield fact("log-arm-moved", distance_m=far)


class DrivingForce(NamedTuple):
    """A replay's wrench."""

    wrench: Wrench  #: Force on the robot, base axes, about the flange point.
    source: Remark  #: Where it comes from.


def stored_force(
    recording: Recording, robot: Robot, choice: WrenchChoice, observer: str
) -> DrivingForce:
    """The virtual sensor's wrench of an observer's stored torque."""
    if choice.solver == SMOOTHER:
        raise ParameterError(
            "virtual-sensor.solver=smoother needs the log itself, not a file of estimates; "
            "give the log, or leave the setting out"
        )
    estimate = ExternalTorque(name=observer, t=recording.t, tau=recording.require("tau_ext"))
    sensor = VirtualSensor(
        solver=choice.by_pose, frame=choice.frame, mounting=choice.mounting(robot)
    )
    # Nobody kept this torque's covariance: its band says nothing.
    seen = replace(sensor.wrench(estimate, recording.q, robot.chain), remarks=())
    return DrivingForce(
        without_zero(seen, choice.zero), fact("force-of-observer", observer=observer)
    )


def sensor_force(recording: Recording, robot: Robot, choice: WrenchChoice) -> DrivingForce:
    """The log's own wrench."""
    frame = recording.wrench_frame
    source = fact("force-of-sensor", frame=str(frame) if frame else "frame not stated")
    wrench = logged_wrench(recording, robot.chain, choice.mounting(robot))
    return DrivingForce(without_zero(wrench, choice.zero), source)


def truth_force(
    recording: Recording, robot: Robot, choice: WrenchChoice, path: Path
) -> DrivingForce:
    """The wrench of a truth file, on the log's own clock."""
    # Few replays have a truth, and reading one loads the references.
    from vftcli.evaluation.references import file_reference

    wrench = file_reference(path, recording, robot, choice.mounting(robot)).wrench
    if wrench is None:
        raise ReferenceTorqueError(
            f"{path}: it has no wrench; a truth file has wrench/fx … wrench/mz at the flange"
        )
    return DrivingForce(without_zero(wrench, choice.zero), fact("force-of-truth", file=path.name))
