"""How well a robot predicts a log's torque, scored as in the docs: filtered, in motion."""

from collections.abc import Sequence

import numpy as np

from vftcli.identification.excitation import SLOW
from vftcli.identification.least_squares import fit_column
from vftcli.identification.processing import PreparedLog, gravity_torque
from vftcli.robots.friction import friction_torque
from vftcli.robots.regressor import LINK, chain_parameters, torque_regressor
from vftcli.robots.robot import Robot
from vftcli.signals.arrays import Array, Mask

EXPLAINS = 0.4
"""Share of a residual that a cause must explain to be named."""

HEAVY = 0.3
"""Smallest load that is remarked on. [kg]"""

TOLD = 50
"""Samples in motion that a remark on friction needs."""

WORSE = 1.5
"""A held-out joint whose residual is this many times the training's is remarked on."""


def rigid_torque(robot: Robot, motion: PreparedLog) -> Array:
    """Rigid-body torque of the loaded arm without its rotors. (M, n) [N·m]"""
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
    friction = friction_torque(robot.friction, recording.require("dq"), load)
    total: Array = torque + motion.filtered(friction)
    return total


def rms(residual: Array) -> Array:
    """Root mean square per joint. (n,)"""
    value: Array = np.sqrt(np.mean(residual**2, axis=0))
    return value


def diagnosis(robot: Robot, motion: PreparedLog, residual: Array, trained: Array) -> list[str]:
    """What a held-out log's residual looks like where it is much larger than in training.

    Args:
        robot: The identified robot.
        motion: The held-out log.
        residual: Measured less predicted. (M, n) [N·m]
        trained: RMS of the training logs. (n,) [N·m]
    """
    sizes, name = rms(residual), motion.recording.name
    worse = np.flatnonzero(sizes > WORSE * trained)
    if not worse.size:
        return []
    mass, explained = apparent_load(robot, motion, residual)
    if explained > EXPLAINS and abs(mass) > HEAVY:
        return [
            f"{name}: the residual looks like {mass:+.2f} kg on the flange "
            f"({100 * explained:.0f} % of it); find the load with --find-payload"
        ]
    resting = [int(j) for j in worse if np.count_nonzero(in_motion(motion, int(j))) < TOLD]
    moving = [int(j) for j in worse if int(j) not in resting]
    remarks = [rubbing(motion, residual, j, float(sizes[j]), float(trained[j])) for j in moving]
    if resting:
        names = ", ".join(str(j + 1) for j in resting)
        remarks.append(f"joints that rest ({names}) keep what stiction holds; they say nothing")
    return [f"{name}: {text}" for text in remarks]


def in_motion(motion: PreparedLog, j: int) -> Mask:
    """Where a joint moves fast enough to tell its friction. (M,)"""
    moving: Mask = motion.usable[:, j] & (np.abs(motion.dq[:, j]) > SLOW)
    return moving


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


def rubbing(motion: PreparedLog, residual: Array, j: int, size: float, trained: float) -> str:
    """How a moving joint's residual differs from the training's: by friction, or unexplained."""
    text = f"joint {j + 1} leaves {size:.2f} N·m, {size / trained:.1f} × the training's"
    dq = motion.recording.require("dq")[:, j]
    used = in_motion(motion, j)
    sign = np.tanh(dq / 0.01)
    A = np.column_stack([motion.filtered(np.column_stack([sign, dq])), np.ones(motion.samples)])
    fit = fit_column(A, residual[:, j], used.astype(float))
    left = float(np.mean(fit.residual[used] ** 2))
    explained = 1.0 - left / max(float(np.mean(residual[used, j] ** 2)), 1e-12)
    if explained < EXPLAINS:
        return text
    speed = float(np.sqrt(np.mean(motion.dq[used, j] ** 2)))
    more = fit.values[0] + fit.values[1] * speed
    return (
        f"{text}; it rubs {abs(more):.1f} N·m {'more' if more > 0 else 'less'} there at "
        f"{speed:.1f} rad/s ({100 * explained:.0f} % of the residual): "
        "identify friction on the day, with the arm warm"
    )


def mean_text(values: Sequence[float] | Array) -> str:
    """Mean of the joints, for remarks."""
    return f"{float(np.mean(values)):.3f} N·m"
