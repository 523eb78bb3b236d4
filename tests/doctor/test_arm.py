"""Whether an arm explains a log: another arm's log, loads, what is not judged, what is refused."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from moving_arms import carrying, exchanged, gravity, moving

from vftcli.doctor import Examination, examine, in_words
from vftcli.doctor.fit import GUESSED, ArmFindings, arm_findings
from vftcli.robots import PROFILES, Robot, load_robot
from vftcli.signals.recording import Recording
from vftcli.signals.remarks import Remark, fact, warning

UR10E, UR5, PANDA = load_robot("ur10e"), load_robot("ur5"), load_robot("panda")


def codes(found: ArmFindings | Examination) -> list[str]:
    return [finding.code for finding in found.findings]


def only(log: Recording, robot: Robot | None) -> Remark:
    (finding,) = arm_findings(log, robot).findings
    return finding


@pytest.mark.parametrize("name", ["ur5", "ur5e", "ur10e", "panda", "fr3"])
def test_nothing_is_said_of_a_sound_log(name: str) -> None:
    for robot in (load_robot(name), None):
        found = arm_findings(moving(name), robot)
        assert codes(found) == []
        assert found.robots[0].robot == name
        assert found.robots[0].fits


def test_the_log_of_another_arm_is_reported_with_its_name() -> None:
    for log, robot, right in ((moving(), UR5, "ur10e"), (moving("ur5"), UR10E, "ur5")):
        finding = only(log, robot)
        assert (finding.code, finding.level) == ("other-robot", "warning")
        assert finding.values["robot"] == right
        assert f"--robot {right}" in in_words(finding).remedy


@pytest.mark.parametrize(
    ("name", "load", "own", "beside", "code"),
    [
        ("ur5e", 0.0, "ur5", 0.07, "other-robot"),  # it would carry 2.4 kg as a UR5
        ("ur10", 2.0, "ur16e", 0.05, "unmodelled-load"),  # 2.9 kg as a UR16e, 2 kg as a UR10
    ],
)
def test_of_arms_that_fit_alike_one_that_carries_much_less_is_the_log_s(
    name: str, load: float, own: str, beside: float, code: str
) -> None:
    """A share of every torque that no arm explains: the right one leaves .6 to .8 of the other."""
    log = moving(name, load=load)
    current = log.require("current")
    wave = np.sin(7.0 * log.t[:, None] + np.arange(6.0))
    current = current + beside * np.sqrt(2.0 * np.mean(current**2, axis=0)) * wave
    found = arm_findings(replace(log, current=current), load_robot(own))
    assert codes(found) == [code]
    misfit = {match.robot: match.misfit for match in found.robots}
    assert 0.6 < misfit[name] / misfit[own] < 0.8


def test_the_vendor_s_residual_tells_a_panda_from_an_fr3() -> None:
    """By the measured torques the two are too much alike."""
    log = replace(moving("panda"), tau_ext=np.full_like(moving("panda").q, 1e-3))
    assert only(log, load_robot("fr3")).code == "other-robot"
    assert codes(arm_findings(log, PANDA)) == []


def test_a_user_s_own_file_may_differ_from_its_maker_s_model(tmp_path: Path) -> None:
    """An arm whose elbow is heavier than its maker says, identified: 3 % beside the targets."""
    mine = tmp_path / "mine.toml"
    text = PROFILES["ur10e"].read_text(encoding="utf-8")
    mine.write_text(text.replace("mass = 3.989", "mass = 5.0"), encoding="utf-8")
    robot, log = load_robot(mine), moving("ur10e")
    drive = log.require("current") * UR10E.torque_constant
    heavier = gravity(robot, log) - gravity(UR10E, log)
    log = replace(log, target_torque=drive, current=log.current + heavier / UR10E.torque_constant)
    own, *_ = arm_findings(log, robot).robots
    assert own.misfit > 5 * GUESSED  # by the maker's own model, which the profile fits exactly
    assert codes(arm_findings(log, robot)) == []
    assert codes(arm_findings(moving("ur5"), robot)) == ["other-robot"]


@pytest.mark.slow
def test_an_arm_that_no_profile_knows_is_refused_with_the_fits() -> None:
    """A torque that no rigid body makes: it turns thrice as fast as gravity's."""
    log = moving("panda")
    unknown = replace(log, torque=20 * np.sin(3 * log.q))
    finding = only(unknown, PANDA)
    assert (finding.code, finding.level) == ("no-robot-fits", "warning")
    assert finding.values["misfit_percent"] > 35
    assert codes(arm_findings(unknown, None))[-1] == "no-robot-fits-any"


def test_a_log_that_says_its_arm_is_held_against_it() -> None:
    log = replace(moving(), robot_hint="ur5")
    assert codes(arm_findings(log, None)) == ["other-robot"]
    assert codes(arm_findings(replace(log, robot_hint="ur10e"), None)) == []


@pytest.mark.slow
def test_an_effort_is_put_right_where_nobody_says_the_arm() -> None:
    log = moving()
    found = arm_findings(replace(log, current=-log.require("current")), None)
    assert codes(found) == ["effort-sign"]


def test_loads_are_reported_with_their_mass_and_mounted_ones_are_not() -> None:
    log = moving(load=2.8)
    finding = only(log, UR10E)
    assert (finding.code, finding.level) == ("unmodelled-load", "warning")
    # 10 %: the load's inertia is not in the fit of its weight
    assert finding.values["load_kg"] == pytest.approx(2.8, rel=0.1)
    assert codes(arm_findings(log, carrying(UR10E, 2.8))) == []
    finding = only(moving("panda", load=0.8), PANDA)
    assert (finding.code, finding.level) == ("light-load", "caution")


@pytest.mark.parametrize(("beside", "expected"), [(0.05, ["light-load"]), (0.1, [])])
def test_a_light_load_is_reported_where_it_is_a_good_part_of_the_misfit(
    beside: float, expected: list[str]
) -> None:
    """Beside a wave that no load explains, .8 kg leave .50 of the misfit; beside twice it .84."""
    log = moving(load=0.8)
    current = log.require("current")
    wave = np.sin(7.0 * log.t[:, None] + np.arange(6.0))
    current = current + beside * np.sqrt(2.0 * np.mean(current**2, axis=0)) * wave
    assert codes(arm_findings(replace(log, current=current), UR10E)) == expected


@pytest.mark.parametrize("declared", [None, 0.0])
@pytest.mark.parametrize(("arm", "held", "mounted"), [("ur5", 0.0, 0.8), ("panda", 1.0, 2.8)])
def test_a_mounted_payload_that_the_arm_does_not_carry_is_reported(
    declared: float | None, arm: str, held: float, mounted: float
) -> None:
    """Neither as a factor of the drives nor as another arm, both of which explain it too."""
    log = replace(moving(arm, load=held), payload_mass=declared)
    finding = only(log, carrying(load_robot(arm), mounted))
    assert (finding.code, finding.values["mounted_kg"]) == ("payload-not-carried", mounted)
    # 10 % of what is missing, as above
    assert finding.values["carried_kg"] == pytest.approx(held, abs=0.1 * (mounted - held))
    assert "kg less (" in str(arm_findings(log, carrying(load_robot(arm), mounted)).robots[0])


def test_a_declared_payload_that_is_not_mounted_is_reported_once() -> None:
    log = replace(moving(load=2.8), payload_mass=2.8)
    finding = only(log, UR10E)
    assert (finding.code, finding.level) == ("payload-not-mounted", "warning")
    assert dict(finding.values) == {"declared_kg": 2.8, "mounted_kg": 0.0}
    assert codes(arm_findings(log, carrying(UR10E, 2.8))) == []
    # one that the drives do not carry is reported, and a load beside a small declared one as well
    assert codes(arm_findings(replace(moving(), payload_mass=1.0), UR10E)) == [
        "payload-not-mounted"
    ]
    both = replace(moving(load=2.8), payload_mass=0.5)
    assert codes(arm_findings(both, UR10E)) == ["payload-not-mounted", "unmodelled-load"]


def test_a_still_arm_is_not_checked_and_that_is_said() -> None:
    log = moving()
    q = np.repeat(log.q[:1], log.samples, axis=0)
    still = replace(log, q=q, dq=0 * q, current=gravity(UR10E, replace(log, q=q)) / 10)
    finding = only(still, UR10E)
    assert (finding.code, finding.level) == ("effort-unchecked", "fact")
    assert finding.values["least_Nm"] == 10.0


def test_a_vendor_torque_of_the_other_sign_is_reported() -> None:
    """Pushes of 5 N·m on every joint, which the drives carry and the vendor sees."""
    log = moving("panda")
    push = 5.0 * np.sin(np.outer(log.t, 0.5 + 0.1 * np.arange(7)))
    pushed = replace(log, torque=log.require("torque") - push, tau_ext=push)
    assert "vendor-sign" not in codes(arm_findings(pushed, PANDA))
    assert codes(arm_findings(replace(pushed, tau_ext=-push), PANDA)) == ["vendor-sign"]


def test_what_cannot_be_compared_is_not_judged() -> None:
    log = moving("panda")
    assert arm_findings(log, UR10E) == ArmFindings()
    assert arm_findings(replace(log, dq=None), PANDA) == ArmFindings()
    four = replace(log, q=log.q[:, :4], dq=log.q[:, :4], torque=log.q[:, :4])
    found = arm_findings(four, None)
    assert codes(found) == ["no-profile"]
    assert arm_findings(replace(log, torque=None), None) == ArmFindings()


def test_a_cause_has_its_numbers_and_no_consequence_is_reported_beside_it() -> None:
    log = moving()
    swapped = replace(log, current=exchanged(log.require("current"), 2, 3))
    finding = only(swapped, UR10E)
    assert finding.code == "effort-order"
    assert finding.where.joints == (2, 3)
    assert finding.values["misfit_percent"] > 35
    assert finding.values["healed_percent"] < 5
    angle = np.deg2rad(30.0)
    tilted = moving(up=np.array([0.0, np.sin(angle), np.cos(angle)]))
    gravity_found = only(tilted, UR10E).values["gravity"]
    # the vector that the robot file needs, to the fit's error
    expected = -9.81 * np.array([0.0, np.sin(angle), np.cos(angle)])
    np.testing.assert_allclose(gravity_found, expected, atol=0.15)


def test_what_makes_results_meaningless_is_refused_and_a_load_never() -> None:
    found = (
        warning("other-robot"),
        warning("effort-sign"),
        warning("unmodelled-load"),
        fact("time-unit"),
    )
    examination = Examination(recording=moving(), findings=found, robots=())
    assert [finding.code for finding in examination.refusals()] == ["other-robot", "effort-sign"]
    # identification makes the arm fit
    assert [f.code for f in examination.refusals(fitting=False)] == ["effort-sign"]
    assert not examine(moving(load=2.8), UR10E).refusals()
