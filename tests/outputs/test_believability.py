"""What supports an answer and what limits it: from the analysis' data, each with its remedy."""

import shlex
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest
from contact_rows import contact, contact_list

from vftcli.analysis import Analysis
from vftcli.contacts.contact_list import Contact
from vftcli.doctor.examination import in_words
from vftcli.doctor.fit import RobotMatch
from vftcli.free_motion.free_motion import FreeRun
from vftcli.outputs.believability import (
    SUBJECTS,
    Ground,
    grounds,
    headline,
    health,
    remedy_of,
    resting,
    subject_of,
)
from vftcli.outputs.examination import command
from vftcli.outputs.screen import facts
from vftcli.readers.reading import read
from vftcli.robots import load_robot
from vftcli.robots.friction import dry_friction
from vftcli.signals.external_torque import ExternalTorque
from vftcli.signals.recording import Recording
from vftcli.signals.remarks import Remark, Where, caution, fact, warning
from vftcli.signals.remarks import words as words_of


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


@pytest.mark.parametrize(("misfit", "standing", "sentence", "shown"), [
    (0.001, "good", "the controller's own model agrees to 0.1 %", "(model error 0.1 %)"),
    (0.5, "caution", "50.0 %", "(does not fit: model error 50.0 %)"),
    # As a turned sign of the current does, which leaves twice of what gravity needs.
    (1.66, "bad", "166.0 %", "(does not fit: model error 166.0 %)"),
])  # fmt: skip
def test_an_arm_is_believed_by_its_misfit(without_reference, misfit, standing, sentence, shown):
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


def test_a_load_nobody_reported_is_first_with_its_command(without_reference: Analysis) -> None:
    list_of_load = contact_list(contact(is_load=True), remarks=(caution("contact-is-load"),))
    made = replace(examined(without_reference, LOAD), contacts=list_of_load)
    first, (row,) = grounds(made)[0], of(made, "lasting contact")
    assert (first.standing, first.subject) == ("bad", "load")
    assert first.sentence == in_words(LOAD).evidence
    assert "--method payload" in (first.remedy or "")
    assert (row.standing, row.remedy) == ("bad", None)


def listed(*rows: Contact, **changed: object) -> dict[str, object]:
    return {"contacts": contact_list(*rows, **{"remarks": (), **changed})}


TOUCHED = warning(
    "reference-zero-touched", Where(span=(8.5, 8.7)), size="7 ± 3 N", spans=2,
    begin_s=8.7, end_s=18.6,
)  # fmt: skip
ZERO = ExternalTorque(name="zero", t=np.arange(600.0), tau=np.zeros((600, 6)), remarks=(TOUCHED,))
OTHER = warning("other-robot", own="ur5 30 %", best="ur5e 1 %", robot="ur5e")
COLD = fact("no-temperature", robot="ur5", reference_C=35.0, least_percent=20, most_percent=24)
UNTOLD = {"contacts": None, "remarks": (caution("contacts-not-listed", reason="no samples"),)}
OF_VENDOR = listed(contact(vendor_force=61.2), contact(vendor_force=None))


@pytest.mark.parametrize(("changed", "subject", "standing", "words", "remedy"), [
    ({"finding": OTHER}, "robot", "bad", "", "--robot ur5e"),
    ({"finding": COLD}, "temperature", "caution", "", ""),
    (listed(contact()), "free motion", "good", "0 contacts listed in its 4 s", ""),
    (listed(false_on_free=1), "free motion", "caution", "1 contact listed in its 4 s", ""),
    (listed(basis="friction", free=()), "free motion", "caution", "none is given: sizes",
     "--free free.csv"),
    (listed(basis="none", free=()), "free motion", "unknown", "no contact is listed",
     "--free free.csv"),
    ({"reference": ZERO}, "reference", "caution", "looks touched", ""),
    ({}, "friction", "caution", "", "vftcli identify free.csv --robot ur5 -o my_ur5.toml"),
    ({"contacts": contact_list(contact())}, "stop", "caution", "", ""),
    (UNTOLD, "contacts", "unknown", "", ""),
    (listed(contact()), "no reference", "unknown", "", ""),
    (OF_VENDOR, "vendor", "unknown", "61, – N at the peaks", "--reference vendor --robot ur5"),
])  # fmt: skip
def test_a_ground_has_its_subject_its_words_and_its_remedy(
    without_reference: Analysis, changed: dict[str, Any], subject: str, standing: str, words: str,
    remedy: str,
) -> None:  # fmt: skip
    if "finding" in changed:
        made = examined(without_reference, changed["finding"])
    else:
        made = replace(without_reference, **changed)
    (ground,) = of(made, subject)
    assert ground.standing == standing
    assert words in ground.sentence
    assert (ground.remedy or "").endswith(remedy)


def test_rows_that_may_be_a_load_are_doubted(without_reference: Analysis) -> None:
    made = replace(examined(without_reference, LOAD), contacts=contact_list(contact()))
    assert headline(made).endswith("they may be its weight.")
    dead = examined(made, warning("zero-effort", Where(joints=(3,)), signal="current"))
    assert headline(dead) == "No contact is listed: the current of J3 is zero in every sample."
    for rows in ([contact(is_load=True)], []):
        assert "weight" not in headline(replace(made, contacts=contact_list(*rows)))
    assert "weight" not in headline(replace(made, examinations=()))
    assert "no contacts are listed" in headline(replace(made, contacts=None))


def test_the_clock_tells_gaps_and_repairs(without_reference: Analysis, as_if) -> None:
    """The fixture's log has one gap of .4 s at 3.2 s and one odd and one mended signal."""
    (ground,) = of(without_reference, "clock")
    assert ground.standing == "caution"
    assert ground.sentence.startswith("1 gap, the longest 0.41 s at 3.2 s; left out look & feel")
    assert ground.sentence.endswith("and 1 more")
    (ground,) = of(as_if(without_reference, sound(without_reference)), "clock")
    assert (ground.standing, ground.sentence) == ("good", "longest step 8 ms, nothing repaired")


def sound(analysis: Analysis) -> Recording:
    """The log without its gap and its remarks."""
    log = analysis.recording
    return replace(log, t=0.008 * np.arange(600.0), source=replace(log.source, remarks=()))


def test_a_joint_at_rest_hides_its_dry_friction(without_reference: Analysis, as_if) -> None:
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


def test_friction_is_measured_from_the_free_log_as_read(without_reference: Analysis) -> None:
    log = without_reference.motion.log
    source = replace(log.recording.source, path=Path("f.csv"), columns="t,q:6", sha256="f")
    run = replace(log, recording=replace(log.recording, source=source))
    motion = replace(without_reference.motion, runs=(FreeRun(run=run, log=log),))
    (ground,) = of(replace(without_reference, motion=motion), "friction")
    typed = "vftcli identify f.csv --columns=t,q:6 --robot ur5 -o my_ur5.toml"
    assert ground.remedy == typed


@pytest.mark.parametrize(("row", "standing"), [
    ({"sensor_force": 58.0}, "good"),  # 64.8 ± 7.1 N
    ({"sensor_force": 57.6}, "caution"),
    ({"sensor_force": 72.0}, "caution"),
    # The sensor does not feel what touches a link before it, and an unknown size has no band.
    ({"sensor_force": 3.0, "places": (2, 3)}, "good"),
    ({"sensor_force": 3.0, "is_load": True}, "good"),
    ({"sensor_force": 3.0, "peak_band": 65.0}, "good"),
])  # fmt: skip
def test_a_row_that_misses_the_sensor_by_its_band_is_a_caution(without_reference, row, standing):
    listed = contact_list(contact(sensor_force=64.0), contact(number=2, **row), remarks=())
    made = replace(without_reference, contacts=listed)
    (ground,) = of(made, "force sensor")
    assert (ground.standing, ground.of_log) == (standing, standing == "caution")
    off = f"{abs(64.8 - row['sensor_force']):.1f}"
    words = f"; off by more than the band: row 2 by {off} N" if standing == "caution" else ""
    reading = f"{row['sensor_force']:.0f}"
    assert ground.sentence == f"the log's own sensor reads 64, {reading} N at the peaks{words}"
    rows = [contact(number=k, sensor_force=20.0) for k in range(1, 7)]
    (ground,) = of(replace(without_reference, contacts=contact_list(*rows)), "force sensor")
    assert ground.sentence.endswith("row 3 by 45 N, row 4 by 45 N and 2 more")


def test_a_check_and_a_caution_have_their_own_names(without_reference: Analysis, as_if) -> None:
    """The joints that a free part leaves still, and stamps that repeat between sound ones."""
    still = caution("free-part-misses-joints", Where(joints=(5,)))
    found = contact_list(contact(), remarks=(still,))
    odd = warning("repeated-stamps", repeats=3, rows=603, share_percent=0.5)
    made = as_if(without_reference, sound(without_reference))
    made = replace(examined(made, odd), contacts=found)
    good = {ground.subject for ground in grounds(made) if ground.standing == "good"}
    others = {ground.subject for ground in grounds(made) if ground.standing != "good"}
    assert {"clock", "free motion"} <= good
    assert {"time stamps", "not moved"} <= others
    assert not good & others


def test_the_references_error_is_the_mean_that_the_table_prints(analysis: Analysis) -> None:
    """Over the joints at which the reference can be trusted, as in the screen's last line."""
    rests = pl.col("joint") == 5
    floor = pl.when(rests).then(5.0).otherwise(pl.col("reference_floor_Nm"))
    errors = analysis.errors.with_columns(reference_trusted=~rests, reference_floor_Nm=floor)
    bare = ExternalTorque(name="sensor", t=analysis.t, tau=np.zeros((len(analysis.t), 6)))
    for made, words in (
        (analysis, "vendor, its own error 0.5 N·m per joint"),
        (replace(analysis, errors=errors), "vendor without J5, its own error 0.5 N·m per joint"),
        (replace(analysis, errors=None, reference=bare), "sensor"),
    ):
        (ground,) = of(made, "reference")
        assert ground.sentence == words


def test_health_is_the_worst_of_the_log_itself(without_reference: Analysis) -> None:
    fine = [
        Ground("good", "robot, gravity", "fits"),
        Ground("caution", "friction", "…", of_log=False),
        Ground("unknown", "no reference", "…", of_log=False),
    ]
    assert health(fine).sentence == "fits"
    odd = Ground("caution", "clock", "2 gaps")
    assert health([*fine, odd]) is odd
    gap = warning("stuck-effort", Where(joints=(2,)), signal="current", longest_s=1.0, at_s=2.0)
    assert health(grounds(examined(without_reference, gap))).subject == "effort"


def test_every_subject_stands_for_remarks_that_exist_once() -> None:
    codes = [code for group in SUBJECTS.values() for code in group]
    assert len(codes) == len(set(codes))
    for code in codes:
        assert words_of(code)["short"]
    assert subject_of("saturation") == "effort"


@pytest.mark.parametrize(("code", "ending"), [
    ("light-load", "--method payload --robot ur5 -o loaded.toml"),
    ("payload-not-mounted", "--robot ur5 --payload log"),
    ("no-robot-fits", "--robot ur5 --method base -o my_robot.toml"),
    ("saturation", "--robot ur5"),
])  # fmt: skip
def test_a_finding_has_its_command(without_reference: Analysis, code: str, ending: str) -> None:
    made = without_reference
    assert remedy_of(warning(code), made.recording, made).endswith(ending)
    assert f"'{made.recording.source.path}'" in command("inspect", made.recording)
    log = made.motion.log
    log = replace(log, robot=replace(log.robot, path=Path("my.toml")))
    own = replace(made, motion=replace(made.motion, log=log))
    assert "--robot my.toml" in remedy_of(warning(code), made.recording, own)


def test_a_command_names_the_columns_that_the_log_was_read_by(tmp_path: Path) -> None:
    """Without them the log may not be read, or its torques for currents."""
    table = tmp_path / "log.csv"
    rows = (f"{0.01 * k},{0.1 * k},{0.2 * k},{0.1},{1.0}\n" for k in range(20))
    table.write_text("t,a1,a2,b1,b2\n" + "".join(rows), encoding="utf-8")
    log = read(table, columns="t=t,q=a{i},-tau=b{i}")
    typed = shlex.split(command("inspect", log, "--robot", "ur5"))
    assert typed[3:] == ["--columns=t=t,q=a{i},-tau=b{i}", "--robot", "ur5"]
