"""A reference from a file: somebody else's torque or wrench, brought onto the log's clock."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from vftcli.evaluation.reference import ReferenceLoad, torque_of
from vftcli.readers.references import read_reference
from vftcli.robots.robot import Robot
from vftcli.signals.arrays import Array
from vftcli.signals.errors import ReferenceTorqueError
from vftcli.signals.external_torque import ExternalTorque
from vftcli.signals.recording import Recording
from vftcli.signals.remarks import caution
from vftcli.signals.series import resample_columns
from vftcli.signals.wrench import WrenchFrame
from vftcli.virtual_sensor.frames import Mounting
from vftcli.virtual_sensor.log_wrench import in_base_axes


def file_reference(
    path: Path,
    recording: Recording,
    robot: Robot,
    mounting: Mounting,
    columns: str | None = None,
) -> ReferenceLoad:
    """External torque, wrench or both from a table whose clock is the log's own.

    A file without torques gives those of its wrench, Jᵀ w. A wrench is taken to be in base axes
    about the flange point unless ``wrench[FRAME]=…`` in the columns says otherwise.
    """
    table = read_reference(path, columns)
    # The recording counts from its first sample, a reference file from the same zero as the log.
    t = table.t - recording.source.t0
    name = f"file:{path.name}"
    wrench = None
    if table.wrench is not None:
        values = on_the_logs_clock(t, table.wrench, recording, path)
        frame = table.wrench_frame or WrenchFrame("base", "flange")
        given = replace(recording, wrench=values, wrench_frame=frame)
        # Zero throughout is an answer here: a truth of a log that nobody touched.
        wrench = in_base_axes(given, robot.chain, mounting)
    if table.tau is None:
        if wrench is None:
            raise ReferenceTorqueError(f"{path}: it holds neither a torque nor a wrench")
        remarks = (caution("reference-wrench-file", file=path.name), *wrench.remarks)
        return ReferenceLoad(
            torque=torque_of(wrench, recording, robot, name, remarks), wrench=wrench
        )
    if table.tau.shape[1] != recording.joints:
        raise ReferenceTorqueError(
            f"{path}: {table.tau.shape[1]} torque columns for a log of {recording.joints} joints"
        )
    tau = on_the_logs_clock(t, table.tau, recording, path)
    covered = int(np.count_nonzero(np.isfinite(tau[:, 0])))
    remarks = (
        caution("reference-file", file=path.name, covered=covered, samples=recording.samples),
    )
    torque = ExternalTorque(name=name, t=recording.t, tau=tau, remarks=remarks)
    return ReferenceLoad(torque=torque, wrench=wrench)


def on_the_logs_clock(t: Array, columns: Array, recording: Recording, path: Path) -> Array:
    """Columns interpolated linearly to the log's samples, NaN beyond the file. (T, k)

    Args:
        t: The file's time, from the log's first sample. (M,) [s]
        columns: Its values. (M, k)
        recording: The log.
        path: The file, for the error.
    """
    # Half a sample more at either end: stamps of one clock, written by two programs, round apart.
    slack = 0.5 * recording.median_step
    inside = (recording.t >= t[0] - slack) & (recording.t <= t[-1] + slack)
    if not np.any(inside):
        start = recording.source.t0
        raise ReferenceTorqueError(
            f"{path}: its clock ({t[0] + start:g} to {t[-1] + start:g} s) does not overlap the "
            f"log's ({recording.t[0] + start:g} to {recording.t[-1] + start:g} s); both must be "
            "the log's own clock"
        )
    there = resample_columns(recording.t, t, columns)
    return np.where(inside[:, None], there, np.nan)
