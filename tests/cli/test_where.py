"""Where a command writes that is not given -o, seen by what it refuses to write over."""

from pathlib import Path

import pytest

from vftcli.robots import PROFILES

LOG = Path(__file__).parents[2] / "fixtures" / "ur5_taps_ur_rtde.csv"


def test_estimates_go_into_a_folder_here_named_after_the_log(run, refused, here: Path) -> None:
    """What is there stays unless it is forced."""
    words = ("estimate", LOG, "--robot", "ur5", "--interval", "0:2", "--causal")
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
    assert [(path.name, path.read_text()) for path in folder.iterdir()] == [
        ("run.json", "precious")
    ]
    assert run(*words, "--force")[0] == 0
    assert (folder / "run.json").read_text() != "precious"


@pytest.mark.parametrize(
    ("words", "folder"),
    [
        (("report", "push.csv"), "push.vft"),
        (("report", "sub/push.tar.csv.gz"), "push.tar.vft"),
        (("report", "push.bag"), "push.vft"),
        (("report", "run_1.5"), "run_1.5.vft"),
        (("report", "bag.d"), "bag.d.vft"),
        (("report", "push.h5", "--episode", "3"), "push-3.vft"),
        (("report", "push.csv", "--episode", "2", "--arm", "left"), "push-2-left.vft"),
        (("report", "a.csv", "b.csv"), "report.vft"),
        (("reproduce", "huang2025"), "huang2025.vft"),
    ],
)
def test_the_folder_s_name_and_nothing_is_read_before_it_is_refused(
    refused, here: Path, words: tuple[str, ...], folder: str
) -> None:
    (here / "bag.d").mkdir()
    (here / folder).mkdir()
    (here / folder / "run.json").touch()
    assert refused(*words).startswith(f"error: {Path(folder) / 'run.json'} exists; ")


def test_what_is_found_of_an_arm_has_its_name(refused, here: Path) -> None:
    robot = here / "my arm.toml"
    robot.write_text(PROFILES["ur5"].read_text("utf-8").replace('"ur5"', '"a/b c"', 1), "utf-8")
    Path("my_a_b_c.toml").touch()
    error = refused("identify", LOG, "--robot", robot, "--method", "gains")
    assert error.startswith("error: my_a_b_c.toml exists; ")
