"""Commands as a user types them: what they print and write, one line for what is wrong."""

import csv
import io
import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from example_logs import BEARING, CIRCLE, EPISODES, TAPS
from typer.testing import CliRunner

from vftcli.cli import make_app
from vftcli.cli.contacts import settled_reference
from vftcli.outputs.conversion import convert
from vftcli.robots import load_robot
from vftcli.signals.recording import Recording
from vftcli.signals.wrench import WrenchFrame

# `vftcli admit`: what scripts rely on, the files it writes, one line for what is wrong.

PANDA = ("admit", BEARING, "--robot", "panda")
RELEASE = ("admit", "--release", "x=0.3", "--robot", "ur5")


def test_release_rows(run) -> None:
    words = ("--alpha", "1,1.3,1.6,1.9", "--set", "admittance.xi=1", "--json")
    code, out, err = run(*RELEASE, *words)
    rows = json.loads(out)["rows"]
    assert (code, err) == (0, "")
    assert [row["alpha"] for row in rows] == [None, 1.0, 1.3, 1.6, 1.9]
    assert [row["controller"] for row in rows] == ["traditional"] + ["variable"] * 4
    # science of the issue, 3 %
    times = [row["return_2_s"] for row in rows]
    assert times == pytest.approx([4.84, 3.14, 2.30, 1.74, 1.35], rel=0.03)
    assert {row["xi"] for row in rows[1:]} == {1.0}
    # Without a choice both controllers, with the profile's values.
    turned = run("admit", "--release", "rx=0.2", "--robot", "panda", "--json")[1]
    rows = json.loads(turned)["rows"]
    assert [row["controller"] for row in rows] == ["traditional", "variable"]
    assert [row["alpha"] for row in rows] == [None, 3.0]


@pytest.mark.slow
def test_log_becomes_a_folder(run, ran, refused, tmp_path: Path) -> None:
    folder = tmp_path / "out"
    out, err = ran(*PANDA, "-o", folder)
    assert "kfo-fe through pinv(Jᵀ)" in err
    assert re.search(r"variable\s+6", out)
    _, _, err = run(*PANDA, "--observer", "best")
    assert "best, smoothed over the whole log, force on the robot" in err
    files = {"index.html", "motion.parquet", "comparison.csv", "comparison.json", "run.json"}
    assert {p.name for p in folder.iterdir()} == files
    page = (folder / "index.html").read_text("utf-8")
    assert not re.findall(r"(?:src|href)=[\"']?(?:https?:)?//", page)  # opens offline
    record = json.loads((folder / "run.json").read_text("utf-8"))
    assert record["parameters"]["threshold"] == [4, 4, 15, 2, 2, 2]
    printed = json.loads(run(*PANDA, "-o", folder, "--force", "--json")[1])
    record = json.loads((folder / "run.json").read_text("utf-8"))
    assert record == printed | {"files": record["files"]}
    assert len(record["input"]["sha256"]) == 64
    motion = pl.read_parquet(folder / "motion.parquet")
    assert {"t", "force/fx", "x/traditional/x", "q/traditional/7"} <= set(motion.columns)
    assert "exists; give another -o, or --force" in refused(*PANDA, "-o", folder)


@pytest.mark.slow
def test_estimates_and_truth_are_forces_too(run, tmp_path: Path) -> None:
    assert run("estimate", *PANDA[1:], "-q", "-o", tmp_path)[0] == 0
    estimates = ("admit", tmp_path / "estimates.parquet", "--robot", "panda")

    def rows(*words: object) -> list[dict[str, object]]:
        return json.loads(run(*words, "--json")[1])["rows"]

    for one, other in zip(rows(*PANDA), rows(*estimates), strict=True):
        assert one["peak"] == pytest.approx(other["peak"], abs=1e-9)  # the same torques, stored
    truth = rows(*PANDA, "--set", f"admittance.force=file:{BEARING}.truth.parquet")
    peaks = {row["axis"]: row["peak"] for row in truth if row["controller"] == "variable"}
    assert peaks["x"] > 0.05  # the guiding hand pulls along +x with 7 N


# `vftcli annotate` as a user types it.


@pytest.mark.slow
def test_it_says_what_was_written(run, ran, tmp_path: Path) -> None:
    words = ("annotate", EPISODES, "-o", tmp_path / "copy", "--add", "wrench,contact")
    err = ran(*words)[1]
    assert "3 episodes (3 done), 540 frames, panda, kfo-zoh, causal" in err
    assert "wrench: N, N·m, flange axes" in err
    assert "contact: 1 in a contact of the list, else 0" in err
    assert "the observer settles in the first 4 frames" in err
    again = run(*words, "--force", "--json", "--observer", "kfo-rts")
    assert json.loads(again[1])["causal"] is False


def test_a_load_is_sought_in_all_episodes_and_too_few_poses_are_refused(refused, tmp_path):
    error = refused("identify", EPISODES, "--method", "payload", "-o", tmp_path / "robot.toml")
    assert "panda_episodes episode 0, panda_episodes episode 1, panda_episodes episode 2" in error
    assert "the arm passes 2 different poses, and a load needs 4 at least" in error


@pytest.mark.parametrize(("words", "said"), [
    (("-o", EPISODES / "copy"), "one inside the other"),
    (("-o", "c", "--add", "sd,force"), "--add force; there is wrench, sd,"),
    (("-o", "c", "--robot", "ur5"), "Choose this log's arm with --robot"),
])  # fmt: skip
def test_refusals_are_one_line(refused, here: Path, words: tuple[object, ...], said: str) -> None:
    assert said in refused("annotate", EPISODES, *words)
    assert not any(here.iterdir())


# `vftcli contacts` at the command line.


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


def test_a_reference_is_one_more_line(run) -> None:
    code, out, _ = run("contacts", CIRCLE, "--robot", "ur5", "--reference", "two-cycle")
    assert (code, "no reference" in out) == (0, False)
    assert "Against two-cycle without J5 (own error " in out


def test_an_estimate_s_record_has_the_list_of_contacts(run, tmp_path: Path) -> None:
    words = ("--robot", "ur5", "--free", "0.3:4")
    assert run("estimate", TAPS, *words, "-q", "-o", tmp_path)[0] == 0
    record = json.loads((tmp_path / "run.json").read_text("utf-8"))
    fresh = json.loads(run("contacts", TAPS, *words, "--json")[1])
    assert record["contacts"]["contacts"] == fresh["contacts"]


# `vftcli identify` at the command line.


@pytest.fixture(scope="module")
def excitation(tmp_path_factory):
    path = tmp_path_factory.mktemp("logs") / "free.csv"
    words = ["simulate", "free-excitation", "-o", str(path), "--seed", "1"]
    result = CliRunner().invoke(make_app(), words)
    assert result.exit_code == 0, result.output
    return path


@pytest.mark.slow
def test_a_log_becomes_a_robot_that_estimate_uses(run, ran, excitation, here: Path) -> None:
    words = ("--robot", "ur5", "--method", "base", "-o", "my_robot.toml")
    out = ran("identify", excitation, *words)[0]
    assert "identified" in out
    written = {path.name for path in here.iterdir()}
    assert written >= {"my_robot.toml", "my_robot.html", "my_robot.run.json"}
    assert load_robot("my_robot.toml").document["identification"]["base_parameters"]
    assert run("estimate", excitation, "--robot", "my_robot.toml", "-o", "out")[0] == 0
    assert Path("out/estimates.parquet").is_file()


@pytest.mark.slow
@pytest.mark.usefixtures("here")
def test_a_fit_says_without_being_asked_that_something_touched_the_arm(ran) -> None:
    words = ("--robot", "ur5", "--method", "friction", "-o", "r.toml")
    err = ran("identify", CIRCLE, *words)[1]
    (said,) = [line for line in err.splitlines() if "suspected contacts" in line]
    assert said.endswith("are left out of the fit")
    assert "presliding" not in err  # a fact: with --details


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


# inspect and convert at the command line.


@pytest.fixture
def table(tmp_path: Path) -> Path:
    t = 0.01 * np.arange(400)
    rows = [f"{a:.2f},{np.sin(a):.9f},{np.cos(a):.9f},{3 * np.cos(a):.9f}" for a in t]
    path = tmp_path / "log.csv"
    path.write_text("\n".join(["t,q1,dq1,tau1", *rows, rows[-1], ""]))
    return path


def test_inspect_in_words_and_strict_fails_on_warnings(run, table: Path) -> None:
    code, out, _ = run("inspect", table)
    assert code == 0
    assert "400 of 401 rows" in out
    assert "no-profile" in out
    reported = json.loads(run("inspect", table, "--json")[1])
    assert (reported["format"], reported["duplicates"]) == ("table", 1)
    assert reported["warnings"]
    for logs, said in (([table], "1 warning"), ([table] * 2, "2 warnings")):
        code, _, err = run("inspect", *logs, "--strict")
        assert (code, err) == (1, f"{said} (--strict)\n")


@pytest.mark.slow
def test_several_logs_that_fill_the_screen_have_a_line_each(run) -> None:
    robot = ("--robot", "ur5")
    code, out, err = run("inspect", *[CIRCLE, BEARING] * 3, *robot)
    assert code == 3
    assert err.count("panda_bearing.csv left out: the log has 7 joints") == 3
    assert len(out.splitlines()) <= 40
    assert out.count("ur5_circle.csv") >= 3
    code, out, _ = run("inspect", *[CIRCLE] * 4, *robot)
    assert (code, out.splitlines()[-1]) == (0, "Each log by itself: --details")
    assert out.count("ur5_circle.csv: log health: sound") == 4
    assert run("inspect", *[CIRCLE] * 4, *robot, "--details")[1].count("longest step") == 4


def test_names_with_control_characters_are_shown_harmlessly(ran, tmp_path: Path) -> None:
    names = ("\x1b[31mred", "two\nlines", "<b>three</b>")
    log = Recording(t=0.1 * np.arange(5), q=np.zeros((5, 3)), joint_names=names)
    convert(log, tmp_path / "x.parquet")
    out = ran("inspect", tmp_path / "x.parquet")[0]
    assert "\x1b" not in out
    assert r"two\nlines" in out


@pytest.mark.parametrize("ending", ["parquet", "csv", "mcap"])
def test_convert(run, refused, table: Path, tmp_path: Path, ending: str) -> None:
    out = tmp_path / f"x.{ending}"
    assert run("convert", table, "-o", out)[0] == 0
    assert json.loads(run("inspect", out, "--json")[1])["samples"] == 400
    assert "--force" in refused("convert", table, "-o", out)


# `vftcli thresholds` as it is called: what it prints, its JSON, its errors in one line.

COLUMNS = ("--robot", "fr3", "--columns", "t,q:7,dq:7,tau_ext:7")


@pytest.fixture(scope="module")
def free(tmp_path_factory) -> Path:
    """A minute of an FR3 that circles with its first joint; its estimates are noise of .2 N·m."""
    rng, t = np.random.default_rng(7), np.arange(0.0, 60.0, 0.02)
    q = np.tile([0.0, -0.8, 0.0, -2.4, 0.0, 1.6, 0.8], (len(t), 1))
    dq = np.zeros(q.shape)
    q[:, 0], dq[:, 0] = 0.3 * np.sin(t), 0.3 * np.cos(t)
    path = tmp_path_factory.mktemp("logs") / "free.npy"
    np.save(path, np.column_stack([t, q, dq, rng.normal(0.0, 0.2, q.shape)]))
    return path


@pytest.fixture(scope="module")
def pushed(free: Path) -> Path:
    """The same with 5 N·m on J2 from 20 to 21 s."""
    table = np.load(free)
    table[(table[:, 0] >= 20.0) & (table[:, 0] <= 21.0), 16] += 5.0
    path = free.with_name("pushed.npy")
    np.save(path, table)
    return path


def test_the_tables_and_the_calls_of_a_franka(free: Path, pushed: Path, ran) -> None:
    out, err = ran("thresholds", free, *COLUMNS, "--rate", 60, "--check", pushed)
    assert "contact 60 × an hour" in out
    assert "robot.set_collision_behavior(" in out
    assert "collision_config:" in out
    assert "pushed.npy: 1 alarm, the weakest at" in out
    assert "thresholds are extrapolated" in err
    # The JSON stands alone, and the push is found.
    words = ("--rate", 60, "--check", pushed, "--check", free, "--json")
    record = json.loads(ran("thresholds", free, *COLUMNS, *words)[0])
    assert record["rate_per_h"] == 60.0
    # Noise of .2 N·m has its largest of 3000 at 3.4 sd; the tail reaches further by some e-folds.
    assert all(0.6 < row["threshold_Nm"] < 1.6 for row in record["joints"])
    check, other = record["checks"]
    (contact,) = check["contacts"]
    assert (contact["start_s"], contact["by"]) == (pytest.approx(20.0, abs=0.03), "J2")
    assert (check["reference"], other["log"], other["contacts"]) == (None, "free.npy", [])


def test_the_robots_own_estimate_may_be_the_reference(free: Path, pushed: Path, ran) -> None:
    """Beyond 3.4 sd of noise everything is a contact of that reference; the push is among them."""
    words = ("--rate", 60, "--check", pushed, "--reference", "vendor", "--json")
    (check,) = json.loads(ran("thresholds", free, *COLUMNS, *words)[0])["checks"]
    assert check["reference"] == "vendor"
    assert [c["by"] for c in check["contacts"] if c["by"]] == ["J2"]
    assert check["smallest_detected_N"] is None


@pytest.mark.slow
def test_a_simulated_log_is_checked_against_the_truth_beside_it(ran, refused) -> None:
    words = ("--robot", "panda", "--rate", 60, "--anyway")
    error = refused("thresholds", BEARING, "--robot", "panda")
    assert "looks touched: 2" in error  # by 20 N and more
    assert "take it all with --anyway" in error
    out, err = ran("thresholds", BEARING, *words, "--check", BEARING)
    assert "of 3 contacts detected" in out
    assert "contacts are those of the reference file:panda_bearing.csv.truth.parquet" in err
    # It is no free log: J2 bears the load for half of it.
    assert "looks touched" in err


def test_a_simulated_log_is_a_table_where_its_name_says_so(ran, tmp_path) -> None:
    out, _ = ran(
        "simulate",
        "panda-bearing",
        "--set",
        "duration=2",
        "-o",
        tmp_path / "log.parquet",
        "--json",
    )
    assert json.loads(out)["format"] == "parquet"
    assert (tmp_path / "log.parquet").read_bytes().startswith(b"PAR1")


FREE = "free_10harm.csv.gz free_12harm.csv free_12harm_40s.csv.gz free_14harm.csv jointwise_2.csv"
REPEATS = "jointwise_4.csv free_repeat_a.csv free_repeat_b.csv free_repeat_c.csv"
UR10E = ("--robot", "ur10e", "--columns", "t,q:6,dq:6,current:6,target_current:6,target_torque:6")


FREE_LOGS = {f"ur10e/{name}": UR10E for name in (*FREE.split(), *REPEATS.split())}
FREE_LOGS["salerno_ur10/ur10_exciting.db3"] = ("--robot", "ur10", "--columns=tau=effort")
FREE_LOGS["ur3/identification.bag"] = ("--robot", "ur3", "--columns=-tau")


@pytest.mark.parametrize("name", FREE_LOGS)
def test_real_free_logs_are_accepted(name: str, logs: Path, ran) -> None:
    out, err = ran("thresholds", logs / name, *FREE_LOGS[name], "--json")
    assert "looks touched" not in err
    # what is printed as a threshold of the wrench is no wider than it is high
    record = json.loads(out)
    for row in (*record["axes"], record["force"] or {"threshold_N": None}):
        unit = "N" if "threshold_N" in row else "Nm"
        if (level := row[f"threshold_{unit}"]) is not None:
            low, high = row[f"interval_{unit}"]
            assert high - low <= level


@pytest.mark.parametrize("name", ["ur10e/push_pose.csv", "ur10e_planted/planted_12harm.csv.gz"])
def test_real_pushes_are_refused(name: str, logs: Path, refused) -> None:
    assert "looks touched" in refused("thresholds", logs / name, *UR10E)


def test_a_sensor_in_the_log_says_where_it_is_touched() -> None:
    still, of_sensor = np.zeros((3, 6)), WrenchFrame("sensor", "sensor")
    log = Recording(t=np.arange(3.0), q=still, wrench=still + 1.0)
    for frame in (None, of_sensor):
        assert settled_reference(replace(log, wrench_frame=frame)).name == "sensor"
    assert settled_reference(replace(log, wrench_frame=WrenchFrame("base", "flange"))) is None
    for wrench in (still, None):
        assert settled_reference(replace(log, wrench=wrench)) is None


@pytest.mark.parametrize(("words", "said"), [
    (("--rate", "0"), "--rate 0 is not a positive number"),
    (("--rate", "1e6"), "at most 1800"),
    (("--interval", "0:6"), "record at least 27 s"),
    (("--check", "none.npy"), "none.npy"),
    (("--check", "pushed.npy", "--reference", "nobody"), "no reference 'nobody'"),
    (("--reference", "sensor"), "name that with --check LOG"),
])  # fmt: skip
def test_an_error_is_one_line(words: tuple[str, ...], said: str, free: Path, pushed, refused):
    given = [pushed if word == "pushed.npy" else word for word in words]
    assert said in refused("thresholds", free, *COLUMNS, *given)
