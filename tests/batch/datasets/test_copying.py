"""Copies of datasets: where they may stand, what is linked, and what a stop leaves."""

from pathlib import Path

import numpy as np
import pytest

from vftcli.batch.datasets import (
    RECORD,
    WORK,
    check_copy,
    copy_others,
    files_within,
    put_rows,
    stored_rows,
    unfinished,
)
from vftcli.signals.errors import LogError, OutputError


@pytest.fixture
def dataset(tmp_path: Path) -> Path:
    folder = tmp_path / "set"
    (folder / "videos").mkdir(parents=True)
    (folder / "videos" / "a.mp4").write_bytes(b"film")
    (folder / "meta.json").write_text("{}")
    (folder / "data.h5").write_text("data")
    return folder


@pytest.mark.parametrize(
    ("copy", "words"),
    [
        ("set", "are the same folder; give another -o"),
        ("set/copy", "one inside the other"),
        (".", "one inside the other"),
    ],
)
def test_a_copy_stands_beside_its_dataset(dataset: Path, copy: str, words: str) -> None:
    with pytest.raises(OutputError, match=words):
        check_copy(dataset, dataset.parent / copy, force=True)


def test_only_an_earlier_copy_is_replaced(dataset: Path) -> None:
    copy = dataset.parent / "copy"
    check_copy(dataset, copy, force=False)
    (copy / RECORD).parent.mkdir(parents=True)
    (copy / "other").write_text("")
    for force in (False, True):
        with pytest.raises(OutputError, match="no copy that annotate made"):
            check_copy(dataset, copy, force=force)
    (copy / RECORD).write_text("{}")
    with pytest.raises(OutputError, match="exists; give another -o, or --force"):
        check_copy(dataset, copy, force=False)
    check_copy(dataset, copy, force=True)
    (dataset.parent / "file").write_text("")
    with pytest.raises(OutputError, match="is no folder"):
        check_copy(dataset, dataset.parent / "file", force=True)


@pytest.mark.parametrize("links", [True, False])
def test_films_are_linked_where_links_can_be_and_the_rest_is_copied(
    dataset: Path, monkeypatch, links: bool
) -> None:
    def refuse(*_: object) -> None:
        raise OSError(18, "cross-device link")

    if not links:
        monkeypatch.setattr("os.link", refuse)
    copy = dataset.parent / "copy"
    copy_others(dataset, copy, {Path("data.h5")})
    film, meta = copy / "videos" / "a.mp4", copy / "meta.json"
    assert film.samefile(dataset / "videos" / "a.mp4") == links
    assert film.read_bytes() == b"film"
    assert not meta.samefile(dataset / "meta.json")
    assert not (copy / "data.h5").exists()


def test_a_finished_copy_takes_the_place_of_an_earlier_one(tmp_path: Path) -> None:
    copy = tmp_path / "copy"
    copy.mkdir()
    (copy / "old").write_text("")
    with unfinished(copy, "key") as folder:
        assert folder == copy.with_name(f"{copy.name}.partial")
        (folder / "new").write_text("")
    assert [path.name for path in tmp_path.rglob("*")] == ["copy", "new"]


def test_what_a_stop_leaves_goes_on_with_the_same_key_only(tmp_path: Path) -> None:
    copy, found = tmp_path / "copy", []

    def stopped(key: str) -> None:
        with unfinished(copy, key) as folder:
            found.append((folder / WORK / "rows").is_file())
            (folder / WORK / "rows").write_text("")
            raise KeyboardInterrupt

    for key in ("one", "one", "two"):
        with pytest.raises(KeyboardInterrupt):
            stopped(key)
        assert not copy.exists()
    assert found == [False, True, False]


def test_two_runs_do_not_write_one_copy(tmp_path: Path) -> None:
    second = unfinished(tmp_path / "copy", "key")
    with unfinished(tmp_path / "copy", "key"), pytest.raises(OutputError, match="another run"):
        second.__enter__()


def test_rows_are_whole_or_not_there(tmp_path: Path) -> None:
    put_rows(tmp_path / "rows.npz", reported=np.array("{}"), a=np.ones(2))
    held = stored_rows(tmp_path / "rows.npz")
    assert (str(held["reported"]), held["a"].tolist()) == ("{}", [1.0, 1.0])
    assert [path.name for path in tmp_path.iterdir()] == ["rows.npz"]


@pytest.mark.parametrize("folder", [False, True])
def test_a_link_that_leaves_the_dataset_is_refused(dataset: Path, folder: bool) -> None:
    """Its file became one of the copy, which may be published."""
    secret = dataset.parent / "private" / "secret.txt"
    secret.parent.mkdir()
    secret.write_text("mine")
    (dataset / "leak").symlink_to(secret.parent if folder else secret)
    with pytest.raises(LogError, match=r"leak.* is a link to .*secret\.txt, outside of the data"):
        copy_others(dataset, dataset.parent / "copy", set())
    assert not list((dataset.parent / "copy").rglob("*leak*"))


def test_links_within_a_dataset_and_into_a_hub_s_store_are_followed(tmp_path: Path) -> None:
    """The layout of Hugging Face's cache: snapshots/REVISION/… → ../../blobs/HASH."""
    snapshot = tmp_path / "datasets--me--arm" / "snapshots" / "abc"
    blobs = snapshot.parents[1] / "blobs"
    for made in (snapshot / "meta", blobs):
        made.mkdir(parents=True)
    (blobs / "0a1b").write_text("info")
    (snapshot / "meta" / "info.json").symlink_to("../../../blobs/0a1b")
    (snapshot / "same.json").symlink_to("meta/info.json")
    copy_others(snapshot, tmp_path / "copy", set())
    for name in ("meta/info.json", "same.json"):
        path = tmp_path / "copy" / name
        assert (path.read_text(), path.is_symlink()) == ("info", False)
    (snapshot / "leak").symlink_to("../../refs")
    (snapshot.parents[1] / "refs").write_text("main")
    with pytest.raises(LogError, match="leak is a link to"):
        list(files_within(snapshot))
