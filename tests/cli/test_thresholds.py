"""`vftcli thresholds` as it is called: what it prints, its JSON, its errors in one line."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from vftcli.cli.thresholds import settled_reference
from vftcli.signals.recording import Recording
from vftcli.signals.wrench import WrenchFrame

FIXTURES = Path(__file__).parents[2] / "fixtures"
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


def test_the_tables_and_the_calls_of_a_franka(free: Path, pushed: Path, run) -> None:
    code, out, err = run("thresholds", free, *COLUMNS, "--rate", 60, "--check", pushed)
    assert code == 0, err
    assert "contact 60 × an hour" in out
    assert "robot.set_collision_behavior(" in out
    assert "collision_config:" in out
    assert "pushed.npy: 1 alarm, the weakest at" in out
    assert "these are extrapolated" in err
    # The JSON stands alone, and the push is found.
    words = ("--rate", 60, "--check", pushed, "--check", free, "--json")
    code, out, _ = run("thresholds", free, *COLUMNS, *words)
    assert code == 0
    record = json.loads(out)
    assert record["rate_per_h"] == 60.0
    # Noise of .2 N·m has its largest of 3000 at 3.4 sd; the tail reaches further by some e-folds.
    assert all(0.6 < row["threshold_Nm"] < 1.6 for row in record["joints"])
    check, other = record["checks"]
    (contact,) = check["contacts"]
    assert (contact["start_s"], contact["by"]) == (pytest.approx(20.0, abs=0.03), "J2")
    assert (check["reference"], other["log"], other["contacts"]) == (None, "free.npy", [])


def test_the_robots_own_estimate_may_be_the_reference(free: Path, pushed: Path, run) -> None:
    """Beyond 3.4 sd of noise everything is a contact of that reference; the push is among them."""
    words = ("--rate", 60, "--check", pushed, "--reference", "vendor", "--json")
    code, out, err = run("thresholds", free, *COLUMNS, *words)
    assert code == 0, err
    (check,) = json.loads(out)["checks"]
    assert check["reference"] == "vendor"
    assert [c["by"] for c in check["contacts"] if c["by"]] == ["J2"]
    assert check["smallest_detected_N"] is None


def test_two_free_logs_are_counted_against_each_other(free: Path, pushed: Path, run) -> None:
    code, out, err = run("thresholds", free, pushed, *COLUMNS, "--rate", 60, "--json")
    assert code == 0, err
    counted = {row["log"]: row for row in json.loads(out)["left_out"]}
    assert counted["pushed.npy"]["joints"][1] >= 1
    assert counted["free.npy"]["joints"][1] == 0


def test_a_simulated_log_is_checked_against_the_truth_beside_it(run, refused) -> None:
    log = FIXTURES / "panda_bearing.csv"
    words = ("--robot", "panda", "--rate", 60, "--anyway")
    error = refused("thresholds", log, "--robot", "panda")
    assert "J2 reads" in error
    assert "take it all with --anyway" in error
    code, out, err = run("thresholds", log, *words, "--check", log)
    assert code == 0, err
    assert "of 3 contacts detected" in out
    assert "contacts are those of the reference file:panda_bearing.csv.truth.parquet" in err
    # It is no free log: J2 bears the load for half of it.
    assert "looks touched" in err


FREE = "free_10harm.csv.gz free_12harm.csv free_12harm_40s.csv.gz free_14harm.csv jointwise_2.csv"
REPEATS = "jointwise_4.csv free_repeat_a.csv free_repeat_b.csv free_repeat_c.csv"
UR10E = ("--robot", "ur10e", "--columns", "t,q:6,dq:6,current:6,target_current:6,target_torque:6")


@pytest.mark.parametrize("name", [*FREE.split(), *REPEATS.split()])
def test_real_free_logs_are_accepted(name: str, logs: Path, run) -> None:
    code, out, err = run("thresholds", logs / "ur10e" / name, *UR10E, "--json")
    assert code == 0, err
    assert "looks touched" not in err
    # what is printed as a threshold of the wrench is no wider than it is high
    record = json.loads(out)
    for row in (*record["axes"], *([record["force"]] if record["force"] else [])):
        unit = "N" if "threshold_N" in row else "Nm"
        low, high = row[f"interval_{unit}"]
        level = row[f"threshold_{unit}"]
        assert level is None or high - low <= level


@pytest.mark.parametrize("name", ["salerno_ur10/ur10_exciting.db3", "ur3/identification.bag"])
def test_free_logs_of_other_arms_are_accepted(name: str, logs: Path, run) -> None:
    arm = ("ur3", "-tau") if name.startswith("ur3") else ("ur10", "tau=effort")
    words = ("--robot", arm[0], f"--columns={arm[1]}", "--json")
    code, _, err = run("thresholds", logs / name, *words)
    assert code == 0, err


@pytest.mark.parametrize("name", ["ur10e/push_pose.csv", "ur10e_planted/planted_12harm.csv.gz"])
def test_real_pushes_are_refused(name: str, logs: Path, refused) -> None:
    assert "looks touched" in refused("thresholds", logs / name, *UR10E)


@pytest.mark.parametrize(
    ("frame", "reference"),
    [
        (None, "sensor"),
        (WrenchFrame("sensor", "sensor"), "sensor"),
        (WrenchFrame("base", "flange"), None),
    ],
)
def test_a_sensor_in_the_log_says_where_it_is_touched(frame, reference: str | None) -> None:
    still = np.zeros((3, 6))
    log = Recording(t=np.arange(3.0), q=still, wrench_frame=frame, wrench=still + 1.0)
    found = settled_reference(log)
    assert (found.name if found else None) == reference
    assert settled_reference(replace(log, wrench=still)) is None
    assert settled_reference(replace(log, wrench=None)) is None


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--rate", "0"), "--rate 0 is not a positive number"),
        (("--rate", "1e6"), "at most 1800"),
        (("--interval", "0:6"), "record at least 27 s"),
        (("--check", "none.npy"), "none.npy"),
        (("--check", "pushed.npy", "--reference", "nobody"), "no reference 'nobody'"),
        (("--reference", "sensor"), "name that with --check LOG"),
    ],
)
def test_an_error_is_one_line(words: tuple[str, ...], said: str, free: Path, pushed, refused):
    given = [pushed if word == "pushed.npy" else word for word in words]
    assert said in refused("thresholds", free, *COLUMNS, *given)
