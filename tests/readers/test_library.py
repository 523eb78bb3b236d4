"""Library: one reading of a log whatever asks for it, and a label of its own."""

import shutil
from pathlib import Path

import pytest

import vftcli.readers
from vftcli.readers.library import Library
from vftcli.readers.reader import ReadChoice
from vftcli.signals.identity import same_run

FIXTURE = Path(__file__).parent.parent.parent / "fixtures" / "ur5_circle.csv"


@pytest.fixture
def count(monkeypatch):
    """The paths that were really read, in order."""
    seen = []
    read = vftcli.readers.read

    def counted(path, **choice):
        seen.append(Path(path).name)
        return read(path, **choice)

    monkeypatch.setattr(vftcli.readers, "read", counted)
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


def test_logs_that_were_named_are_told_apart_both(folders):
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


def test_a_part_of_a_log_is_not_read_again(folders, count):
    library = Library()
    whole = library.open(folders / "a" / "log.csv")
    part = library.open(folders / "a" / "log.csv", ReadChoice(interval=(1.0, 2.0)))
    assert part.samples < whole.samples
    assert (part.t[0], part.name) == (1.0, "log.csv")
    assert count == ["log.csv"]
