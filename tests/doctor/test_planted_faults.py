"""Planted faults: named, about the right joints, however the log is kept.

The faults and what names them stand in `planted_faults.py`. That their remedies heal is tried in
`tests/test_remedies.py`, that commands report and refuse in `tests/cli/test_health.py`.
"""

import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from fault_matrix import Cell, base_logs, matrix, said_of
from fault_variants import estimate, harm
from planted_faults import FAULTS, HARMLESS, READER, Table, robot_named

from vftcli.doctor import examine
from vftcli.doctor.examination import NO_FIT, REFUSING
from vftcli.readers.reading import read
from vftcli.signals.remarks import Remark

LOGS = ("ur10e", "ur5", "panda")
ONE_EFFORT = {"torque_called_current", "current_called_torque", "current_mA"}
PAIRS = [
    (log, fault)
    for log in LOGS
    for fault in FAULTS
    if not (log == "panda" and fault in ONE_EFFORT)
    and not (log != "panda" and fault == "tau_ext_inverted")
]

SILENT: Mapping[tuple[str, str], str] = {
    ("panda", "velocity_lag_3"): "2.8 ms at 1 kHz: sound logs of a real FR3 are 2.9 ms late",
    ("panda", "offset_J3_20pct"): "0.8 N·m, a fifth of what the log's own hand leaves on J4",
}
"""Harmful pairs that nothing in the log can tell from a sound one, with the reason."""

ECHOES: Mapping[tuple[str, str], tuple[str, ...]] = {
    ("panda", "saturated_J2"): ("effort-offset",),  # clipped on one side, its mean is moved
}
"""Other warnings beside the right one."""

Cells = Mapping[tuple[str, str], Cell]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where the simulated logs are kept."""
    return tmp_path_factory.mktemp("planted")


@pytest.fixture(scope="module")
def tables(folder: Path) -> dict[str, Table]:
    """The logs that faults are planted in; the real one where VFT_LOGS is set."""
    return dict(base_logs(folder))


@pytest.fixture(scope="module")
def cells(tables: dict[str, Table], folder: Path) -> Cells:
    """What is said of every fault in every log, and not of the log without it."""
    return {
        (log, name): cell
        for log, table in tables.items()
        for name, _, cell in matrix(table, FAULTS, folder)
    }


def cell_in(cells: Cells, log: str, fault: str) -> Cell:
    if (log, fault) not in cells:
        pytest.skip("VFT_LOGS is not set: the real log is not part of the repository")
    return cells[log, fault]


@pytest.mark.slow
@pytest.mark.parametrize("log", LOGS)
def test_the_logs_are_sound(tables: dict[str, Table], log: str, tmp_path: Path) -> None:
    if log not in tables:
        pytest.skip("VFT_LOGS is not set: the real log is not part of the repository")
    said = said_of(tables[log], tmp_path / "sound.csv")
    assert [str(finding) for finding in said if finding.level == "warning"] == []


REFUSED = {
    "wrong_robot", "one_sign_J2", "all_signs", "time_ms", "effort_swapped_J2_J3",
    "all_swapped_J2_J3", "gravity_compensated", "torque_called_current", "current_called_torque",
    "current_mA", "ceiling_mount", "wall_mount_30deg", "clock_skew_5%",
}  # fmt: skip
"""Faults with which no result means anything, beside those that the reader refuses."""


@pytest.mark.slow
@pytest.mark.parametrize(("log", "fault"), PAIRS, ids=str)
def test_a_fault_is_named_by_no_other_name_and_refused_where_results_mean_nothing(
    cells: Cells, log: str, fault: str
) -> None:
    cell = cell_in(cells, log, fault)
    assert cell.wrong == ECHOES.get((log, fault), ())
    if fault in HARMLESS[log]:
        return
    assert cell.named == ((log, fault) not in SILENT), cell
    codes = {finding.code for finding in cell.findings if finding.level == "warning"}
    if READER not in {finding.code for finding in cell.findings}:
        assert bool(codes & REFUSING) == (fault in REFUSED)
        # Another arm's model is what identification is for.
        assert bool(codes & (REFUSING - NO_FIT)) == (fault in REFUSED - {"wrong_robot"})


@pytest.mark.slow
def test_pairs_without_a_name_do_little(tables: dict[str, Table], tmp_path: Path) -> None:
    """What moves the estimate by more than 5 N·m or half the effort is always named."""
    for log, fault in SILENT:
        sound = estimate(tables[log], tmp_path / "log.parquet")
        assert sound is not None
        faulty = estimate(FAULTS[fault].plant(tables[log]), tmp_path / "log.parquet")
        moved, share = harm(faulty, sound, tables[log])
        assert moved < 5.0
        assert share < 0.5


def renamed(table: Table, path: Path) -> Path:
    """The table as a program that counts from zero and has its own names writes it."""
    names = {"q": "joint_pos_", "dq": "joint_vel_", "current": "motor_current_", "tau": "effort_"}
    frame = table.frame()
    new = {"t": "time"}
    for column in frame.columns[1:]:
        stem, joint = re.fullmatch(r"(\D+)(\d+)", column).groups()  # type: ignore[union-attr]
        new[column] = f"{names.get(stem, stem + '_')}{int(joint) - 1}"
    frame.rename(new).write_csv(path.with_suffix(".csv"), float_precision=9)
    return path.with_suffix(".csv")


def later(table: Table, path: Path) -> Path:
    """The table with stamps of a whole year on."""
    return replace(table, t=table.t + 31536000.0).write(path.with_suffix(".csv"))


def in_parquet(table: Table, path: Path) -> Path:
    return table.write(path.with_suffix(".parquet"))


SEEN_ANYHOW = [
    "one_sign_J2", "effort_swapped_J2_J3", "velocity_swapped_J2_J3", "velocity_1Hz_filtered",
    "payload_2.8kg", "gravity_compensated", "current_called_torque", "clock_skew_5%",
    "stuck_effort_J3", "wall_mount_30deg", "offset_J3_20pct",
]  # fmt: skip


@pytest.mark.parametrize("write", [renamed, later, in_parquet])
@pytest.mark.parametrize("fault", SEEN_ANYHOW)
def test_findings_do_not_depend_on_how_the_log_is_kept(
    tables: dict[str, Table],
    cells: Cells,
    fault: str,
    write: Callable[[Table, Path], Path],
    tmp_path: Path,
) -> None:
    table, known = FAULTS[fault].plant(tables["ur5"]), cells["ur5", fault].findings
    found = examine(read(write(table, tmp_path / "log")), robot_named(table.given)).findings
    assert places(found) >= places(known)
    warnings, expected = (
        {f.code for f in each if f.level == "warning"} for each in (found, known)
    )
    assert warnings == expected


def places(findings: Iterable[Remark]) -> set[tuple[str, tuple[int, ...]]]:
    """Code and joints of the findings of a doctor, not of a reader."""
    return {(finding.code, finding.where.joints) for finding in findings}


@pytest.mark.parametrize("fault", SEEN_ANYHOW)
def test_half_the_rows_tell_the_same(
    tables: dict[str, Table], fault: str, tmp_path: Path
) -> None:
    table = tables["ur5"]
    half = FAULTS[fault].plant(table.selected(np.arange(0, len(table.t), 2)))
    found = examine(read(half.write(tmp_path / "log.parquet")), robot_named(half.given))
    assert set(FAULTS[fault].codes) & {finding.code for finding in found.findings}
