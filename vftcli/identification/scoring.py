"""How well a robot predicts a log's torque, scored as in the docs: filtered, in motion."""

from collections.abc import Sequence

import numpy as np

from vftcli.identification.processing import (
    PreparedLog,
    Processing,
    gravity_torque,
    prepare,
    root_mean_square,
)
from vftcli.identification.result import Trace
from vftcli.robots.drive import uses_current
from vftcli.robots.friction import SMOOTHING
from vftcli.robots.regressor import LINK, chain_parameters, torque_regressor
from vftcli.robots.robot import Robot
from vftcli.robots.running_friction import RunningFriction
from vftcli.robots.temperature import measured_temperature
from vftcli.signals.arrays import Array
from vftcli.signals.least_squares import fit_column
from vftcli.signals.recording import Recording
from vftcli.signals.remarks import Remark, Where, caution, fact
from vftcli.signals.rest import faster
from vftcli.signals.series import resample_columns

EXPLAINS = 0.4  #: Share of a residual that a cause must explain to be named.
HEAVY = 0.3  #: Smallest load that is remarked on. [kg]
ENOUGH = 50  #: Samples in motion that a remark on friction needs.
WORSE = 1.5  #: A held-out joint whose residual is this many times the training's is remarked on.
#: A model that leaves this many times what the profile leaves of a log has made it worse.
BEHIND = 1.01
NEAR = 0.01  #: Largest joint distance at which two samples are the same place. [rad]
SLOWNESS = 0.1  #: Velocity difference that counts as much as that distance, as a time. [s]
#: Share of a log's samples on another's trajectory from which on it repeats that trajectory.
REPEATED = 0.8


def rigid_torque(robot: Robot, motion: PreparedLog) -> Array:
    """Rigid-body torque of the loaded arm, without rotors. (M, n) [N·m]"""
    phi = chain_parameters(robot.loaded_chain)
    out = np.empty(motion.q.shape)
    for span in motion.chunks():
        state = motion.q[span], motion.dq[span], motion.ddq[span]
        out[span] = torque_regressor(robot.chain, *state) @ phi
    return out


def predicted_torque(robot: Robot, motion: PreparedLog) -> Array:
    """Torque the drives need by the robot's model, friction filtered like the log. (M, n) [N·m]"""
    torque = rigid_torque(robot, motion) + robot.chain.rotor_inertia * motion.ddq
    if not robot.friction:
        return torque
    recording = motion.recording
    load = gravity_torque(robot, recording.q)
    friction = RunningFriction(robot.friction).torque(
        recording.q, recording.require("dq"), load, measured_temperature(recording)
    )
    total: Array = torque + motion.filtered(friction)
    return total


def score(log: Recording, role: str, profile: Robot, robot: Robot, processing: Processing) -> Trace:
    """Measured torque of a log beside what the identified robot and the profile expect."""
    motion = prepare(log, profile, processing)
    if motion.samples < 2:
        return Trace(motion, role, motion.tau, motion.tau, np.zeros(motion.tau.shape[1]))
    before = root_mean_square(motion.tau - predicted_torque(profile, motion))
    old, new, measured = profile.torque_constant, robot.torque_constant, motion.tau
    # What was made from currents with the old constants is made with the new.
    if old is not None and new is not None and uses_current(log, profile):
        measured = measured * (new / old)
    return Trace(motion, role, measured, predicted_torque(robot, motion), before)


def score_remarks(robot: Robot, traces: Sequence[Trace]) -> list[Remark]:
    """What the scores mean: logs that got worse or repeat others, joints much worse elsewhere."""
    train = [trace for trace in traces if trace.role == "train"]
    held_out = [trace for trace in traces if trace.role == "held-out"]
    remarks = []
    for trace in traces:
        left, before = float(np.mean(trace.rms)), float(np.mean(trace.before))
        if left > BEHIND * before > 0.0:
            where = Where(trace.motion.recording.name)
            remarks.append(
                caution("worse-than-profile", where, identified_Nm=left, profile_Nm=before)
            )
    for test in held_out:
        where = Where(test.motion.recording.name)
        for other in (trace.motion for trace in train):
            if (share := repeated_share(other, test.motion)) >= REPEATED:
                values = {"training_log": other.recording.name, "share_percent": 100.0 * share}
                remarks.append(caution("repeated-trajectory", where, **values))
    if not train:
        return remarks
    level = np.mean([trace.rms for trace in train], axis=0)
    for test in held_out:
        remarks += held_out_remarks(robot, test, level)
    return [*remarks, fact("training-residual", mean_Nm=float(np.mean(level)))]


def held_out_remarks(robot: Robot, trace: Trace, trained: Array) -> list[Remark]:
    """Causes of a held-out log's residual where it is much larger than in training.

    A load on the flange explains all joints at once and is looked for first; what is left is
    looked at joint by joint.

    Args:
        robot: The identified robot.
        trace: The held-out log.
        trained: RMS of the training logs. (n,) [N·m]
    """
    motion, name = trace.motion, trace.motion.recording.name
    worse = np.flatnonzero(trace.rms > WORSE * trained).tolist()
    if not worse:
        return []
    mass, explained = apparent_load(robot, motion, trace.residual)
    if explained > EXPLAINS and abs(mass) > HEAVY:
        share = 100.0 * explained
        return [caution("apparent-load", Where(name), mass_kg=mass, share_percent=share)]
    moving = np.count_nonzero(motion.usable & faster(motion.dq), axis=0)
    resting = [j for j in worse if moving[j] < ENOUGH]
    remarks = [joint_remark(trace, j, float(trained[j])) for j in worse if j not in resting]
    if resting:
        remarks.append(fact("resting-joints", Where(name, tuple(j + 1 for j in resting))))
    return remarks


def apparent_load(robot: Robot, motion: PreparedLog, residual: Array) -> tuple[float, float]:
    """Mass that would explain the residual, and the share of it that it explains. [kg], [1]"""
    Y = [
        torque_regressor(robot.chain, motion.q[s], motion.dq[s], motion.ddq[s])[:, :, -LINK:]
        for s in motion.chunks()
    ]
    A = np.concatenate(Y)[:, :, :4].reshape(-1, 4)
    y = residual.ravel()
    x = np.linalg.lstsq(A, y, rcond=1e-6)[0]
    return float(x[0]), 1.0 - float(np.sum((y - A @ x) ** 2) / max(np.sum(y**2), 1e-12))


def joint_remark(trace: Trace, j: int, trained: float) -> Remark:
    """Whether friction explains how the residual of joint j (from 0) differs from training.

    Coulomb and viscous friction and an offset are fitted to the residual; where they explain
    `EXPLAINS` of it, friction is named as its cause.

    Args:
        trace: The held-out log.
        j: Joint, from 0.
        trained: RMS of its residual in the training logs. [N·m]
    """
    motion, residual, size = trace.motion, trace.residual, float(trace.rms[j])
    where = Where(motion.recording.name, (j + 1,))
    values = {"rms_Nm": size, "ratio": size / trained}
    dq = motion.recording.require("dq")[:, j]
    used = (motion.usable & faster(motion.dq))[:, j]
    sign = np.tanh(dq / SMOOTHING)
    A = np.column_stack([motion.filtered(np.column_stack([sign, dq])), np.ones(motion.samples)])
    fit = fit_column(A, residual[:, j], used.astype(float))
    left = float(np.mean(fit.residual[used] ** 2))
    explained = 1.0 - left / max(float(np.mean(residual[used, j] ** 2)), 1e-12)
    if explained < EXPLAINS:
        return caution("larger-residual", where, **values)
    speed = float(np.sqrt(np.mean(motion.dq[used, j] ** 2)))
    more = float(fit.values[0] + fit.values[1] * speed)
    values |= {"friction_Nm": abs(more), "speed_rad_s": speed, "share_percent": 100.0 * explained}
    return caution("more-friction" if more > 0 else "less-friction", where, **values)


def repeated_share(train: PreparedLog, test: PreparedLog) -> float:
    """Share of the test's moving samples that lie on the training log's path through (q, q̇).

    A log that repeats the training's trajectory is no test of a model made from it: whatever error
    the model has along that path, it has fitted.
    """
    from scipy.spatial import cKDTree

    if train.samples == 0 or test.samples == 0:
        return 0.0
    path, points = (np.hstack([log.q, SLOWNESS * log.dq]) for log in (train, test))
    # Between samples the path is interpolated, so that its points lie nearer than `NEAR`.
    index = np.arange(0, len(path) - 1 + 1e-9, 0.25)
    tree = cKDTree(resample_columns(index, np.arange(float(len(path))), path))
    distance, _ = tree.query(points, p=np.inf, distance_upper_bound=NEAR)
    return float(np.mean(np.isfinite(distance)))
