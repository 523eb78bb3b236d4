import json
import shutil
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from vftcli.outputs.files import (
    OutputFolder,
    atomic,
    digest,
    digests,
    numbered,
    protected,
    refuse_existing,
    write_text,
)
from vftcli.signals.errors import OutputError


def texts(folder: Path) -> dict[str, str]:
    """All that there is, by name; of a folder no text."""
    found = {path: path.read_text() if path.is_file() else "" for path in folder.rglob("*")}
    return {path.relative_to(folder).as_posix(): text for path, text in found.items()}


def cut_short(path: Path) -> None:
    path.write_text("half")
    raise KeyboardInterrupt


def test_a_file_appears_whole_or_the_old_one_stays_and_nothing_else(tmp_path: Path) -> None:
    with atomic(tmp_path / "a.txt") as temporary:
        temporary.write_text("half")
        assert not (tmp_path / "a.txt").exists()
        temporary.write_text("whole")
    assert texts(tmp_path) == {"a.txt": "whole"}
    with pytest.raises(KeyboardInterrupt), atomic(tmp_path / "a.txt", force=True) as temporary:
        cut_short(temporary)
    assert texts(tmp_path) == {"a.txt": "whole"}


def test_an_existing_file_needs_force_and_no_file_is_no_place_for_one(tmp_path: Path) -> None:
    write_text(tmp_path / "a.txt", "old")
    with pytest.raises(OutputError, match=r"a\.txt exists.*--force"):
        write_text(tmp_path / "a.txt", "new")
    write_text(tmp_path / "a.txt", "new", force=True)
    assert (tmp_path / "a.txt").read_text() == "new"
    with pytest.raises(OutputError, match="no such folder"):
        write_text(tmp_path / "no" / "a.txt", "text")
    with pytest.raises(OutputError, match="is a folder"):
        write_text(tmp_path, "text", force=True)


def test_a_link_is_written_through_and_a_device_straight(tmp_path: Path) -> None:
    (tmp_path / "there").mkdir()
    (tmp_path / "link.txt").symlink_to(tmp_path / "there" / "a.txt")
    write_text(tmp_path / "link.txt", "text", force=True)
    assert (tmp_path / "link.txt").is_symlink()
    assert (tmp_path / "there" / "a.txt").read_text() == "text"
    with atomic(Path("/dev/null")) as path:
        assert path == Path("/dev/null")
        path.write_text("gone")
    assert Path("/dev/null").is_char_device()


def test_a_failing_folder_leaves_what_was_there(tmp_path: Path) -> None:
    with pytest.raises(KeyboardInterrupt), OutputFolder(tmp_path / "new" / "out") as folder:
        cut_short(folder / "a.txt")
    full = OutputFolder(tmp_path / "new")
    with pytest.raises(OutputError, match="no space left on device"), full:
        raise OSError(28, "No space left on device")
    assert texts(tmp_path) == {}
    (tmp_path / "mine.txt").write_text("mine")
    (tmp_path / "a.txt").write_text("old")
    out = OutputFolder(tmp_path, force=True, names=["a.txt"])
    with pytest.raises(KeyboardInterrupt), out as folder:
        cut_short(folder / "a.txt")
    assert texts(tmp_path) == {"a.txt": "old", "mine.txt": "mine"}


def test_an_existing_output_is_refused_at_once_an_undeclared_one_at_the_end(tmp_path):
    (tmp_path / "a.txt").write_text("old")
    out = OutputFolder(tmp_path, names=["estimates.parquet", "a.txt"])
    with pytest.raises(OutputError, match=r"a\.txt exists.*--force"), out:
        pytest.fail("the block ran")
    with pytest.raises(OutputError, match="exists"), OutputFolder(tmp_path) as folder:
        (folder / "a.txt").write_text("new")
    assert texts(tmp_path) == {"a.txt": "old"}


def test_force_leaves_no_declared_file_of_an_earlier_run(tmp_path: Path) -> None:
    for name in ("run.json", "errors.csv", "mine.txt"):
        (tmp_path / name).write_text("old")
    with OutputFolder(tmp_path, force=True, names=["run.json", "errors.csv"]) as folder:
        (folder / "run.json").write_text("new")
    assert texts(tmp_path) == {"mine.txt": "old", "run.json": "new"}


def test_a_move_that_fails_is_undone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The second of three files cannot be moved: the first is what it was, the third not there."""
    for name in ("a.txt", "b.txt", "stale.txt"):
        (tmp_path / name).write_text("old")
    move = Path.replace

    def failing(self: Path, target: Path) -> Path:
        if self.name == "b.txt" and target.parent == tmp_path:
            raise OSError(5, "Input/output error")
        return move(self, target)

    monkeypatch.setattr(Path, "replace", failing)
    declared = ["a.txt", "b.txt", "c.txt", "stale.txt"]
    out = OutputFolder(tmp_path, force=True, names=declared)
    with pytest.raises(OutputError, match="input/output error"), out as folder:
        fill(folder, dict.fromkeys(declared[:3], "new"))
    assert texts(tmp_path) == dict.fromkeys(("a.txt", "b.txt", "stale.txt"), "old")


def test_equal_names_get_numbers_that_are_free() -> None:
    assert numbered(["a", "b", "a", "a-2", "a"]) == ["a", "b", "a-2", "a-2-2", "a-3"]


def fill(folder: OutputFolder, texts: dict[str, str]) -> None:
    for name, text in texts.items():
        folder.write(name, text)


def sealed(folder: Path, texts: dict[str, str], force: bool = True) -> None:
    """Write a run: the files, and a seal that lists them."""
    with OutputFolder(folder, force, ["run.json"]) as out:
        fill(out, texts)
        out.write("run.json", json.dumps({"files": out.digests()}))


def test_files_of_the_run_before_go_if_nobody_changed_them(tmp_path: Path) -> None:
    """Also those of another command, which this one's names do not declare, and their folders."""
    sealed(tmp_path, {"a.txt": "a", "b.txt": "b", "sub/c.txt": "c", "mine.txt": "run's"})
    (tmp_path / "mine.txt").write_text("mine")
    sealed(tmp_path, {"b.txt": "new"})
    assert texts(tmp_path).keys() == {"b.txt", "mine.txt", "run.json"}


def test_a_seal_is_not_believed_outside_its_folder(tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "precious.txt").write_text("precious")
    precious = digest(tmp_path / "precious.txt")
    lies = {"../precious.txt": precious, "": "", "\0": "x", "run.json": 3}
    for files in (lies, [], None, "text"):
        (tmp_path / "out" / "run.json").write_text(json.dumps({"files": files}))
        sealed(tmp_path / "out", {"a.txt": "a"})
    assert (tmp_path / "precious.txt").read_text() == "precious"


@pytest.mark.parametrize(("given", "refused", "free"), [
    ("log.csv", "log.csv link.csv", "other.csv"),
    # A report may be in the folder of its log.
    (".", "log.csv sub/inner.csv", "run.json made.csv batch.run.json"),
    ("sub", "sub/inner.csv", "log.csv"),
    ("gone", "", "log.csv"),
])  # fmt: skip
def test_what_is_read_is_kept(tmp_path: Path, given: str, refused: str, free: str) -> None:
    """By whatever name; but what an earlier run wrote into a folder that is read."""
    sealed(tmp_path, {"made.csv": "made"})
    (tmp_path / "sub").mkdir()
    for name in ("log.csv", "other.csv", "sub/inner.csv", "batch.run.json"):
        (tmp_path / name).write_text(name)
    (tmp_path / "link.csv").symlink_to(tmp_path / "log.csv")
    with protected([tmp_path / given]):
        for name in refused.split():
            with pytest.raises(OutputError, match="is what this command reads"):
                refuse_existing(tmp_path / name, force=True)
        for name in free.split():
            refuse_existing(tmp_path / name, force=True)
    for name in refused.split():
        refuse_existing(tmp_path / name, force=True)


def test_leftovers_of_the_dead_go_and_those_of_the_living_stay(tmp_path: Path) -> None:
    print_id = [sys.executable, "-c", "import os; print(os.getpid())"]
    dead = subprocess.check_output(print_id, text=True).strip()
    for name in (f".vftcli-{dead}-00000000.partial", ".vftcli-x-00000000.partial", ".a.partial"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "half.txt").write_text("half")
    with OutputFolder(tmp_path) as living:
        living.write("a.txt", "a")
        sealed(tmp_path, {"b.txt": "b"})
    left = [".a.partial", ".vftcli-x-00000000.partial", "a.txt", "b.txt", "run.json"]
    assert sorted(path.name for path in tmp_path.iterdir()) == left


def test_a_failed_run_clears_nothing(tmp_path: Path) -> None:
    """What a killed run moved aside may be all that is left of the run before."""
    (tmp_path / ".vftcli-999999999-00000000.partial").mkdir()
    with pytest.raises(KeyboardInterrupt), OutputFolder(tmp_path) as folder:
        cut_short(folder / "a.txt")
    assert len(texts(tmp_path)) == 1


def test_half_a_letter_is_refused_in_a_name_but_not_in_a_text(tmp_path: Path) -> None:
    """No library writes such a name."""
    with pytest.raises(OutputError, match="no name in UTF-8"):
        write_text(tmp_path / "bad\udcff.csv", "text")
    with pytest.raises(OutputError, match="no name in UTF-8"):
        OutputFolder(tmp_path, names=["bad\udcff.toml"]).check()
    write_text(tmp_path / "a.txt", "bad\udcff.csv")
    assert (tmp_path / "a.txt").read_text() == "bad\\udcff.csv"


def test_runs_into_one_folder_at_once_do_not_mix(tmp_path: Path) -> None:
    texts = [{name: f"{run}{name}" for name in "abcdef"} for run in range(8)]
    with ThreadPoolExecutor(8) as pool:
        list(pool.map(lambda text: sealed(tmp_path, text), texts))
    found = {path.name: path.read_text() for path in tmp_path.iterdir()}
    listed = json.loads(found.pop("run.json"))["files"]
    assert found in texts
    assert listed == {name: digest(tmp_path / name) for name in found}


def test_a_kill_mixes_no_sealed_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A folder with sub-folders, each sealed, above them a seal for all; the new run has others."""
    out, copies = tmp_path / "out", []
    move = Path.replace

    def copied(self: Path, target: Path) -> Path:
        copies.append(shutil.copytree(out, tmp_path / f"copy-{len(copies)}"))
        return move(self, target)

    def report(places: str, text: str, out: Path = out) -> dict[str, str]:
        with OutputFolder(out, force=True, names=["run.json", "index.html"]) as folder:
            for place in places:
                folder.write(f"{place}/page.html", text + place)
                folder.write(f"{place}/run.json", json.dumps({"files": folder.digests(place)}))
            folder.write("index.html", text)
            folder.write("run.json", json.dumps({"files": folder.digests()}))
        return digests(out)

    old = report("ab", "old")
    monkeypatch.setattr(Path, "replace", copied)
    new = report("bc", "new")
    inner = {f"{place}/{name}" for place in "bc" for name in ("page.html", "run.json")}
    assert new.keys() == {"index.html", "run.json"} | inner
    monkeypatch.undo()
    for copy in copies:
        again = shutil.copytree(copy, tmp_path / "again")
        report("bc", "new", again)
        shutil.rmtree(next(again.glob(".vftcli-*.partial")))
        assert digests(again) == new  # nothing of the first run outlives the second
        shutil.rmtree(again)
        shutil.rmtree(next(copy.glob(".vftcli-*.partial")))
        found = digests(copy)
        for seal in [name for name in found if name.endswith("run.json")]:
            place = seal.removesuffix("run.json")
            listed = json.loads((copy / seal).read_text())["files"]
            beside = {n.removeprefix(place): d for n, d in found.items() if n.startswith(place)}
            beside.pop("run.json")
            assert listed == beside
        assert "run.json" not in found or found == old
    # Six files go and six come; the first change leaves the old one as it is.
    assert len(copies) == 12
    assert sum(digests(copy) == old for copy in copies) == 1
