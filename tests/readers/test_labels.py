"""Labels: unique, as short as they can be, the same for every spelling of a path."""

from pathlib import Path

from hypothesis import given
from hypothesis import strategies as st

from vftcli.readers.labels import absolute, labelled

NAMES = st.sampled_from(["log.csv", "a", "b", "run1"])
PATHS = st.lists(NAMES, min_size=1, max_size=4).map(lambda parts: Path("/", *parts))


def test_a_name_of_its_own_is_the_label():
    found = labelled(["/home/me/one.csv", "/home/me/two.csv"])
    assert list(found.values()) == ["one.csv", "two.csv"]


def test_equal_names_are_told_apart_by_their_folders_and_the_others_stay_short():
    found = labelled(["/x/a/log.csv", "/x/b/log.csv", "/x/b/other.csv"])
    assert list(found.values()) == ["a/log.csv", "b/log.csv", "other.csv"]


def test_as_many_folders_as_it_takes():
    found = labelled(["/x/a/log.csv", "/y/a/log.csv", "/y/b/log.csv"])
    assert list(found.values()) == ["x/a/log.csv", "y/a/log.csv", "b/log.csv"]


def test_a_path_that_ends_another_is_told_from_it():
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
