"""Planted faults: named, about the right joints, at half the rate too.

The faults and what names them stand in `planted_faults.py`. That their remedies heal is tried in
`tests/test_remedies.py`, that commands report and refuse in `tests/cli/test_health.py`.
"""

from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from planted_faults import FAULTS, READER, Table, robot_named, simulated, table_from
from sound_logs import UR10E

from vftcli.doctor import examine
from vftcli.doctor.examination import NO_FIT, REFUSING
from vftcli.readers.reading import read
from vftcli.signals.errors import VftError
from vftcli.signals.remarks import Remark, fact

EFFORT = {"ur10e": "current", "ur5": "current", "panda": "tau"}
"""Log that faults are planted in → its effort."""
SCENARIOS = {"ur5": ("ur5-circle", 16.0), "panda": ("panda-bearing", 14.0)}
"""Simulated log → its scenario and how much of it is run. [s]"""
PAIRS = [
    (log, name) for log in EFFORT for name in FAULTS if FAULTS[name].signal in {"", EFFORT[log]}
]

SILENT: Mapping[tuple[str, str], str] = {
    ("panda", "velocity_lag_3"): "2.8 ms at 1 kHz: sound logs of a real FR3 are 2.9 ms late",
    ("panda", "offset_J3_20pct"): "0.8 N·m, a fifth of what the log's own hand leaves on J4",
}
"""Harmful pairs that nothing in the log can tell from a sound one, with the reason."""

ECHOES = {("panda", "saturated_J2"): ["effort-offset"]}
"""Other warnings beside the right one: clipped on one side, an effort's mean is moved."""

OF_ROWS = {"dropped_5%", "dropped_1s", "duplicate_rows_10%", "stale_rows_10%", "quantised_1mrad"}
HARMLESS = {
    "ur10e": OF_ROWS,
    "ur5": OF_ROWS | {"stuck_position_J4"},
    "panda": OF_ROWS | {"stuck_position_J4", "time_ms", "effort_lag_5", "effort_zero_J5"},
}
"""Log → faults that move its estimate by less than 0.1 N·m and 2 % of the effort."""

REFUSED = {
    "wrong_robot", "one_sign_J2", "all_signs", "time_ms", "effort_swapped_J2_J3",
    "all_swapped_J2_J3", "gravity_compensated", "torque_called_current", "current_called_torque",
    "current_mA", "ceiling_mount", "wall_mount_30deg", "clock_skew_5%",
}  # fmt: skip
"""Faults with which no result means anything, beside those that the reader refuses."""


@pytest.fixture(scope="module")
def table_of(request):
    def opened(log: str) -> Table:
        if log in SCENARIOS:
            return simulated(*SCENARIOS[log], robot=log)
        path = request.getfixturevalue("logs") / "ur10e" / "free_14harm.csv"
        return table_from(read(path, columns=UR10E), log).between(2.0, 24.0)

    return cache(opened)


@pytest.fixture(scope="module")
def kinds_of(table_of, tmp_path_factory):
    path = tmp_path_factory.mktemp("sound") / "log.csv"
    return cache(lambda log: {kind(finding) for finding in said_of(table_of(log), path)})


def said_of(table: Table, path: Path) -> Sequence[Remark]:
    """The findings on a table once it is a file, a refusal by the reader as one of them."""
    table.write(path)
    try:
        recording = read(path)
    except VftError:
        return [fact(READER)]
    return [*examine(recording, robot_named(table.given)).findings, *recording.source.remarks]


def kind(finding: Remark) -> tuple[str, str, tuple[int, ...]]:
    return finding.code, finding.level, finding.where.joints


@pytest.mark.slow
@pytest.mark.parametrize("log", EFFORT)
def test_the_logs_are_sound(kinds_of, log):
    assert [kind for kind in kinds_of(log) if "warning" in kind] == []


@pytest.mark.slow
@pytest.mark.parametrize(("log", "name"), PAIRS, ids=str)
def test_a_fault_is_named_by_no_other_name_and_refused_where_results_mean_nothing(
    table_of, kinds_of, log, name, tmp_path
):
    fault = FAULTS[name]
    findings = said_of(fault.plant(table_of(log)), tmp_path / "log.csv")
    new = [finding for finding in findings if kind(finding) not in kinds_of(log)]
    warnings = [finding for finding in new if finding.level == "warning"]
    wrong = [finding.code for finding in warnings if not fault.is_named_by(finding)]
    assert wrong == ECHOES.get((log, name), [])
    if name in HARMLESS[log]:
        return
    named = any(fault.is_named_by(finding) for finding in new)
    assert named == ((log, name) not in SILENT), new
    if READER not in {finding.code for finding in new}:
        codes = {finding.code for finding in warnings}
        assert bool(codes & REFUSING) == (name in REFUSED)
        # Another arm's model is what identification is for.
        assert bool(codes & (REFUSING - NO_FIT)) == (name in REFUSED - {"wrong_robot"})


SEEN_ANYHOW = [
    "one_sign_J2", "effort_swapped_J2_J3", "velocity_swapped_J2_J3", "velocity_1Hz_filtered",
    "payload_2.8kg", "gravity_compensated", "current_called_torque", "clock_skew_5%",
    "stuck_effort_J3", "wall_mount_30deg", "offset_J3_20pct",
]  # fmt: skip


@pytest.mark.parametrize("fault", SEEN_ANYHOW)
def test_half_the_rows_tell_the_same(table_of, fault, tmp_path):
    table = table_of("ur5")
    half = FAULTS[fault].plant(table.selected(np.arange(0, len(table.t), 2)))
    found = examine(read(half.write(tmp_path / "log.parquet")), robot_named(half.given))
    assert set(FAULTS[fault].codes) & {finding.code for finding in found.findings}
