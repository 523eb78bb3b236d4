"""Friction models: torque lost in a joint as a function of its velocity and of its load."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from vftcli.robots.robot import JointFriction
from vftcli.signals.arrays import Array
from vftcli.signals.parsing import check_known

SMOOTHING = 0.01
"""Velocity at which the smoothed sign tanh(q̇/smoothing) reaches tanh(1), by default. [rad/s]"""


def coulomb_viscous(
    dq: Array,
    coulomb: Array | float,
    viscous: Array | float,
    quadratic: Array | float = 0.0,
    offset: Array | float = 0.0,
    smoothing: Array | float = SMOOTHING,
    load_coulomb: Array | float = 0.0,
    stribeck: Array | float = 0.0,
    stribeck_velocity: Array | float = 1.0,
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
    torque: Array = dq / smoothing
    np.tanh(torque, out=torque)
    dry = coulomb
    if load is not None and np.any(load_coulomb):
        dry = dry + load_coulomb * np.abs(load)
    if np.any(stribeck):
        dry = dry + stribeck * np.exp(-((dq / stribeck_velocity) ** 2))
    torque *= dry
    torque += viscous * dq
    if np.any(quadratic):
        torque += quadratic * dq * np.abs(dq)
    if np.any(offset):
        torque += offset
    return torque


def sigmoid(
    dq: Array, amplitude: Array | float, slope: Array | float, shift: Array | float
) -> Array:
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
    # Far below −v₀ the term is zero long before the exponential overflows.
    exponent = np.minimum(-slope * (dq + shift), 700.0)  # e^709 is the largest float64
    moving = amplitude / (1.0 + np.exp(exponent))
    at_rest = amplitude / (1.0 + np.exp(-slope * np.asarray(shift)))
    torque: Array = moving - at_rest
    return torque


MODELS: dict[str, Callable[..., Array]] = {
    "coulomb-viscous": coulomb_viscous,
    "coulomb-viscous-offset": coulomb_viscous,
    "coulomb-viscous-quadratic": coulomb_viscous,
    "coulomb-viscous-load": coulomb_viscous,
    "coulomb-viscous-stribeck": coulomb_viscous,
    "sigmoid": sigmoid,
}
"""Name in a robot file → function of velocity and the file's parameters."""


def friction_torque(
    friction: Sequence[JointFriction], dq: Array, load: Array | None = None
) -> Array:
    """Friction torque of every joint at every sample, opposing motion when subtracted. (T, n) [N·m]

    Joints that share a model are evaluated together.

    Args:
        friction: One model a joint; empty for a frictionless arm.
        dq: Joint velocities. (T, n) [rad/s]
        load: Gravity torques of the loaded arm, for models whose Coulomb torque grows with the
            load; None for unloaded joints. (T, n) [N·m]

    Raises:
        ParameterError: If a model's name is unknown.
    """
    torque = np.zeros_like(dq)
    groups: dict[tuple[str, tuple[str, ...]], list[int]] = {}
    for j, joint in enumerate(friction):
        if joint.model != "none":
            groups.setdefault((joint.model, tuple(sorted(joint.parameters))), []).append(j)
    for (model, keys), joints in groups.items():
        check_known(model, MODELS, f"no friction model {model!r}")
        values = {key: np.array([friction[j].parameters[key] for j in joints]) for key in keys}
        every = len(joints) == dq.shape[1]
        if load is not None and "load_coulomb" in values:
            values["load"] = load if every else load[:, joints]
        if every:
            return MODELS[model](dq, **values)
        torque[:, joints] = MODELS[model](dq[:, joints], **values)
    return torque


def dry_friction(friction: Sequence[JointFriction], joints: int) -> Array:
    """Torque of each joint's dry friction, unloaded: what can hold it at rest. (n,) [N·m]

    Args:
        friction: One model a joint; empty for a frictionless arm.
        joints: Number of joints n.
    """
    if not friction:
        return np.zeros(joints)
    return np.array([float(dry_torque(joint.parameters)) for joint in friction])


def dry_torque(parameters: Mapping[str, float], load: Array | float = 0.0) -> Array:
    """Half the step that one joint's friction makes where its velocity changes sign. Like `load`

    It is taken from the parameters rather than from the friction at some low speed: the smoothing
    of the sign, the viscous part and the fading of the breakaway torque would then count in it, in
    each robot another share.

    Args:
        parameters: A joint's numbers, keys as in `MODELS`.
        load: Torque the gear carries. [N·m]
    """
    coulomb = parameters.get("coulomb", 0.0) + parameters.get("stribeck", 0.0)
    # A sigmoid runs from one saturation to the other, which lie one amplitude apart.
    coulomb += 0.5 * abs(parameters.get("amplitude", 0.0))
    return np.asarray(coulomb + parameters.get("load_coulomb", 0.0) * np.abs(load))
