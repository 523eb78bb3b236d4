"""About which point a UR controller's force has its moment: what the joints' currents say."""

from typing import Any

import numpy as np

from vftcli.robots.chain import Chain
from vftcli.robots.kinematics import flange_jacobian, link_poses
from vftcli.signals.arrays import Array
from vftcli.signals.recording import Recording
from vftcli.signals.remarks import Remark, caution, fact

#: As much of a log as counts for one independent sample: friction's errors last as long. [s]
PIECE = 1.0
#: Evidence from which on the currents' word is believed, that of three standard errors. [nats]
SURE = 4.5


def controller_point(
    recording: Recording, chain: Chain, tool: Array | None
) -> tuple[str, tuple[Remark, ...]]:
    """The point of a controller's moment, "flange" or "tool", and why.

    The controller knows its payload and its arm: what the measured currents have beyond its target
    currents is what touches the arm, each joint with a factor and an offset of its own. It is
    explained by Jᵀ of the wrench, once about the flange and once about the tool's point. The one
    that leaves less is used if it is likelier by `SURE`; the flange is used where nothing tells,
    as an e-Series' own sensor has it.

    Args:
        recording: A log with a wrench in base axes.
        chain: The arm.
        tool: The tool's point in the flange frame, None where it is not known. (3,) [m]
    """
    if recording.current is None or recording.target_current is None:
        return "flange", (caution("controller-point-without-currents"),)
    if tool is None or not np.any(tool):
        return "flange", (caution("controller-point-without-tool"),)
    beyond = recording.current - recording.target_current
    force, moment = np.hsplit(recording.require("wrench"), 2)
    lever = link_poses(chain, recording.q).rotation[:, -1] @ tool
    J = flange_jacobian(chain, recording.q)
    about = {"flange": moment, "tool": moment + np.cross(lever, force)}
    left = {
        point: unexplained(beyond, np.einsum("tij,ti->tj", J, np.hstack([force, turned])))
        for point, turned in about.items()
    }
    values: dict[str, Any] = {
        point: float(np.sqrt(np.mean(share))) for point, share in left.items()
    }
    pieces = recording.duration / PIECE
    evidence = 0.5 * pieces * float(np.sum(np.log(left["flange"] / left["tool"])))
    if abs(evidence) <= SURE:
        return "flange", (caution("controller-point-open", **values),)
    point = "tool" if evidence > 0.0 else "flange"
    return point, (fact(f"controller-point-{point}", **values),)


def unexplained(beyond: Array, torque: Array) -> Array:
    """Share of each joint's variance that a line in a torque leaves. (n,)

    Args:
        beyond: Measured less target current. (T, n) [A]
        torque: What might explain it. (T, n) [N·m]
    """
    y, x = beyond - beyond.mean(axis=0), torque - torque.mean(axis=0)
    tiny = np.finfo(np.float64).tiny
    slope = np.sum(x * y, axis=0) / np.maximum(np.sum(x**2, axis=0), tiny)
    rest = np.sum((y - slope * x) ** 2, axis=0)
    share: Array = np.maximum(rest, tiny) / np.maximum(np.sum(y**2, axis=0), tiny)
    return share
