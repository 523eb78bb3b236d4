"""Method "friction": everything but the links, which stay at the maker's table."""

from dataclasses import replace

from vftcli.identification.clean_fit import CleanFit, fit_without_contacts
from vftcli.identification.friction_shapes import round_digits
from vftcli.identification.method_result import (
    DETERMINED,
    MethodResult,
    bound_remarks,
    check_friction,
    friction_numbers,
    friction_source,
    held_joints,
    identified_friction,
    presliding_remark,
    profile_constant,
    profile_friction,
    rotor_number,
    temperature_remarks,
)
from vftcli.identification.result import Number, number
from vftcli.identification.training import Training
from vftcli.signals.arrays import Array
from vftcli.signals.errors import IdentificationError
from vftcli.signals.remarks import Remark, Where, caution

#: Slope of measured over expected torque below which a current does not follow its torque.
LEAST_SLOPE = 0.05


def friction_method(data: Training, fitted: CleanFit | None = None) -> MethodResult:
    """Friction, rotor inertia and, if asked, drive constants; links at the maker's table."""
    if not (data.rubs or data.rotor):
        raise IdentificationError(
            f"robot {data.robot.name!r} has its torque behind the gears: without friction the "
            "friction method has nothing to find; use --method base"
        )
    fits, _, remarks = fitted or fit_without_contacts(data, strict=True)
    remarks, robot = [*remarks], data.robot
    rotor, frictions = robot.chain.rotor_inertia.copy(), list(profile_friction(robot))
    constants = None if robot.torque_constant is None else robot.torque_constant.copy()
    numbers: list[Number] = []
    for j, found in enumerate(fits):
        if found is None:
            continue
        count, where = len(found.shape.terms), Where(joints=(j + 1,))
        if found.is_kept:
            found_rms, profile_rms = found.errors
            missed = {"found_Nm": found_rms, "profile_Nm": profile_rms}
            remarks.append(caution("profile-kept", where, **missed))
            continue
        values, sd = found.fit.values, found.fit.sd
        if data.fit_constants and not found.constant:
            remarks.append(caution("unloaded-drive-constant", where))
        if found.constant and constants is not None:
            values, sd, K = by_constant(data, j, values, sd)
            numbers.append(K)
            constants[j] = round_digits(K.value)
        if data.rotor:
            J = rotor_number(j, values[count], sd[count], rotor[j])
            numbers.append(J)
            remarks += rotor_remarks(J, where)
            rotor[j] = round_digits(J.value) if J.determined else rotor[j]
        if data.rubs:
            source = friction_source(data, "friction", sd)
            frictions[j] = identified_friction(data, j, found.shape, values[:count], source)
            numbers += friction_numbers(j, found.shape, values, sd, profile_friction(robot)[j])
            remarks += check_friction(j, frictions[j], data)
    chain = replace(robot.chain, rotor_inertia=rotor)
    friction = tuple(frictions) if data.rubs else ()
    new = replace(robot, chain=chain, friction=friction, torque_constant=constants)
    choices = [c for f in fits if f is not None for c in f.choices]
    remarks += [*bound_remarks(fits), *presliding_remark(fits), *temperature_remarks(data)]
    remarks += held_joints(data)
    return MethodResult(new, numbers, choices, None, remarks)


def by_constant(data: Training, j: int, values: Array, sd: Array) -> tuple[Array, Array, Number]:
    """Coefficients of joint j (from 0) and their sd by the drive constant fitted last, and it.

    Torque was made from currents with the profile's K. Where the rigid body's torque comes out as
    scale times what it must be, the true K is K / scale, and so are all coefficients beside it.
    """
    scale, scale_sd = float(values[-1]), float(sd[-1])
    if scale <= LEAST_SLOPE:
        raise IdentificationError(
            f"{data.recordings[0].name}: the current of joint {j + 1} does not follow its torque "
            f"(slope {scale:.2g}); wrong robot, sign or joint order, or the joint carries no load: "
            "leave out --fit-constants"
        )
    before = profile_constant(data.robot, j)
    K, K_sd = before / scale, before * scale_sd / scale**2
    return values / scale, sd / scale, number(j, "torque_constant", K, K_sd, before, True)


def rotor_remarks(J: Number, where: Where) -> list[Remark]:
    """That a rotor inertia is not known to `DETERMINED`, and which one is taken."""
    if J.determined and J.sd < DETERMINED * J.value:
        return []
    found = {"found_kgm2": J.value, "sd_kgm2": J.sd, "profile_kgm2": J.profile}
    code = "refuted-rotor-inertia" if J.determined else "undetermined-rotor-inertia"
    return [caution(code, where, **found)]
