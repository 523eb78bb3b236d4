"""What a user may choose of the virtual sensor: one meaning of each option."""

from pathlib import Path

import numpy as np
import polars as pl
import pytest
from fault_commands import run

from vftcli.robots import load_robot
from vftcli.signals.errors import ParameterError
from vftcli.wrench import FIT, WrenchChoice, ZeroChoice


def test_a_named_solver_is_every_observers_and_else_the_smoother_is_for_best():
    # the smoother's σ_min, null space and mask are pinv's
    for solver, by_pose, best, other in (
        (None, "pinv", True, False),
        ("smoother", "pinv", True, True),
        ("map", "map", False, False),
    ):
        choice = WrenchChoice(solver=solver)
        found = choice.by_pose, choice.smooths("best"), choice.smooths("kfo-fe")
        assert found == (by_pose, best, other)


def test_a_zero_is_spans_or_the_start():
    assert ZeroChoice.parsed(["1:2", "8:9"]).spans == ((1.0, 2.0), (8.0, 9.0))
    assert ZeroChoice.parsed(["start"]) == ZeroChoice(start=True)
    assert ZeroChoice.parsed([]) == ZeroChoice()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["free.csv"], "nor start; name a log of free motion by --free LOG"),
        (["12:30.csv"], "nor start; name a log of free motion by --free LOG"),
        (["start", "1:2"], "either start or spans A:B"),
        (["2:1"], "A:B with A < B"),
    ],
)
def test_a_zero_that_is_none(words, message):
    with pytest.raises(ParameterError, match=message):
        ZeroChoice.parsed(words)


def test_what_is_asked_goes_before_the_robot_file():
    robot = load_robot("ur5")
    there = WrenchChoice(tool="0,0,0.1", sensor_pose="0,0,0.03").mounting(robot)
    np.testing.assert_array_equal(there.tool.translation, [0, 0, 0.1])
    np.testing.assert_array_equal(there.sensor.translation, [0, 0, 0.03])
    assert WrenchChoice(sensor_pose=FIT).mounting(robot).sensor is None


CIRCLE = Path(__file__).parents[2] / "fixtures" / "ur5_circle.csv"
COMMON = [CIRCLE, "--robot", "ur5", "--observer", "gmo"]


@pytest.mark.parametrize(
    ("option", "asks"),
    [
        (("--frame", "base"), True),
        (("--set", "virtual-sensor.solver=map"), True),
        (("--zero", "1:3"), True),
        ((), False),
    ],
)
def test_any_wrench_option_asks_for_the_wrench(tmp_path, option, asks):
    code, _, err = run(["estimate", *COMMON, *option, "-o", tmp_path])
    assert code == 0, err
    columns = pl.read_parquet_schema(tmp_path / "estimates.parquet")
    assert any("wrench" in name for name in columns) is asks


@pytest.mark.parametrize(
    ("option", "words"),
    [
        (("--frame", "wrist"), "no frame 'wrist' for a wrench; there is flange"),
        (("--frame", "tool"), "the robot has no tool"),
        (("--set", "virtual-sensor.solver=svd"), "virtual-sensor.solver=svd; there is smoother"),
        (("--zero", "500:600"), "is outside the log"),
        (("--frame", "sensor", "--set", "virtual-sensor.sensor=0,0,0,2"), "three or six"),
    ],
)
def test_bad_options_are_one_line_and_leave_nothing(tmp_path, option, words):
    out = tmp_path / "out"
    code, _, err = run(["estimate", *COMMON, *option, "-o", out])
    assert code == 1
    assert words in err
    lines = [line for line in err.splitlines() if not line.startswith(("log health: ", "note: "))]
    assert len(lines) == 1
    assert not out.exists()
