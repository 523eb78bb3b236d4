"""Sound logs, whole and in parts, at their own rate and thinned: no warning but what is true, and
nothing is cut out of them.
"""

from pathlib import Path

import pytest
from sound_logs import LOGS, PLAIN, SoundLog, parts, recording_of, robot_of, unexpected

from vftcli.doctor import Examiner, examine, in_words
from vftcli.readers.reader import ReadChoice
from vftcli.robots import load_robot


def name_of(log: SoundLog) -> str:
    return f"{Path(log.path).name}-{log.robot or 'any'}-{(log.columns or '').count(',')}"


@pytest.mark.slow
@pytest.mark.parametrize("log", LOGS, ids=name_of)
def test_nothing_false_is_said_and_nothing_cut_out(logs, log):
    if log.path.startswith("..") and not (logs / log.path).exists():
        pytest.skip("the samples are not beside VFT_LOGS")
    robot = robot_of(log, logs)
    false = {}
    for part, recording in parts(recording_of(log, logs)):
        findings = examine(recording, robot).findings
        if found := unexpected(log, recording, findings):
            false[part] = [str(finding) for finding in found]
        if part == "all":
            codes = " ".join(f" {finding.code}" for finding in findings)
            assert [code for code in log.known if f" {code}" not in codes] == []
    assert false == {}
    whole = recording_of(log, logs)
    arm = robot or load_robot("panda" if whole.joints == 7 else "ur5")
    middle = 0.5 * float(whole.t[0] + whole.t[-1])
    for part in (whole, whole.between(0.0, middle), whole.between(middle, float(whole.t[-1]))):
        assert Examiner().read_as(part, arm, ReadChoice()).source.cuts == ()


OF_AN_ARM = [
    log
    for log in LOGS
    if log.path.startswith(("ur10e/", "fr3/", "franka_bags/", "panda_exciting", "rtde/static"))
    and log.columns != PLAIN
    and "harm_40s" not in log.path
    and "10harm" not in log.path
]
TURNED = [SoundLog(f"ur3/{name}.bag") for name in ("identification", "repeat_a", "repeat_b")]
"""As they are, their efforts' signs turned."""


@pytest.mark.slow
@pytest.mark.parametrize(
    "log", [*OF_AN_ARM, *TURNED, SoundLog("other_robot_yu_cobot.parquet")], ids=name_of
)
def test_real_logs_are_assigned_to_their_robot_or_to_none(logs, log):
    made = examine(recording_of(log, logs))
    assert [fit.robot for fit in made.robots if fit.fits] == ([log.robot] if log.robot else [])
    codes = {in_words(finding).name for finding in made.findings}
    assert ("no-robot-fits" in codes) == (not log.robot)
    if log.path == "panda_exciting":
        assert "stale-rows" in codes  # the README of the logs counts 1145 repeated rows
    if log in TURNED:
        words = next(in_words(f) for f in made.findings if in_words(f).name == "effort-sign")
        assert "J1, J2, J3, J4, J5, J6" in words.evidence
        assert "--columns -tau" in words.remedy
