"""`vftcli contacts` at the command line."""

import csv
import io
import json
from pathlib import Path

TAPS = Path(__file__).parents[2] / "fixtures" / "ur5_taps_ur_rtde.csv"


def test_the_answer_is_on_stdout_and_nothing_is_written(run, here: Path) -> None:
    """JSON and CSV hold the same rows."""
    words = ("contacts", TAPS, "--robot", "ur5", "--free", "0.3:4")
    code, out, err = run(*words)
    assert (code, err) == (0, "")
    assert "2 contacts. The hardest" in out
    assert "Can it be believed?" in out
    code, out, err = run(*words, "--json")
    record = json.loads(out)
    assert (code, record["recording"]) == (0, TAPS.name)
    assert "log health: sound" in err
    rows = list(csv.DictReader(io.StringIO(run(*words, "--csv")[1])))
    peaks = [each["peak_force_N"] for each in record["contacts"]]
    assert [float(row["peak_force_N"]) for row in rows] == peaks
    assert not list(here.iterdir())


def test_a_free_part_that_is_not_there_is_refused(refused) -> None:
    assert "free part" in refused("contacts", TAPS, "--robot", "ur5", "--free", "90:95")


def test_estimates_are_listed_as_they_were_written(run, refused, tmp_path: Path) -> None:
    words = ("--robot", "ur5", "--free", "0.3:4")
    assert run("estimate", TAPS, *words, "-q", "-o", tmp_path)[0] == 0
    stored = tmp_path / "estimates.parquet"
    code, out, _ = run("contacts", stored, "--json")
    assert code == 0
    fresh = json.loads(run("contacts", TAPS, *words, "--json")[1])
    assert json.loads(out)["contacts"] == fresh["contacts"]
    assert "2 contacts. The hardest" in run("contacts", stored)[1]
    assert run("contacts", stored, "--csv")[1].count("\n") == 3
    error = refused("compare", stored, "--reference", "zero")
    assert "holds estimates, not what the drives measured; give the log" in error
