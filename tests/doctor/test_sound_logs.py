"""Sound logs, whole and in parts, at their own rate and thinned: no warning but what is true."""

from pathlib import Path

import pytest
from sound_logs import LOGS, SoundLog, parts, recording_of, robot_of, unexpected

from vftcli.doctor import examine


def name_of(log: SoundLog) -> str:
    return f"{Path(log.path).name}-{log.robot or 'any'}-{(log.columns or '').count(',')}"


@pytest.mark.slow
@pytest.mark.parametrize("log", LOGS, ids=name_of)
def test_nothing_false_is_said(logs: Path, log: SoundLog) -> None:
    if log.path.startswith("..") and not (logs / log.path).exists():
        pytest.skip("the samples are not beside VFT_LOGS")
    robot = robot_of(log, logs)
    false = {}
    for part, recording in parts(recording_of(log, logs)):
        # Spans of 20 s and halves hold what spans of 10 s do; `sound_logs.py` does them all. Of an
        # arm that nobody names the whole log is looked at.
        if part not in {"all", "50 Hz", "25 Hz"} and (recording.duration > 11 or robot is None):
            continue
        findings = examine(recording, robot).findings
        if found := unexpected(log, recording, findings):
            false[part] = [str(finding) for finding in found]
        if part == "all":
            codes = " ".join(f" {finding.code}" for finding in findings)
            assert [code for code in log.known if f" {code}" not in codes] == []
    assert false == {}
