"""Where a log shows contact by itself: planted pushes, free logs, and what cannot be known."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from vftcli.evaluation import ReferenceChoice
from vftcli.evaluation.references import make_reference, touched_remarks, touches
from vftcli.free_motion.free_motion import FreeMotion
from vftcli.readers import reading
from vftcli.robots import load_robot
from vftcli.robots.run import Run
from vftcli.signals.remarks import sentence

ROOT = Path(__file__).parent.parent.parent
FIXTURE = reading.read(ROOT / "fixtures" / "ur5_circle.csv")
UR5 = load_robot("ur5")
REAL = "t,q:6,dq:6,current:6,target_current:6,target_torque:6"


def test_a_simulated_push_is_found_where_it_was() -> None:
    """The scenario holds 30 N and more from 4 s on; its first cycle of 4 s is free."""
    found = touches(Run(recording=FIXTURE, robot=UR5))
    assert found
    assert min(touch.start for touch in found) > 4.0
    remarks = touched_remarks(Run(recording=FIXTURE, robot=UR5))
    (warned,) = remarks
    assert (warned.code, warned.level) == ("reference-zero-touched", "warning")
    assert "--interval 0.0:" in sentence(warned)
    free = Run(recording=FIXTURE.between(0.0, 4.0), robot=UR5)
    assert touches(free) == ()
    assert touched_remarks(free) == ()


def test_two_planted_torques_are_where_they_were_planted() -> None:
    """30 N·m on J3 and 12 N·m on J5 of a free motion, as the current that they need.

    A first-order flank of the 2 Hz low-pass spreads a pulse by .1 s or so. The excess is over
    the largest of 8 times the quiet level, 1.5 times the dry friction and 2 N·m, by definition.
    """
    free = FIXTURE.between(0.0, 4.0)
    pulses = ((0.5, 1.0, 2, 30.0), (3.3, 3.6, 4, 12.0))
    current = free.require("current").copy()
    for start, stop, j, torque in pulses:
        on = (free.t > start) & (free.t < stop)
        current[on, j] -= torque / UR5.torque_constant[j]
    log = Run(recording=replace(free, current=current), robot=UR5)
    found = touches(log)
    for touch, (start, stop, j, torque) in zip(found, pulses, strict=True):
        assert touch.joint == j
        assert (touch.start, touch.stop) == pytest.approx((start, stop), abs=0.12)
        assert touch.torque == pytest.approx(torque, rel=0.15)
        limit = max(8.0 * touch.quiet, 1.5 * log.dry_friction[j], 2.0)
        assert touch.excess == pytest.approx(touch.torque / limit)
    (warned,) = touched_remarks(log)
    assert (warned.where.joints, warned.where.span) == ((3,), (found[0].start, found[0].stop))
    assert warned.values["spans"] == 2
    begin, end = warned.values["begin_s"], warned.values["end_s"]
    assert 0.0 <= begin - found[0].stop < 0.1
    assert 0.0 <= found[1].start - end < 0.1
    assert [round(float(x), 1) for x in (begin, end)] == [begin, end]


def test_the_worst_contact_is_the_largest_for_its_joint_s_quiet_level() -> None:
    """Half of a sine of 7 N·m on J2 is above 4.9: 60 N·m there are less than 30 of 2 on J5."""
    free = FIXTURE.between(0.0, 4.0)
    torque = np.zeros_like(free.q)
    torque[:, 1] = 7.0 * np.sin(2.0 * np.pi * free.t / 2.0)
    torque[(free.t > 0.4) & (free.t < 0.9), 1] += 60.0
    torque[(free.t > 3.0) & (free.t < 3.4), 4] += 30.0
    current = free.require("current") - torque / UR5.torque_constant
    log = Run(recording=replace(free, current=current), robot=UR5)
    assert [touch.joint for touch in touches(log)] == [1, 4]
    assert touches(log)[0].quiet > 4.0
    (warned,) = touched_remarks(log)
    assert warned.where.joints == (5,)
    assert warned.values["torque_Nm"] == pytest.approx(30.0, rel=0.15)


def test_a_free_log_is_judged_against_zero_though_it_shows_contact(logs: Path) -> None:
    """That nobody touched this UR10 is its authors' word; 7 N·m of J6's friction are open."""
    path = logs / "salerno_ur10" / "ur10_exciting.db3"
    recording = reading.read(path, columns="tau=effort")
    log = Run(recording=recording, robot=load_robot("ur10"))
    made = make_reference(FreeMotion(log=log), ReferenceChoice(name="zero"))
    assert not made.torque.tau.any()
    assert [remark.code for remark in made.torque.remarks] == [
        "reference-zero",
        "reference-zero-touched",
    ]


def test_without_friction_or_a_quiet_level_a_log_is_not_judged() -> None:
    bare = Run(recording=FIXTURE, robot=UR5.without_friction())
    assert touches(bare) == ()
    assert touches(Run(recording=FIXTURE.between(5.0, 6.9), robot=UR5)) == ()


@pytest.mark.parametrize(
    ("name", "columns", "touched"),
    [
        ("ur10e/free_14harm.csv", REAL, False),
        ("ur10e/free_12harm.csv", REAL, False),
        ("ur10e/free_repeat_b.csv", REAL, False),
        ("ur10e/jointwise_2.csv", REAL, False),
        ("ur10e/load_14harm.csv", REAL, False),  # a load is no contact
        ("ur10e/push_pose.csv", REAL, True),  # four pushes by hand
    ],
)
def test_hands_are_found_in_real_logs_and_in_those_alone(
    name: str, columns: str, touched: bool, logs: Path
) -> None:
    recording = reading.read(logs / name, columns=columns)
    found = touches(Run(recording=recording, robot=load_robot("ur10e")))
    assert bool(found) == touched
    assert np.all([touch.torque > touch.quiet for touch in found])
