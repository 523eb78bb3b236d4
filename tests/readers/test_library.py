"""Library: one reading of a log whatever asks for it, and a label of its own, short and unique."""

import shutil
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

import vftcli.readers.reading
from vftcli.readers.library import Library, absolute, labelled
from vftcli.readers.reader import ALL, ReadChoice
from vftcli.signals.recording import same_run

NAMES = st.sampled_from(["log.csv", "a", "b", "run1"])
PATHS = st.lists(NAMES, min_size=1, max_size=4).map(lambda parts: Path("/", *parts))
FIXTURE = Path(__file__).parent.parent.parent / "fixtures" / "ur5_circle.csv"


@pytest.fixture
def count(monkeypatch):
    """The paths that were really read, in order."""
    seen = []
    read = vftcli.readers.reading.read_chosen

    def counted(path, *choice):
        seen.append(Path(path).name)
        return read(path, *choice)

    monkeypatch.setattr(vftcli.readers.reading, "read_chosen", counted)
    return seen


@pytest.fixture
def folders(tmp_path):
    """The same file name in two folders."""
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        shutil.copy(FIXTURE, tmp_path / name / "log.csv")
    return tmp_path


def test_a_log_is_read_once_however_it_is_spelt(folders, count):
    library = Library()
    first = library.open(folders / "a" / "log.csv")
    assert library.open(folders / "b" / ".." / "a" / "log.csv") is first
    assert library.open(str(folders / "a" / "log.csv")) is first
    assert count == ["log.csv"]


def test_another_choice_is_another_reading(folders, count):
    library = Library()
    whole = library.open(folders / "a" / "log.csv")
    part = library.open(folders / "a" / "log.csv", ReadChoice(signals=frozenset({"dq"})))
    assert whole.current is not None
    assert part.dq is not None
    assert len(count) == 2


def test_logs_that_were_named_are_reported_apart_both(folders):
    paths = [folders / "a" / "log.csv", folders / "b" / "log.csv"]
    library = Library(paths)
    assert [library.open(path).name for path in paths] == ["a/log.csv", "b/log.csv"]


def test_a_log_that_was_not_named_differs_from_those_that_were(folders):
    library = Library([folders / "a" / "log.csv"])
    later = library.open(folders / "b" / "log.csv")
    assert library.open(folders / "a" / "log.csv").name == "log.csv"
    assert later.name == later.source.label == "b/log.csv"


def test_a_copy_is_the_same_run_under_any_name(folders):
    library = Library()
    one, other = (library.open(folders / name / "log.csv") for name in "ab")
    assert same_run(one, other)
    assert same_run(one.between(1.0, 2.0), other)


def test_a_log_that_is_read_is_one_log_where_all_episodes_are_asked_for():
    log = Library().open(FIXTURE)
    assert list(Library().open_each([log], ReadChoice(episode=ALL))) == [log]


def test_a_part_of_a_log_is_not_read_again(folders, count):
    library = Library()
    whole = library.open(folders / "a" / "log.csv")
    part = library.open(folders / "a" / "log.csv", ReadChoice(interval=(1.0, 2.0)))
    assert part.samples < whole.samples
    assert (part.t[0], part.name) == (1.0, "log.csv")
    assert count == ["log.csv"]


def test_a_name_of_its_own_is_the_label():
    found = labelled(["/home/me/one.csv", "/home/me/two.csv"])
    assert list(found.values()) == ["one.csv", "two.csv"]


def test_equal_names_are_reported_apart_by_their_folders_and_the_others_stay_short():
    found = labelled(["/x/a/log.csv", "/x/b/log.csv", "/x/b/other.csv"])
    assert list(found.values()) == ["a/log.csv", "b/log.csv", "other.csv"]


def test_as_many_folders_as_it_takes():
    found = labelled(["/x/a/log.csv", "/y/a/log.csv", "/y/b/log.csv"])
    assert list(found.values()) == ["x/a/log.csv", "y/a/log.csv", "b/log.csv"]


def test_a_path_that_ends_another_is_distinct_from_it():
    assert list(labelled(["/log.csv", "/a/log.csv"]).values()) == ["/log.csv", "a/log.csv"]


def test_spellings_of_one_path_have_one_label():
    found = labelled(["/x/a/log.csv", "/x/b/../a/log.csv"])
    assert set(found.values()) == {"log.csv"}


@given(st.lists(PATHS, max_size=6))
def test_two_paths_never_share_a_label(paths):
    found = labelled(paths)
    labels = {absolute(path): label for path, label in found.items()}
    assert len(set(labels.values())) == len(labels)
    for path, label in found.items():
        assert str(absolute(path)).endswith(label)


@given(st.lists(PATHS, max_size=6), st.randoms())
def test_labels_do_not_depend_on_the_order(paths, random):
    shuffled = list(paths)
    random.shuffle(shuffled)
    assert labelled(paths) == labelled(shuffled)
