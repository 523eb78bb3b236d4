"""What is `effort`? The readings that an arm's model tells apart.

Drivers publish motor currents, joint torques, or torques less gravity under one name, some with
the sign turned. Each reading is judged by what the arm needs minus the reading, after friction,
relative to the column as it was logged: relative to the reading a slow arm's currents would pass
for torques without gravity.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from vftcli.doctor.case import Case, size_of
from vftcli.doctor.robust import solve
from vftcli.doctor.windows import Windows
from vftcli.robots import Robot
from vftcli.robots.drive import effort_name
from vftcli.robots.friction import steady_torque
from vftcli.signals.arrays import Array
from vftcli.signals.recording import Recording

#: Range of gravity's torque below which a log does not tell what its effort is. [N·m]
#:
#: Of real and simulated logs all 105 readings with 24 N·m and more were right, 3 of 10 below wrong.
RANGE = 10.0
#: Misfit that a model of the arm leaves of another's; measured efforts leave 1.3 % and more.
MODELLED = 0.02
#: Share of the friction of the robot file that no arm falls below, and standard deviations.
RUBS, SURE = 0.1, 4.0
#: Mean direction of a window in which a joint moves, such windows each way, and joints, by which
#: friction is judged.
FAST, WAYS, WITHOUT = 0.8, 8, 3
CLEAR = 1.5  #: How much better another reading must explain a log than the second best.


class Reading(NamedTuple):
    """What an effort may be."""

    code: str  #: The finding that it is this and not what its name says; "" for what the name says.
    case: Case  #: The log, its effort read so.


def case_of(recording: Recording, robot: Robot, windows: Windows) -> Case | None:
    """The log with its effort as its name says, None without any."""
    found = next(readings(recording, robot, windows), None)
    return None if found is None else found.case


def readings(
    recording: Recording, robot: Robot, windows: Windows, ignored: Sequence[int] = ()
) -> Iterator[Reading]:
    """What an effort may be, what its name says first."""
    name = effort_name(recording, robot)
    value, constant = getattr(recording, name), robot.torque_constant
    if value is None or (name == "current" and constant is None):
        return
    mean = windows.mean(value)
    mean[:, list(ignored)] = 0.0
    if not np.any(mean) or not np.all(np.isfinite(mean)):
        return
    gravity = windows.gravity[:, :, 2]
    driven = mean.copy() if constant is None else mean * constant
    as_torque, as_current = size_of(mean), size_of(driven)

    def reading(code: str, given: Array, size: float) -> Reading:
        columns = list(ignored)
        given[:, columns] = windows.inertial[:, columns] + gravity[:, columns]
        factor = constant if name == "current" and constant is not None else np.ones(mean.shape[1])
        return Reading(code, Case(windows=windows, given=given, size=size, constant=factor))

    if name == "current":
        yield reading("", driven, as_current)
        yield reading("current-as-torque", mean.copy(), as_torque)
        yield reading("milliamperes", driven / 1e3, as_current / 1e3)
        yield reading("effort-sign", -driven, as_current)
        yield reading("current-as-turned-torque", -mean, as_torque)
        yield reading("torque-without-gravity", mean + gravity, as_torque)
        yield reading("current-without-gravity", driven + gravity, as_current)
        return
    held = gravity if name == "torque_without_gravity" else 0.0 * gravity
    # What is left over is told relative to the whole torque, of which gravity is the most.
    as_torque = max(as_torque, float(np.sqrt(np.mean((mean + held) ** 2))))
    yield reading("", mean + held, as_torque)
    yield reading("effort-sign", -mean + held, as_torque)
    if name == "torque":
        yield reading("torque-without-gravity", mean + gravity, as_torque)
    else:
        yield reading("torque-with-gravity", mean.copy(), as_torque)
    if constant is not None:
        yield reading("torque-as-current", driven.copy(), as_current)
        yield reading("torque-as-turned-current", -driven, as_current)


def is_modelled(case: Case, robot: Robot) -> bool:
    """Whether an effort is what a model asks for: the arm's own friction is not in it.

    A simulation without friction beside another model of the arm leaves more open than a maker's
    own model does, and is not judged.
    """
    direction, speed = case.windows.motion
    n = direction.shape[1]
    if len(robot.friction) != n:
        return False
    typical = np.sqrt(np.mean(speed**2, axis=0))
    stated = np.array(
        [
            abs(float(steady_torque(f, np.array([v]))[0]))
            for f, v in zip(robot.friction, typical, strict=True)
        ]
    )
    both_ways = np.minimum((direction > FAST).sum(axis=0), (direction < -FAST).sum(axis=0))
    moving = (both_ways >= WAYS) & (stated > 0)
    if moving.sum() < WITHOUT:
        return False
    # A joint that tells nothing has what is needed in the place of its effort.
    tells = np.abs(case.given - case.needed).max(axis=0) > 1e-9 * case.size
    held = case.windows.gravity @ case.up
    static = solve((case.given - held) * tells, case.windows.friction)
    for fit in (case.bare, static):
        rubs = fit.values[:n] + fit.values[n:] * typical + SURE * fit.sd[:n]
        if fit.size < MODELLED * case.size and np.all(rubs[moving] < RUBS * stated[moving]):
            return True
    return False
