"""Who examines the logs of a command: each once, refusals with their remedy, robots and efforts."""

from dataclasses import replace

import numpy as np
import pytest
from moving_arms import FRICTION, moving

from vftcli.doctor import Examiner, in_words
from vftcli.doctor.examination import refuse
from vftcli.readers.reader import ReadChoice
from vftcli.robots import RobotChoice, load_robot
from vftcli.signals.errors import ExaminationError, MissingSignalError, RobotError
from vftcli.signals.recording import Recording
from vftcli.signals.remarks import warning

UR5E = load_robot("ur5e")


def excited(seconds: float = 12.0) -> Recording:
    log = moving("ur5e", seconds=seconds)
    return replace(log, current=None, torque=log.require("current") * UR5E.torque_constant)


def turned(log: Recording) -> Recording:
    return replace(log, torque=-log.require("torque"))


def test_a_log_is_examined_once_for_an_arm():
    examiner, log = Examiner(), excited()
    first = examiner.examine(log, UR5E)
    assert examiner.examine(log, UR5E) is first
    assert examiner.examine(log, replace(UR5E)) is not first
    assert examiner.examinations[0] is first


def test_several_refusals_are_one_line():
    refuse("log", [])
    others = [warning("too-short", samples=1), warning("no-velocity"), warning("no-velocity")]
    with pytest.raises(ExaminationError) as error:
        refuse("a.csv", [warning("no-effort"), *others])
    assert str(error.value).startswith(f"a.csv: {in_words(warning('no-effort'))}")
    assert " Also: too-short, no-velocity. " in str(error.value)


def test_a_robot_is_loaded_once_and_guessed_where_the_makers_model_tells_it():
    """No other profile comes near a log whose target torques are one's own."""
    examiner, log = Examiner(), excited()
    reported = RobotChoice(name="ur5e")
    assert examiner.robot(log, reported) is examiner.robot(log, reported)
    friction = FRICTION * np.tanh(log.require("dq") / 0.01)
    known = replace(log, target_torque=log.require("torque") - friction)
    guessed = examiner.robot(known, RobotChoice())
    assert guessed.name == "ur5e"
    assert "robot-guessed" in [remark.code for remark in guessed.remarks]
    with pytest.raises(RobotError, match=r"^Which arm\? Best fits: ur5e \(.* Add --robot ur5e$"):
        examiner.robot(log, RobotChoice())


@pytest.mark.slow
@pytest.mark.parametrize(
    ("turns", "reason"),
    [
        (True, ": the torque of .* has its sign turned .* a leading minus"),
        (False, "; nearest is .* --robot FILE"),
    ],
)
def test_a_log_of_no_profile_is_refused_by_its_cause(turns: bool, reason: str) -> None:
    log = excited()
    unlike = np.random.default_rng(1).normal(0.0, 30.0, log.q.shape)
    other = turned(log) if turns else replace(log, torque=unlike)
    with pytest.raises(RobotError, match=rf"^Which arm\? No profile fits{reason}"):
        Examiner().robot(other, RobotChoice())


def test_positions_alone_name_no_arm() -> None:
    with pytest.raises(MissingSignalError, match="positions alone carry no force; it has q, dq"):
        Examiner().robot(replace(excited(), torque=None), RobotChoice())


def test_the_payload_of_one_log_is_not_that_of_another():
    examiner, log = Examiner(), replace(excited(), payload_mass=1.5, payload_com=(0.0, 0.0, 0.1))
    choice = RobotChoice(name="ur5e", payload="log")
    first, second = (examiner.robot(replace(log, payload_mass=m), choice) for m in (1.5, 2.0))
    assert (first.payload.mass, second.payload.mass) == (1.5, 2.0)


def test_an_open_effort_is_taken_for_what_the_model_explains():
    """The sign that was turned is turned back; a log that says the truth stays as it is."""
    examiner, log = Examiner(), excited()
    auto = ReadChoice(effort="auto")
    assert examiner.read_as(log, UR5E, auto) is log
    healed = examiner.read_as(turned(log), UR5E, auto)
    assert healed.torque == pytest.approx(log.torque)
    assert [remark.code for remark in healed.source.remarks] == ["effort-used"]
    assert examiner.read_as(turned(log), UR5E, ReadChoice()).source.remarks == ()
    assert not Examiner().examine(healed, UR5E).refusals()


def test_the_unit_of_the_effort_is_what_the_last_tenth_of_a_long_log_says(monkeypatch):
    """An arm that stands upright needs no current; then it moves, on currents in mA."""
    monkeypatch.setattr("vftcli.doctor.examination.EXAMINED", 4000)
    monkeypatch.setattr("vftcli.doctor.examination.STRETCH", 400)
    motion, constant = excited(40.0), UR5E.torque_constant
    still, noise = np.zeros((9 * motion.samples, 6)), np.random.default_rng(2)
    upright = np.array([0.0, -0.5 * np.pi, 0.0, -0.5 * np.pi, 0.0, 0.0])
    current = 1e3 * motion.require("torque") / constant
    log = Recording(
        t=0.008 * np.arange(10 * motion.samples),
        q=np.concatenate([still + upright, motion.q]),
        dq=np.concatenate([still, motion.require("dq")]),
        current=np.concatenate([noise.normal(0, 1.0, still.shape), current]),
    )
    auto = ReadChoice(effort="auto")
    read = Examiner().read_as(log, UR5E, auto, in_stretches=True)
    assert read.require("current")[-1] == pytest.approx(1e-3 * current[-1])
