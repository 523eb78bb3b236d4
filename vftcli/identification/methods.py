"""Methods: "friction" holds the maker's links, "base" frees them, "auto" chooses."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import polars as pl

from vftcli.identification.clean_fit import (
    OTHER_LINKS,
    CleanFit,
    fit_without_contacts,
    heavy_joints,
    links_explain,
    weighted_rms,
)
from vftcli.identification.friction_fit import (
    BOUNDED,
    PLAIN,
    JointFit,
    all_residuals,
    fit_frictions,
    is_dissipative,
)
from vftcli.identification.links import (
    TABLE,
    WEIGHTS,
    base_parameters,
    nearest_physical_links,
    predicts_best_unpulled,
    stack,
)
from vftcli.identification.shapes import Shape, round_digits
from vftcli.identification.training import ParameterColumns, Training
from vftcli.robots.friction import SMOOTHING, falling_speed, steady_torque
from vftcli.robots.kernels import chain_parameters, with_parameters
from vftcli.robots.robot import JointFriction, Robot
from vftcli.signals.arrays import Array
from vftcli.signals.errors import IdentificationError
from vftcli.signals.estimation import robust_sd
from vftcli.signals.remarks import Remark, Where, caution, fact, on_joints, warning

#: Parameter → its unit.
UNITS = {
    "torque_constant": "N·m/A",
    "rotor_inertia": "kg·m²",
    **dict.fromkeys(("coulomb", "offset", "logarithmic", "presliding", "stribeck"), "N·m"),
    **{f"point{k}": "N·m" for k in range(1, 5)},
    "viscous": "N·m·s/rad",
    "quadratic": "N·m·s²/rad²",
    "load_coulomb": "1",
    "mass": "kg",
    **dict.fromkeys(("com_x", "com_y", "com_z"), "m"),
}
#: Largest relative SD of a determined number.
DETERMINED = 0.3
#: SDs from a profile's rotor inertia to its replacement.
REFUTED = 3.0
#: Least ratio of measured to expected torque of a current.
LEAST_SLOPE = 0.05


class Number(NamedTuple):
    """One identified number."""

    joint: int  #: Joint, from 1; the last one for a load on the flange.
    parameter: str  #: Its key in the robot file, one of `UNITS`.
    value: float  #: The estimate.
    sd: float  #: Its SD.
    unit: str  #: Unit of value, sd and profile.
    profile: float  #: The profile's number, NaN without one.
    determined: bool  #: Whether it is determined, and written.


def number(
    j: int, parameter: str, value: float, sd: float, profile: float, determined: bool
) -> Number:
    """An identified number of joint j (from 0), with its parameter's unit."""
    unit = UNITS[parameter]
    return Number(j + 1, parameter, value, sd, unit, profile, bool(determined))


class MethodResult(NamedTuple):
    """Robot, numbers and remarks of one method."""

    method: str  #: Its name.
    robot: Robot  #: The identified robot.
    numbers: Sequence[Number] = ()  #: Its identified numbers.
    remarks: Sequence[Remark] = ()  #: Limits of the numbers.
    fits: Mapping[int, JointFit] = {}  #: Joint, from 0 → its fit of friction.
    base: pl.DataFrame | None = None  #: Base parameters (`BASE`), if any.
    is_narrow: bool = False  #: Whether the motion shows few links.


def friction_method(data: Training, fitted: CleanFit | None = None) -> MethodResult:
    """Friction, rotor inertia, perhaps drive constants; the maker's links."""
    if not (data.rubs or data.rotor):
        raise IdentificationError(
            f"robot {data.robot.name!r} has its torque behind the gears: without friction the "
            "friction method has nothing to find; use --method base"
        )
    data, fits, doubts = fitted or fit_without_contacts(data, strict=True)
    remarks, numbers, robot = [*doubts], list[Number](), data.robot
    rotor, frictions = robot.chain.rotor_inertia.copy(), list(profile_friction(robot))
    constants = None if robot.torque_constant is None else robot.torque_constant.copy()
    for j, fit in fits.items():
        count, where = len(fit.shape.terms), on_joints([j])
        if fit.is_kept:
            own, theirs = fit.errors
            remarks.append(caution("profile-kept", where, found_Nm=own, profile_Nm=theirs))
            continue
        values, sd = fit.fit.values, fit.fit.sd
        if data.fit_constants and not fit.constant:
            remarks.append(caution("unloaded-drive-constant", where))
        if fit.constant and constants is not None:
            values, sd, K = by_constant(data, j, values, sd)
            numbers.append(K)
            constants[j] = round_digits(K.value)
        if data.rotor:
            J, doubts = rotor_number(j, values[count], sd[count], rotor[j])
            numbers.append(J)
            remarks += doubts
            if J.determined:
                rotor[j] = round_digits(J.value)
        if data.rubs:
            frictions[j], more = identified_friction(data, j, fit.shape, values, sd, "friction")
            numbers += more
            remarks += check_friction(j, frictions[j], data)
    new = replace(
        robot,
        chain=replace(robot.chain, rotor_inertia=rotor),
        friction=tuple(frictions) if data.rubs else (),
        torque_constant=constants,
    )
    remarks += fit_remarks(data, fits)
    return MethodResult("friction", new, numbers, remarks, fits)


def by_constant(data: Training, j: int, values: Array, sd: Array) -> tuple[Array, Array, Number]:
    """Coefficients of joint j (from 0), sd by its last drive constant, and this.

    Torque is K i: a rigid torque at `scale` means K / scale, and so all coefficients.
    """
    scale, scale_sd = values[-1], sd[-1]
    if scale <= LEAST_SLOPE:
        raise IdentificationError(
            f"{data.recordings[0].name}: the current of joint {j + 1} does not follow its torque "
            f"(slope {scale:.2g}); wrong robot, sign or joint order, or the joint carries no load: "
            "leave out --set identify.constants=yes"
        )
    before = np.array(data.robot.torque_constant, float)[j]
    K, K_sd = before / scale, before * scale_sd / scale**2
    return values / scale, sd / scale, number(j, "torque_constant", K, K_sd, before, True)


def rotor_number(j: int, value: float, sd: float, before: float) -> tuple[Number, list[Remark]]:
    """Rotor inertia of joint j (from 0) [kg·m²], perhaps a remark."""
    if refuted := abs(value - before) >= REFUTED * sd:
        value = max(value, 0.0)
    known = value > 0 and sd < DETERMINED * value
    J = number(j, "rotor_inertia", value, sd, before, refuted or known)
    if known:
        return J, []
    code = "refuted-rotor-inertia" if refuted else "undetermined-rotor-inertia"
    values = {"found_kgm2": J.value, "sd_kgm2": sd, "profile_kgm2": before}
    return J, [caution(code, on_joints([j]), **values)]


def identified_friction(
    data: Training, j: int, shape: Shape, values: Array, sd: Array, method: str
) -> tuple[JointFriction, list[Number]]:
    """Friction of joint j (from 0) by its fit, coefficients beside the profile's.

    It holds at the temperature of the profile's; others may follow the coefficients. (k,)
    """
    before = profile_friction(data.robot)[j]
    logs = ", ".join(f"{r.name} (sha256 {r.source.sha256 or 'unknown'})" for r in data.recordings)
    errors = ", ".join(f"{value:.2g}" for value in sd)
    friction = replace(
        shape.friction(
            values, f"identified ({method}) from {logs}; standard deviations {errors}"
        ),
        temperature=before.temperature,
        temperature_at=before.temperature_at,
    )
    known = dict(before.parameters)
    if before.speeds[: len(shape.speeds)] == shape.speeds:
        known |= dict(zip(shape.points, before.torques, strict=False))
    return friction, [
        number(j, term, value, error, known.get(term, np.nan), error < DETERMINED * abs(value))
        for term, value, error in zip(shape.terms, values, sd, strict=False)
    ]


def check_friction(j: int, friction: JointFriction, data: Training) -> Iterator[Remark]:
    """A remark if joint j's (from 0) friction pushes, or falls."""
    speed = abs(data.joined("dq")[:, j]).max()
    torque = steady_torque(friction, np.linspace(0.1 * speed, speed, 10))
    noise = max(robust_sd(log.tau)[j] for log in data.logs)
    # A hundredth of the torque's spread: no friction scatters about zero.
    if np.all(torque < -0.01 * noise):
        raise IdentificationError(
            f"{data.recordings[0].name}: friction of joint {j + 1} comes out as {torque[0]:.2g} to "
            f"{torque[-1]:.2g} N·m: it would push. Velocity and effort differ in sign, or this "
            "is another robot; check --columns and --robot"
        )
    where = on_joints([j])
    if np.any(torque < 0):
        yield caution("negative-friction", where, least_Nm=torque.min())
        return
    limit = data.top_speed(j)
    if np.isfinite(falls := falling_speed(friction, limit)):
        yield warning("falling-friction", where, speeds_rad_s=[falls], limits_rad_s=[limit])


def fit_remarks(data: Training, fits: Mapping[int, JointFit]) -> Iterator[Remark]:
    """Remarks on fits of friction, and on their motion."""
    for j, fit in fits.items():
        bounded = [term for term in BOUNDED if term not in fit.shape.terms]
        if bounded and fit.shape.terms and not fit.scores:
            yield caution("friction-at-bound", on_joints([j]), terms=" and ".join(bounded))
    presliding = fit.presliding  # the same of all joints
    if len(presliding.errors) > 1:
        yield fact(
            "presliding-length",
            length_mrad=1e3 * presliding.length,
            lengths_mrad=[1e3 * length for length in presliding.errors],
            errors=[*presliding.errors.values()],
        )
    yield from temperature_remarks(data)
    for j, (moves, reverses) in enumerate(zip(data.moves, data.reverses, strict=True)):
        if not moves:
            yield fact("static-joint", on_joints([j]))
        elif not reverses:
            yield caution("one-way-joint", on_joints([j]))


def temperature_remarks(data: Training) -> Iterator[Remark]:
    """Remarks on the factors of friction by the joints' temperatures."""
    for log in data.logs:
        if (warmth := log.warmth) is not None:
            where = Where(log.recording.name)
            yield fact("friction-by-temperature", where, factors=[warmth.min(), warmth.max()])


def profile_friction(robot: Robot) -> tuple[JointFriction, ...]:
    """The profile's friction, one a joint, empty ones too."""
    return robot.friction or (JointFriction(),) * robot.joints


#: Share of undetermined base parameters from which a motion is narrow.
NARROW = 0.7
#: That share if the weakest pull predicts best, as in rounds of one motion.
MOST = 0.5
#: Share of a joint's torque from which other links are tried.
MATTERS = 0.02


def whole_arm(data: Training) -> MethodResult:
    """Base parameters, and the robot of the nearest physical links."""
    data, fits, remarks = fit_without_contacts(data, strict=False)
    layout, start = initial_columns(data, fits)
    x = nearest_physical_links(stack(layout, data.logs, start), start)
    # Friction is chosen anew, without the error of the profile's links.
    refined = with_vector(data.robot, layout, x, data.robot.friction)
    data = data._replace(logs=tuple(log.with_robot(refined) for log in data.logs))
    fits = fit_frictions(data)
    layout, start = initial_columns(data, fits)
    triangles = stack(layout, data.logs, start)
    base = base_parameters(triangles, start)
    behind = len(base) - layout.size  # of a coefficient's row to its column
    count = layout.rotor_places.stop + behind
    undetermined = (~base["determined"][:count]).sum()
    share = undetermined / count
    narrow = share > NARROW or (share > MOST and predicts_best_unpulled(triangles, start))
    x = nearest_physical_links(triangles, start, TABLE if narrow else WEIGHTS[0])
    level = caution if narrow else fact
    lost = level("undetermined-base-parameters", count=count, undetermined=undetermined)
    remarks += [fact("nearest-physical-model"), lost]
    if data.robot.payload is not None:
        remarks.append(fact("payload-in-link"))
    numbers, frictions = list[Number](), list(profile_friction(data.robot))
    for j, fit in fits.items() if data.rubs else ():
        place = layout.frictions[j]
        values, sd = x[place], base["sd"].to_numpy()[place.start + behind : place.stop + behind]
        # Beside errors of the links it may fall; the joint's own fit does not.
        if not is_dissipative(fit.shape, values, data.top_speed(j)):
            values = fit.fit.values
        frictions[j], more = identified_friction(data, j, fit.shape, values, sd, "base")
        numbers += more
        remarks += check_friction(j, frictions[j], data)
    robot = with_vector(data.robot, layout, x, tuple(frictions) if data.rubs else ())
    remarks += fit_remarks(data, fits)
    return MethodResult("base", robot, numbers, remarks, fits, base, narrow)


def initial_columns(
    data: Training, fits: Mapping[int, JointFit]
) -> tuple[ParameterColumns, Array]:
    """The unknowns, and the profile with fitted friction. (size,)"""
    chain = data.robot.loaded_chain
    shapes, values, rotor = list[Shape](), list[float](), chain.rotor_inertia.copy()
    for j, joint in enumerate(profile_friction(data.robot)):
        if j in fits:
            shape = fits[j].shape
            own, others = np.split(fits[j].fit.values, [len(shape.terms)])
            values += own.tolist()
            if data.rotor and others[0] > 0:
                rotor[j] = others[0]
        else:
            known = joint.parameters
            shape = Shape(PLAIN if data.rubs else (), known.get("smoothing", SMOOTHING))
            values += [known.get(term, 0.0) for term in shape.terms]
        shapes.append(shape)
    start = np.concatenate([chain_parameters(chain), rotor if data.rotor else [], values])
    return ParameterColumns(data.robot.chain, data.rotor, tuple(shapes)), start


def with_vector(
    robot: Robot, layout: ParameterColumns, x: Array, friction: tuple[JointFriction, ...]
) -> Robot:
    """The robot with a vector of parameters, a mounted payload included."""
    phi = np.array([round_digits(v, 12) for v in x[: layout.inertial]])
    rotor = robot.chain.rotor_inertia
    if layout.rotor:
        rotor = np.array([round_digits(v) for v in x[layout.rotor_places]])
    chain = with_parameters(robot.chain, phi, rotor)
    return replace(robot, chain=chain, payload=None, friction=friction)


def chosen_method(data: Training) -> MethodResult:
    """Result of "friction", or of "base" if the profile's links are not the arm's.

    Links are freed if the profile's leave `OTHER_LINKS` times the rest, and no load shows.
    """
    fitted = fit_without_contacts(data, strict=True)
    kept = friction_method(data, fitted)
    free, fits, remarks = fitted
    much = weighted_rms(free, all_residuals(free, fits)) > MATTERS * free.joined("tau").std(
        axis=0
    )
    ratio = links_explain(free, fits)[much[heavy_joints(free)]].max(initial=0.0)
    doubted = any(remark.level == "warning" for remark in remarks)
    if ratio > OTHER_LINKS and not doubted and not data.fit_constants:
        with suppress(IdentificationError):
            freed = whole_arm(data)
            if not freed.is_narrow:
                remark = caution("links-identified", robot=data.robot.name, ratio=ratio)
                return freed._replace(remarks=[remark, *freed.remarks])
    return kept
