"""The references a comparison can be made against: one table of names."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from vftcli.robots.robot import Robot
from vftcli.signals.errors import ReferenceTorqueError
from vftcli.signals.external_torque import ExternalTorque
from vftcli.signals.recording import Recording

if TYPE_CHECKING:
    from vftcli.virtual_sensor.frames import Mounting


@dataclass(frozen=True, kw_only=True)
class ReferenceRequest:
    """Which reference, and what it is made from.

    Attributes:
        name: A key of `REFERENCES`, or ``file:PATH``.
        free: Free runs of the same trajectory, already read, for ``two-cycle``.
        columns: The column description of a reference file, or None to recognise its columns.
        mounting: Where tool and sensor sit on the flange, for ``sensor``.
        period: The commanded period of a repeated motion, or None to find it. [s]
        free_cycles: Its free cycles, as ``1`` or ``1,2`` or ``1-3``, or None to find them.
        alignment: Rung of the alignment ladder, or "auto".
        low_pass: Cutoff of the two-cycle difference in Hz, "none", or "auto".
    """

    name: str
    free: tuple[Recording, ...] = ()
    columns: str | None = None
    mounting: "Mounting | None" = None
    period: float | None = None
    free_cycles: str | None = None
    alignment: str = "auto"
    low_pass: str = "auto"


def zero(recording: Recording, _robot: Robot, _request: ReferenceRequest) -> ExternalTorque:
    """No contact at all: the reference of a free motion, exact if the motion really was free."""
    shape = recording.q.shape
    return ExternalTorque(
        name="zero",
        t=recording.t,
        tau=np.zeros(shape),
        floor=np.zeros(shape[1]),
        remarks=("reference zero: every estimate counts as error, so the motion must be free",),
    )


def vendor(recording: Recording, _robot: Robot, _request: ReferenceRequest) -> ExternalTorque:
    """The vendor's own estimate in the log, torque on the robot; its error is not known."""
    return ExternalTorque(
        name="vendor",
        t=recording.t,
        tau=recording.require("tau_ext"),
        remarks=(
            "reference vendor: the log's own external torque, itself an estimate unless the log "
            "was simulated, so its floor is not known; the RMSE measures agreement, not accuracy",
        ),
    )


def two_cycle(recording: Recording, robot: Robot, request: ReferenceRequest) -> ExternalTorque:
    """The two-cycle difference, against cycles of the same log or free runs in others."""
    from vftcli.repetition.two_cycle import TwoCycleOptions, two_cycle_difference

    options = TwoCycleOptions(
        period=request.period,
        free_cycles=request.free_cycles,
        alignment=request.alignment,
        low_pass=request.low_pass,
    )
    return two_cycle_difference(recording, request.free, robot, options)


def sensor(recording: Recording, robot: Robot, request: ReferenceRequest) -> ExternalTorque:
    """The log's own wrench through the transposed flange Jacobian."""
    from vftcli.evaluation.reference_sensor import sensor_reference

    return sensor_reference(recording, robot, request.mounting)


def from_file(recording: Recording, robot: Robot, request: ReferenceRequest) -> ExternalTorque:
    """A table with t and one torque column a joint, on the log's own clock."""
    from vftcli.evaluation.reference_file import reference_from_file
    from vftcli.evaluation.reference_wrench import torque_of_file
    from vftcli.readers.references import read_reference

    path = Path(request.name.removeprefix("file:"))
    table = read_reference(path, request.columns)
    if table.tau is None and table.wrench is not None:
        return torque_of_file(recording, robot, path, request)
    return reference_from_file(path, recording, request.columns)


REFERENCES: dict[str, Callable[[Recording, Robot, ReferenceRequest], ExternalTorque]] = {
    "zero": zero,
    "vendor": vendor,
    "two-cycle": two_cycle,
    "sensor": sensor,
}
"""Name at the command line → what makes it; ``file:PATH`` is the one name with a path in it."""


def names() -> Sequence[str]:
    """Every form `--reference` takes."""
    return (*REFERENCES, "file:PATH")


def make_reference(recording: Recording, robot: Robot, request: ReferenceRequest) -> ExternalTorque:
    """Make the reference a comparison asks for, on the recording's clock.

    Raises:
        ReferenceTorqueError: If there is no such reference, or it cannot be made from the log.
    """
    if request.name.startswith("file:"):
        return from_file(recording, robot, request)
    if request.name not in REFERENCES:
        raise ReferenceTorqueError(f"no reference {request.name!r}; there is {', '.join(names())}")
    if request.free and request.name != "two-cycle":
        raise ReferenceTorqueError(
            f"--free goes with --reference two-cycle, not with {request.name}"
        )
    return REFERENCES[request.name](recording, robot, request)
