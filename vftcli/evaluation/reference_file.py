"""A reference from a file: somebody else's torque, brought onto the log's clock."""

from pathlib import Path

import numpy as np

from vftcli.readers.references import read_reference
from vftcli.signals.errors import ReferenceTorqueError
from vftcli.signals.external_torque import ExternalTorque
from vftcli.signals.recording import Recording


def reference_from_file(path: Path, recording: Recording, columns: str | None) -> ExternalTorque:
    """External torque from a table whose clock is the log's own.

    The file's stamps are shifted by the log's first stamp, then interpolated linearly to the log's
    samples; samples beyond the file are NaN.

    Args:
        path: The table: t and one torque column a joint.
        recording: The log it belongs to.
        columns: Description of its columns, or None.

    Raises:
        ReferenceTorqueError: If the joints differ or the clocks do not overlap.
        LogError: If the table cannot be read.
    """
    table = read_reference(path, columns)
    if table.tau is None:
        raise ReferenceTorqueError(f"{path}: it has a wrench but no torques; compare with --wrench")
    if table.tau.shape[1] != recording.joints:
        raise ReferenceTorqueError(
            f"{path}: {table.tau.shape[1]} torque columns for a log of {recording.joints} joints"
        )
    t = table.t - recording.source.t0
    slack = 0.5 * recording.step
    inside = (recording.t >= t[0] - slack) & (recording.t <= t[-1] + slack)
    if not np.any(inside):
        raise ReferenceTorqueError(
            f"{path}: its clock ({table.t[0]:g} to {table.t[-1]:g} s) does not overlap the log's "
            f"({recording.source.t0 + recording.t[0]:g} to "
            f"{recording.source.t0 + recording.t[-1]:g} s); both must be the log's own clock"
        )
    there = np.column_stack([np.interp(recording.t, t, tau) for tau in table.tau.T])
    tau = np.where(inside[:, None], there, np.nan)
    note = (
        f"reference from {path.name}: {np.count_nonzero(inside)} of {recording.samples} samples "
        "covered; its own error is not stated, so no floor is known"
    )
    return ExternalTorque(name=f"file:{path.name}", t=recording.t, tau=tau, remarks=(note,))
