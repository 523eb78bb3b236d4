"""What the doctor says of the robot: known faults of effort, load and robot, inside and outside."""

from dataclasses import replace

import numpy as np
import pytest

from vftcli.doctor.examination import (
    Examination,
    examine,
    guess_robot,
    hypotheses,
    no_fit,
    robot_findings,
)
from vftcli.doctor.fit import RobotMatch
from vftcli.robots import Payload, Robot, load_robot
from vftcli.robots.kernels import momentum_terms
from vftcli.signals.arrays import Array
from vftcli.signals.recording import Recording
from vftcli.signals.remarks import Remark, fact, warning

UR10E, PANDA = load_robot("ur10e"), load_robot("panda")
T = 0.01 * np.arange(1000)


def gravity(robot: Robot, q: Array) -> Array:
    """Torque that holds an arm at rest. (T, n) [N·m]"""
    return np.asarray(momentum_terms(robot.loaded_chain, q, np.zeros_like(q)).gravity)


def held(robot: Robot = PANDA, factor: float = 1.0) -> Recording:
    """An arm held in one pose by its own gravity torques times a factor."""
    q = np.tile(np.linspace(0.3, 1.2, robot.joints), (len(T), 1))
    return Recording(t=T, q=q, dq=np.zeros_like(q), torque=factor * gravity(robot, q))


def creeping(robot: Robot = PANDA, load: float = 0.0) -> Recording:
    """An arm that goes slowly through many poses, held by its gravity torques and a load's."""
    tool = Payload(mass=load, com=np.array([0.0, 0.0, 0.05]), inertia=np.zeros((3, 3)))
    rates = 0.2 + 0.03 * np.arange(robot.joints)
    q = 0.5 + 0.5 * np.sin(np.outer(T, rates) + np.arange(robot.joints))
    dq = 0.5 * rates * np.cos(np.outer(T, rates) + np.arange(robot.joints))
    return Recording(t=T, q=q, dq=dq, torque=gravity(robot.with_payload(tool), q))


def match(robot: str, misfit: float, *, fits: bool = True, load: float = 0.0) -> RobotMatch:
    return RobotMatch(robot=robot, misfit=misfit, fits=fits, evidence="told", load=load)


def of_code(findings: tuple[Remark, ...], code: str) -> list[Remark]:
    return [finding for finding in findings if finding.code == code]


def test_warnings_go_before_facts() -> None:
    log = held(PANDA, -1.0)
    levels = [finding.level for finding in examine(log).findings]
    assert levels == sorted(levels, reverse=True)
    assert {"warning", "fact"} == set(levels)
    warnings = examine(log).warnings
    assert [finding.level for finding in warnings] == ["warning"] * len(warnings)
    assert len(warnings) == levels.count("warning")


def test_constants_are_compared_with_the_robot_that_fits_and_with_none_else() -> None:
    """A controller whose constants are 6 % above the profile's, and one whose arm is unknown."""
    assert UR10E.torque_constant is not None
    log = held(UR10E)
    torque = log.require("torque") + 1.0  # also where gravity does not act, for its drive constant
    current = torque / (1.06 * np.asarray(UR10E.torque_constant))
    told = replace(log, torque=None, current=current, target_current=current, target_torque=torque)
    (remark,) = of_code(examine(told, UR10E).findings, "drive-constants")
    assert remark.values["worst_percent"] == pytest.approx(6.0)
    other = examine(replace(told, target_torque=-torque), UR10E)
    assert of_code(other.findings, "no-robot-fits-at-rest")
    assert not of_code(other.findings, "drive-constants")


@pytest.mark.parametrize(("ratio", "told"), [(1.29, False), (1.31, True)])
def test_a_log_s_own_robot_must_fit_nearly_as_well_as_the_best(ratio: float, told: bool) -> None:
    log = replace(held(), robot_hint="fr3")
    fits = (match("panda", 0.01), match("fr3", 0.01 * ratio))
    robots = {"panda": PANDA, "fr3": load_robot("fr3")}
    found = list(robot_findings(log, fits, robots))
    assert [remark.code for remark in found] == (["other-robot"] if told else [])
    assert not list(robot_findings(replace(log, robot_hint=None), fits, robots))
    assert not list(robot_findings(replace(log, robot_hint="ur5"), fits, robots))
    for remark in found:
        assert remark.level == "warning"
        assert dict(remark.values) == {
            "hint": "fr3",
            "robot": "panda",
            "best": "panda 1 % (told)",
            "hinted": "fr3 1.31 % (told)",
        }


def test_an_arm_with_another_number_of_joints_has_no_profile() -> None:
    log = held()
    robots = {"ur10e": UR10E, "panda": PANDA}
    four = replace(log, q=log.q[:, :4], dq=log.q[:, :4], torque=log.q[:, :4])
    (remark,) = robot_findings(four, (), robots)
    assert (remark.code, remark.level) == ("no-profile", "warning")
    assert dict(remark.values) == {"joint_count": 4, "counts": [6, 7]}
    assert not list(robot_findings(log, (), robots))  # the joints are right, the effort is missing


@pytest.mark.parametrize(("load", "told"), [(0.38, False), (0.42, True)])
def test_a_load_of_four_hundred_grams_is_told(load: float, told: bool) -> None:
    """The fit itself takes loads from 50 g; here it is given, and the drives show none."""
    fits = (match("panda", 0.01, load=load),)
    found = list(robot_findings(held(), fits, {"panda": PANDA}))
    assert [remark.code for remark in found] == (["unmodelled-load"] if told else [])
    for remark in found:
        assert remark.level == "fact"
        assert dict(remark.values) == {"load_kg": load, "robot": "panda"}


def test_a_load_that_the_controller_knows_nothing_of_is_a_warning() -> None:
    """Drives that carry 3 kg more than the controller's model, which fits without any load."""
    model = creeping().torque
    log = replace(creeping(load=3.0), target_torque=model)
    (finding,) = robot_findings(log, (match("panda", 0.01),), {"panda": PANDA})
    assert (finding.code, finding.level) == ("unmodelled-load-untold", "warning")
    # 2 %: the log neglects the inertia of 3 kg at 0.2 rad/s
    assert finding.values["load_kg"] == pytest.approx(3.0, rel=0.02)
    told = (match("panda", 0.01, load=2.0),)
    (finding,) = robot_findings(log, told, {"panda": PANDA})
    assert (finding.code, finding.level) == ("unmodelled-load", "fact")
    (finding,) = robot_findings(creeping(load=3.0), (match("panda", 0.01),), {"panda": PANDA})
    assert (finding.code, finding.level) == ("unmodelled-load", "fact")


@pytest.mark.parametrize(("misfit", "told"), [(0.07, True), (0.09, False)])
def test_a_torque_of_the_other_sign_is_told_up_to_its_misfit(misfit: float, told: bool) -> None:
    """In one pose no load can be fitted, so the planted share is the misfit to rounding."""
    examination = examine(held(PANDA, -1 / (1 - misfit)), PANDA)
    found = of_code(examination.findings, "effort-unit")
    assert len(found) == told
    for remark in found:
        assert remark.level == "warning"
        assert dict(remark.values) == {
            "evidence": "torque of the other sign",
            "robot": "panda",
            "misfit_percent": pytest.approx(7.0),
        }
    assert of_code(examination.findings, "no-robot-fits-at-rest")


def test_an_effort_is_tried_on_profiles_with_as_many_joints_only() -> None:
    examination = examine(held(PANDA, -1.0), PANDA)
    found = of_code(examination.findings, "effort-unit")
    assert [remark.values["robot"] for remark in found] == ["panda"]


def test_what_an_effort_may_be() -> None:
    """Each of them undoes one mistake: the joint torques it gives are those of the profile."""
    log = held(UR10E)
    torque, constant = log.require("torque"), UR10E.torque_constant
    assert constant is not None
    current = torque / constant
    nothing = replace(log, torque=None)
    mistakes = {
        "torque of the other sign": replace(log, torque=-torque),
        "motor current [A]": replace(log, torque=current),
        "motor current [mA]": replace(log, torque=1e3 * current),
        "joint torque [N·m]": replace(nothing, current=torque),
        "current of the other sign": replace(nothing, current=-current),
        "current in mA": replace(nothing, current=1e3 * current),
    }
    for name, mistaken in mistakes.items():
        found = {item.name: item for item in hypotheses(mistaken, UR10E)}
        np.testing.assert_allclose(found[name].torque, torque, rtol=1e-12)
        assert found[name].friction
        assert len(found) == 3
    unknown = replace(UR10E, torque_constant=None)
    assert [item.name for item in hypotheses(log, unknown)] == ["torque of the other sign"]
    as_current = hypotheses(mistakes["joint torque [N·m]"], unknown)
    assert [item.name for item in as_current] == ["joint torque [N·m]"]
    assert not list(hypotheses(nothing, UR10E))


@pytest.mark.parametrize(
    ("travel", "code"), [(0.04, "no-robot-fits-at-rest"), (0.06, "no-robot-fits")]
)
def test_why_no_robot_fits_a_log_that_hardly_moves(travel: float, code: str) -> None:
    log = held()
    q = log.q.copy()
    q[:, 3] += travel * np.sin(T) ** 2
    fits = (match("panda", 0.5, fits=False), match("fr3", 0.6, fits=False))
    found = no_fit(replace(log, q=q), fits)
    assert (found.code, found.level) == (code, "warning")
    assert found.values["ranked"] == "panda 50 % (told); fr3 60 % (told)"


@pytest.mark.parametrize(
    ("inverted", "code"), [(3, "no-robot-fits"), (4, "no-robot-fits-inverted")]
)
def test_why_no_robot_fits_a_log_whose_effort_is_inverted(inverted: int, code: str) -> None:
    """Of seven joints that move against friction, four are most."""
    t = 0.01 * np.arange(2000)
    q = np.sin(np.outer(t, np.arange(1, 8)))
    dq = np.arange(1, 8) * np.cos(np.outer(t, np.arange(1, 8)))
    turned = np.where(np.arange(7) < inverted, -1.0, 1.0) * np.sign(dq)
    log = Recording(t=t, q=q, dq=dq, torque=turned)
    assert no_fit(log, (match("panda", 0.5, fits=False),)).code == code


def test_what_makes_results_meaningless_is_refused_and_a_load_never() -> None:
    found = (
        warning("other-robot"),
        warning("effort-sign"),
        warning("unmodelled-load"),
        fact("time-unit"),
    )
    examination = Examination(recording=held(), findings=found, robots=())
    assert [finding.code for finding in examination.refusals()] == ["other-robot", "effort-sign"]
    # identification makes the arm fit
    assert [f.code for f in examination.refusals(fitting=False)] == ["effort-sign"]


def test_a_robot_is_guessed_by_the_maker_s_own_model_alone() -> None:
    """A Panda's torques: by the vendor's residual the maker's model, alone a measurement."""
    log = creeping()
    assert guess_robot(log)[0] is None
    told = replace(log, tau_ext=np.full_like(log.q, 1e-3))
    match, fits = guess_robot(told)
    assert match is not None
    assert match.robot == "panda"
    assert [fit.robot for fit in fits] == ["panda", "fr3"]
    # a Panda with 2 % more torque is no Panda to 1 %
    assert guess_robot(replace(told, torque=1.02 * log.require("torque")))[0] is None
