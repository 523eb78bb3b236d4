"""Where a UR controller's wrench has its moment: a sensor of its own, or one beside it."""

from dataclasses import replace

import numpy as np
import pytest

from vftcli.robots import load_robot
from vftcli.robots.chain import flange_jacobian, link_poses
from vftcli.signals.pose import Pose
from vftcli.signals.recording import Recording
from vftcli.signals.wrench import WrenchFrame
from vftcli.wrench.solvers import Mounting, logged_wrench

ROBOT = load_robot("ur5e")
TOOL = Mounting(tool=Pose(np.eye(3), np.array([0.02, 0.0, 0.16])))
CONTROLLER = WrenchFrame("base", "controller")
NOISE = 0.05
"""Noise of the currents, as UR logs have it. [A]"""


def pushed(point: str, force: float = 25.0, seed: int = 3) -> Recording:
    """20 s of motion with five pushes, planted; the controller gives their moment about a point."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, 20.0, 0.008)
    q = np.array([0.3, -1.2, 1.4, -1.7, -1.5, 0.2]) + 0.4 * np.sin(
        t[:, None] * rng.uniform(0.3, 1.0, 6) + rng.uniform(0.0, 6.0, 6)
    )
    about_flange = np.zeros((len(t), 6))
    for start in (2.0, 5.0, 9.0, 13.0, 17.0):
        inside = (t >= start) & (t < start + 1.5)
        shape = np.sin(np.pi * (t[inside] - start) / 1.5)[:, None]
        about_flange[inside] = shape * rng.normal(0.0, 1.0, 6) * np.repeat([force, 1.0], 3)
    J = flange_jacobian(ROBOT.chain, q)
    torque = np.einsum("tij,ti->tj", J, about_flange)
    target = rng.normal(0.0, 1.0, 6) * np.sin(t)[:, None]
    current = target - torque / ROBOT.torque_constant + rng.normal(0.0, NOISE, q.shape)
    wrench = about_flange.copy()
    if point == "tool":
        lever = link_poses(ROBOT.chain, q).rotation[:, -1] @ TOOL.tool.translation  # type: ignore[union-attr]
        wrench[:, 3:] -= np.cross(lever, wrench[:, :3])
    return Recording(
        t=t, q=q, current=current, target_current=target, wrench=wrench, wrench_frame=CONTROLLER
    )


@pytest.mark.parametrize("seed", [3, 4, 5])
@pytest.mark.parametrize("point", ["flange", "tool"])
def test_the_currents_tell_the_point(point: str, seed: int) -> None:
    log = pushed(point, seed=seed)
    found = logged_wrench(log, ROBOT.chain, TOOL)
    (remark,) = found.remarks
    assert remark.code == f"controller-point-{point}"
    other = {"flange": "tool", "tool": "flange"}[point]
    assert remark.values[point] < remark.values[other]
    # Planted about the flange, to the rounding of a lever of .16 m.
    planted = logged_wrench(pushed("flange", seed=seed), ROBOT.chain, TOOL)
    np.testing.assert_allclose(found.values, planted.values, atol=1e-12)


def test_a_log_without_pushes_tells_nothing() -> None:
    log = pushed("tool", force=0.0)
    noise = np.random.default_rng(8).normal(0.0, 2.0, log.q.shape)
    quiet = replace(log, current=log.target_current + NOISE * noise, wrench=noise)  # type: ignore[operator]
    found = logged_wrench(quiet, ROBOT.chain, TOOL)
    assert [remark.code for remark in found.remarks] == ["controller-point-open"]


def test_without_a_tool_or_target_currents_it_is_the_flange_aloud() -> None:
    log = pushed("flange")
    bare = logged_wrench(log, ROBOT.chain, Mounting())
    assert [remark.code for remark in bare.remarks] == ["controller-point-without-tool"]
    found = logged_wrench(replace(log, target_current=None), ROBOT.chain, TOOL)
    assert [remark.code for remark in found.remarks] == ["controller-point-without-currents"]
    np.testing.assert_array_equal(found.values, log.wrench)


def test_a_stated_point_is_not_tested() -> None:
    stated = replace(pushed("tool"), wrench_frame=WrenchFrame("base", "tool"))
    assert logged_wrench(stated, ROBOT.chain, TOOL).remarks == ()
