"""From the wrench options of a command to a WrenchRequest."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from vftcli.virtual_sensor.sensor_reading import WrenchRequest

START = "start"
"""The word for the unloaded start of the log."""


def wrench_request(
    asked: bool,
    frame: str | None,
    solver: str | None,
    tool: str | None,
    sensor_pose: str | None,
    zero: Sequence[str] | None,
    sensor_weight: bool,
    torque_sd: str | None,
) -> "WrenchRequest | None":
    """What is asked of the virtual sensor, None where no option asks for a wrench.

    Raises:
        ParameterError: If a frame or solver does not exist, or a zero is malformed.
    """
    options = (frame, solver, tool, sensor_pose, zero or None, torque_sd, sensor_weight or None)
    if not asked and all(option is None for option in options):
        return None
    from vftcli.pipeline import parse_interval
    from vftcli.signals.errors import ParameterError
    from vftcli.virtual_sensor.frames import check_frame
    from vftcli.virtual_sensor.sensor_reading import WrenchRequest
    from vftcli.virtual_sensor.solvers import check_solver

    spans, logs = [], []
    for text in zero or ():
        if text == START:
            continue
        if Path(text).exists():
            logs.append(Path(text))
        elif ":" in text:
            spans.append(parse_interval(text))
        else:
            raise ParameterError(
                f"--zero {text!r} is neither A:B in seconds, nor start, nor a log that exists"
            )
    start = START in (zero or ())
    if len(logs) > 1 or (spans and start):
        raise ParameterError("--zero takes one free run, and either start or spans A:B")
    return WrenchRequest(
        frame=check_frame(frame or "flange"),
        solver=check_solver(solver or "pinv"),
        tool=tool,
        sensor_pose=sensor_pose,
        zero=tuple(spans),
        zero_start=start,
        zero_log=logs[0] if logs else None,
        sensor_weight=sensor_weight,
        torque_sd=torque_sd,
    )
