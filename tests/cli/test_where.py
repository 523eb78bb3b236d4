"""Where a command writes that is not given -o, seen by what it refuses to write over."""

from collections.abc import Callable
from pathlib import Path

import pytest

Run = Callable[..., tuple[int, str, str]]

LOG = Path(__file__).parents[2] / "fixtures" / "ur5_taps_ur_rtde.csv"


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working folder."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_estimates_go_into_a_folder_here_named_after_the_log(run: Run, here: Path) -> None:
    words = ("estimate", LOG, "--robot", "ur5", "--interval", "0:2", "--causal")
    code, out, _ = run(*words)
    folder = Path("ur5_taps_ur_rtde.vft")
    assert code == 0
    assert f"{folder}/  estimates.parquet  run.json" in out
    assert {file.name for file in (here / folder).iterdir()} == {"estimates.parquet", "run.json"}
    code, out, err = run(*words)
    assert (code, out) == (1, "")
    assert err.startswith(f"error: {folder / 'estimates.parquet'} exists; ")
    assert run(*words, "--force")[0] == 0


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
    run: Run, here: Path, words: tuple[str, ...], folder: str
) -> None:
    (here / "bag.d").mkdir()
    (here / folder).mkdir()
    (here / folder / "run.json").touch()
    code, out, err = run(*words)
    assert (code, out) == (1, "")
    assert err.startswith(f"error: {Path(folder) / 'run.json'} exists; ")
