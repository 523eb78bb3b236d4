"""One envelope for machines: how every command's JSON, `run.json`, `contacts.json` begin."""

import hashlib
import json
from pathlib import Path
from typing import Any

import pytest

FIXTURES = Path(__file__).parents[2] / "fixtures"
LOG, OTHER = FIXTURES / "ur5_taps_ur_rtde.csv", FIXTURES / "ur5_circle.csv"
BEARING = FIXTURES / "panda_bearing.csv"
SHORT = ("--robot", "ur5", "--interval", "0:4")
GMO = (*SHORT, "--observer", "gmo")
RATE = ("--robot", "panda", "--rate", 60, "--anyway")
QUICK = ("--set", "bench.samples=2000", "--set", "bench.rounds=1")
#: Command → keys of its result.
RESULTS: dict[tuple[object, ...], str] = {
    ("inspect", LOG): "format joints samples duration_s rate_hz max_gap_s duplicates findings "
    "robots",
    ("contacts", LOG, *SHORT): "frame sign free_part smallest_force_N contacts candidates",
    ("estimate", LOG, *GMO, "-o", "out"): "examination robot observers conventions",
    ("report", LOG, *GMO, "-o", "out"): "examination robot observers reference contacts",
    ("compare", LOG, *GMO, "--reference", "zero"): "rows",
    ("thresholds", BEARING, *RATE): "rate_per_h joints axes calls",
    ("identify", OTHER, *SHORT, "-o", "out.toml"): "method residuals parameters",
    ("convert", LOG, "-o", "out.csv"): "output format samples signals",
    ("admit", OTHER, *SHORT): "rows",
    ("admit", "--release", "x=0.3", "--robot", "ur5"): "rows",
    ("simulate", "ur5-circle", "--set", "duration=1", "-o", "out.csv"): "scenario seed files",
    ("benchmark", "speed", *QUICK): "observers dynamics ratios",
}


def checked(record: dict[str, Any]) -> None:
    """The envelope of a record of one log or none."""
    assert list(record)[:4] == ["command", "versions", "logs", "remarks"]
    assert record["command"].startswith("vftcli ")
    assert "vftcli" in record["versions"]
    for log in record["logs"]:
        assert log["sha256"] == hashlib.sha256(Path(log["path"]).read_bytes()).hexdigest()
        assert log["recording"] == Path(log["path"]).name
        assert {key: record[key] for key in log} == log
    for remark in record["remarks"]:
        assert {"code", "level", "message", "values", "joints", "span_s"} <= set(remark)


@pytest.mark.slow
@pytest.mark.parametrize("words", RESULTS, ids=lambda words: f"{words[0]} {len(words)}")
def test_every_command_has_the_envelope(words: tuple[object, ...], run, here: Path) -> None:
    code, out, err = run(*words, "--json")
    assert code == 0, err
    record = json.loads(out)
    checked(record)
    assert len(record["logs"]) == (isinstance(words[1], Path))
    assert set(RESULTS[words].split()) <= set(record)
    for name in ("run.json", "contacts.json"):
        if (written := here / "out" / name).exists():
            checked(json.loads(written.read_text("utf-8")))


@pytest.mark.slow
def test_several_logs_have_an_entry_each_with_what_was_found(run, tmp_path: Path) -> None:
    for words, key in (
        (("contacts",), "contacts"),
        (("inspect",), "findings"),
        (("report", "--observer", "gmo", "-o", tmp_path / "out"), "contacts"),
    ):
        name, *options = words
        asked = () if name == "inspect" else SHORT
        code, out, err = run(name, LOG, OTHER, *asked, *options, "--json")
        assert code == 0, err
        record = json.loads(out)
        assert [log["recording"] for log in record["logs"]] == [LOG.name, OTHER.name]
        assert all(key in log for log in record["logs"])
        assert key not in record
    summary = json.loads((tmp_path / "out" / "run.json").read_text("utf-8"))
    assert [log["folder"] for log in summary["logs"]] == [LOG.stem, OTHER.stem]
