"""Method "friction": everything but the links, which stay at the maker's table."""

from dataclasses import replace

from vftcli.identification.friction_shapes import rounded
from vftcli.identification.method_result import (
    MethodResult,
    confidence,
    friction_numbers,
    held,
    odd_friction,
    profile_friction,
)
from vftcli.identification.result import Number
from vftcli.identification.training import Training, fitted
from vftcli.signals.errors import IdentificationError


def friction_method(data: Training) -> MethodResult:
    """Friction, rotor inertia and, if asked, drive constants; links at the maker's table."""
    fits, _, notes = fitted(data, strict=True)
    robot = data.robot
    rotor, frictions = robot.chain.rotor_inertia.copy(), list(profile_friction(robot))
    constants = None if robot.torque_constant is None else robot.torque_constant.copy()
    numbers: list[Number] = []
    for j, found in enumerate(fits):
        if found is None:
            continue
        count = len(found.shape.terms)
        values, sd = found.fit.values.copy(), found.fit.sd.copy()
        if data.fit_constants and not found.constant:
            notes.append(
                f"joint {j + 1}: its load does not tell the drive constant; the profile's stays"
            )
        if found.constant and constants is not None:
            scale, scale_sd = float(values[-1]), float(sd[-1])
            refuse_sign(data, j, scale)
            values, sd = values / scale, sd / scale
            before = float(constants[j])
            K, K_sd = before / scale, before * scale_sd / scale**2
            numbers.append(Number(j + 1, "torque_constant", K, K_sd, before, True))
            constants[j] = rounded(K)
        if data.rotor:
            number, remark = rotor_number(j, values[count], sd[count], rotor[j])
            numbers.append(number)
            notes += remark
            if number.determined:
                rotor[j] = rounded(number.value)
        frictions[j] = found.shape.friction(values[:count], confidence(data, "friction", sd))
        numbers += friction_numbers(j, found.shape, values, sd, profile_friction(robot)[j])
        notes += odd_friction(j, frictions[j], data)
    chain = replace(robot.chain, rotor_inertia=rotor)
    new = replace(robot, chain=chain, friction=tuple(frictions), torque_constant=constants)
    contests = [c for f in fits if f is not None for c in f.contests]
    return MethodResult(new, numbers, contests, None, [*notes, *held(data)])


def refuse_sign(data: Training, j: int, scale: float) -> None:
    """Raise if the current falls where the torque rises."""
    if scale <= 0.05:
        raise IdentificationError(
            f"{data.recordings[0].name}: the current of joint {j + 1} does not follow its torque "
            f"(slope {scale:.2g}); wrong robot, sign or joint order, or the joint carries no load: "
            "leave out --fit-constants"
        )


def rotor_number(j: int, value: float, sd: float, before: float) -> tuple[Number, list[str]]:
    """The rotor inertia as a number; kept at the profile's where it is not determined."""
    known = bool(value > 0 and sd < 0.3 * value)
    number = Number(j + 1, "rotor_inertia", float(value), float(sd), float(before), known)
    if known:
        return number, []
    return number, [
        f"joint {j + 1}: rotor inertia {value:.3g} ± {sd:.2g} kg·m² is not determined by these "
        f"logs; the profile's {before:g} stays"
    ]
