"""Exciting motions made for any arm: inside its limits, well conditioned, always the same."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from vftcli.robots import load_robot
from vftcli.robots.robot import Limits
from vftcli.signals.errors import ParameterError
from vftcli.simulation import load_scenario, simulate
from vftcli.simulation.calibration_motions import ExcitationSpec
from vftcli.simulation.fourier_excitation import (
    base_columns,
    condition_number,
    make_excitation,
    torque_share,
)
from vftcli.simulation.kinematics import check_limits
from vftcli.simulation.servo import rigid_torque

LIMITS = ("q_min", "q_max", "qd_max", "tau_max", "qdd_max")
URDF = str(Path(__file__).parents[2] / "fixtures" / "arm.urdf")


@pytest.mark.parametrize(("name", "rank", "condition"), [("ur5", 58, 13.9), ("panda", 69, 10.1)])
def test_condition_is_that_of_the_optimised_series(name: str, rank: int, condition: float) -> None:
    # the same figures as by Pinocchio's regressor, `test_motions`
    robot, best = load_robot(name), ExcitationSpec(cycles=1.0).motion(load_robot(name))
    columns = base_columns(robot)
    motion = best.at(np.linspace(0.0, 10.0, 500, endpoint=False))
    assert len(columns) == rank
    assert condition_number(robot, motion, columns) == pytest.approx(condition, abs=0.1)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["ur3", "gen3", URDF])
def test_a_made_motion_excites_inside_the_limits(name: str) -> None:
    robot = load_robot(name)
    made = make_excitation(robot)
    motion = made.series.at(np.linspace(0.0, 10.0, 1000))
    check_limits(robot, motion.q, motion.dq, name)
    assert np.all(np.abs(motion.ddq) < 5.05)
    assert np.max(torque_share(robot, motion)) <= 0.81  # 1 %: made at 200 instants, not 1000
    assert made.condition < 30.0


@pytest.mark.slow
def test_torque_is_that_of_pinocchio() -> None:
    robot = load_robot("xarm6")  # without friction
    motion = ExcitationSpec().motion(robot).at(np.linspace(0.0, 10.0, 20))
    expected = np.max(np.abs(rigid_torque(robot.model, motion)), axis=0) / robot.limits.tau_max
    np.testing.assert_allclose(torque_share(robot, motion), expected, rtol=1e-9)


@pytest.mark.slow
def test_an_arm_without_limits_moves_with_caution_and_says_so(tmp_path: Path) -> None:
    nothing = np.full(6, np.nan)
    robot = replace(load_robot(URDF), limits=Limits(**dict.fromkeys(LIMITS, nothing)))
    motion = make_excitation(robot).series.at(np.linspace(0.0, 10.0, 500))
    # the stated defaults: half a turn, 1 rad/s, 5 rad/s²; 1 %: made at 200 instants, not 500
    assert np.max(np.abs(motion.q)) < np.pi
    assert np.max(np.abs(motion.dq)) < 1.01
    assert np.max(np.abs(motion.ddq)) < 5.05
    text = "".join(line for line in Path(URDF).read_text().splitlines() if "<limit" not in line)
    bare = tmp_path / "bare.urdf"
    bare.write_text(text.replace('"revolute"', '"continuous"'))
    said = load_scenario("free-excitation", [f"robot={bare}"]).adapted or ()
    assert [words.split(":")[0].split(" of ")[0] for words in said[1:]] == [
        "no position limits", "no speed limit", "no acceleration limit", "no torque limit",
    ]  # fmt: skip


def test_an_arm_that_cannot_carry_itself_is_refused() -> None:
    robot = load_robot(URDF)
    weak = replace(robot, limits=replace(robot.limits, tau_max=np.full(6, 0.5)))
    with pytest.raises(ParameterError, match="no exciting motion of 10 s"):
        make_excitation(weak)


@pytest.mark.slow
def test_a_stated_period_is_kept() -> None:
    scenario = load_scenario("free-excitation", ["robot=ur10", "trajectory.period=6"])
    assert scenario.trajectory.period == 6.0
    run = simulate(load_scenario("free-excitation", [f"robot={URDF}", "duration=0.2"]))
    assert np.all(np.isfinite(run.recording.q))
