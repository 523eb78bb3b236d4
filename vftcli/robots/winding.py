"""Joints that turn on and on: positions that a log holds within one turn are wound up again."""

from dataclasses import replace
from typing import Any

import numpy as np

from vftcli.robots.robot import Robot
from vftcli.signals.recording import Recording
from vftcli.signals.remarks import Where, fact


def unwound(recording: Recording, robot: Robot) -> Recording:
    """The recording without the jumps of a turn in the positions of endless joints.

    A position that changes by more than half a turn between two samples has been taken back into
    one turn by who logged it. The log itself is returned where none does.
    """
    columns = [j for j, name in enumerate(robot.chain.names) if name in robot.endless]
    if recording.joints != robot.joints:
        return recording
    changed: dict[str, Any] = {}
    jumping = set[int]()
    for signal in ("q", "target_q"):
        if (values := getattr(recording, signal)) is not None:
            # A sample that is missing is no number; what is wound up behind it would be none.
            steps = np.abs(np.diff(values, axis=0)).max(axis=0, initial=0.0)
            if turns := [j for j in columns if steps[j] > np.pi]:
                changed[signal] = smooth = values.copy()
                smooth[:, turns] = np.unwrap(values[:, turns], axis=0)
                jumping.update(turns)
    if not changed:
        return recording
    said = fact("endless-joint-unwound", Where(joints=tuple(j + 1 for j in sorted(jumping))))
    source = replace(recording.source, remarks=(*recording.source.remarks, said))
    return replace(recording, source=source, **changed)
