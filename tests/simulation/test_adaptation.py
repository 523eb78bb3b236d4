"""A motion suited to another arm: inside its limits, said, and only where it is needed."""

from pathlib import Path

import numpy as np
import pytest

from vftcli.robots import load_robot
from vftcli.signals.errors import ParameterError
from vftcli.simulation import load_scenario, simulate
from vftcli.simulation.adaptation import bearable, one_round, reach_of
from vftcli.simulation.fourier_excitation import torque_share
from vftcli.simulation.kinematics import check_limits
from vftcli.simulation.load import to_toml
from vftcli.simulation.pushes import STYLES, PushesSpec

URDF = str(Path(__file__).parents[2] / "fixtures" / "arm.urdf")


@pytest.mark.slow
@pytest.mark.parametrize("name", ["ur3", "xarm6", "m1013", "panda", "gen3", URDF])
def test_a_circle_stays_inside_the_limits_of_any_arm(name: str) -> None:
    scenario, robot = load_scenario("ur5-circle", [f"robot={name}"]), load_robot(name)
    motion = one_round(scenario.trajectory, robot)
    check_limits(robot, motion.q, motion.dq, name)
    assert np.max(torque_share(robot, motion)) <= 0.8
    assert scenario.adapted
    assert scenario.trajectory.cycles == 5.0


@pytest.mark.parametrize("name", ["ur5", "UR-5", "ur10e"])
def test_a_circle_that_fits_stays_as_it_is(name: str) -> None:
    own, scenario = load_scenario("ur5-circle"), load_scenario("ur5-circle", [f"robot={name}"])
    assert scenario.adapted is None
    assert (scenario.trajectory, scenario.contacts) == (own.trajectory, own.contacts)


def test_only_what_must_change_does() -> None:
    own, slow = load_scenario("ur5-circle"), load_scenario("ur5-circle", ["robot=m1013"])
    # it reaches farther than a UR5, and its first joints turn at 2.09 rad/s in place of 3.14
    assert (slow.trajectory.start, slow.trajectory.radius) == (own.trajectory.start, 0.2)
    assert slow.trajectory.period > own.trajectory.period


@pytest.mark.slow
def test_what_the_user_states_stays() -> None:
    ur3 = load_scenario("ur5-circle", ["robot=ur3", "trajectory.radius=0.1"])
    assert ur3.trajectory.radius == 0.1
    start = "trajectory.start=[0.0, -1.35, 1.9, -2.1208, -1.5708, 0.0]"
    with pytest.raises(ParameterError, match="cannot reach"):
        simulate(load_scenario("ur5-circle", ["robot=ur3", start]))
    fast = ["robot=m1013", "trajectory.period=1", start]
    with pytest.raises(ParameterError, match="its limit is"):
        simulate(load_scenario("ur5-circle", fast))
    hand = load_scenario("ur5-circle", ["robot=fr3", "contacts.hand.torque=[1.0, 2.0]"])
    assert hand.contacts[0].torque == (1.0, 2.0)


@pytest.mark.slow
def test_a_file_of_a_suited_scenario_makes_it_again(tmp_path: Path) -> None:
    for name in ("ur5-circle", "free-excitation"):
        scenario = load_scenario(name, ["robot=ur3e"])
        path = tmp_path / f"{name}.toml"
        path.write_text(to_toml(scenario, scenario.seed), encoding="utf-8")
        assert "adapted = [" in path.read_text("utf-8")
        assert load_scenario(path) == scenario


@pytest.mark.slow
def test_a_hand_pushes_no_harder_than_the_arm_holds() -> None:
    scenario = load_scenario("ur5-circle", ["robot=xarm6", "duration=6"])
    (hand,) = scenario.contacts
    assert isinstance(hand, PushesSpec)
    most = bearable(load_robot("xarm6"), one_round(scenario.trajectory, load_robot("xarm6")))
    for key, largest in most.items():
        low, high = getattr(hand, key)
        usual = getattr(STYLES["mixed"], key)
        # two digits are kept; the ratio of the range stays but for them
        assert high == pytest.approx(largest, rel=0.05)
        assert low / high == pytest.approx(usual[0] / usual[1], rel=0.1)
    run = simulate(scenario)
    # 0.1 rad if it is pushed with all at rest; the push ends before the loop has swung
    assert np.max(np.abs(run.samples.q - run.samples.target_q)) < 0.15


def test_reach_is_that_of_the_links() -> None:
    # UR5: 0.425 + 0.39225 m of links, and the wrist's 0.0823 across 0.10915 and 0.09465 beside
    assert 0.85 < reach_of(load_robot("ur5")) < 0.425 + 0.39225 + 0.10915 + 0.09465 + 0.0823
