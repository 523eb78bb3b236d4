"""Parsing ahead: what was parsed is taken where it is asked for, and else parsed anew."""

import gzip
import subprocess
import sys
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from vftcli.readers import opening, read, read_chosen
from vftcli.readers.ahead import Ahead, wanted_columns
from vftcli.readers.reader import ReadChoice
from vftcli.signals.errors import LogError
from vftcli.signals.names import EXAMINED, MEANINGS

FIXTURE = Path(__file__).parents[2] / "fixtures" / "ur5_circle.csv"


@pytest.fixture
def parsed(monkeypatch: pytest.MonkeyPatch) -> list[list[int]]:
    """The columns of each parse that was begun."""
    seen, original = [], pl.read_csv

    def counted(*words: object, **options: object) -> pl.DataFrame:
        seen.append(options["columns"])
        return original(*words, **options)  # type: ignore[arg-type]

    monkeypatch.setattr(pl, "read_csv", counted)
    return seen


@pytest.mark.parametrize("signals", [EXAMINED, None, frozenset({"dq"})])
def test_the_log_is_the_same_and_parsed_once(signals, parsed) -> None:  # type: ignore[no-untyped-def]
    ahead = Ahead.of(FIXTURE, signals)
    made = read_chosen(FIXTURE, ReadChoice(signals=signals, ahead=ahead))
    assert len(parsed) == 1
    plain = read(FIXTURE, signals=signals)
    assert made.source.sha256 == plain.source.sha256
    for name in ("t", *MEANINGS):
        mine, other = getattr(made, name), getattr(plain, name)
        assert (mine is None) == (other is None)
        assert mine is None or np.array_equal(mine, other)


def test_a_wrong_guess_changes_nothing(parsed) -> None:  # type: ignore[no-untyped-def]
    ahead = Ahead.of(FIXTURE, frozenset())
    made = read_chosen(FIXTURE, ReadChoice(signals=EXAMINED, ahead=ahead))
    assert len(parsed) == 2
    assert np.array_equal(made.require("current"), read(FIXTURE).require("current"))


def test_it_is_for_its_own_file_and_once(tmp_path: Path, parsed) -> None:  # type: ignore[no-untyped-def]
    other = tmp_path / "log.csv"
    other.write_bytes(FIXTURE.read_bytes())
    choice = ReadChoice(ahead=Ahead.of(FIXTURE, None))
    for path, count in ((other, 2), (FIXTURE, 2), (FIXTURE, 3)):
        read_chosen(path, choice)
        assert len(parsed) == count


def test_only_plain_tables_of_rtde_names_are_parsed_ahead(tmp_path: Path) -> None:
    text = FIXTURE.read_bytes()
    files = {
        "other.csv": text.replace(b"actual_q_", b"pos_"),
        "quoted.csv": text.replace(b"timestamp", b'"timestamp"'),
        "packed.csv.gz": gzip.compress(text),
        "head.csv": text.partition(b"\n")[0],
        "empty.csv": b"",
    }
    for name, content in files.items():
        (tmp_path / name).write_bytes(content)
        assert Ahead.of(tmp_path / name, None) is None
    assert Ahead.of(tmp_path, None) is None
    assert Ahead.of(tmp_path / "missing.csv", None) is None


def test_a_long_log_is_not_parsed_in_one_piece() -> None:
    head = FIXTURE.read_bytes()[: opening.HEAD_BYTES]
    row = len(head) / head.count(b"\n")
    assert wanted_columns(head, int(0.9 * row * opening.WHOLE_ROWS), None)
    assert not wanted_columns(head, int(1.1 * row * opening.WHOLE_ROWS), None)


def test_the_client_of_ur_separates_by_blanks() -> None:
    head = b"timestamp actual_q_0 actual_qd_0\n1.0 0.1 0.2\n1.1 0.1 0.2\n"
    assert wanted_columns(head, len(head), None) == [0]  # no signal is whole
    six = [f"actual_q_{j}" for j in range(6)]
    head = f"timestamp {' '.join(six)} payload\n{'1.0 ' * 8}\n".encode()
    assert wanted_columns(head, len(head), frozenset()) == [0, 1, 2, 3, 4, 5, 6, 7]


def test_a_damaged_row_is_told_as_ever(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    lines = FIXTURE.read_bytes().splitlines()
    lines[40] = b"x" + lines[40]
    path.write_bytes(b"\n".join(lines) + b"\n")
    with pytest.raises(LogError) as plain:
        read(path)
    with pytest.raises(LogError) as ahead:
        read_chosen(path, ReadChoice(ahead=Ahead.of(path, None)))
    assert str(ahead.value) == str(plain.value)


@pytest.mark.slow
def test_the_parse_begins_before_numpy_is_there(tmp_path: Path) -> None:
    script = (
        "import sys\n"
        "from vftcli.readers import ahead\n"
        "begin = ahead.Ahead.__init__\n"
        "def begun(*words):\n"
        "    print('begun', 'numpy' in sys.modules)\n"
        "    begin(*words)\n"
        "ahead.Ahead.__init__ = begun\n"
        "from vftcli.cli import launch; launch()"
    )
    words = ["estimate", str(FIXTURE), "--robot", "ur5", "--causal", "-o", str(tmp_path / "out")]
    command = [sys.executable, "-c", script, *words]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "begun False" in done.stdout
