"""`vftcli identify` at the command line."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from vftcli.cli import make_app
from vftcli.cli.identify import file_for
from vftcli.robots import load_robot
from vftcli.signals.errors import ExaminationError, ParameterError

app = make_app()

RUNNER = CliRunner()


@pytest.fixture(scope="module")
def excitation(tmp_path_factory):
    """A simulated log of free motion, and one at rest cut from another scenario's."""
    path = tmp_path_factory.mktemp("logs") / "free.csv"
    result = RUNNER.invoke(app, ["simulate", "free-excitation", "-o", str(path), "--seed", "1"])
    assert result.exit_code == 0, result.output
    return path


@pytest.mark.slow
def test_a_log_becomes_a_robot_that_estimate_uses(excitation, tmp_path):
    robot = tmp_path / "my_robot.toml"
    result = RUNNER.invoke(
        app, ["identify", str(excitation), "--robot", "ur5", "--method", "base", "-o", str(robot)]
    )
    assert result.exit_code == 0, result.output
    assert "identified" in result.stdout
    for ending in (".toml", ".html", ".run.json"):
        assert robot.with_suffix(ending).is_file()
    assert load_robot(robot).document["identification"]["base_parameters"]
    out = tmp_path / "out"
    used = RUNNER.invoke(
        app, ["estimate", str(excitation), "--robot", str(robot), "-o", str(out)]
    )
    assert used.exit_code == 0, used.output
    assert (out / "estimates.parquet").is_file()


@pytest.mark.slow
def test_json_is_all_there_is_on_stdout(excitation, tmp_path):
    command = ["identify", str(excitation), "--robot", "ur5", "--json"]
    command += ["--check", str(excitation), "-o", str(tmp_path / "r.toml")]
    result = RUNNER.invoke(app, command)
    assert result.exit_code == 0, result.output
    record = json.loads(result.stdout)
    assert {row["role"] for row in record["residuals"]} == {"train", "held-out"}
    assert {"joint", "parameter", "value", "sd", "unit"} <= set(record["parameters"][0])
    assert "repeated-trajectory" in {remark["code"] for remark in record["remarks"]}


@pytest.mark.slow
def test_a_refusal_leaves_no_file(excitation, tmp_path):
    robot = tmp_path / "r.toml"
    command = ["identify", str(excitation), "--robot", "ur10e", "-o", str(robot)]
    result = RUNNER.invoke(app, command)
    assert isinstance(result.exception, ExaminationError)  # the links are another arm's
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_what_exists_stays_without_force(excitation, tmp_path):
    page = tmp_path / "r.html"
    page.write_text("mine")
    command = ["identify", str(excitation), "--robot", "ur5", "-o", str(tmp_path / "r.toml")]
    result = RUNNER.invoke(app, command)
    assert result.exit_code == 1
    assert "--force" in str(result.exception)
    assert page.read_text() == "mine"
    assert list(tmp_path.iterdir()) == [page]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--free", "other.csv"], "is the motion without the load that --method payload seeks"),
        (["--method", "payload", "--free", "0:4"], "give --free the log without it, once"),
        (["--method", "payload", "--free", "a.csv", "--free", "b.csv"], "from one pair of logs"),
        (["--method", "guess"], "there is friction, base"),
        (["--method", "base", "--set", "identify.constants=yes"], "is for --method friction"),
        (["--set", "identify.check-interval=4:1"], "is not A:B with A < B"),
        (["--gains", "auto"], "--gains is an option of --method gains"),
        (["--method", "base", "--gains", "auto"], "--method base makes no use of --gains"),
        (["--method", "gains", "--check", "a.csv"], "--method gains makes no use of --check"),
        (["--method", "gains", "other.csv"], "takes one LOG; name free motion by --free"),
        (["--method", "gains", "--gains", "paper"], "is not auto or delay=S (seconds) or"),
    ],
)
def test_options_that_do_not_go_together_are_refused(words, message, tmp_path):
    """Nothing is left out without a word: --free without a payload had no effect."""
    command = ["identify", "log.csv", "--robot", "ur5", "-o", str(tmp_path / "r.toml"), *words]
    result = RUNNER.invoke(app, command)
    assert isinstance(result.exception, ParameterError)
    assert message in str(result.exception)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("robot", "file"), [("ur10e", "my_ur10e.toml"), ("a/b c", "my_a_b_c.toml")]
)
def test_what_is_found_of_an_arm_has_its_name(robot, file):
    assert file_for(robot) == Path(file)
