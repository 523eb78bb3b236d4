"""Friction: torque lost in a joint, by velocity, load, temperature and past motion.

The teeth of a gear give before they slide: the angle alone shows it. The play (backlash)
operator follows the joint angle q at a distance of at most the presliding length s₀,

    cᵗ = clip(cᵗ⁻¹, qᵗ − s₀, qᵗ + s₀),   sᵗ = (qᵗ − cᵗ)/s₀ ∈ [−1, 1],

so that s is the sign of the motion once the joint has moved 2 s₀, and is held at rest. It
is causal and needs no velocity or clock: across a gap only the net displacement counts.
Each model has presliding friction a·s: a and the Coulomb torque together are the dry
friction of steady sliding.

All but a constant offset follows the joint's temperature where the robot has a law: that
of Universal Robots' controllers, two exponentials that fall with the temperature T of the
joint in °C,

    s(T) = p₁ e^(p₂ T) + p₃ e^(p₄ T),

by joint size. Friction stated at a temperature T₀ is multiplied with s(T)/s(T₀). Logs
with target current and target torque follow it within 1 % on unloaded joints, at 28 to 38
°C; the numbers were measured for friction at 44 to 45 °C.

References:
    A. Visintin, "Differential Models of Hysteresis", Springer, 1994, Ch. III, for play and stop;
    F. Al-Bender, J. Swevers, "Characterization of friction force dynamics", IEEE Control Systems
    Magazine 28(6), 2008, for presliding friction in drives.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from vftcli.robots.robot import JointFriction, Robot
from vftcli.signals.arrays import Array
from vftcli.signals.parsing import check_known
from vftcli.signals.recording import Recording
from vftcli.signals.remarks import Remark, on_joints, warning

#: Presliding beside every model: a [N·m] and s₀ [rad].
PRESLIDING = ("presliding", "presliding_length")
#: Default velocity at which tanh(q̇/smoothing) is tanh(1). [rad/s]
SMOOTHING = 0.01
#: Temperatures of a joint; a reading beyond is none. [°C]
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

    with f_l the growth with the torque that the gear carries [1] (`load`, the joint's
    gravity torque [N·m], like `dq`), f_s dry torque at breakaway above f_c [N·m], which
    fades over v_s.
    """
    torque = np.tanh(dq * (1.0 / smoothing))
    dry: Array | float = coulomb
    if load is not None and load_coulomb:
        dry = coulomb + load_coulomb * abs(load)
    if stribeck:
        dry = dry + stribeck * np.exp(-((dq / stribeck_velocity) ** 2))
    torque *= dry
    if viscous:
        torque += viscous * dq
    if quadratic:
        torque += quadratic * dq * abs(dq)
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

    The logarithm is zero at rest, so its sign needs no smoothing. With three numbers
    (Coulomb torque, a, b) it follows the joint tests of UR arms to .01–.3 N·m, where a
    signed quadratic falls from 1.1–1.6 rad/s on.
    """
    rise = np.copysign(np.log1p(abs(dq) / logarithmic_velocity), dq)
    return rise * logarithmic + coulomb_viscous(dq, **others)


def sigmoid(dq: Array, amplitude: float, slope: float, shift: float) -> Array:
    """Sigmoid friction, zero at rest. Like `dq` [N·m]

    f = A/(1 + exp(−s(q̇ + v₀))) − A/(1 + exp(−s v₀)) with A in N·m, s in s/rad, v₀ in rad/s

    Reference:
        C. Gaz et al., "Dynamic identification of the Franka Emika Panda robot with retrieval of
        feasible parameters using penalty-based optimization", IEEE RA-L 2019, Sec. II.
    """
    with np.errstate(over="ignore"):  # far below zero: A/∞ is 0, as it should be
        rise = amplitude / (1.0 + np.exp(-slope * dq - slope * shift))
    return np.asarray(rise - amplitude / (1.0 + np.exp(-slope * shift)))


def bent_line(
    dq: Array,
    speeds: Sequence[float],
    torques: Sequence[float],
    **others: Any,  # noqa: ANN401
) -> Array:
    """A line through points (v_k, f_k), as in UR controllers. Like `dq` [N·m]

    f = f_1 tanh(q̇/smoothing) + sign(q̇) Σ_k (m_k − m_{k−1}) max(|q̇| − v_k, 0) + what
    `coulomb_viscous` makes of the other parameters,

    with m_k the slope from point k to the next, m_0 = 0: constant up to the first speed,
    linear between the points, the last stretch continued beyond. Speeds rise; there are
    at least two.
    """
    slopes = [
        (f - before) / (v - slower)
        for (slower, v), (before, f) in zip(pairwise(speeds), pairwise(torques), strict=True)
    ]
    # sign(v) max(|v| − v_k, 0) is v − clip(v, ±v_k).
    torque = coulomb_viscous(dq, torques[0], **others) + slopes[-1] * dq
    for speed, slope, before in zip(speeds, slopes, [0.0, *slopes], strict=False):
        torque -= (slope - before) * dq.clip(-speed, speed)
    return torque


class FrictionModel(NamedTuple):
    """A law of friction, and its keys in ``[joints.friction]``."""

    torque: Callable[..., Array]  #: Friction of velocities and the keys' numbers.
    required: tuple[str, ...]  #: Keys that it must have.
    optional: tuple[str, ...]  #: Keys that it may have.


PLAIN = ("coulomb", "viscous")
FADING = ("stribeck", "stribeck_velocity")
ALWAYS = ("offset", "smoothing")  #: Keys that most models may have.
#: Name in a robot file → friction model.
FRICTION_MODELS = {
    "coulomb-viscous": FrictionModel(coulomb_viscous, PLAIN, ALWAYS[1:]),
    "coulomb-viscous-offset": FrictionModel(coulomb_viscous, PLAIN, ALWAYS),
    "coulomb-viscous-quadratic": FrictionModel(coulomb_viscous, PLAIN, ("quadratic", *ALWAYS)),
    "coulomb-viscous-load": FrictionModel(
        coulomb_viscous, (*PLAIN, "load_coulomb"), ("quadratic", *ALWAYS)
    ),
    "coulomb-viscous-stribeck": FrictionModel(
        coulomb_viscous, (*PLAIN, *FADING), ("load_coulomb", "quadratic", *ALWAYS)
    ),
    "coulomb-logarithmic": FrictionModel(
        coulomb_logarithmic,
        ("coulomb", "logarithmic", "logarithmic_velocity"),
        ("viscous", "load_coulomb", *FADING, *ALWAYS),
    ),
    "points": FrictionModel(bent_line, (), ("load_coulomb", *FADING, *ALWAYS)),
    "sigmoid": FrictionModel(sigmoid, ("amplitude", "slope", "shift"), ()),
}


def warmth(law: Sequence[float], temperature: Array | float) -> Array:
    """s(T) = p₁ e^(p₂ T) + p₃ e^(p₄ T), T in °C. Like `temperature` [1]"""
    p1, p2, p3, p4 = law
    T = np.asarray(temperature, float)
    return p1 * np.exp(p2 * T) + p3 * np.exp(p4 * T)


def lawless(law: Sequence[float]) -> str:
    """Say why no joint's friction follows a law, or "" where one may."""
    if not law:
        return ""
    with np.errstate(over="ignore", invalid="ignore"):
        share = warmth(law, np.linspace(COLDEST, WARMEST, 100))
        least, most = share.min(), share.max()
    if np.isfinite(most) and least > 0.0 and most < 1e3 * least:
        return ""
    return (
        f"temperature makes friction {most:.3g} / {least:.3g} times between {COLDEST:g} and "
        f"{WARMEST:g} °C; p1 e^(p2 T) + p3 e^(p4 T) stays positive and within a factor of 1000"
    )


def friction_factor(friction: Sequence[JointFriction], temperature: Array) -> Array | None:
    """Factor of friction, 1 where T [°C] is NaN; None if none has a law. (T, n) [1]"""
    if not any(joint.temperature for joint in friction):
        return None
    factor = np.ones(temperature.shape, order="F")
    for joint, own, T in zip(friction, factor.T, temperature.T, strict=True):
        if law := joint.temperature:
            share = warmth(law, T) / warmth(law, joint.reference_temperature)
            own[:] = np.where(np.isnan(share), 1.0, share)
    return factor


def friction_torque(
    friction: Sequence[JointFriction],
    dq: Array,
    load: Array | None = None,
    *,
    deflection: Array | None = None,
    temperature: Array | None = None,
) -> Array:
    """Friction torque, opposing motion when subtracted. (T, n) [N·m]

    Joint by joint, for the cache, at velocities `dq` [rad/s] and under gravity torques
    `load` [N·m]; `deflection` is the state s of `RunningFriction`, `temperature` [°C] is
    NaN where not measured, None for the models' own. (T, n) each
    """
    torque = np.zeros(dq.shape, order="F")
    for j, joint in enumerate(friction):
        if joint.model == "none":
            continue
        check_known(joint.model, FRICTION_MODELS, f"no friction model {joint.model!r}")
        numbers = joint.parameters.items()
        values: dict[str, Any] = {k: v for k, v in numbers if k not in PRESLIDING}
        if joint.speeds:
            values |= {"speeds": joint.speeds, "torques": joint.torques}
        if load is not None and "load_coulomb" in values:
            values["load"] = load[:, j]
        torque[:, j] = FRICTION_MODELS[joint.model].torque(dq[:, j], **values)
        if deflection is not None and (a := joint.parameters.get("presliding", 0.0)) > 0.0:
            torque[:, j] += a * deflection[:, j]
    if temperature is not None and (factor := friction_factor(friction, temperature)) is not None:
        offset = np.array([joint.parameters.get("offset", 0.0) for joint in friction])
        torque -= offset
        torque *= factor
        torque += offset
    return torque


def steady_torque(friction: JointFriction, dq: Array) -> Array:
    """One joint's friction in steady sliding, without what fades. [N·m]"""
    absent = dict.fromkeys({"offset", "stribeck"} & friction.parameters.keys(), 0.0)
    steady, v = (replace(friction, parameters={**friction.parameters, **absent}),), dq[:, None]
    return friction_torque(steady, v, deflection=np.sign(v))[:, 0]


def falling_speed(friction: JointFriction, limit: float) -> float:
    """Lowest speed up to `limit` where a friction falls, or NaN. [rad/s]

    Without fading dry friction and offset: what then rises also opposes every motion.
    """
    if not np.isfinite(limit):
        return float("nan")
    # Beside rest a Coulomb torque pushes; 500 steps see a turn to .2 %.
    dq = np.linspace(-limit, limit, 1001)
    torque = steady_torque(friction, dq)
    # A hundred-thousandth of the torque is rounding.
    falls = np.diff(torque) < -1e-5 * abs(torque).max()
    ends = np.minimum(abs(dq[:-1]), abs(dq[1:]))
    return float(ends[falls].min()) if falls.any() else float("nan")


def falling_friction(friction: Sequence[JointFriction], limits: Array) -> Iterator[Remark]:
    """A warning on friction that falls below the speed limits [rad/s]."""
    speeds = np.array([*map(falling_speed, friction, limits)])
    falls = np.isfinite(speeds)
    if falls.any():
        values = {"speeds_rad_s": speeds[falls], "limits_rad_s": limits[falls]}
        yield warning("falling-friction", on_joints(falls), **values)


def dry_friction(friction: Sequence[JointFriction], joints: int) -> Array:
    """Torque of each joint's unloaded dry friction. (n,) [N·m]"""
    return np.array([float(dry_torque(joint)) for joint in friction] or [0.0] * joints)


def dry_torques(robot: Robot) -> Array:
    """Dry friction of every joint, of a sigmoid its whole amplitude. (n,)"""
    dry = dry_friction(robot.friction, robot.joints)
    whole = [abs(joint.parameters.get("amplitude", 0.0)) for joint in robot.friction]
    return np.maximum(dry, whole) if whole else dry


def dry_torque(joint: JointFriction, load: Array | float = 0.0) -> Array:
    """Half the step of a joint's friction where its velocity turns. Like `load`

    Made of the parameters; presliding friction is held at rest, in full or in part.
    """
    known = joint.parameters
    coulomb = sum(known.get(key, 0.0) for key in ("coulomb", "stribeck", "presliding"))
    # A sigmoid's saturations lie one amplitude apart.
    coulomb += 0.5 * abs(known.get("amplitude", 0.0)) + sum(joint.torques[:1])
    return coulomb + known.get("load_coulomb", 0.0) * np.abs(load)


#: Deviation of a uniform torque within ±F_c, and of the difference of two: analytic. [F_c]
ONE_STOP, TWO_STOPS = np.sqrt(1.0 / 3.0), np.sqrt(2.0 / 3.0)

#: The latter where the whole arm rests untouched: a UR10e's runs have .05 to .5, mean .13.
REPEATED_STOP = 0.13

#: What an observer reads on a joint at rest, rms: on real UR10e logs .31 to .61 of F_c.
HELD = 0.45
#: SD of the wrench smoother's model error at rest, by the same logs.
REST_SHARE = 0.5
#: For contacts: added at rest to what was learned, the least that these logs show, and for
#: the wrench too where a joint turns round; and drawn anew where a joint comes to rest.
CREEP_SHARE, STOP_SHARE = 0.3, 0.7
#: For a joint that rests under a contact, which re-settles it.
PUSHED_SHARE = 0.6
#: SD of a momentum observer near a rest: .6 of F_c are the 95 % bound.
NEAR_REST_SHARE = 0.6 / 1.96


class Play(NamedTuple):
    """The play operator along a stretch of a log."""

    state: Array  #: s, the share of full deflection. (T, n)
    centre: Array  #: c after the last sample, for the next stretch. (n,) [rad]


def play(q: Array, length: Array | float, centre: Array | None = None) -> Play:
    """Deflection s of the play operator, alike in one piece and in stretches.

    A sample moves c into q − s₀ … q + s₀. Without the centre c before the first sample it
    starts undeflected, c = q⁰, wrong by at most the whole deflection until the joint has
    moved 2 s₀.
    """
    reach = np.asarray(length, float)
    if not len(q):
        return Play(np.zeros_like(q), np.zeros(q.shape[1:]) if centre is None else centre)
    start = q[0] if centre is None else centre
    centres, lows, highs = np.empty_like(q), (q - reach).T, (q + reach).T
    # Python's own numbers: NumPy's single ones take ten times as long.
    for j, begin in enumerate(start.tolist()):
        c, passed = begin, []
        for low, high in zip(lows[j].tolist(), highs[j].tolist(), strict=True):
            c = low if c < low else high if c > high else c
            passed.append(c)
        centres[:, j] = passed
    state = (q - centres) / reach
    return Play(state.clip(-1.0, 1.0, out=state), centres[-1])


class RunningFriction:
    """The friction of an arm's joints, stretch after stretch of a motion.

    `centre` is c after the last sample, of joints with presliding; None at first (m,) [rad].
    """

    def __init__(self, friction: Sequence[JointFriction]) -> None:
        self.friction = friction
        self.centre: Array | None = None
        presliding = [joint.parameters.get("presliding", 0.0) for joint in friction]
        self._joints = [j for j, torque in enumerate(presliding) if torque > 0.0]
        lengths = [friction[j].parameters["presliding_length"] for j in self._joints]
        self._length = np.array(lengths)

    def torque(
        self, q: Array, dq: Array, load: Array | None = None, temperature: Array | None = None
    ) -> Array:
        """Friction torque of the next samples. (T, n) [N·m]"""
        state = None
        if self._joints:
            found = play(q[:, self._joints], self._length, self.centre)
            self.centre = found.centre
            state = np.zeros(q.shape, order="F")
            state[:, self._joints] = found.state
        return friction_torque(self.friction, dq, load, deflection=state, temperature=temperature)


def measured_temperature(recording: Recording) -> Array | None:
    """A log's joint temperatures, NaN where missing. (T, n) [°C]

    Controllers that do not measure them write zeros.
    """
    if recording.temperature is None:
        return None
    T = recording.temperature
    plausible = (T >= COLDEST) & (T <= WARMEST)
    if not plausible.any():
        return None
    return T if plausible.all() else np.where(plausible, T, np.nan)
