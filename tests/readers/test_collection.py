"""What files, folders, patterns and data sets hold."""

import json
import shutil
from pathlib import Path

import pytest

from vftcli.batch.run import LogCollection, LogEntry
from vftcli.readers.reader import ALL, ReadChoice

FIXTURES = Path(__file__).parents[2] / "fixtures"
CIRCLE = FIXTURES / "ur5_circle.csv"


def found(*places: Path, choice: ReadChoice | None = None, leave: Path | None = None):
    return list(LogCollection(choice or ReadChoice(), leave).find(places))


def names(entries: list[LogEntry]) -> list[str]:
    return [entry.path.name for entry in entries]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "a" / ".hidden").mkdir(parents=True)
    for place in ("b.csv", "a/b.csv", "a/.hidden/b.csv"):
        shutil.copy(CIRCLE, tmp_path / place)
    shutil.copy(f"{CIRCLE}.truth.parquet", tmp_path / "a" / "b.csv.truth.parquet")
    (tmp_path / "notes.txt").write_text("Nothing that was recorded.\n")
    (tmp_path / "empty.csv").touch()
    return tmp_path


def test_a_folder_is_searched_and_what_is_no_log_left_out(folder: Path) -> None:
    collection = LogCollection(ReadChoice())
    entries = list(collection.find([folder]))
    assert [e.path.relative_to(folder).as_posix() for e in entries] == [
        "a/b.csv",
        "b.csv",
        "empty.csv",  # a recording that failed: reported when it is read
    ]
    assert {path.name for path in collection.passed} == {"b.csv.truth.parquet", "notes.txt"}


def test_a_file_is_a_log_whatever_it_holds_and_each_counts_once(folder: Path) -> None:
    entries = found(folder / "notes.txt", folder / "gone.csv", folder / "b.csv", folder)
    given = ["notes.txt", "gone.csv", "b.csv"]
    assert names(entries) == [*given, "b.csv", "b.csv", "empty.csv"]


def test_a_pattern_fits_files(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert names(found(folder / "**" / "b.?sv")) == ["b.csv"] * 3
    assert found(folder / "*.nothing") == []
    monkeypatch.chdir(folder)
    assert [e.path for e in found(Path("a/*.csv"))] == [folder / "a" / "b.csv"]


def test_what_we_wrote_is_not_searched(folder: Path) -> None:
    (folder / "a" / "run.json").write_text(
        json.dumps({"versions": {"vftcli": "1"}, "files": {"b.csv": "…"}})
    )
    (folder / "c").mkdir()
    shutil.copy(CIRCLE, folder / "c")
    (folder / "c" / "batch.json").touch()
    assert names(found(folder)) == ["b.csv", "empty.csv"]
    assert names(found(folder, leave=folder / "a")) == ["b.csv", "empty.csv"]


def test_a_bag_is_one_log() -> None:
    (entry,) = found(FIXTURES / "panda_bag")
    assert entry.episode is None
    assert len(entry.files) > 1


def test_bags_in_a_folder_without_their_list_are_logs_each(tmp_path: Path) -> None:
    (bag,) = (FIXTURES / "panda_bag").glob("*.mcap")
    for name in ("monday.mcap", "tuesday.mcap"):
        shutil.copy(bag, tmp_path / name)
    shutil.copy(CIRCLE, tmp_path)
    assert names(found(tmp_path)) == ["monday.mcap", "tuesday.mcap", "ur5_circle.csv"]


@pytest.mark.parametrize(
    ("name", "episodes"),
    [
        ("lerobot_v3_effort", [0, 1, 2]),
        ("lerobot_v21_effort", [0, 1]),
        ("droid_raw", [None, None]),
    ],
)
def test_an_episode_of_a_data_set_is_a_log(
    samples: Path, name: str, episodes: list[int | None]
) -> None:
    """The samples' episodes; DROID's are files of their own."""
    if name == "droid_raw":
        pytest.importorskip("h5py")
    entries = found(samples / name)
    assert [entry.episode for entry in entries] == episodes
    assert all(path.is_file() for entry in entries for path in entry.files)


def test_one_episode_may_be_chosen(samples: Path) -> None:
    entries = found(samples / "lerobot_v3_effort", choice=ReadChoice(episode=1))
    assert [entry.episode for entry in entries] == [1]


def test_all_episodes_are_each_a_log_beside_what_describes_them(folder: Path) -> None:
    (folder / "about.json").write_text('{"who": "me"}')
    assert names(found(folder, choice=ReadChoice(episode=ALL))) == ["b.csv", "b.csv", "empty.csv"]
