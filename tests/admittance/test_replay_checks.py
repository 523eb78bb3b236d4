"""What is said of a replay: each remark where it is due, and nowhere else."""

from dataclasses import replace

import numpy as np
import pytest

from vftcli.admittance import replay as checks
from vftcli.admittance.joints import JointPath
from vftcli.admittance.law import controllers
from vftcli.admittance.metrics import Drag
from vftcli.admittance.motion import AxisMotion
from vftcli.admittance.parameters import from_table
from vftcli.robots import load_robot
from vftcli.signals.wrench import Wrench

PARAMETERS = from_table(load_robot("ur5").admittance, "ur5", {})
TWO = controllers(PARAMETERS)
ROWS = 51


def motion(x: np.ndarray | None = None, clipped: np.ndarray | None = None) -> AxisMotion:
    """Five seconds of two controllers, at rest unless something is given."""
    zero = np.zeros((ROWS, 2, 6))
    flags = np.zeros(zero.shape, dtype=bool) if clipped is None else clipped
    return AxisMotion(t=np.arange(ROWS) * 0.1, x=zero if x is None else x, v=zero, clipped=flags)


def path(reached: np.ndarray | None = None, speed: float = 0.5) -> JointPath:
    good = np.ones((ROWS, 2), dtype=bool) if reached is None else reached
    return JointPath(q=np.zeros((ROWS, 2, 6)), reached=good, speed=np.array([speed, np.nan]))


NONE = np.zeros(2, dtype=np.int64)


def test_nothing_is_said_of_a_replay_without_trouble() -> None:
    assert checks.limits_met(TWO, motion(), path(), NONE) == ()
    assert checks.implausible_travel(PARAMETERS, TWO, motion(), path()) == ()
    assert checks.arm_moved(np.full((5, 6), 0.005)) == ()


def test_each_limit_is_told_with_its_number_and_its_controller() -> None:
    x, clipped, reached = (
        np.zeros((ROWS, 2, 6)),
        np.zeros((ROWS, 2, 6), bool),
        np.ones((ROWS, 2), bool),
    )
    x[20:, 1, 0] = np.inf
    clipped[3:6, 0, 2] = clipped[5, 0, 3] = True
    reached[30:40, 1] = False
    found = checks.limits_met(TWO, motion(x, clipped), path(reached, 1.5), np.array([0, 7]))
    assert "the first at 3.000 s" in " ".join(str(remark) for remark in found)
    told = {(r.code, r.where.about): dict(r.values) for r in found}
    first, second = (controller.name for controller in TWO)
    assert told == {
        ("speed-limit-acted", first): {"periods": 3},
        ("joint-too-fast", first): {"share": 1.5},
        ("motion-escaped", second): {"time_s": pytest.approx(2.0)},
        ("poses-out-of-reach", second): {"lost": 10, "poses": ROWS, "first_s": pytest.approx(3.0)},
        ("energy-rises", second): {"steps": 7},
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
    (remark,) = checks.implausible_travel(parameters, TWO, motion(x), path(reached))
    assert remark.code == code
    assert remark.values["travel_m"] == pytest.approx(1.0)  # not the other controller's 9 m


def test_the_axis_nearest_to_its_threshold_is_named() -> None:
    wrench = np.zeros((10, 6))
    wrench[4, 0], wrench[5, 4] = -10.0, 0.75 * PARAMETERS.threshold[4]
    wrench[6] = np.nan
    (remark,) = checks.nothing_dragged(wrench, PARAMETERS, dragged=False)
    assert remark.values["axis"] == "ry"
    assert remark.values["share"] == pytest.approx(0.75)
    assert checks.nothing_dragged(wrench, PARAMETERS, dragged=True) == ()
    assert checks.nothing_dragged(wrench[:0], PARAMETERS, dragged=False) == ()


def drag(begin: int, release: int, axis: int = 2) -> Drag:
    return Drag(axis=axis, number=1, begin=begin, release=release, end=release)


def test_a_long_drag_of_an_arm_at_rest_is_told_once_an_axis() -> None:
    logged = np.zeros((100, 6))
    found = checks.drags_at_rest([drag(0, 30), drag(40, 90), drag(10, 25, axis=0)], logged, 0.1)
    assert [(r.values["axis"], r.values["duration_s"]) for r in found] == [
        ("z", pytest.approx(5.0))
    ]


def test_a_moving_arm_is_dragged_as_it_should_be() -> None:
    t = np.arange(100) * 0.1
    there = np.zeros((100, 6))
    there[:, 0] = 0.3 * np.sin(2 * np.pi * t / 2.0)  # back where it was after every 2 s
    assert len(checks.drags_at_rest([drag(0, 90)], there, 0.1)) == 1  # each sample meets itself
    there[:, 0] = 0.1 * t
    assert checks.drags_at_rest([drag(0, 90)], there, 0.1) == ()


def test_unknown_samples_are_counted() -> None:
    masked = np.arange(10) < 3
    wrench = Wrench(
        name="x", t=np.arange(10.0), values=np.zeros((10, 6)), frame="base", masked=masked
    )
    (remark,) = checks.unknown_force(wrench)
    assert remark.values["samples"] == 3
    assert checks.unknown_force(replace(wrench, masked=np.zeros(10, dtype=bool))) == ()


def test_a_log_that_moves_is_told_how_far() -> None:
    logged = np.zeros((5, 6))
    logged[3, :3], logged[4, 3:] = [0.03, 0.0, 0.04], 1.0
    (remark,) = checks.arm_moved(logged)
    assert remark.values["distance_m"] == pytest.approx(0.05)
