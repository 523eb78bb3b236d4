"""How much is said and to whom: -v, -q, colours, stages; a bad log of several is left out."""

import csv
import io
import json
import shutil
from pathlib import Path

import pytest

from vftcli.cli.console import canvas, say, speaking

FIXTURES = Path(__file__).parents[2] / "fixtures"
TAPS = FIXTURES / "ur5_taps_ur_rtde.csv"
TRUTH = f"file:{TAPS}.truth.parquet"
OTHER = FIXTURES / "panda_bag"


class Terminal(io.StringIO):
    """Standard output that is a terminal."""

    encoding = "utf-8"

    def isatty(self) -> bool:
        return True


def test_lines_stay_lines_and_what_a_terminal_obeys_is_shown(capsys) -> None:
    with speaking(details=False, quiet=False):
        say("one\x1b[2J\ntwo\rthree")
    assert capsys.readouterr().err == "one\\x1b[2J\ntwo\\rthree\n"


@pytest.mark.parametrize(
    ("variables", "colour"),
    [({}, True), ({"NO_COLOR": "1"}, False), ({"NO_COLOR": ""}, True), ({"TERM": "dumb"}, False)],
)
def test_colours_and_letters_are_those_of_a_terminal_that_wants_them(
    monkeypatch, variables: dict[str, str], colour: bool
) -> None:
    monkeypatch.delenv("NO_COLOR", raising=False)
    for name, value in {"TERM": "xterm", **variables}.items():
        monkeypatch.setenv(name, value)
    monkeypatch.setattr("sys.stdout", Terminal())
    assert canvas().colour is colour
    assert canvas().unicode
    monkeypatch.setattr("sys.stdout", io.TextIOWrapper(io.BytesIO(), encoding="ascii"))
    assert not canvas().colour
    assert not canvas().unicode


@pytest.fixture
def logs(tmp_path: Path) -> tuple[Path, Path]:
    """Two logs, of which the second is none."""
    good, bad = tmp_path / "good.csv", tmp_path / "bad.csv"
    shutil.copy(TAPS, good)
    bad.write_text("# no log\n")
    return good, bad


def test_a_report_writes_the_others_and_fails(logs, tmp_path: Path, run) -> None:
    out = tmp_path / "out"
    code, stdout, err = run("report", *logs, "--robot", "ur5", "-o", out)
    assert code == 1
    assert "error: bad.csv left out: " in err
    assert err.count("error: ") == 1
    assert (out / "good" / "index.html").exists()
    assert not (out / "bad").exists()
    assert "✗ left out" in stdout
    record = json.loads((out / "run.json").read_text(encoding="utf-8"))
    assert list(record["left_out"]) == ["bad.csv"]
    assert [log["folder"] for log in record["logs"]] == ["good"]


def test_lists_and_tables_show_the_others_and_fail(logs: tuple[Path, Path], run) -> None:
    words = (*logs, "--robot", "ur5")
    code, out, _ = run("contacts", *words, "--json")
    assert code == 1
    assert [record["recording"] for record in json.loads(out)["logs"]] == ["good.csv"]
    code, out, _ = run("compare", *words, "--observer", "gmo", "--reference", TRUTH, "--csv")
    assert code == 1
    rows = csv.DictReader(io.StringIO(out))
    assert {row["recording"] for row in rows} == {"good.csv"}


def test_if_all_are_bad_nothing_is_written(tmp_path: Path, run) -> None:
    bad = [tmp_path / name for name in ("one.csv", "two.csv")]
    for path in bad:
        path.write_text("# no log\n")
    out = tmp_path / "out"
    for words in (("report", "-o", out), ("contacts",), ("compare", "--reference", "zero")):
        name, *options = words
        code, stdout, err = run(name, *bad, *options)
        assert (code, stdout) == (1, "")
        assert "none of the logs can be analysed" in err
    assert not out.exists()


def test_each_log_has_the_robot_that_it_settles_itself(run) -> None:
    code, out, _ = run("contacts", TAPS, OTHER)
    assert code == 0
    assert out.startswith("2 logs · ur5 and panda")


def test_of_several_logs_each_health_line_names_its_own(run) -> None:
    logs = (TAPS, FIXTURES / "ur5_circle.csv")
    words = ("--robot", "ur5", "--observer", "gmo", "--reference", "zero")
    said = [line for line in run("compare", *logs, *words)[2].splitlines() if "health" in line]
    assert said == [f"{log.name}: log health: sound" for log in logs]
    assert run("compare", TAPS, *words)[2].startswith("log health: sound\n")


def test_quiet_prints_errors_only_and_tables_that_are_asked_for(tmp_path: Path, run) -> None:
    words = ("--robot", "ur5", "--observer", "gmo", "-q")
    assert run("estimate", TAPS, *words, "-o", tmp_path / "out") == (0, "", "")
    code, out, err = run("compare", TAPS, *words, "--reference", TRUTH)
    assert (code, err) == (0, "")
    assert "gmo" in out


def test_details_say_everything_that_is_known(tmp_path: Path, run) -> None:
    words = ("estimate", TAPS, "--robot", "ur5", "--observer", "gmo")
    _, short, usual = run(*words, "-o", tmp_path / "one")
    _, same, details = run(*words, "-o", tmp_path / "two", "-v")
    assert "note: " not in usual
    assert "note: " in details
    assert short.splitlines()[:2] == same.splitlines()[:2]


def test_a_log_of_one_sample_has_no_rate(tmp_path: Path, run) -> None:
    path = tmp_path / "one.csv"
    path.write_text("".join(TAPS.read_text().splitlines(keepends=True)[:2]))
    code, _, err = run("identify", path, "--robot", "ur5", "-o", tmp_path / "out.toml", "-v")
    assert code != 0
    assert "6 joints, 1 sample, 0.0 s\n" in err
