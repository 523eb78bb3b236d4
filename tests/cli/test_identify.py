"""`vftcli identify` at the command line."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from vftcli.cli import make_app
from vftcli.robots import load_robot


@pytest.fixture(scope="module")
def excitation(tmp_path_factory):
    """A simulated log of free motion."""
    path = tmp_path_factory.mktemp("logs") / "free.csv"
    words = ["simulate", "free-excitation", "-o", str(path), "--seed", "1"]
    result = CliRunner().invoke(make_app(), words)
    assert result.exit_code == 0, result.output
    return path


@pytest.mark.slow
def test_a_log_becomes_a_robot_that_estimate_uses(run, excitation, here: Path) -> None:
    words = ("--robot", "ur5", "--method", "base", "-o", "my_robot.toml")
    code, out, err = run("identify", excitation, *words)
    assert code == 0, err
    assert "identified" in out
    written = {path.name for path in here.iterdir()}
    assert written >= {"my_robot.toml", "my_robot.html", "my_robot.run.json"}
    assert load_robot("my_robot.toml").document["identification"]["base_parameters"]
    assert run("estimate", excitation, "--robot", "my_robot.toml", "-o", "out")[0] == 0
    assert Path("out/estimates.parquet").is_file()


@pytest.mark.slow
@pytest.mark.usefixtures("here")
def test_json_is_all_there_is_on_stdout(run, excitation) -> None:
    words = ("--robot", "ur5", "--json", "--check", excitation, "-o", "r.toml")
    code, out, err = run("identify", excitation, *words)
    assert code == 0, err
    record = json.loads(out)
    assert {row["role"] for row in record["residuals"]} == {"train", "held-out"}
    assert {"joint", "parameter", "value", "sd", "unit"} <= set(record["parameters"][0])
    assert "repeated-trajectory" in {remark["code"] for remark in record["remarks"]}


@pytest.mark.slow
def test_a_refusal_leaves_no_file_and_what_exists_stays(refused, excitation, here: Path) -> None:
    words = ("identify", excitation, "-o", "r.toml", "--robot")
    refused(*words, "ur10e")  # the links are another arm's
    assert not list(here.iterdir())
    page = here / "r.html"
    page.write_text("mine")
    assert "--force" in refused(*words, "ur5")
    assert page.read_text() == "mine"
    assert list(here.iterdir()) == [page]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("--free other.csv", "is the motion without the load that --method payload seeks"),
        ("--method payload --free 0:4", "give --free the log without it, once"),
        ("--method payload --free a.csv --free b.csv", "from one pair of logs"),
        ("--method guess", "there is friction, base"),
        ("--method base --set identify.constants=yes", "is for --method friction"),
        ("--set identify.check-interval=4:1", "is not A:B with A < B"),
        ("--gains auto", "--gains is an option of --method gains"),
        ("--method base --gains auto", "--method base makes no use of --gains"),
        ("--method gains --check a.csv", "--method gains makes no use of --check"),
        ("--method gains other.csv", "takes one LOG; name free motion by --free"),
        ("--method gains --gains paper", "is not auto or delay=S (seconds) or"),
    ],
)
def test_options_that_do_not_go_together_are_refused(refused, here, words, message) -> None:
    """Nothing is left out without a word: --free without a payload had no effect."""
    command = ("identify", "log.csv", "--robot", "ur5", "-o", "r.toml")
    assert message in refused(*command, *words.split())
    assert not list(here.iterdir())
