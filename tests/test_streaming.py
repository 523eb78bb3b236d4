"""Long logs through `vftcli estimate`: the same numbers, the same record, nothing half done."""

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import polars as pl
import pytest
from example_logs import BEARING, CIRCLE
from made_runs import command

from vftcli import pipeline
from vftcli.doctor import examination
from vftcli.evaluation import ReferenceChoice
from vftcli.free_motion import FreeChoice
from vftcli.observers import ObserverChoice
from vftcli.pipeline import AnalysisChoice, comes_in_blocks
from vftcli.readers.reading import read
from vftcli.robots.terms import RunningTerms
from vftcli.signals.errors import VftError
from vftcli.signals.external_torque import DynamicsTerms
from vftcli.signals.recording import Recording
from vftcli.wrench import WrenchChoice, ZeroChoice


@pytest.fixture
def in_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every table counts as a long log, in blocks of 320 samples."""
    monkeypatch.setattr("vftcli.readers.delimited.BLOCK_BYTES", 1 << 16)
    monkeypatch.setattr("vftcli.readers.table.HELD", 1 << 14)
    monkeypatch.setattr(pipeline, "WHOLE_ROWS", 0)
    monkeypatch.setattr(pipeline, "PIECE", 320)


def estimated(folder: Path, *words: str, log: Path = CIRCLE) -> tuple[pl.DataFrame, Any]:
    """The table and the record of an estimate of a log, the fixture's if none is given."""
    command("estimate", log, "--robot", "ur5", "-o", folder, *words)
    record = json.loads((folder / "run.json").read_text("utf-8"))
    return pl.read_parquet(folder / "estimates.parquet"), record


def check_equal(made: pl.DataFrame, whole: pl.DataFrame) -> None:
    """All columns to 1e-9 N·m: sums of filters in another order, as blocks cut their pieces."""
    assert made.schema == whole.schema
    for name in whole.columns:
        np.testing.assert_allclose(made[name], whole[name], rtol=0, atol=1e-9, err_msg=name)


@pytest.mark.slow
@pytest.mark.parametrize("words", [
    ("--causal",),
    ("--causal", "--as-printed"),
    ("--causal", "--wrench", "--observer", "kfo-zoh"),
    ("--set", "contacts.list=no", "--observer", "gmo"),
    ("--causal", "--interval", "2:9"),
])  # fmt: skip
def test_numbers_and_record_of_the_whole(tmp_path: Path, request, words: tuple[str, ...]) -> None:
    whole, of_whole = estimated(tmp_path / "whole", *words, "--csv")
    request.getfixturevalue("in_blocks")
    made, record = estimated(tmp_path / "blocks", *words, "--csv")
    check_equal(made, whole)
    for key in ("command", "files", "versions"):
        of_whole.pop(key), record.pop(key)
    assert record == of_whole
    text = pl.read_csv(tmp_path / "blocks" / "estimates.csv")
    assert text.columns == made.columns
    assert len(text) == len(made)


@pytest.mark.slow
def test_the_wrench_of_seven_joints_comes_in_blocks_too(tmp_path: Path, request) -> None:
    """Before any estimate there is none to take the null space of: it was a traceback."""
    words = "--robot", "panda", "--causal", "--wrench", "--observer", "gmo", "--anyway"
    whole, _ = estimated(tmp_path / "whole", *words, log=BEARING)
    request.getfixturevalue("in_blocks")
    made, _ = estimated(tmp_path / "blocks", *words, log=BEARING)
    check_equal(made, whole)
    assert made["null_space/gmo"].max() > 0.0


@pytest.mark.usefixtures("in_blocks")
def test_interruption_leaves_nothing(tmp_path: Path, monkeypatch) -> None:
    """A run that ends in the middle of a log leaves no folder."""
    whole, blocks = RunningTerms.next, []

    def broken(terms: RunningTerms, block: Recording) -> DynamicsTerms:
        blocks.append(block)
        if len(blocks) == 3:
            raise KeyboardInterrupt
        return whole(terms, block)

    monkeypatch.setattr(pipeline.RunningTerms, "next", broken)
    with pytest.raises(AssertionError):  # its exit code is not 0
        estimated(tmp_path / "out", "--causal")
    assert len(blocks) == 3
    assert list(tmp_path.iterdir()) == []


@pytest.mark.usefixtures("in_blocks")
def test_wrong_robot_is_refused_before_anything_is_written(tmp_path: Path) -> None:
    """The stretches that are examined tell what the whole log tells."""
    with pytest.raises(VftError):
        estimated(tmp_path / "o", "--causal", "--robot", "ur10")
    assert not (tmp_path / "o").exists()


BASE = WrenchChoice(frame="base")


@pytest.mark.parametrize(("asked", "log", "blocks"), [
    ({}, {}, True),
    ({"wrench": BASE}, {}, True),
    ({}, {"samples": 100_000}, False),  # there is memory for so many
    ({}, {"dq": None}, False),
    ({}, {"source": SimpleNamespace(derived=("dq",))}, False),
    ({"contacts": True}, {}, False),
    ({"free": FreeChoice(spans=((0.0, 1.0),))}, {}, False),
    ({"reference": ReferenceChoice(name="zero")}, {}, False),
    ({"observers": ObserverChoice(names=("gmo", "kfo-rts"))}, {}, False),
    ({"wrench": replace(BASE, solver="smoother")}, {}, False),
    ({"wrench": replace(BASE, torque_sd="own")}, {}, False),
    ({"wrench": replace(BASE, zero=ZeroChoice(start=True))}, {}, False),
    ({"wrench": replace(BASE, zero=ZeroChoice(spans=((0.0, 1.0),)))}, {}, False),
])  # fmt: skip
def test_what_needs_all_of_a_log_at_once_has_it(asked, log, blocks):
    source = SimpleNamespace(derived=())
    long = SimpleNamespace(**{"samples": 100_001, "dq": True, "source": source} | log)
    plain = AnalysisChoice(observers=ObserverChoice(names=("gmo", "fdo")), contacts=False)
    assert comes_in_blocks(long, replace(plain, **asked)) == blocks  # type: ignore[arg-type]


@pytest.mark.slow
@pytest.mark.parametrize("words", [("--causal",), ("--causal", "--wrench")])
def test_bad_samples_are_cut_out_as_of_the_whole(tmp_path: Path, request, words) -> None:
    """A velocity that no arm has, in the last tenth: the row goes, and the numbers are equal."""
    path, rows = tmp_path / "log.csv", pl.read_csv(CIRCLE, separator=" ")
    late, speed = pl.int_range(rows.height) == int(0.95 * rows.height), pl.col("actual_qd_2")
    rows = rows.with_columns(pl.when(late).then(3.0).otherwise(speed).alias("actual_qd_2"))
    rows.write_csv(path, separator=" ")
    whole, of_whole = estimated(tmp_path / "whole", *words, log=path)
    request.getfixturevalue("in_blocks")
    made, record = estimated(tmp_path / "blocks", *words, log=path)
    assert len(made) == len(whole) == rows.height - 1
    check_equal(made, whole)
    codes = [finding["code"] for finding in record["examination"][0]["findings"]]
    assert codes == [finding["code"] for finding in of_whole["examination"][0]["findings"]]
    assert "isolated-velocity" in codes


@pytest.mark.usefixtures("in_blocks")
def test_a_log_that_is_examined_in_stretches_says_so(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr(examination, "EXAMINED", 1000)
    monkeypatch.setattr(examination, "STRETCH", 100)
    made, record = estimated(tmp_path / "o", "--causal")
    found = {each["code"]: each for each in record["examination"][0]["findings"]}
    assert found["examined-in-stretches"]["values"] == {"examined": 1000, "samples": len(made)}


#: A command, then the most memory that its process had, in kB.
MEASURED = """
import sys
from vftcli.cli import make_app
make_app()(sys.argv[1:], standalone_mode=False)
with open("/proc/self/status") as status:
    print(next(line.split()[1] for line in status if line.startswith("VmHWM")))
"""


def peak_memory(samples: int, folder: Path) -> int:
    """Peak memory of `estimate --causal` of the fixture's motion over and over. [B]"""
    short = read(CIRCLE)
    rows = np.arange(samples) % short.samples
    columns = {"timestamp": np.arange(samples) * 0.008}
    for field, values in (("q", short.q), ("qd", short.dq), ("current", short.current)):
        columns |= {f"actual_{field}_{j}": values[rows, j] for j in range(short.joints)}
    log = folder / f"{samples}.parquet"
    pl.DataFrame(columns).write_parquet(log, row_group_size=50_000)
    words = ("estimate", log, "--causal", "--robot", "ur5", "-o", folder / f"of_{samples}")
    printed = subprocess.check_output([sys.executable, "-c", MEASURED, *map(str, words)])
    return int(printed.split()[-1]) * 1024


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="/proc is Linux's")
def test_memory_grows_with_the_clock_alone(tmp_path: Path) -> None:
    """A clock, its steps and copies to judge them are five numbers a sample, 40 B.

    Positions, velocities and currents, 144 B, stay in files. Twice that for the allocator.
    """
    few, many = 200_000, 1_200_000
    grown = peak_memory(many, tmp_path) - peak_memory(few, tmp_path)
    assert grown < 80 * (many - few)
