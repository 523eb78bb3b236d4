"""`vftcli admit`: what scripts rely on, the files it writes, one line for what is wrong."""

import json
import re
from pathlib import Path

import polars as pl
import pytest

FIXTURE = Path(__file__).parents[2] / "fixtures" / "panda_bearing.csv"
PANDA = ("admit", FIXTURE, "--robot", "panda")
RELEASE = ("admit", "--release", "x=0.3", "--robot", "ur5")


def test_release_rows(run) -> None:
    words = ("--alpha", "1,1.3,1.6,1.9", "--set", "admittance.xi=1", "--json")
    code, out, err = run(*RELEASE, *words)
    rows = json.loads(out)["rows"]
    assert (code, err) == (0, "")
    assert [row["alpha"] for row in rows] == [None, 1.0, 1.3, 1.6, 1.9]
    assert [row["controller"] for row in rows] == ["traditional"] + ["variable"] * 4
    needed = {"controller", "alpha", "xi", "axis", "peak", "time_to_peak_s", "overshoot"}
    assert needed | {"return_10_s", "return_2_s"} <= set(rows[0])
    # science of the issue, 3 %
    times = [row["return_2_s"] for row in rows]
    assert times == pytest.approx([4.84, 3.14, 2.30, 1.74, 1.35], rel=0.03)
    assert {row["xi"] for row in rows[1:]} == {1.0}
    # Without a choice both controllers, with the profile's values.
    rows = json.loads(run("admit", "--release", "rx=0.2", "--robot", "panda", "--json")[1])[
        "rows"
    ]
    assert [row["controller"] for row in rows] == ["traditional", "variable"]
    assert [row["alpha"] for row in rows] == [None, 3.0]


@pytest.mark.slow
def test_log_becomes_a_folder(run, refused, tmp_path: Path) -> None:
    folder = tmp_path / "out"
    code, out, err = run(*PANDA, "-o", folder)
    assert code == 0
    assert "kfo-fe through pinv(Jᵀ)" in err
    assert re.search(r"variable\s+6", out)
    _, _, err = run(*PANDA, "--observer", "best")
    assert "best, smoothed over the whole log, force on the robot" in err
    files = {"index.html", "motion.parquet", "comparison.csv", "comparison.json", "run.json"}
    assert {p.name for p in folder.iterdir()} == files
    page = (folder / "index.html").read_text("utf-8")
    for words in ("Force and motion over time", "What differs from the paper", "F_tsd"):
        assert words in page
    assert "± threshold" in page
    assert not re.findall(r"(?:src|href)=[\"']?(?:https?:)?//", page)  # opens offline
    record = json.loads((folder / "run.json").read_text("utf-8"))
    assert record["parameters"]["threshold"] == [4, 4, 15, 2, 2, 2]
    assert len(record["input"]["sha256"]) == 64
    motion = pl.read_parquet(folder / "motion.parquet")
    assert {"t", "force/fx", "x/traditional/x", "q/traditional/7"} <= set(motion.columns)
    assert "exists; give another -o, or --force" in refused(*PANDA, "-o", folder)


@pytest.mark.slow
def test_estimates_and_truth_are_forces_too(run, refused, tmp_path: Path) -> None:
    assert run("estimate", *PANDA[1:], "-q", "-o", tmp_path)[0] == 0
    estimates = ("admit", tmp_path / "estimates.parquet", "--robot", "panda")

    def rows(*words: object) -> list[dict[str, object]]:
        return json.loads(run(*words, "--json")[1])["rows"]

    for one, other in zip(rows(*PANDA), rows(*estimates), strict=True):
        assert one["peak"] == pytest.approx(other["peak"], abs=1e-9)  # the same torques, stored
    truth = rows(*PANDA, "--set", f"admittance.force=file:{FIXTURE}.truth.parquet")
    peaks = {row["axis"]: row["peak"] for row in truth if row["controller"] == "variable"}
    assert peaks["x"] > 0.05  # the guiding hand pulls along +x with 7 N
    error = refused(*estimates, "--observer", "kfo")
    assert "holds no estimates of 'kfo'; it holds best, fdo, gmo" in error


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        ((*RELEASE, "--set", "position.mass=0"), "mass of axis x is 0"),
        ((*RELEASE, "--set", "foo.mass=3"), "--set foo.mass is no setting here"),
        ((*RELEASE, "--set", "period=0.5"), "= 4.25 must be below 4"),
        ((*RELEASE, "--set", "admittance.start=0,0,0,0,0,7"), "is outside the joint limits"),
        ((*RELEASE, "--set", "admittance.threshold_mode=firm"), "there is hard, soft"),
        (("admit", "--release", "w=1", "--robot", "ur5"), "axis of x, y, z, rx, ry, rz"),
        ((*PANDA, "--set", "admittance.force=sensor"), "wrench"),
        ((*PANDA, "--observer", "gmo", "--observer", "fdo"), "give --observer once"),
        ((*PANDA, "--set", "admittance.force=x"), "is neither sensor nor file:PATH"),
        (("admit", "ur5-dragg"), "ur5-drag"),
    ],
)
def test_bad_input_is_one_clear_line(refused, words: tuple[object, ...], complaint: str) -> None:
    assert complaint in refused(*words)
