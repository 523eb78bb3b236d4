"""What supports an answer and what limits it: from the analysis' data, each with its remedy."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from contact_rows import contact, contact_list

from vftcli.analysis import Analysis
from vftcli.doctor.examination import in_words
from vftcli.doctor.fit import RobotMatch
from vftcli.free_motion.free_motion import FreeRun
from vftcli.outputs.believability import Ground, grounds, headline, health, joint_words, resting
from vftcli.outputs.contacts import otherwise
from vftcli.outputs.screen import facts
from vftcli.robots import load_robot
from vftcli.robots.friction import dry_friction
from vftcli.signals.external_torque import ExternalTorque
from vftcli.signals.remarks import Remark, Where, caution, fact, warning


def of(analysis: Analysis, subject: str) -> list[Ground]:
    return [ground for ground in grounds(analysis) if ground.subject == subject]


def examined(analysis: Analysis, *findings: Remark, misfit: float = 0.001) -> Analysis:
    """The analysis as if its log had these findings, and its arm this misfit."""
    match = RobotMatch(
        robot="ur5", misfit=misfit, fits=misfit < 0.02, evidence="the controller's own model",
        load=0.0, by_maker=True,
    )  # fmt: skip
    (own, *_) = analysis.examinations
    return replace(analysis, examinations=(replace(own, findings=findings, robots=(match,)),))


@pytest.mark.parametrize(
    ("misfit", "standing", "sentence", "shown"),
    [
        (0.001, "good", "the controller's own model agrees to 0.1 %", "(model error 0.1 %)"),
        (0.3, "caution", "30.0 %", "(does not fit: model error 30.0 %)"),
        (0.5, "caution", "50.0 %", "(does not fit: model error 50.0 %)"),
        # As a turned sign of the current does, which leaves twice of what gravity needs.
        (1.66, "bad", "166.0 %", "(does not fit: model error 166.0 %)"),
    ],
)
def test_an_arm_is_believed_by_its_misfit(
    without_reference: Analysis, misfit: float, standing: str, sentence: str, shown: str
) -> None:
    made = examined(without_reference, misfit=misfit)
    (ground,) = of(made, "robot, gravity")
    assert ground.standing == standing
    assert shown in facts(made)
    if standing == "good":
        assert (ground.sentence, ground.remedy) == (sentence, None)
    else:
        unexplained = "of the controller's own model unexplained"
        assert ground.sentence == f"ur5 leaves {sentence} {unexplained}"
        assert (ground.remedy or "").startswith("vftcli inspect")
    (unknown,) = of(replace(made, examinations=()), "robot, gravity")
    assert unknown.standing == "unknown"


LOAD = warning("light-load", load_kg=1.2, sd_kg=0.1, robot="ur5")


def test_a_load_nobody_reported_is_first_with_its_command_which_is_given_once(
    without_reference: Analysis,
) -> None:
    list_of_load = contact_list(contact(is_load=True), remarks=(caution("contact-is-load"),))
    made = replace(examined(without_reference, LOAD), contacts=list_of_load)
    first, (row,) = grounds(made)[0], of(made, "lasting contact")
    assert (first.standing, first.subject) == ("bad", "load")
    assert first.sentence == in_words(LOAD).evidence
    assert "--method payload" in (first.remedy or "")
    assert (row.standing, row.remedy) == ("bad", None)


@pytest.mark.parametrize(
    ("finding", "subject", "standing", "remedy"),
    [
        (warning("other-robot", own="ur5 30 %", best="ur5e 1 %", robot="ur5e"), "robot", "bad",
         "--robot ur5e"),
        (fact("no-temperature", robot="ur5", reference_C=35.0, least_percent=20.0,
              most_percent=24.0), "temperature", "caution", ""),
    ],
)  # fmt: skip
def test_a_finding_has_its_subject_and_remedy(
    without_reference: Analysis, finding: Remark, subject: str, standing: str, remedy: str
) -> None:
    (ground,) = of(examined(without_reference, finding), subject)
    assert ground.standing == standing
    assert (ground.remedy or "").endswith(remedy)


@pytest.mark.parametrize(
    ("changed", "standing", "words", "remedy"),
    [
        ({"false_on_free": 0}, "good", "0 contacts listed in its 4 s", ""),
        ({"false_on_free": 1}, "caution", "1 contact listed in its 4 s", ""),
        (
            {"basis": "friction", "free": ()},
            "caution",
            "none is given: pushes",
            "--free free.csv",
        ),
        ({"basis": "none", "free": ()}, "unknown", "no contact is listed", "--free free.csv"),
    ],
)
def test_free_motion_counts_its_false_rows_or_is_asked_for(
    without_reference: Analysis,
    changed: dict[str, object],
    standing: str,
    words: str,
    remedy: str,
) -> None:
    found = contact_list(contact(), remarks=(), **changed)
    (ground,) = of(replace(without_reference, contacts=found), "free motion")
    assert ground.standing == standing
    assert words in ground.sentence
    assert (ground.remedy or "").endswith(remedy)


def test_a_reference_that_a_warning_speaks_against_is_a_caution(
    without_reference: Analysis,
) -> None:
    t, q = without_reference.recording.t, without_reference.recording.q
    where = Where(joints=(6,), span=(8.5, 8.7))
    values = {"torque_Nm": 7.0, "quiet_Nm": 0.8, "spans": 2, "begin_s": 8.7, "end_s": 18.6}
    touched = warning("reference-zero-touched", where, **values)
    reference = ExternalTorque(name="zero", t=t, tau=np.zeros(q.shape), remarks=(touched,))
    (ground,) = of(replace(without_reference, reference=reference), "reference")
    assert ground.standing == "caution"
    assert "looks touched" in ground.sentence


def test_rows_that_may_be_a_load_are_doubted(without_reference: Analysis) -> None:
    made = replace(examined(without_reference, LOAD), contacts=contact_list(contact()))
    assert headline(made).endswith("they may be its weight.")
    dead = examined(made, warning("zero-effort", Where(joints=(3,)), signal="current"))
    assert headline(dead) == "No contact is listed: the current of J3 is zero in every sample."
    for other in (
        replace(made, contacts=contact_list(contact(is_load=True))),
        replace(made, contacts=contact_list()),
        replace(made, examinations=()),
    ):
        assert "weight" not in headline(other)


def test_the_clock_tells_gaps_and_repairs(without_reference: Analysis) -> None:
    """The fixture's log has one gap of .4 s at 3.2 s and one odd and one mended signal."""
    (ground,) = of(without_reference, "clock")
    assert ground.standing == "caution"
    assert ground.sentence.startswith("1 gap, the longest 0.41 s at 3.2 s; left out look & feel")
    assert ground.sentence.endswith("and 1 more")


def test_a_sound_clock_says_how_sound(without_reference: Analysis, as_if) -> None:  # type: ignore[no-untyped-def]
    recording = without_reference.recording
    source = replace(recording.source, remarks=())
    sound = replace(recording, t=0.008 * np.arange(600.0), source=source)
    (ground,) = of(as_if(without_reference, sound), "clock")
    assert (ground.standing, ground.sentence) == ("good", "no gap above 8 ms, nothing repaired")


def test_a_joint_at_rest_hides_its_dry_friction(without_reference: Analysis, as_if) -> None:  # type: ignore[no-untyped-def]
    recording = without_reference.recording
    dq = np.array(recording.require("dq"))
    dq[:, 4] = 0.0
    made = as_if(without_reference, replace(recording, dq=dq))
    assert resting(made.recording).tolist() == [False] * 4 + [True, False]
    (ground,) = of(made, "joints at rest")
    dry = dry_friction(load_robot("ur5").friction, 6)[4]
    assert ground.sentence == f"J5: pushes below {dry:.2g} N·m do not show"
    still = as_if(without_reference, replace(recording, dq=np.zeros_like(dq)))
    assert len(of(still, "the arm is still")) == 1


def test_friction_of_a_profile_names_the_command_for_ones_own(
    without_reference: Analysis,
) -> None:
    (ground,) = of(without_reference, "friction")
    assert ground.standing == "caution"
    assert ground.remedy == "vftcli identify free.csv --robot ur5 -o my_ur5.toml"


def test_friction_is_measured_from_the_free_log_with_its_columns(
    without_reference: Analysis,
) -> None:
    log = without_reference.motion.log
    source = replace(log.recording.source, path=Path("f.csv"), columns="t,q:6", sha256="f")
    run = replace(log, recording=replace(log.recording, source=source))
    motion = replace(without_reference.motion, runs=(FreeRun(run=run, log=log),))
    (ground,) = of(replace(without_reference, motion=motion), "friction")
    typed = "vftcli identify f.csv --columns=t,q:6 --robot ur5 -o my_ur5.toml"
    assert ground.remedy == typed


def test_what_limits_the_list_is_reported_with_its_subject(without_reference: Analysis) -> None:
    (stop,) = of(replace(without_reference, contacts=contact_list(contact())), "stop")
    assert stop.standing == "caution"
    reason = caution("contacts-not-listed", reason="no samples")
    untold = replace(without_reference, contacts=None, remarks=(reason,))
    (ground,) = of(untold, "contacts")
    assert ground.standing == "unknown"


def test_what_measures_the_force(analysis: Analysis, without_reference: Analysis) -> None:
    (reference,) = of(analysis, "reference")
    assert reference.sentence == "vendor, its own error 0.5 N·m a joint"
    t = without_reference.t
    bare = ExternalTorque(name="sensor", t=t, tau=np.zeros((len(t), 6)))
    (floorless,) = of(replace(without_reference, reference=bare), "reference")
    assert floorless.sentence == "sensor"
    without = replace(without_reference, contacts=contact_list(contact()))
    (none,) = of(without, "no reference")
    assert none.standing == "unknown"
    vendor = contact_list(contact(vendor_force=61.2), contact(vendor_force=None))
    (own,) = of(replace(without_reference, contacts=vendor), "vendor")
    assert "61, – N at the peaks" in own.sentence
    assert own.standing == "unknown"
    assert "--reference vendor" in own.remedy


@pytest.mark.parametrize(
    ("row", "standing"),
    [
        ({"sensor_force": 58.0}, "good"),  # 64.8 ± 7.1 N
        ({"sensor_force": 57.6}, "caution"),
        ({"sensor_force": 72.0}, "caution"),
        # The sensor does not feel what touches a link before it, and an unknown size has no band.
        ({"sensor_force": 3.0, "places": (2, 3)}, "good"),
        ({"sensor_force": 3.0, "is_load": True}, "good"),
        ({"sensor_force": 3.0, "peak_band": 65.0}, "good"),
    ],
)
def test_a_row_that_misses_the_sensor_by_more_than_its_band_is_a_caution(
    without_reference: Analysis, row: dict[str, object], standing: str
) -> None:
    listed = contact_list(contact(sensor_force=64.0), contact(number=2, **row), remarks=())
    made = replace(without_reference, contacts=listed)
    (ground,) = of(made, "force sensor")
    assert (ground.standing, ground.of_log) == (standing, standing == "caution")
    off = f"{abs(64.8 - row['sensor_force']):.1f}"  # type: ignore[operator]
    words = f"; off by more than the band: row 2 by {off} N" if standing == "caution" else ""
    reading = f"{row['sensor_force']:.0f}"
    assert ground.sentence == f"the log's own sensor reads 64, {reading} N at the peaks{words}"


def test_few_rows_that_miss_the_sensor_are_named(without_reference: Analysis) -> None:
    rows = [contact(number=k, sensor_force=20.0) for k in range(1, 7)]
    (ground,) = of(replace(without_reference, contacts=contact_list(*rows)), "force sensor")
    assert ground.sentence.endswith("row 3 by 45 N, row 4 by 45 N and 2 more")


def test_a_check_and_a_caution_do_not_share_their_name(
    without_reference: Analysis, as_if
) -> None:  # type: ignore[no-untyped-def]
    """The joints that a free part leaves still, and stamps that repeat between sound ones."""
    found = contact_list(
        contact(), remarks=(caution("free-part-misses-joints", Where(joints=(5,))),)
    )
    log = without_reference.recording
    sound = replace(log, t=0.008 * np.arange(600.0), source=replace(log.source, remarks=()))
    odd = warning("repeated-stamps", repeats=3, rows=603, share_percent=0.5)
    made = replace(examined(as_if(without_reference, sound), odd), contacts=found)
    names = {
        side: {ground.subject for ground in grounds(made) if (ground.standing == "good") == side}
        for side in (True, False)
    }
    assert {"clock", "free motion"} <= names[True]
    assert {"time stamps", "not moved"} <= names[False]
    assert not names[True] & names[False]


def test_the_references_error_is_the_mean_that_the_table_prints(analysis: Analysis) -> None:
    """Over the joints at which the reference can be trusted, as in the screen's last line."""
    rests = pl.col("joint") == 5
    errors = analysis.errors.with_columns(
        reference_trusted=~rests,
        reference_floor_Nm=pl.when(rests).then(5.0).otherwise(pl.col("reference_floor_Nm")),
    )
    (ground,) = of(replace(analysis, errors=errors), "reference")
    assert ground.sentence == "vendor without J5, its own error 0.5 N·m a joint"


def test_the_rest_of_the_log(without_reference: Analysis) -> None:
    assert otherwise(contact_list(contact())).startswith("Nothing else above 6 N.")
    inferred = contact_list(contact(), basis="friction", smallest_force=29.7)
    assert otherwise(inferred) == "Pushes below 30 N do not show."
    more = replace(inferred, candidates=(contact(), contact()))
    assert otherwise(more) == "Pushes below 30 N do not show. 2 candidates more: --all."
    assert otherwise(contact_list(contact(is_load=True))) == ""
    assert otherwise(contact_list(smallest_force=float("nan"))) == ""
    assert "A push along one axis may go unseen" in otherwise(contact_list(smallest_force=3473.0))
    faint = contact_list(contact(peak_force=5.0, peak_band=2.0))
    assert otherwise(faint) == "Nothing else above 6 N (less at good poses)."
    assert otherwise(contact_list(smallest_force=None)) == ""
    listed = replace(without_reference, contacts=contact_list())
    assert headline(listed) == "Nothing touched the arm, as far as this log shows."
    assert "no contacts are listed" in headline(replace(listed, contacts=None))


def test_health_is_the_worst_of_the_log_itself(without_reference: Analysis) -> None:
    sound = [
        Ground(standing="good", subject="robot, gravity", sentence="fits"),
        Ground(standing="caution", subject="friction", sentence="…", of_log=False),
        Ground(standing="unknown", subject="no reference", sentence="…", of_log=False),
    ]
    assert health(sound).sentence == "fits"
    odd = Ground(standing="caution", subject="clock", sentence="2 gaps")
    assert health([*sound, odd]) is odd
    gap = warning("stuck-effort", Where(joints=(2,)), signal="current", longest_s=1.0, at_s=2.0)
    assert health(grounds(examined(without_reference, gap))).subject == "effort"


def test_words_of_joints() -> None:
    assert joint_words([0, 1, 2]) == "J1…J3"
    assert joint_words([0, 2, 3]) == "J1, J3, J4"
