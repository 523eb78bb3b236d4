"""--episode and --arm on the command line: what is taken of several is said, by every command."""

import importlib.util
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from vftcli.cli import main
from vftcli.readers.reading import read

FIXTURE = Path(__file__).parents[2] / "fixtures" / "ur5_circle.csv"
SAID = "ur5.arrow episode 0: episode 0, of 2 in all: --episode K|all"


@pytest.fixture(scope="module")
def episodes(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two episodes of a UR5 in one Arrow file: two spans of six seconds of the fixture."""
    import pyarrow as pa

    log = read(FIXTURE)
    rows = {k: np.flatnonzero((log.t >= 6 * k) & (log.t < 6 * (k + 1))) for k in (0, 1)}
    order = np.concatenate(list(rows.values()))
    held: dict[str, Any] = {
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


def run(monkeypatch: pytest.MonkeyPatch, *words: object) -> int:
    monkeypatch.setattr("sys.argv", ["vftcli", *map(str, words)])
    with pytest.raises(SystemExit) as stop:
        main()
    return int(stop.value.code or 0)


def test_the_first_is_said_on_the_terminal_and_in_the_record(
    episodes: Path, tmp_path: Path, monkeypatch: Any, capsys: Any
) -> None:
    out = tmp_path / "out"
    words = ("estimate", episodes, "--robot", "ur5", "--observer", "gmo", "-o", out, "--anyway")
    assert run(monkeypatch, *words) == 0
    assert capsys.readouterr().err.count(SAID) == 1
    record = json.loads((out / "run.json").read_text("utf-8"))
    assert "episode-chosen" in {reported["code"] for reported in record["warnings"]}


def test_contacts_and_convert_say_it_too(
    episodes: Path, tmp_path: Path, monkeypatch: Any, capsys: Any
) -> None:
    assert run(monkeypatch, "contacts", episodes, "--robot", "ur5", "--anyway") == 0
    assert SAID in capsys.readouterr().err
    assert run(monkeypatch, "convert", episodes, "-o", tmp_path / "x.csv") == 0
    assert "episode 0, of 2 in all: --episode K|all" in capsys.readouterr().err


def test_all_are_logs_of_their_own(episodes: Path, monkeypatch: Any, capsys: Any) -> None:
    words = ("contacts", episodes, "--robot", "ur5", "--episode", "all", "--anyway", "--json")
    assert run(monkeypatch, *words) == 0
    found = capsys.readouterr()
    assert [each["recording"] for each in json.loads(found.out)["logs"]] == [
        "ur5.arrow episode 0",
        "ur5.arrow episode 1",
    ]
    assert "--episode K" not in found.err


def test_a_command_of_one_log_takes_no_all(episodes: Path, monkeypatch: Any, capsys: Any) -> None:
    assert run(monkeypatch, "inspect", episodes, "--episode", "all") == 1
    assert "name one: --episode K" in capsys.readouterr().err


def test_inspect_describes_the_left_arm_and_names_both(
    tmp_path: Path, monkeypatch: Any, capsys: Any
) -> None:
    if importlib.util.find_spec("h5py") is None:
        pytest.skip("h5py, the extra hdf5, is not installed")
    from seed_containers import aloha

    path = aloha(tmp_path / "episode_0.hdf5")
    assert run(monkeypatch, "inspect", path) == 0
    assert "this is the left one: --arm left|right" in capsys.readouterr().out
    assert run(monkeypatch, "convert", path, "-o", tmp_path / "x.csv") == 1
    assert "say which with --arm left or --arm right" in capsys.readouterr().err
