"""Friction models: torque lost in a joint, by its velocity, its load and what it did before.

Beside each model stands presliding friction a·s, s the state of the play operator
(`vftcli.robots.running_friction`): a and the Coulomb torque together are the dry friction of steady
sliding. All but a constant offset follows the joint's temperature where the robot has a law for it:
a cold gear rubs more than a warm one.
The law is that of Universal Robots' controllers, a sum of two exponentials that falls with the
temperature T of the joint in °C,

    s(T) = p₁ e^(p₂ T) + p₃ e^(p₄ T),

by joint size. Friction stated at a reference temperature T₀ is multiplied with s(T)/s(T₀). Logs
with target current and target torque follow it within 1 % on joints that carry nothing, at 28 to
38 °C; the numbers themselves were measured for friction at 44 to 45 °C.

A joint at rest holds any torque within its dry friction ±F_c, and nobody sees which: the shares of
F_c that are allowed for it are at the end of this file.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np

from vftcli.robots.robot import JointFriction, Robot
from vftcli.signals.arrays import Array, empty_series
from vftcli.signals.parsing import check_known
from vftcli.signals.remarks import Remark, Where, warning

#: Keys of the presliding friction that may stand beside every model: a [N·m] and s₀ [rad].
PRESLIDING = ("presliding", "presliding_length")
#: Velocity at which the smoothed sign tanh(q̇/smoothing) reaches tanh(1), by default. [rad/s]
SMOOTHING = 0.01
#: Temperatures that a joint can have; a reading beyond them, as a constant zero, is none. [°C]
COLDEST, WARMEST = 1.0, 100.0


def coulomb_viscous(
    dq: Array,
    coulomb: float,
    viscous: float = 0.0,
    quadratic: float = 0.0,
    offset: float = 0.0,
    smoothing: float = SMOOTHING,
    load_coulomb: float = 0.0,
    stribeck: float = 0.0,
    stribeck_velocity: float = 1.0,
    load: Array | None = None,
) -> Array:
    """Coulomb, viscous and signed quadratic friction with an offset. Like `dq` [N·m]

    f = offset + (f_c + f_l |load| + f_s exp(−(q̇/v_s)²)) tanh(q̇/smoothing) + f_v q̇ + f_2 q̇|q̇|

    Args:
        dq: Joint velocities. (T,) or (T, n) [rad/s]
        coulomb: Coulomb torque f_c. [N·m]
        viscous: Viscous coefficient f_v. [N·m·s/rad]
        quadratic: Signed quadratic coefficient f_2. [N·m·s²/rad²]
        offset: Torque at rest. [N·m]
        smoothing: Velocity over which the sign is smoothed. [rad/s]
        load_coulomb: Growth f_l of the Coulomb torque with the torque the gear carries. [1]
        stribeck: Extra dry torque f_s at breakaway, above the Coulomb torque. [N·m]
        stribeck_velocity: Velocity v_s over which it fades. [rad/s]
        load: Torque the gear carries: the joint's gravity torque; None for none. Like `dq` [N·m]
    """
    torque: Array = dq * (1.0 / smoothing)
    np.tanh(torque, out=torque)
    dry: Array | float = coulomb
    if load is not None and load_coulomb:
        dry = np.abs(load)
        dry *= load_coulomb
        dry += coulomb
    if stribeck:
        dry = dry + stribeck * np.exp(-((dq / stribeck_velocity) ** 2))
    torque *= dry
    if viscous:
        torque += viscous * dq
    if quadratic:
        torque += quadratic * dq * np.abs(dq)
    if offset:
        torque += offset
    return torque


def coulomb_logarithmic(
    dq: Array,
    logarithmic: float,
    logarithmic_velocity: float,
    **others: Any,  # noqa: ANN401
) -> Array:
    """Coulomb friction and a logarithmic rise, which never turns down. Like `dq` [N·m]

    f = a ln(1 + |q̇|/b) sign(q̇) + what `coulomb_viscous` makes of the other parameters

    The logarithm is zero at rest, so its sign needs no smoothing. With three numbers (Coulomb
    torque, a, b) it follows the joint tests of UR arms to .01–.3 N·m, where a signed quadratic
    falls from 1.1–1.6 rad/s on.

    Args:
        dq: Joint velocities. (T,) or (T, n) [rad/s]
        logarithmic: Rise a. [N·m]
        logarithmic_velocity: Velocity b from which the rise flattens. [rad/s]
        others: Parameters of `coulomb_viscous`.
    """
    rise = np.abs(dq)
    rise /= logarithmic_velocity
    np.log1p(rise, out=rise)
    np.copysign(rise, dq, out=rise)
    rise *= logarithmic
    rise += coulomb_viscous(dq, **others)
    return rise


def sigmoid(dq: Array, amplitude: float, slope: float, shift: float) -> Array:
    """Sigmoid friction, zero at rest. Like `dq` [N·m]

    f = A/(1 + exp(−s(q̇ + v₀))) − A/(1 + exp(−s v₀))

    Args:
        dq: Joint velocities. (T,) or (T, n) [rad/s]
        amplitude: A. [N·m]
        slope: s. [s/rad]
        shift: v₀. [rad/s]

    Reference:
        C. Gaz et al., "Dynamic identification of the Franka Emika Panda robot with retrieval of
        feasible parameters using penalty-based optimization", IEEE RA-L 2019, Sec. II.
    """
    torque: Array = -slope * dq
    torque -= slope * shift
    with np.errstate(over="ignore"):  # far below zero: A/∞ is 0, as it should be
        np.exp(torque, out=torque)
    torque += 1.0
    np.divide(amplitude, torque, out=torque)
    torque -= amplitude / (1.0 + np.exp(-slope * shift))
    return torque


def bent_line(
    dq: Array,
    speeds: Sequence[float],
    torques: Sequence[float],
    **others: Any,  # noqa: ANN401
) -> Array:
    """A line through points (v_k, f_k), as UR controllers feed friction forward. Like `dq` [N·m]

    f = f_1 tanh(q̇/smoothing) + sign(q̇) Σ_k (m_k − m_{k−1}) max(|q̇| − v_k, 0) + what
    `coulomb_viscous` makes of the other parameters,

    with m_k the slope from point k to the next, m_0 = 0: constant up to the first speed, linear
    between the points, the last stretch continued beyond.

    Args:
        dq: Joint velocities. (T,) or (T, n) [rad/s]
        speeds: Speeds v_k, rising, at least two. (K,) [rad/s]
        torques: Friction f_k there. (K,) [N·m]
        others: Parameters of `coulomb_viscous`.
    """
    slopes = [
        (f - before) / (v - slower)
        for (slower, v), (before, f) in zip(pairwise(speeds), pairwise(torques), strict=True)
    ]
    # sign(v) max(|v| − v_k, 0) is v − clip(v, ±v_k), and the changes add up to the last slope.
    torque = coulomb_viscous(dq, torques[0], **others)
    part: Array = dq * slopes[-1]
    torque += part
    for speed, slope, before in zip(speeds, slopes, [0.0, *slopes], strict=False):
        np.clip(dq, -speed, speed, out=part)
        part *= slope - before
        torque -= part
    return torque


#: Name in a robot file → function of velocity and the file's parameters.
MODELS: dict[str, Callable[..., Array]] = {
    "coulomb-viscous": coulomb_viscous,
    "coulomb-viscous-offset": coulomb_viscous,
    "coulomb-viscous-quadratic": coulomb_viscous,
    "coulomb-viscous-load": coulomb_viscous,
    "coulomb-viscous-stribeck": coulomb_viscous,
    "coulomb-logarithmic": coulomb_logarithmic,
    "points": bent_line,
    "sigmoid": sigmoid,
}


def warmth(law: Sequence[float], temperature: Array | float) -> Array:
    """s(T) = p₁ e^(p₂ T) + p₃ e^(p₄ T). Like `temperature` [1]

    Args:
        law: p₁, p₂, p₃, p₄; p₂ and p₄ in 1/K.
        temperature: Joint temperatures T. [°C]
    """
    p1, p2, p3, p4 = law
    T = np.asarray(temperature, dtype=np.float64)
    share: Array = p1 * np.exp(p2 * T) + p3 * np.exp(p4 * T)
    return share


def lawless(law: Sequence[float]) -> str:
    """Say why no joint's friction follows a law, or "" where one may."""
    if not law:
        return ""
    with np.errstate(over="ignore", invalid="ignore"):
        share = warmth(law, np.linspace(COLDEST, WARMEST, 100))
        least, most = float(np.min(share)), float(np.max(share))
    if np.isfinite(most) and least > 0.0 and most < 1e3 * least:
        return ""
    return (
        f"temperature makes friction {most:.3g} / {least:.3g} times between {COLDEST:g} and "
        f"{WARMEST:g} °C; p1 e^(p2 T) + p3 e^(p4 T) stays positive and within a factor of 1000"
    )


def friction_factor(friction: Sequence[JointFriction], temperature: Array) -> Array | None:
    """What each joint's friction is multiplied with, None where no joint has a law. (T, n) [1]

    Args:
        friction: One model a joint.
        temperature: Joint temperatures, NaN where they were not measured: there the factor is 1,
            friction as at its reference temperature. (T, n) [°C]
    """
    joints = [j for j, joint in enumerate(friction) if joint.temperature]
    if not joints:
        return None
    factor = np.ones(temperature.shape, order="F")
    for j in joints:
        law = friction[j].temperature
        share = warmth(law, temperature[:, j])
        share /= warmth(law, friction[j].reference_temperature)
        factor[:, j] = np.where(np.isnan(share), 1.0, share)
    return factor


def friction_torque(
    friction: Sequence[JointFriction],
    dq: Array,
    load: Array | None = None,
    *,
    deflection: Array | None = None,
    temperature: Array | None = None,
) -> Array:
    """Friction torque of every joint at every sample, opposing motion when subtracted. (T, n) [N·m]

    Joint by joint, so that a chunk of one stays in the cache. Along a motion, `RunningFriction`
    follows the presliding state.

    Args:
        friction: One model a joint; empty for a frictionless arm.
        dq: Joint velocities. (T, n) [rad/s]
        load: Gravity torques of the loaded arm, for models whose Coulomb torque grows with the
            load; None for unloaded joints. (T, n) [N·m]
        deflection: State s of the play operator, for presliding friction; None for undeflected
            joints. (T, n)
        temperature: Joint temperatures, NaN where not measured; None for those at which the models
            were taken. (T, n) [°C]
    """
    torque = empty_series(*dq.shape)
    if not friction:
        torque[:] = 0.0
    for j, joint in enumerate(friction):
        torque[:, j] = joint_friction(joint, dq[:, j], None if load is None else load[:, j])
        if deflection is not None and (a := joint.parameters.get("presliding", 0.0)) > 0.0:
            torque[:, j] += a * deflection[:, j]
    if temperature is not None and (factor := friction_factor(friction, temperature)) is not None:
        offset = np.array([joint.parameters.get("offset", 0.0) for joint in friction])
        torque -= offset
        torque *= factor
        torque += offset
    return torque


def joint_friction(joint: JointFriction, dq: Array, load: Array | None) -> Array | float:
    """What one joint's model makes of its velocities and its load. (T,) [N·m]"""
    if joint.model == "none":
        return 0.0
    check_known(joint.model, MODELS, f"no friction model {joint.model!r}")
    values: dict[str, Any] = {k: v for k, v in joint.parameters.items() if k not in PRESLIDING}
    if joint.speeds:
        values |= {"speeds": joint.speeds, "torques": joint.torques}
    if load is not None and "load_coulomb" in values:
        values["load"] = load
    return MODELS[joint.model](dq, **values)


def steady_torque(friction: JointFriction, dq: Array) -> Array:
    """One joint's friction in steady sliding, without offset and the dry torque that fades. [N·m]

    Presliding friction is fully deflected, and what the numbers hold for is the temperature.

    Args:
        friction: The joint's model.
        dq: Its velocities. (T,) [rad/s]
    """
    absent = {"offset": 0.0, "stribeck": 0.0}
    values = {key: absent.get(key, value) for key, value in friction.parameters.items()}
    steady, v = (replace(friction, parameters=values),), dq[:, None]
    return friction_torque(steady, v, deflection=np.sign(v))[:, 0]


def falling_speed(friction: JointFriction, limit: float) -> float:
    """Lowest speed up to `limit` where a friction falls or pushes, NaN where none does. [rad/s]

    Dry friction that fades (Stribeck) falls by nature and an offset is no friction: both are left
    out. What then rises everywhere with the velocity passes through zero at rest, so that it also
    opposes every motion.

    Args:
        friction: One joint's model.
        limit: Speed up to which the joint moves. [rad/s]
    """
    if not np.isfinite(limit):
        return float("nan")
    # The steps beside rest see a Coulomb torque that pushes; 500 of them see a turn to .2 %.
    dq = np.linspace(-limit, limit, 1001)
    torque = steady_torque(friction, dq)
    # A hundred-thousandth of the torque is rounding, at a sigmoid's flat ends too.
    falls = np.diff(torque) < -1e-5 * np.max(np.abs(torque))
    ends = np.minimum(np.abs(dq[:-1]), np.abs(dq[1:]))
    return float(ends[falls].min()) if falls.any() else float("nan")


def falling_friction(friction: Sequence[JointFriction], limits: Array) -> list[Remark]:
    """A warning on the joints whose friction falls or pushes within their speed range, if any.

    Args:
        friction: One model a joint; empty for a frictionless arm.
        limits: Speed limits, NaN where unknown. (n,) [rad/s]
    """
    speeds = [falling_speed(joint, limit) for joint, limit in zip(friction, limits, strict=False)]
    falls = np.flatnonzero(np.isfinite(speeds))
    if not falls.size:
        return []
    where = Where(joints=tuple(int(j) + 1 for j in falls))
    values = {"speeds_rad_s": [speeds[j] for j in falls], "limits_rad_s": limits[falls].tolist()}
    return [warning("falling-friction", where, **values)]


def dry_friction(friction: Sequence[JointFriction], joints: int) -> Array:
    """Torque of each joint's dry friction, unloaded: what can hold it at rest. (n,) [N·m]"""
    if not friction:
        return np.zeros(joints)
    return np.array([float(dry_torque(joint)) for joint in friction])


def dry_torques(robot: Robot) -> Array:
    """Dry friction of every joint, of a sigmoid its whole amplitude; 0 where none is known. (n,)"""
    dry = dry_friction(robot.friction, robot.joints)
    whole = [abs(joint.parameters.get("amplitude", 0.0)) for joint in robot.friction]
    return np.maximum(dry, whole) if whole else dry


def dry_torque(joint: JointFriction, load: Array | float = 0.0) -> Array:
    """Half the step that one joint's friction makes where its velocity changes sign. Like `load`

    It is taken from the parameters rather than from the friction at some low speed: the smoothing
    of the sign, the viscous part and the fading of the breakaway torque would then count in it, in
    each robot another share.

    Args:
        joint: Its model.
        load: Torque the gear carries. [N·m]
    """
    parameters = joint.parameters
    coulomb = parameters.get("coulomb", 0.0) + parameters.get("stribeck", 0.0)
    coulomb += parameters.get("presliding", 0.0)  # which a joint at rest holds, in full or in part
    # A sigmoid runs from one saturation to the other, which lie one amplitude apart.
    coulomb += 0.5 * abs(parameters.get("amplitude", 0.0)) + sum(joint.torques[:1])
    return np.asarray(coulomb + parameters.get("load_coulomb", 0.0) * np.abs(load))


#: Standard deviation of a torque that rests anywhere within ±F_c, as a share of F_c, and of the
#: difference of two such torques: analytic.
ONE_STOP, TWO_STOPS = np.sqrt(1.0 / 3.0), np.sqrt(2.0 / 3.0)

#: The same of two torques where the whole arm rests at the same place after the same motion, as
#: long as nobody touches it: three runs of one motion of a UR10e differ by .05 to .5 of F_c, .13 in
#: the mean.
REPEATED_STOP = 0.13

#: What an observer reads on a joint at rest, rms: on real UR10e logs .31 to .61 of F_c.
HELD = 0.45
#: Standard deviation of the wrench smoother's model error at rest, by the same logs.
REST_SHARE = 0.5
#: The same of the list of contacts: what it adds at rest to what was learned, the least that these
#: logs show, and what it draws anew in the block in which a joint comes to rest.
CREEP_SHARE, STOP_SHARE = 0.3, 0.7
#: The same of both for a joint that rests under a contact: the push re-settles its stiction.
PUSHED_SHARE = 0.6
#: Standard deviation of a momentum observer near a rest: .6 of F_c are the 95 % bound.
NEAR_REST_SHARE = 0.6 / 1.96
