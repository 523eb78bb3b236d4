"""`vftcli admit`: what scripts rely on, the files it writes, one line for what is wrong."""

import json
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from vftcli.cli import main

FIXTURE = Path(__file__).parent.parent.parent / "fixtures" / "panda_bearing.csv"
FILES = {"index.html", "motion.parquet", "comparison.csv", "comparison.json"}

Run = Callable[..., tuple[int, str, str]]


@pytest.fixture
def admit(run: Run) -> Run:
    """Run `vftcli admit` as installed; return its exit code, stdout and stderr."""
    return lambda *words: run("admit", *words)


def test_release_rows(admit: Run) -> None:
    code, out, err = admit(
        "--release",
        "x=0.3",
        "--robot",
        "ur5",
        "--alpha",
        "1,1.3,1.6,1.9",
        "--set",
        "admittance.xi=1",
        "--json",
    )
    rows = json.loads(out)["rows"]
    assert (code, err) == (0, "")
    assert [row["alpha"] for row in rows] == [None, 1.0, 1.3, 1.6, 1.9]
    assert [row["controller"] for row in rows] == ["traditional"] + ["variable"] * 4
    needed = {"controller", "alpha", "xi", "axis", "peak", "time_to_peak_s", "overshoot"}
    assert needed | {"return_10_s", "return_2_s"} <= set(rows[0])
    # science of the issue, 3 %
    times = [row["return_2_s"] for row in rows]
    np.testing.assert_allclose(times, [4.84, 3.14, 2.30, 1.74, 1.35], rtol=0.03)
    assert {row["xi"] for row in rows[1:]} == {1.0}


def test_default_is_both_controllers_with_the_profile_s_values(admit: Run) -> None:
    rows = json.loads(admit("--release", "rx=0.2", "--robot", "panda", "--json")[1])["rows"]
    assert [(row["controller"], row["alpha"]) for row in rows] == [
        ("traditional", None),
        ("variable", 3.0),
    ]


@pytest.mark.slow
def test_log_becomes_a_folder(admit: Run, tmp_path: Path) -> None:
    folder = tmp_path / "out"
    code, out, err = admit(FIXTURE, "--robot", "panda", "-o", folder)
    assert code == 0
    assert "kfo-fe through pinv(Jᵀ)" in err
    _, _, err = admit(FIXTURE, "--robot", "panda", "--observer", "best")
    assert "best, smoothed over the whole log, force on the robot" in err
    assert re.search(r"variable\s+6", out)
    assert {p.name for p in folder.iterdir()} == FILES | {"run.json"}
    page = (folder / "index.html").read_text("utf-8")
    for words in (
        "Force and motion over time",
        "What differs from the paper",
        "F_tsd",
        "± threshold",
    ):
        assert words in page
    assert not re.findall(r"(?:src|href)=[\"']?(?:https?:)?//", page)  # opens offline
    record = json.loads((folder / "run.json").read_text("utf-8"))
    assert record["parameters"]["threshold"] == [4, 4, 15, 2, 2, 2]
    assert len(record["input"]["sha256"]) == 64
    motion = pl.read_parquet(folder / "motion.parquet")
    assert {"t", "force/fx", "x/traditional/x", "q/traditional/7"} <= set(motion.columns)
    code, _, err = admit(FIXTURE, "--robot", "panda", "-o", folder)
    assert (code, "exists; give another -o, or --force" in err) == (1, True)


@pytest.mark.slow
def test_estimates_and_truth_are_forces_too(admit: Run, tmp_path: Path, monkeypatch) -> None:
    words = [
        "vftcli",
        "estimate",
        str(FIXTURE),
        "--robot",
        "panda",
        "-q",
        "-o",
        str(tmp_path / "e"),
    ]
    monkeypatch.setattr("sys.argv", words)
    with pytest.raises(SystemExit, match="0"):
        main()
    asked = ("--robot", "panda", "--json")
    estimates = tmp_path / "e" / "estimates.parquet"
    from_log = json.loads(admit(FIXTURE, *asked)[1])["rows"]
    from_estimates = json.loads(admit(estimates, *asked)[1])["rows"]
    for one, other in zip(from_log, from_estimates, strict=True):
        assert one["peak"] == pytest.approx(other["peak"], abs=1e-9)  # the same torques, stored
    truth = json.loads(
        admit(FIXTURE, "--set", f"admittance.force=file:{FIXTURE}.truth.parquet", *asked)[1]
    )
    peaks = {row["axis"]: row["peak"] for row in truth["rows"] if row["controller"] == "variable"}
    assert peaks["x"] > 0.05  # the guiding hand pulls along +x with 7 N
    code, _, err = admit(estimates, "--robot", "panda", "--observer", "kfo")
    assert code == 1
    assert "holds no estimates of 'kfo'; it holds best, fdo, gmo" in err


RELEASE = ("--release", "x=0.3", "--robot", "ur5")


@pytest.mark.parametrize(
    ("words", "code", "complaint"),
    [
        ((*RELEASE, "--alpha", "0"), 1, "alpha of axis x is 0; it must be positive"),
        ((*RELEASE, "--alpha", "one"), 1, "is not a list of numbers"),
        ((*RELEASE, "--set", "admittance.xi=0"), 1, "xi of axis x is 0; it must be positive"),
        ((*RELEASE, "--set", "position.mass=0"), 1, "mass of axis x is 0"),
        ((*RELEASE, "--set", "rx.stiffness=-1"), 1, "stiffness of axis rx is -1"),
        ((*RELEASE, "--set", "rx.threshold=nan"), 1, "no admittance threshold for rx"),
        ((*RELEASE, "--set", "foo.mass=3"), 1, "--set foo.mass is no setting here"),
        ((*RELEASE, "--set", "period=0.5"), 1, "= 4.25 must be below 4"),
        (
            (*RELEASE, "--set", "admittance.start=0,0,0,0,0,7"),
            1,
            "start pose is outside the joint limits",
        ),
        ((*RELEASE, "--set", "admittance.start=0,0"), 1, "the start pose has 2 joints"),
        ((*RELEASE, "--set", "admittance.threshold_mode=firm"), 1, "there is hard, soft"),
        ((*RELEASE, "--set", "admittance.controller=fuzzy"), 1, "there is traditional, variable"),
        (("--release", "w=1", "--robot", "ur5"), 1, "axis of x, y, z, rx, ry, rz"),
        (("--release", "x=0.3"), 1, "a release needs an arm"),
        (("--robot", "ur5"), 2, "give one of LOG, SCENARIO, --release"),
        ((FIXTURE, "--robot", "panda", "--set", "admittance.force=sensor"), 1, "wrench"),
        ((FIXTURE, "--robot", "panda", "--observer", "nope"), 1, "no observer 'nope'"),
        (
            (FIXTURE, "--robot", "panda", "--observer", "gmo", "--observer", "fdo"),
            1,
            "give --observer once",
        ),
        ((FIXTURE, "--robot", "panda", "--frame", "tool"), 1, "the replay is in base axes"),
        (
            (
                FIXTURE,
                "--robot",
                "panda",
                "--set",
                "admittance.force=x",
            ),
            1,
            "admittance.force=x is neither sensor nor file:PATH",
        ),
        (("ur5-drag", "--zero", "start"), 1, "give it as --zero A:B"),
        (("ur5-drag", "--observer", "gmo"), 1, "the closed loop runs kfo-fe or kfo-zoh"),
        (("ur5-dragg",), 1, "ur5-drag"),
    ],
)
def test_bad_input_is_one_clear_line(
    admit: Run, words: tuple[object, ...], code: int, complaint: str
) -> None:
    found, out, err = admit(*words)
    assert found == code
    assert out == ""
    assert complaint in " ".join(err.split())
    if code == 1:
        # What the examination says of a readable log comes first.
        complaints = [x for x in err.strip().splitlines() if not x.startswith("log health:")]
        assert len(complaints) == 1
