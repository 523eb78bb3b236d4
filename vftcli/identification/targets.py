"""Method "targets": a UR controller's own model of its arm, by its targets.

The controller logs its inverse dynamics' torque (target_moment) and its expected current
(target_current). At rest their ratio is K; in motion target_moment less the rigid body is
J q̈, and K·target_current − target_moment its friction. A hand changes no target.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from vftcli.identification.friction_fit import LIGHT, is_dissipative
from vftcli.identification.methods import (
    MethodResult,
    Number,
    identified_friction,
    number,
    profile_friction,
    temperature_remarks,
)
from vftcli.identification.shapes import LOGARITHMIC_VELOCITIES, Shape, bent, round_digits
from vftcli.identification.training import PreparedLog, Training, prepare
from vftcli.robots.friction import friction_torque
from vftcli.robots.robot import Robot
from vftcli.robots.terms import gravity_torque
from vftcli.signals.arrays import Array, runs_of
from vftcli.signals.errors import IdentificationError
from vftcli.signals.estimation import fit_column, solve
from vftcli.signals.filters import derivative, zero_phase
from vftcli.signals.recording import Recording
from vftcli.signals.remarks import Remark, caution, on_joints
from vftcli.signals.rest import NONZERO, SLIDES, faster

#: Cutoff for targets: above it the measured motion departs from them. [Hz]
CUTOFF = 4.0
#: Largest relative deviation of a determined drive constant.
CONSTANT_KNOWN = 1e-2
ROTOR_KNOWN = 2e-2  #: That of a rotor inertia.
#: Friction shapes that must agree on drive constants.
SHAPES = (
    Shape(("coulomb", "viscous", "quadratic")),
    Shape(("coulomb", "viscous", "quadratic", "offset")),
)
#: Friction shapes, the best of them written if the law has too few points.
WRITTEN = tuple(
    Shape(("coulomb", "logarithmic"), logarithmic_velocity=bend)
    for bend in LOGARITHMIC_VELOCITIES
)
UNASKED = 0.5  #: Least share of motion with a target velocity.
#: Most of the law in a joint's friction under a guiding hand; programs feed .8 to 1.3 of it
#: forward, by temperature and load.
GUIDED = 0.4
SPEEDS = (0.0, 0.05, 0.1, 0.2)  #: Lowest speeds that must agree too. [rad/s]
SETTLE = 0.1  #: Cut at both ends of a rest. [s]
STEADY = 5e-3  #: Largest relative change of the target current in a rest.


class Estimate(NamedTuple):
    """A number, its SD, and whether the log determines it."""

    value: float
    sd: float
    known: bool


UNKNOWN = Estimate(np.nan, np.inf, False)
#: A friction shape, its coefficients, their deviations. (k,), (k,)
FrictionLaw = tuple[Shape, Array, Array]


class ControllerModel(NamedTuple):
    """The controller's model of one joint."""

    constant: Estimate  #: Drive constant K. [N·m/A]
    rotor: Estimate  #: Reflected rotor inertia. [kg·m²]
    friction: FrictionLaw | None  #: Its feed-forward law, None at rest.


def targets_method(data: Training) -> MethodResult:
    """K, rotor inertia and friction of the controller's own model."""
    robot = data.robot
    models = list(controller_models(data.recordings, robot))
    rotor, frictions = robot.chain.rotor_inertia.copy(), list(profile_friction(robot))
    constants = np.array(robot.torque_constant, float)
    numbers, remarks = list[Number](), list[Remark]()
    for j, model in enumerate(models):
        for name, found, own in (
            ("torque_constant", model.constant, constants),
            ("rotor_inertia", model.rotor, rotor),
        ):
            numbers.append(number(j, name, found.value, found.sd, own[j], found.known))
            if found.known:
                own[j] = round_digits(found.value)
        remarks += target_remarks(j, model, robot)
        if model.friction is not None:
            frictions[j], more = identified_friction(data, j, *model.friction, "targets")
            numbers += more
    remarks += temperature_remarks(data)
    chain = replace(robot.chain, rotor_inertia=rotor)
    new = replace(robot, chain=chain, friction=tuple(frictions), torque_constant=constants)
    return MethodResult("targets", new, numbers, remarks)


def target_remarks(j: int, model: ControllerModel, robot: Robot) -> Iterator[Remark]:
    """Remarks on joint j's (from 0) open numbers: the profile's stay."""
    where = on_joints([j])
    if not model.constant.known:
        found, sd, _ = model.constant
        values = {"profile_NmA": np.array(robot.torque_constant, float)[j]}
        if np.isfinite(sd):
            values |= {"found_NmA": found, "sd_NmA": sd}
        code = "undetermined" if np.isfinite(sd) else "unexcited"
        yield caution(f"{code}-drive-constant", where, **values)
    if not model.rotor.known:
        yield caution("unaccelerated-joint", where, profile_kgm2=robot.chain.rotor_inertia[j])
    if model.friction is None:
        yield caution("unexcited-friction", where)


class ControllerTargets(NamedTuple):
    """Targets beside the motion, filtered alike, of logs."""

    logs: tuple[PreparedLog, ...]  #: The logs.
    dq: Array  #: Measured velocities. (M, n) [rad/s]
    ddq: Array  #: Measured accelerations. (M, n) [rad/s²]
    current: Array  #: Target current. (M, n) [A]
    moment: Array  #: Target moment. (M, n) [N·m]
    lead: Array  #: Its time derivative: effect of a time shift. (M, n) [N·m/s]
    rigid: Array  #: The profile's rigid-body torque. (M, n) [N·m]
    gravity: Array  #: The profile's gravity torque. (M, n) [N·m]

    def columns(self, j: int, shape: Shape) -> Array:
        """Friction columns of joint j (from 0). (M, k)"""
        return np.concatenate([log.friction(j, shape) for log in self.logs])


def controller_models(recordings: Sequence[Recording], robot: Robot) -> Iterator[ControllerModel]:
    """The controller's model of every joint, by its filtered targets."""
    if robot.torque_constant is None:
        raise IdentificationError(
            f"robot {robot.name!r} has no torque constants, so its log has no target currents to "
            "read a model off; use --method friction or base"
        )
    each = list[ControllerTargets]()
    for recording in recordings:
        current, moment = (recording.require(f"target_{name}") for name in ("current", "torque"))
        motion, smooth = (
            prepare(recording, robot, CUTOFF),
            zero_phase(recording.t, moment, CUTOFF),
        )
        log = ControllerTargets(
            logs=(motion,),
            dq=motion.dq,
            ddq=motion.ddq,
            current=motion.filtered(current),
            moment=smooth[motion.kept],
            lead=derivative(recording.t, smooth)[motion.kept],
            rigid=motion.rigid,
            gravity=gravity_torque(robot, motion.q),
        )
        refuse_guided(recording, log, robot)
        each.append(log)
    motions, *signals = zip(*each, strict=True)
    every = ControllerTargets(sum(motions, ()), *map(np.concatenate, signals))
    for j, before in enumerate(robot.torque_constant):
        # Of two ways to K, the surer one wins; friction needs it.
        ways = constant_at_rest(j, every), constant_in_motion(j, every)
        K = min(ways, key=lambda k: k.sd / abs(k.value) if k.sd < np.inf else np.inf)
        friction = controller_friction(j, every, K.value if K.known else before)
        yield ControllerModel(K, rotor_inertia(j, every), friction)


def constant_at_rest(j: int, log: ControllerTargets) -> Estimate:
    """K from the ratio at rest, without friction; sd from the current's digits."""
    points = []
    for recording in (motion.recording for motion in log.logs):
        names, t = ("target_current", "target_torque"), recording.t
        current, moment = (recording.require(name)[:, j] for name in names)
        steps = np.diff(np.unique(current.round(9)))
        step = steps.min() if steps.size else 0.0  # its digits
        for start, stop in runs_of(~np.any(faster(recording.require("dq"), NONZERO), axis=1)):
            first, last = t[start] + SETTLE, t[stop - 1] - SETTLE
            inside = slice(t.searchsorted(first, side="right"), t.searchsorted(last))
            held = current[inside]
            if len(held) > 3:
                i, m = np.median(held), np.median(moment[inside])
                if np.ptp(held) <= max(4 * step, STEADY * abs(i)) and abs(i) > 20 * step:
                    points.append((i, m, step))
    if not points:
        return UNKNOWN
    i, m, steps = np.array(points).T
    value = i @ m / (i @ i)
    rounding = abs(value) * steps.max() / np.sqrt(12.0)
    sd = np.hypot(rounding, np.std(m - value * i)) / np.sqrt(i @ i)
    return Estimate(value, sd, value > 0 and sd <= CONSTANT_KNOWN * value)


def constant_in_motion(j: int, log: ControllerTargets) -> Estimate:
    """K from current against moment; sd from the friction's shapes."""
    moment, speed = log.moment[:, j], abs(log.dq[:, j])
    slopes = []
    for shape in SHAPES:
        A = np.column_stack([moment, log.columns(j, shape)])
        for used in (speed >= low for low in SPEEDS):
            if np.count_nonzero(used) >= 50 and np.ptp(moment[used]):
                fit = fit_column(A, log.current[:, j], used.astype(float))
                slopes.append((fit.values[0], fit.sd[0]))
    slope, spread = np.array([one for one in slopes if one[0] > 0]).reshape(-1, 2).T
    if len(slope) < len(SPEEDS):
        return UNKNOWN
    value = np.median(1.0 / slope)
    sd = np.hypot(np.median(spread / slope**2), 0.5 * np.ptp(1.0 / slope))
    return Estimate(value, sd, sd <= CONSTANT_KNOWN * value)


def rotor_inertia(j: int, log: ControllerTargets) -> Estimate:
    """J from the moment beyond the rigid body."""
    ddq, gravity, lead, y = (
        signal[:, j] for signal in (log.ddq, log.gravity, log.lead, log.moment - log.rigid)
    )
    # y = J q̈ + s g + c + δ·dy/dt: s separates 9.82 from 9.81 m/s², δ shifts time.
    A = np.column_stack([ddq, gravity, np.ones(len(y)), lead])
    if ddq.std() < 1e-2:
        return UNKNOWN
    # Half of robustness's change joins the spread, for the model's error.
    fit, value = fit_column(A, y, np.ones(len(y))), solve(A, y)[0]
    sd = np.hypot(fit.sd[0], 0.5 * (fit.values[0] - value))
    return Estimate(value, sd, value > 0 and sd <= ROTOR_KNOWN * value)


def controller_friction(j: int, log: ControllerTargets, constant: float) -> FrictionLaw | None:
    """Best shape of K·target_current − target_moment, coefficients, sd.

    A bent line where the motion spans its points, else a logarithm. None at rest.
    """
    speed = abs(log.dq[:, j])
    fast = np.quantile(speed, 0.9)
    if fast < SLIDES:
        return None
    y = constant * log.current[:, j] - log.moment[:, j]
    line = bent(speed.max())
    shapes = WRITTEN if line is None else (line,)
    if np.std(abs(log.gravity[:, j])) >= LIGHT:
        shapes = (*shapes, *(s._replace(terms=(*s.terms, "load_coulomb")) for s in shapes))
    fits = [(shape, fit_column(log.columns(j, shape), y, np.ones(len(y)))) for shape in shapes]
    laws = [
        (fit.weights @ fit.residual**2, (shape, fit.values, fit.sd))
        for shape, fit in fits
        if is_dissipative(shape, fit.values, fast)
    ]
    return min(laws, key=lambda law: law[0])[1] if laws else None


def refuse_guided(recording: Recording, log: ControllerTargets, robot: Robot) -> None:
    """Raise if a hand led the arm: the controller then uses less friction.

    Target velocities are then zero, or a joint's friction fed forward is far below the law.
    """
    share, least = 1.0, UNASKED
    if recording.target_dq is not None:
        moves = faster(recording.require("dq"), SLIDES).any(axis=1)
        asked = np.any(recording.target_dq[moves] != 0.0, axis=1)
        share = asked.mean() if asked.size else 1.0
    elif robot.torque_constant is not None and robot.friction:
        law = friction_torque(robot.friction, log.dq)
        fed = robot.torque_constant * log.current - log.moment
        used = np.where(faster(log.dq, SLIDES), law, 0.0)
        size = np.sum(used**2, axis=0)
        shares = np.sum(used * fed, axis=0)[size > 0] / size[size > 0]
        share, least = shares.min(initial=1.0), GUIDED
    if share < least:
        raise IdentificationError(
            f"{recording.name}: a hand led the arm, and the controller feeds less friction forward "
            "then; read its model off a log in which a program moves the arm"
        )
