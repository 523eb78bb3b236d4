"""What is written and where: options, folders, JSON; no input, no copy and no name is lost."""

import hashlib
import json
import os
import shutil
import tomllib
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pytest
from example_logs import BEARING, CIRCLE, FIXTURES, TAPS

from vftcli.cli.config import NAME
from vftcli.cli.inspect import from_folder
from vftcli.proposal import ProposedOption
from vftcli.readers.reading import read
from vftcli.robots import PROFILES
from vftcli.simulation.scenario import FOLDER

# What `vftcli inspect -o` writes runs: commands beside it give the numbers of typed options.


def options(folder: Path) -> dict[str, object]:
    """What is taken."""
    return tomllib.loads((folder / NAME).read_text("utf-8"))


@pytest.mark.slow
@pytest.mark.parametrize(("log", "given", "expected"), [
    ("ur5_circle.csv", ("--robot", "ur5"), {"robot": "ur5", "reference": "two-cycle"}),
    ("ur5_sensor.parquet", (), {"robot": "ur5", "reference": "sensor"}),
    ("panda_bag", ("--robot", "panda"), {"robot": "panda", "reference": "sensor"}),
])  # fmt: skip
def test_what_is_written_gives_the_numbers_of_typed_options(run, here, log, given, expected):
    code, _, err = run("inspect", FIXTURES / log, *given, "-o", NAME)
    assert (code, options(here)) == (0, expected)
    assert f"wrote {NAME}: robot, reference; read unasked" in err
    asked = ("compare", FIXTURES / log, "--observer", "gmo", "--json")
    code, kept, _ = run(*asked)
    typed = [word for key, value in expected.items() for word in (f"--{key}", value)]
    kept, of_words = (json.loads(x) for x in (kept, run(*asked, *typed, "--config", "none")[1]))
    assert (code, kept | {"command": ""}) == (0, of_words | {"command": ""})
    assert kept["rows"]


def test_each_option_stands_under_its_reason(run, here: Path) -> None:
    words = (FIXTURES / "ur5_circle.csv", "--robot", "ur5", "--interval", "0:9", "-o", NAME)
    assert run("inspect", *words)[0] == 0
    parts = (here / NAME).read_text("utf-8").strip().split("\n\n")
    reasons = {option: why for why, _, option in (part.rpartition("\n") for part in parts[1:])}
    expected = {
        'interval = "0:9"': "# as given",
        'robot = "ur5"': "# as given",
        'reference = "two-cycle"': "# the free motion is known too: the reference is the diff",
    }
    assert [option for option, why in reasons.items() if why.startswith("# ")] == [*expected]
    assert all(reasons[option].startswith(why) for option, why in expected.items())


def test_an_arm_is_looked_for_where_it_is_named_or_tells_what_an_effort_is(run) -> None:
    words = ("inspect", FIXTURES / "ur5_circle.csv", "--details")
    assert "robot guessed" not in run(*words)[2]
    assert "note: robot guessed: ur5" in run(*words, "--set", "log.effort=auto")[2]
    assert "note: torque_constant: " in run(*words, "--robot", "ur5")[2]  # of its profile


@pytest.mark.slow
def test_a_second_log_is_offered_as_free_motion(run, ran, here: Path, logs: Path) -> None:
    """The load's own log, the same motion without the load, and a pose that hands push."""
    for name in ("load_14harm.csv", "free_14harm.csv", "push_pose.csv"):
        shutil.copy(logs / "ur10e" / name, here)
    named = ("load_14harm.csv", "free_14harm.csv", "push_pose.csv")
    out, err = ran("inspect", *named, "--robot", "ur10e", "--json", "-o", NAME)
    columns = "t,q:6,dq:6,current:6,target_current:6,target_torque:6"
    found = {"robot": "ur10e", "columns": columns, "free": ["free_14harm.csv"]}
    found["reference"] = "two-cycle"
    assert options(here) == found == json.loads(out)["options"]
    assert '# free = ["push_pose.csv"]' in (here / NAME).read_text("utf-8")
    asked = ("load_14harm.csv", "--observer", "gmo", "--set", "contacts.list=no")
    assert run("report", *asked, "-o", "kept")[0] == 0
    typed = ["--robot", "ur10e", "--columns", columns, "--free", "free_14harm.csv"]
    (here / NAME).unlink()
    assert run("report", *asked, "-o", "typed", *typed, "--reference", "two-cycle")[0] == 0
    for file in ("errors.csv", "estimates.parquet"):
        assert (here / "kept" / file).read_bytes() == (here / "typed" / file).read_bytes()
    assert "note: vftcli.toml" not in err
    # The arm that the first log settles is the others' too.
    assert run("inspect", "push_pose.csv", "free_14harm.csv", "--force", "-o", NAME)[0] == 0
    assert {"robot": "ur10e", "free": ["free_14harm.csv"]}.items() <= options(here).items()


def test_an_effort_that_is_not_what_it_is_called_is_written(run, here, samples):
    log = samples / "reach" / "ros2_ur_effort_torque"
    assert run("inspect", log, "--robot", "ur5", "-o", NAME)[0] == 0
    assert options(here) == {"robot": "ur5", "log": {"effort": "torque-without-gravity"}}
    assert run("compare", log, "--reference", "zero", "--interval", "0.5:3.9")[0] == 0


def test_what_is_not_settled_is_there_to_be_taken(run, here: Path, logs: Path) -> None:
    code, _, err = run("inspect", logs / "libfranka_sim" / "pushes.csv.gz", "-o", NAME)
    assert (code, options(here)) == (0, {})
    assert "which arm it is remains open" in err
    assert '# robot = "panda"\n' in (here / NAME).read_text("utf-8")


def test_a_file_that_is_there_is_not_written_over(run, refused, here: Path) -> None:
    """Nor is it read: what is written is what the log calls for, not what was kept before."""
    (here / NAME).write_text("robot = 'ur3'\nno TOML", "utf-8")
    words = ("inspect", FIXTURES / "panda_bag", "-o", NAME)
    assert "--force" in refused(*words)
    assert (here / NAME).read_text("utf-8") == "robot = 'ur3'\nno TOML"
    code, _, err = run(*words, "--force")
    assert (code, options(here)["robot"]) == (0, "panda")
    assert "note: vftcli.toml gives" not in err


def test_what_cannot_be_read_leaves_no_file(run, here: Path) -> None:
    for words in (("nowhere.csv",), (FIXTURES / "panda_bag", "--robot", "ur9")):
        code, _, err = run("inspect", *words, "-o", NAME)
        assert (code, err.count("error: ")) == (1, 1)
        assert not (here / NAME).exists()


def test_files_are_named_from_the_folder_of_the_file(here: Path) -> None:
    (here / "sub").mkdir()
    (here / "arm.toml").touch()

    def named(folder: Path, key: str, value: str | list[str]) -> str | list[str]:
        return from_folder(folder, ProposedOption("", key, value)).value

    assert named(here / "sub", "robot", "arm.toml") == "../arm.toml"
    assert named(Path(), "free", ["arm.toml", "0:4"]) == ["arm.toml", "0:4"]
    assert named(here / "sub", "columns", "arm.toml") == "arm.toml"
    assert named(here / "sub", "robot", "ur5") == "ur5"


def test_nothing_is_written_without_a_name(run, here: Path) -> None:
    logs = (FIXTURES / "panda_bag", FIXTURES / "ur5_sensor.parquet")
    code, out, _ = run("inspect", *logs, "--json")
    assert (code, list(here.iterdir())) == (0, [])
    assert [one["joints"] for one in json.loads(out)["logs"]] == [7, 6]
    code, out, err = run("inspect", *logs, "nowhere.csv", "--json")
    assert (code, len(json.loads(out)["logs"])) == (3, 2)
    assert err.startswith("error: nowhere.csv left out: ")


# Where a command writes that is not given -o, seen by what it refuses to write over.


def test_estimates_go_into_a_folder_here_named_after_the_log(run, refused, here: Path) -> None:
    """What is there stays unless it is forced."""
    words = ("estimate", TAPS, "--robot", "ur5", "--interval", "0:2", "--causal")
    assert run("report", *words[1:], "--csv", "-q", "-o", "all")[0] == 0
    assert (here / "all/estimates.csv").is_file()
    code, out, _ = run(*words)
    folder = here / "ur5_taps_ur_rtde.vft"
    assert code == 0
    assert f"{folder.name}/  estimates.parquet  run.json" in out
    assert {file.name for file in folder.iterdir()} == {"estimates.parquet", "run.json"}
    (folder / "estimates.parquet").unlink()
    (folder / "run.json").write_text("precious")
    error = refused(*words)
    assert error.startswith(f"error: {Path(folder.name) / 'run.json'} exists; ")
    assert "--force" in error
    (kept,) = folder.iterdir()
    assert (kept.name, kept.read_text()) == ("run.json", "precious")
    assert run(*words, "--force")[0] == 0
    assert (folder / "run.json").read_text() != "precious"


@pytest.mark.parametrize(("words", "folder"), [
    (("report", "push.csv"), "push.vft"),
    (("report", "sub/push.tar.csv.gz"), "push.tar.vft"),
    (("report", "push.bag"), "push.vft"),
    (("report", "run_1.5"), "run_1.5.vft"),
    (("report", "bag.d"), "bag.d.vft"),
    (("report", "push.h5", "--episode", "3"), "push-3.vft"),
    (("report", "push.csv", "--episode", "2", "--arm", "left"), "push-2-left.vft"),
    (("report", "a.csv", "b.csv"), "report.vft"),
    (("reproduce", "huang2025"), "huang2025.vft"),
])  # fmt: skip
def test_the_folder_s_name_and_nothing_is_read_before_it_is_refused(refused, here, words, folder):
    (here / "bag.d").mkdir()
    (here / folder).mkdir()
    (here / folder / "run.json").touch()
    assert refused(*words).startswith(f"error: {Path(folder) / 'run.json'} exists; ")


def test_what_is_found_of_an_arm_has_its_name(refused, here: Path) -> None:
    robot = here / "my arm.toml"
    robot.write_text(PROFILES["ur5"].read_text("utf-8").replace('"ur5"', '"a/b c"', 1), "utf-8")
    Path("my_a_b_c.toml").touch()
    words = ("identify", TAPS, "--robot", robot, "--method", "gains")
    assert refused(*words).startswith("error: my_a_b_c.toml exists; ")


# No command writes over what it reads, with --force or without, under whatever name.

SIMULATE = ("simulate", "ur5-circle", "--as", "rosbag2", "--set", "duration=1", "-o", "bag")


@pytest.fixture
def there(here: Path) -> Path:
    """A working folder with a log, its names, a robot, a scenario and a table called as ours."""
    for name in ("log.csv", "log", "estimates.parquet", "recording.rrd"):
        shutil.copy(CIRCLE, here / name)
    (here / "link.csv").symlink_to("log.csv")
    os.link(here / "log.csv", here / "hard.csv")
    shutil.copy(PROFILES["ur5"], here / "arm.toml")
    shutil.copy(FOLDER / "ur5-circle.toml", here / "scene.toml")
    return here


@pytest.mark.parametrize("words", [
    "convert log.csv -o log.csv",
    "convert log.csv -o link.csv",
    "convert log.csv -o hard.csv",
    "convert link.csv -o ./log.csv",
    "estimate estimates.parquet --robot ur5 -o .",
    "estimate log.csv --free recording.rrd --robot ur5 --rrd -o .",
    "report log.csv --robot ur5 --reference file:estimates.parquet -o .",
    "identify log.csv --robot arm.toml -o arm.toml",
    "identify log.csv --method gains --robot arm.toml -o arm.toml",
    "identify log.csv --method gains --robot ur5 --free log -o log",
    "simulate scene.toml -o scene.toml",
])  # fmt: skip
def test_no_input_is_ever_overwritten(refused, there: Path, words: str) -> None:
    before = {path: path.read_bytes() for path in there.iterdir()}
    assert "what this command reads" in refused(*words.split(), "--force")
    assert {path: path.read_bytes() for path in there.iterdir()} == before


def test_a_folder_given_as_log_keeps_its_files(run, refused, here: Path) -> None:
    """A bag's folder: a file in it is refused as output, a new name beside it is not."""
    assert run(*SIMULATE)[0] == 0
    data = next((here / "bag").glob("*.mcap"))
    before = data.read_bytes()
    (here / "bag.csv").symlink_to(data)
    assert "what this command reads" in refused("convert", "bag", "-o", "bag.csv", "--force")
    assert data.read_bytes() == before
    assert run("convert", "bag", "-o", "bag/flat.csv")[0] == 0


# Logs of one file name: every command tells them apart, and refuses copies of one run.

ROWS = {"a": 1501, "b": 1001}
"""Lines kept of the fixture, header included: two different runs."""


@pytest.fixture
def pair(tmp_path: Path) -> list[Path]:
    """`a/log.csv` and `b/log.csv`, two logs with one file name."""
    paths = [tmp_path / name / "log.csv" for name in ROWS]
    for path, rows in zip(paths, ROWS.values(), strict=True):
        path.parent.mkdir()
        with CIRCLE.open(encoding="utf-8") as file:
            path.write_text("".join(islice(file, rows)), encoding="utf-8")
    return paths


def test_a_table_has_the_rows_of_both_logs(run, ran, pair: list[Path], monkeypatch) -> None:
    words = ("--robot", "ur5", "--reference", f"file:{CIRCLE}.truth.parquet", "--json")
    out = ran("compare", *pair, *words)[0]
    samples = {row["recording"]: row["samples"] for row in json.loads(out)["rows"]}
    assert samples["a/log.csv"] == ROWS["a"] - 1
    assert samples["b/log.csv"] == ROWS["b"] - 1
    assert samples.keys() == {"a/log.csv", "b/log.csv", "pooled"}
    monkeypatch.setattr("vftcli.outputs.screen.MOST_LINES", 20)
    first, *_, each, _ = run("compare", *pair, *words[:-1])[1].splitlines()
    assert first.startswith("pooled against file:")
    assert each == "Each log by itself: --details"


@pytest.mark.slow
def test_an_identified_robot_has_one_rms_a_joint_and_log(ran, pair: list[Path], here) -> None:
    ran("identify", *pair, "--robot", "ur5", "-o", "robot.toml")
    robot = tomllib.loads((here / "robot.toml").read_text(encoding="utf-8"))
    sets = robot["identification"]["residuals"]
    assert [one["log"] for one in sets] == ["a/log.csv", "b/log.csv"]
    assert all(len(one["rms_Nm"]) == 6 for one in sets)


@pytest.mark.slow
def test_a_payload_pair_of_equal_names_is_scored_on_the_log_without_load(run, ran, here) -> None:
    """The loaded log of a pair is the heavier one, whatever the files are called."""
    assert run("simulate", "payload-pair", "-o", "log.csv", "--seed", 1)[0] == 0
    for name, ending in (("a", "csv"), ("b", "free.csv")):
        (here / name).mkdir()
        (here / f"log.{ending}").rename(here / name / "log.csv")
    words = ("--robot", "ur5", "--method", "payload", "--json", "-o", "robot.toml")
    record = json.loads(ran("identify", "a/log.csv", "b/log.csv", *words)[0])
    assert {row["log"] for row in record["residuals"]} == {"b/log.csv"}
    found = {row["parameter"] for row in record["parameters"]}
    assert found == {"mass", "com_x", "com_y", "com_z"}


def test_a_copy_of_the_log_is_no_motion_without_the_load(refused, pair: list[Path], here) -> None:
    copy = shutil.copy(pair[0], "copy.csv")
    words = ("--robot", "ur5", "--method", "payload", "-o", "r.toml", "--free", copy)
    assert "are one run" in refused("identify", pair[0], *words)
    assert {path.name for path in here.iterdir()} == {"a", "b", "copy.csv"}


# --episode and --arm on the command line: what is taken of several is said, by every command.

SAID = "ur5.arrow episode 0: episode 0, of 2 in all: --episode K|all"


@pytest.fixture(scope="module")
def episodes(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two episodes of a UR5 in one Arrow file: two spans of six seconds of the fixture."""
    log = read(CIRCLE)
    rows = slice(0, 1500)  # at 125 Hz
    held = {name: log.require(name)[rows].tolist() for name in ("q", "dq", "current")}
    held |= {"t": np.tile(log.t[:750], 2), "episode_index": np.repeat([0, 1], 750)}
    path = tmp_path_factory.mktemp("episodes") / "ur5.arrow"
    table = pa.table(held)
    with path.open("wb") as file, pa.ipc.new_file(file, table.schema) as writer:
        writer.write_table(table)
    return path


def test_the_first_is_said_on_the_terminal_and_in_the_record(run, episodes: Path, here) -> None:
    words = ("--robot", "ur5", "--observer", "gmo", "-o", "out", "--anyway")
    code, _, err = run("estimate", episodes, *words)
    assert (code, err.count(SAID)) == (0, 1)
    record = json.loads((here / "out" / "run.json").read_text("utf-8"))
    assert "episode-chosen" in {reported["code"] for reported in record["warnings"]}
    code, _, err = run("contacts", episodes, "--robot", "ur5", "--anyway")
    assert (code, SAID in err) == (0, True)
    code, _, err = run("convert", episodes, "-o", "x.csv")
    assert (code, "episode 0, of 2 in all: --episode K|all" in err) == (0, True)


def test_all_are_logs_of_their_own(run, episodes: Path) -> None:
    words = ("--robot", "ur5", "--episode", "all", "--anyway", "--json")
    code, out, err = run("contacts", episodes, *words)
    assert (code, "--episode K" in err) == (0, False)
    names = [each["recording"] for each in json.loads(out)["logs"]]
    assert names == ["ur5.arrow episode 0", "ur5.arrow episode 1"]


# One envelope for machines: how every command's JSON, `run.json`, `contacts.json` begin.

SHORT = ("--robot", "ur5", "--interval", "0:4")
GMO = (*SHORT, "--observer", "gmo")
RATE = ("--robot", "panda", "--rate", 60, "--anyway")
QUICK = ("--set", "bench.samples=2000", "--set", "bench.rounds=1")


#: Command → keys of its result.
RESULTS: dict[tuple[object, ...], str] = {
    ("inspect", TAPS): "format joints samples duration_s rate_hz max_gap_s duplicates findings "
    "robots",
    ("contacts", TAPS, *SHORT): "frame sign free_part smallest_force_N contacts candidates",
    ("estimate", TAPS, *GMO, "-o", "out"): "examination robot observers conventions",
    ("report", TAPS, *GMO, "-o", "out"): "examination robot observers reference contacts",
    ("compare", TAPS, *GMO, "--reference", "zero"): "rows",
    ("thresholds", BEARING, *RATE): "rate_per_h joints axes calls",
    ("identify", CIRCLE, *SHORT, "-o", "out.toml"): "method residuals parameters",
    ("convert", TAPS, "-o", "out.csv"): "output format samples signals",
    ("admit", CIRCLE, *SHORT): "rows",
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
def test_every_command_has_the_envelope(words: tuple[object, ...], ran, here: Path) -> None:
    out = ran(*words, "--json")[0]
    record = json.loads(out)
    checked(record)
    assert len(record["logs"]) == (isinstance(words[1], Path))
    assert set(RESULTS[words].split()) <= set(record)
    for name in ("run.json", "contacts.json"):
        if (written := here / "out" / name).exists():
            checked(json.loads(written.read_text("utf-8")))


@pytest.mark.slow
def test_several_logs_have_an_entry_each_with_what_was_found(ran, tmp_path: Path) -> None:
    written = ("--observer", "gmo", "-o", tmp_path / "out")
    for name, key, *options in (
        ("contacts", "contacts", *SHORT),
        ("inspect", "findings"),
        ("report", "contacts", *SHORT, *written),
    ):
        out = ran(name, TAPS, CIRCLE, *options, "--json")[0]
        record = json.loads(out)
        assert [log["recording"] for log in record["logs"]] == [TAPS.name, CIRCLE.name]
        assert all(key in log for log in record["logs"])
        assert key not in record
    summary = json.loads((tmp_path / "out" / "run.json").read_text("utf-8"))
    assert [log["folder"] for log in summary["logs"]] == [TAPS.stem, CIRCLE.stem]
