"""Logs of one command: what places hold, one reading of each, a label short and unique."""

import json
import shutil
from pathlib import Path
from unittest.mock import Mock

import pytest
from hypothesis import given
from hypothesis import strategies as st

import vftcli.readers.reading
from vftcli.batch.run import LogCollection, LogEntry
from vftcli.readers.reader import ALL, ReadChoice
from vftcli.readers.reading import Library, absolute, labelled
from vftcli.signals.recording import same_run

FIXTURES = Path(__file__).parents[2] / "fixtures"
CIRCLE = FIXTURES / "ur5_circle.csv"
NAMES = st.sampled_from(["log.csv", "a", "b", "run1"])
PATHS = st.lists(NAMES, min_size=1, max_size=4).map(lambda parts: Path("/", *parts))


@pytest.fixture
def paths(tmp_path):
    found = [tmp_path / name / "log.csv" for name in ("a", "b")]
    for path in found:
        path.parent.mkdir()
        shutil.copy(CIRCLE, path)
    return found


def test_a_log_is_read_once_however_it_is_spelt_and_whatever_part_is_asked(paths, monkeypatch):
    really = Mock(wraps=vftcli.readers.reading.read_chosen)
    monkeypatch.setattr(vftcli.readers.reading, "read_chosen", really)
    library = Library()
    first = library.open(paths[0])
    assert library.open(paths[1].parent / ".." / "a" / "log.csv") is first
    assert library.open(str(paths[0])) is first
    part = library.open(paths[0], ReadChoice(interval=(1.0, 2.0)))
    assert part.samples < first.samples
    assert (part.t[0], part.name) == (1.0, "log.csv")
    assert really.call_count == 1
    other = library.open(paths[0], ReadChoice(signals=frozenset({"dq"})))
    assert (first.current is None, other.current is None) == (False, True)
    assert really.call_count == 2


def test_logs_are_called_apart_whether_they_were_named_or_not(paths):
    library = Library(paths)
    assert [library.open(path).name for path in paths] == ["a/log.csv", "b/log.csv"]
    library = Library(paths[:1])
    later = library.open(paths[1])
    assert library.open(paths[0]).name == "log.csv"
    assert later.name == later.source.label == "b/log.csv"


def test_a_copy_is_the_same_run_under_any_name(paths):
    library = Library()
    one, other = map(library.open, paths)
    assert same_run(one, other)
    assert same_run(one.between(1.0, 2.0), other)


def test_a_log_that_is_read_is_one_log_where_all_episodes_are_asked_for():
    log = Library().open(CIRCLE)
    assert list(Library().open_each([log], ReadChoice(episode=ALL))) == [log]


@pytest.mark.parametrize(
    ("paths", "labels"),
    [
        (["/home/me/one.csv", "/home/me/two.csv"], ["one.csv", "two.csv"]),
        (["/x/a/log.csv", "/x/b/log.csv", "/x/b/o.csv"], ["a/log.csv", "b/log.csv", "o.csv"]),
        (["/x/a/log", "/y/a/log", "/y/b/log"], ["x/a/log", "y/a/log", "b/log"]),
        (["/log.csv", "/a/log.csv"], ["/log.csv", "a/log.csv"]),
        (["/x/a/log.csv", "/x/b/../a/log.csv"], ["log.csv"]),
    ],
)
def test_a_label_has_as_many_folders_as_it_takes(paths, labels):
    assert list(labelled(paths).values()) == labels


@given(st.lists(PATHS, max_size=6), st.randoms())
def test_two_paths_never_share_a_label_whatever_their_order(paths, random):
    found = labelled(paths)
    labels = {absolute(path): label for path, label in found.items()}
    assert len(set(labels.values())) == len(labels)
    for path, label in found.items():
        assert str(absolute(path)).endswith(label)
    random.shuffle(paths)
    assert labelled(paths) == found


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


def test_a_folder_is_searched_and_what_is_no_log_left_out(folder):
    collection = LogCollection(ReadChoice())
    entries = [e.path.relative_to(folder).as_posix() for e in collection.find([folder])]
    # A recording that failed is reported when it is read.
    assert entries == ["a/b.csv", "b.csv", "empty.csv"]
    assert {path.name for path in collection.passed} == {"b.csv.truth.parquet", "notes.txt"}
    # A file is a log whatever it holds.
    given = ["notes.txt", "gone.csv", "b.csv"]
    all_of_it = found(*(folder / name for name in given), folder)
    assert names(all_of_it) == [*given, "b.csv", "b.csv", "empty.csv"]
    (folder / "about.json").write_text('{"who": "me"}')
    assert names(found(folder, choice=ReadChoice(episode=ALL))) == ["b.csv", "b.csv", "empty.csv"]


def test_a_pattern_fits_files(folder, monkeypatch):
    assert names(found(folder / "**" / "b.?sv")) == ["b.csv"] * 3
    assert found(folder / "*.nothing") == []
    monkeypatch.chdir(folder)
    assert [e.path for e in found(Path("a/*.csv"))] == [folder / "a" / "b.csv"]


def test_what_we_wrote_is_not_searched(folder):
    record = {"versions": {"vftcli": "1"}, "files": {"b.csv": "…"}}
    (folder / "a" / "run.json").write_text(json.dumps(record))
    (folder / "c").mkdir()
    shutil.copy(CIRCLE, folder / "c")
    (folder / "c" / "batch.json").touch()
    assert names(found(folder)) == ["b.csv", "empty.csv"]
    assert names(found(folder, leave=folder / "a")) == ["b.csv", "empty.csv"]


def test_a_bag_is_one_log_and_bags_without_their_list_are_logs_each(tmp_path):
    (entry,) = found(FIXTURES / "panda_bag")
    assert (entry.episode, len(entry.files) > 1) == (None, True)
    (bag,) = (FIXTURES / "panda_bag").glob("*.mcap")
    for name in ("monday.mcap", "tuesday.mcap"):
        shutil.copy(bag, tmp_path / name)
    shutil.copy(CIRCLE, tmp_path)
    assert names(found(tmp_path)) == ["monday.mcap", "tuesday.mcap", "ur5_circle.csv"]


@pytest.mark.parametrize(
    ("name", "episode", "expected"),
    [
        ("lerobot_v3_effort", None, [0, 1, 2]),
        ("lerobot_v3_effort", 1, [1]),
        ("lerobot_v21_effort", None, [0, 1]),
        ("droid_raw", None, [None, None]),
    ],
)
def test_an_episode_of_a_data_set_is_a_log(samples, name, episode, expected):
    """The samples' episodes; DROID's are files of their own."""
    if name == "droid_raw":
        pytest.importorskip("h5py")
    entries = found(samples / name, choice=ReadChoice(episode=episode))
    assert [entry.episode for entry in entries] == expected
    assert all(path.is_file() for entry in entries for path in entry.files)
