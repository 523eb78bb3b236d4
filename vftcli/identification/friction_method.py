"""Method "friction": everything but the links, which stay at the maker's table."""

from dataclasses import replace

from vftcli.identification.clean_fit import fit_without_contacts
from vftcli.identification.friction_shapes import round_digits
from vftcli.identification.method_result import (
    DETERMINED,
    MethodResult,
    check_friction,
    friction_numbers,
    friction_source,
    held_joints,
    identified_friction,
    presliding_remark,
    profile_friction,
    temperature_remarks,
)
from vftcli.identification.result import Number, number
from vftcli.identification.training import Training
from vftcli.signals.errors import IdentificationError
from vftcli.signals.remarks import Where, caution

LEAST_SLOPE = 0.05
"""Slope of measured over expected torque below which a current does not follow its torque."""


def friction_method(data: Training) -> MethodResult:
    """Friction, rotor inertia and, if asked, drive constants; links at the maker's table."""
    fits, _, remarks = fit_without_contacts(data, strict=True)
    robot = data.robot
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
        values, sd = found.fit.values.copy(), found.fit.sd.copy()
        if data.fit_constants and not found.constant:
            remarks.append(caution("unloaded-drive-constant", where))
        if found.constant and constants is not None:
            # Torque was made from currents with the profile's K. Where the rigid body's torque
            # comes out as scale times what it must be, the true K is K / scale, and so are all
            # coefficients beside it.
            scale, scale_sd = float(values[-1]), float(sd[-1])
            refuse_sign(data, j, scale)
            values, sd = values / scale, sd / scale
            before = float(constants[j])
            K, K_sd = before / scale, before * scale_sd / scale**2
            numbers.append(number(j, "torque_constant", K, K_sd, before, True))
            constants[j] = round_digits(K)
        if data.rotor:
            J = rotor_number(j, values[count], sd[count], rotor[j])
            numbers.append(J)
            if J.determined:
                rotor[j] = round_digits(J.value)
            else:
                found_here = {"found_kgm2": J.value, "sd_kgm2": J.sd, "profile_kgm2": J.profile}
                remarks.append(caution("undetermined-rotor-inertia", where, **found_here))
        source = friction_source(data, "friction", sd)
        frictions[j] = identified_friction(data, j, found.shape, values[:count], source)
        numbers += friction_numbers(j, found.shape, values, sd, profile_friction(robot)[j])
        remarks += check_friction(j, frictions[j], data)
    chain = replace(robot.chain, rotor_inertia=rotor)
    new = replace(robot, chain=chain, friction=tuple(frictions), torque_constant=constants)
    choices = [c for f in fits if f is not None for c in f.choices]
    return MethodResult(
        new,
        numbers,
        choices,
        None,
        [*remarks, *presliding_remark(fits), *temperature_remarks(data), *held_joints(data)],
    )


def refuse_sign(data: Training, j: int, scale: float) -> None:
    """Raise an IdentificationError if the current falls where the torque rises."""
    if scale <= LEAST_SLOPE:
        raise IdentificationError(
            f"{data.recordings[0].name}: the current of joint {j + 1} does not follow its torque "
            f"(slope {scale:.2g}); wrong robot, sign or joint order, or the joint carries no load: "
            "leave out --fit-constants"
        )


def rotor_number(j: int, value: float, sd: float, before: float) -> Number:
    """The rotor inertia of joint j (from 0) as a number, determined or not. [kg·m²]"""
    known = bool(value > 0 and sd < DETERMINED * value)
    return number(j, "rotor_inertia", value, sd, before, known)
