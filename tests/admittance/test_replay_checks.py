"""What is said of a replay: each remark where it is due, and nowhere else."""

from dataclasses import replace

import numpy as np
import pytest

from vftcli.admittance.law import Admittance, controllers, from_table
from vftcli.admittance.motion import AxisMotion, Drag, JointPath
from vftcli.admittance.replay import Replay, drag_remarks, trouble
from vftcli.robots import load_robot

PARAMETERS = from_table(load_robot("ur5").admittance, "ur5", {})
TWO = controllers(PARAMETERS)
ROWS = 51


REST = np.zeros((ROWS, 2, 6))


def motion(x: np.ndarray = REST, v: np.ndarray = REST) -> AxisMotion:
    """Five seconds of two controllers, at rest unless something is given."""
    return AxisMotion(t=np.arange(ROWS) * 0.1, x=x, v=v)


def path(reached: np.ndarray | None = None, speed: float = 0.5) -> JointPath:
    good = np.ones((ROWS, 2), dtype=bool) if reached is None else reached
    return JointPath(q=np.zeros((ROWS, 2, 6)), reached=good, speed=np.array([speed, np.nan]))


def replayed(
    made: AxisMotion | None = None,
    way: JointPath | None = None,
    *,
    parameters: Admittance = PARAMETERS,
    **others: np.ndarray,
) -> Replay:
    """A replay without trouble, but for what is given."""
    zero = np.zeros((ROWS - 1, 6))
    given = {"start": zero[0], "wrench": zero, "drags": (), **others}
    found = Replay(
        robot=load_robot("ur5"),
        controllers=controllers(parameters),
        motion=made or motion(),
        **given,
    )
    vars(found).update(path=way or path())
    return found


def test_nothing_is_said_of_a_replay_without_trouble() -> None:
    assert not [*trouble(replayed())]
    assert not [*trouble(replayed(logged=np.full((5, 6), 0.005)))]


def test_each_limit_is_reported_with_its_number_and_its_controller() -> None:
    (x, v), reached = np.zeros((2, ROWS, 2, 6)), np.ones((ROWS, 2), bool)
    x[20:, 1, 0] = v[20:, 1, 0] = np.inf
    limit = PARAMETERS.speed_limit
    v[3:6, 0, 2], v[5, 0, 3], v[7, 0, 3] = limit[2], -limit[3], 0.99 * limit[3]
    reached[30:40, 1] = False
    found = [*trouble(replayed(motion(x, v), path(reached, 1.5)))]
    assert "the first at 3.000 s" in " ".join(str(remark) for remark in found)
    reported = {(r.code, r.where.about): dict(r.values) for r in found}
    first, second = (controller.name for controller in TWO)
    assert reported.pop(("travel-implausible-hard", ""))["travel_m"] > 1e300  # it escaped
    assert reported == {
        ("speed-limit-acted", first): {"periods": 3},
        ("joint-too-fast", first): {"share": 1.5},
        ("motion-escaped", second): {"time_s": pytest.approx(2.0)},
        ("poses-out-of-reach", second): {
            "lost": 10,
            "poses": ROWS,
            "first_s": pytest.approx(3.0),
        },
    }


@pytest.mark.parametrize(
    ("mode", "code"), [("hard", "travel-implausible-hard"), ("soft", "travel-implausible")]
)
def test_travel_counts_where_poses_are_out_of_reach(mode: str, code: str) -> None:
    x = np.zeros((ROWS, 2, 6))
    x[10, 0, :3], x[10, 1, :3] = [9.0, 0, 0], [0.6, 0.8, 0]
    reached = np.ones((ROWS, 2), dtype=bool)
    reached[10, 1] = False
    parameters = replace(PARAMETERS, threshold_mode=mode)
    _, remark = trouble(replayed(motion(x), path(reached), parameters=parameters))
    assert remark.code == code
    assert remark.values["travel_m"] == pytest.approx(1.0)  # not the other controller's 9 m


def test_the_axis_nearest_to_its_threshold_is_named() -> None:
    wrench = np.zeros((10, 6))
    wrench[4, 0], wrench[5, 4] = -10.0, 0.75 * PARAMETERS.threshold[4]
    wrench[6] = np.nan
    (remark,) = drag_remarks(replayed(wrench=wrench, logged=wrench))
    assert remark.values["axis"] == "ry"
    assert remark.values["share"] == pytest.approx(0.75)
    assert not [*drag_remarks(replayed(wrench=wrench, logged=wrench, drags=[drag(4, 5)]))]
    assert not [*drag_remarks(replayed(wrench=wrench[:0], logged=wrench))]


def drag(begin: int, release: int, axis: int = 2) -> Drag:
    return Drag(axis=axis, number=1, begin=begin, release=release, end=release)


def test_the_travel_of_a_log_that_moves_is_reported() -> None:
    logged = np.zeros((5, 6))
    logged[3, :3], logged[4, 3:] = [0.03, 0.0, 0.04], 1.0
    (remark,) = trouble(replayed(logged=logged))
    assert remark.values["distance_m"] == pytest.approx(0.05)
