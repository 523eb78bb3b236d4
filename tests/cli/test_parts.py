"""--episode and --arm on the command line: what is taken of several is said, by every command."""

import json
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest

from vftcli.readers.reading import read

FIXTURE = Path(__file__).parents[2] / "fixtures" / "ur5_circle.csv"
SAID = "ur5.arrow episode 0: episode 0, of 2 in all: --episode K|all"


@pytest.fixture(scope="module")
def episodes(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two episodes of a UR5 in one Arrow file: two spans of six seconds of the fixture."""
    log = read(FIXTURE)
    rows = {k: np.flatnonzero((log.t >= 6 * k) & (log.t < 6 * (k + 1))) for k in (0, 1)}
    order = np.concatenate(list(rows.values()))
    held = {
        "t": np.concatenate([log.t[part] - log.t[part[0]] for part in rows.values()]),
        "q": log.q[order].tolist(), "dq": np.asarray(log.dq)[order].tolist(),
        "current": np.asarray(log.current)[order].tolist(),
        "episode_index": np.repeat([0, 1], [len(part) for part in rows.values()]),
    }  # fmt: skip
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


def test_a_command_of_one_log_takes_no_all(refused, episodes: Path) -> None:
    assert "name one: --episode K" in refused("inspect", episodes, "--episode", "all")


@pytest.mark.usefixtures("here")
def test_inspect_describes_the_left_arm_and_names_both(run, refused, tmp_path: Path) -> None:
    pytest.importorskip("h5py", reason="h5py, the extra hdf5, is not installed")
    from seed_containers import aloha

    path = aloha(tmp_path / "episode_0.hdf5")
    code, out, _ = run("inspect", path)
    assert (code, "this is the left one: --arm left|right" in out) == (0, True)
    error = refused("convert", path, "-o", "x.csv")
    assert "say which with --arm left or --arm right" in error
