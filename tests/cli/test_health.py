"""The examination in every command: a health line, refusal, --anyway, and what outputs carry.

The log is the UR5 fixture (its truth is known, so it is sound); the fault is its currents turned.
"""

import json
from pathlib import Path

import polars as pl
import pytest

FIXTURE = Path(__file__).parents[2] / "fixtures" / "ur5_circle.csv"
UR5 = ("--robot", "ur5")

COMMANDS: dict[str, tuple[str, ...]] = {
    "estimate": (*UR5, "--observer", "gmo", "-o", "out"),
    "compare": (*UR5, "--observer", "gmo", "--reference", f"file:{FIXTURE}.truth.parquet"),
    "report": (*UR5, "--observer", "gmo", "-o", "out"),
    "identify --method gains": (*UR5, "--free", "0:4", "-o", "gains.toml"),
    "admit": UR5,
    "identify": (*UR5, "-o", "mine.toml"),
}
"""Command that a fault refuses → what else it is given."""


pytestmark = pytest.mark.usefixtures("here")


@pytest.fixture
def turned(here: Path) -> str:
    """The fixture with its currents turned, in the folder that the commands run in."""
    table = pl.read_csv(FIXTURE, separator=" ")
    currents = -pl.col("^actual_current_.$")
    table.with_columns(currents).write_csv(here / "turned.csv", separator=" ")
    return "turned.csv"


@pytest.mark.slow
@pytest.mark.parametrize("command", [*COMMANDS, "convert"])
def test_a_sound_log_is_said_to_be_sound(command: str, run) -> None:
    words = COMMANDS.get(command, ("-o", "other.csv"))
    code, out, err = run(*command.split(), FIXTURE, *words, "--json", "-v")
    assert code == 0, err
    assert "log health: sound" in err.splitlines()
    # the short recipe has none, and the UR5's friction follows them where a command models the log
    assert err.count("no joint temperatures") == (command != "convert")
    json.loads(out)


def test_a_log_with_temperatures_is_modelled_by_them(run) -> None:
    """At 35 °C, where the profile stands, the estimate is that without; in the cold it is not."""
    table = pl.read_csv(FIXTURE, separator=" ").head(500)
    estimates = {}
    for name, temperatures in (("untold", []), ("warm", 6 * [35.0]), ("cold", 6 * [25.0])):
        columns = {f"joint_temperatures_{j}": pl.lit(x) for j, x in enumerate(temperatures)}
        table.with_columns(**columns).write_csv(f"{name}.csv", separator=" ")
        code, _, err = run("estimate", f"{name}.csv", *COMMANDS["estimate"], "--force", "-v")
        assert code == 0, err
        assert ("no joint temperatures" in err) is (name == "untold")
        estimates[name] = pl.read_parquet("out/estimates.parquet")
    assert estimates["warm"].equals(estimates["untold"])
    assert not estimates["cold"].equals(estimates["untold"])


@pytest.mark.slow
@pytest.mark.parametrize("command", COMMANDS)
def test_a_meaningless_log_is_refused_in_one_line_and_nothing_is_written(
    command: str, turned: str, refused, here: Path
) -> None:
    line = refused(*command.split(), turned, *COMMANDS[command])
    assert "effort-sign" in line
    assert "--anyway" in line
    assert [file.name for file in here.iterdir()] == [turned]


# identify has a guard of its own: links that explain nothing make no robot.
@pytest.mark.slow
@pytest.mark.parametrize("command", sorted(COMMANDS.keys() - {"identify"}))
def test_anyway_goes_on_and_says_so_first(command: str, turned: str, run) -> None:
    code, _, err = run(*command.split(), turned, *COMMANDS[command], "--anyway")
    assert code == 0, err
    lines = err.splitlines()
    (doubt,) = [line for line in lines if line.startswith("MEANINGLESS")]
    assert "effort-sign" in doubt
    assert any("log health: " in line and "effort-sign" in line for line in lines)


@pytest.mark.slow
def test_every_output_of_a_report_carries_what_was_overridden(turned, run, here: Path) -> None:
    truth = f"file:{FIXTURE}.truth.parquet"
    words = ("--reference", truth, "--observer", "gmo", "-o", "out", "--anyway")
    code, _, err = run("report", turned, *UR5, *words)
    assert code == 0, err
    out = here / "out"
    record = json.loads((out / "run.json").read_text("utf-8"))
    (examined,) = record["examination"]
    assert examined["overridden"] == ["effort-sign"]
    assert not examined["sound"]
    finding = next(f for f in examined["findings"] if f["code"] == "effort-sign")
    assert finding["level"] == "warning"
    assert finding["values"]
    page = (out / "index.html").read_text("utf-8")
    assert page.index("MEANINGLESS") < page.index("Errors against the reference")
    assert (out / "errors.md").read_text("utf-8").startswith("> **MEANINGLESS")
    assert (out / "errors.tex").read_text("utf-8").startswith("% MEANINGLESS")
    rows = json.loads((out / "errors.json").read_text("utf-8"))
    assert {row["overridden"] for row in rows} == {"effort-sign"}
    assert set(pl.read_csv(out / "errors.csv")["overridden"]) == {"effort-sign"}
    assert "effort-sign" in pl.read_parquet_metadata(out / "estimates.parquet")["vftcli"]


def test_an_open_effort_heals_the_log(turned: str, run) -> None:
    words = ("--observer", "gmo", "--set", "log.effort=auto", "-o", "out", "--json")
    code, out, err = run("estimate", turned, *UR5, *words)
    assert code == 0, err
    record = json.loads(out)
    assert record["examination"][0]["overridden"] == []
    assert "effort-used" in [repair["code"] for repair in record["repairs"]]
    healed = pl.read_parquet("out/estimates.parquet")
    run("estimate", FIXTURE, *UR5, "--observer", "gmo", "-o", "plain")
    plain = pl.read_parquet("plain/estimates.parquet")
    assert healed.equals(plain)


def test_free_runs_are_examined_too_and_reported_by_name(turned: str, refused) -> None:
    words = ("--observer", "gmo", "--free", turned, "-o", "out")
    assert "turned.csv: effort-sign" in refused("estimate", FIXTURE, *UR5, *words)


def test_inspect_examines_the_users_own_arm(turned: str, run) -> None:
    code, out, _ = run("inspect", turned, *UR5, "--json")
    assert code == 0
    assert "effort-sign" in [finding["code"] for finding in json.loads(out)["findings"]]
