"""What `vftcli inspect -o` writes runs: commands beside it give the numbers of typed options."""

import json
import shutil
import tomllib
from pathlib import Path

import pytest

from vftcli.cli.config import NAME
from vftcli.cli.inspect import from_folder
from vftcli.proposal import ProposedOption

FIXTURES = Path(__file__).parents[2] / "fixtures"


def options(folder: Path) -> dict[str, object]:
    """What is taken; a group of settings that are only there to be taken is empty."""
    found = tomllib.loads((folder / NAME).read_text("utf-8"))
    return {key: value for key, value in found.items() if value != {}}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("log", "given", "expected"),
    [
        ("ur5_circle.csv", ("--robot", "ur5"), {"robot": "ur5", "reference": "two-cycle"}),
        ("ur5_sensor.parquet", (), {"robot": "ur5", "reference": "sensor"}),
        ("panda_bag", ("--robot", "panda"), {"robot": "panda", "reference": "sensor"}),
    ],
)
def test_what_is_written_gives_the_numbers_of_typed_options(
    run, here: Path, log: str, given: tuple[str, ...], expected: dict[str, str]
) -> None:
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
        '# format = "ur-csv"': "# ur5_circle.csv is recognised by its content; a file that is not",
        '# effort = "current"': "# as the log calls it; the robot's model explains no other",
    }
    assert [option for option, why in reasons.items() if why.startswith("# ")] == [*expected]
    assert all(reasons[option].startswith(why) for option, why in expected.items())


def test_an_arm_is_looked_for_where_it_is_named_or_tells_what_an_effort_is(run) -> None:
    words = ("inspect", FIXTURES / "ur5_circle.csv")
    assert "robot guessed" not in run(*words)[2]
    assert "note: robot guessed: ur5" in run(*words, "--set", "log.effort=auto")[2]
    assert "note: torque_constant: " in run(*words, "--robot", "ur5")[2]  # of its profile


@pytest.mark.slow
def test_a_second_log_is_offered_as_free_motion(run, here: Path, logs: Path) -> None:
    """The load's own log, the same motion without the load, and a pose that hands push."""
    for name in ("load_14harm.csv", "free_14harm.csv", "push_pose.csv"):
        shutil.copy(logs / "ur10e" / name, here)
    named = ("load_14harm.csv", "free_14harm.csv", "push_pose.csv")
    code, out, err = run("inspect", *named, "--robot", "ur10e", "--json", "-o", NAME)
    assert code == 0
    found = {
        "robot": "ur10e",
        "columns": "t,q:6,dq:6,current:6,target_current:6,target_torque:6",
        "free": ["free_14harm.csv"],
        "reference": "two-cycle",
    }
    assert options(here) == found == json.loads(out)["options"]
    assert '# free = ["push_pose.csv"]' in (here / NAME).read_text("utf-8")
    asked = ("load_14harm.csv", "--observer", "gmo", "--set", "contacts.list=no")
    assert run("report", *asked, "-o", "kept")[0] == 0
    typed = ["--robot", "ur10e", "--columns", found["columns"], "--free", "free_14harm.csv"]
    (here / NAME).unlink()
    assert run("report", *asked, "-o", "typed", *typed, "--reference", "two-cycle")[0] == 0
    for file in ("errors.csv", "estimates.parquet"):
        assert (here / "kept" / file).read_bytes() == (here / "typed" / file).read_bytes()
    assert "note: vftcli.toml" not in err


def test_an_effort_that_is_not_what_it_is_called_is_written(
    run, here: Path, samples: Path
) -> None:
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
