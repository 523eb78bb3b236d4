"""Manifests: what an entry says, what is refused, and which rows would be unfair."""

import shutil
from dataclasses import replace
from pathlib import Path

import pytest
from example_logs import CIRCLE

from vftcli.batch.log_work import digest_of
from vftcli.reproduction.manifest import Manifest, Rival, load_manifest, rival_of
from vftcli.signals.errors import ParameterError

ENTRY = '[[log]]\nname = "a"\narm = "UR5"\ntruth = "free"\nfile = "a.csv"\nday = "monday"\n'


@pytest.fixture(autouse=True)
def _unread() -> None:
    digest_of.cache_clear()


def made(folder: Path, text: str) -> Manifest:
    """A manifest beside two logs of equal bytes and a third."""
    for name in ("a.csv", "b.csv"):
        shutil.copy(CIRCLE, folder / name)
    (folder / "c.csv").write_text("t\n")
    (folder / "my.toml").write_text(text)
    return load_manifest(str(folder / "my.toml"), None)


def other(name: str, day: str) -> str:
    entry = ENTRY.replace('"a"', f'"{name}"').replace("a.csv", f"{name}.csv")
    return entry.replace("monday", day)


def lines(manifest: Manifest, rivals: tuple[Rival, ...] = ()) -> list[str]:
    return [line for _, line in manifest.complaints(rivals)]


def test_an_entry_with_pushes_is_two_logs(tmp_path: Path) -> None:
    text = ENTRY + 'robot = "ur5"\ncolumns = "t,q:6"\npushes = [[4, 0.5, [10, 0, 0]]]\n'
    free, pushed = made(tmp_path, text).logs.values()
    assert (free.name, free.arm, free.pushes) == ("a", "UR5", ())
    assert (pushed.name, pushed.arm) == ("a-pushed", "UR5 (planted)")
    assert dict(pushed.options) == {"robot": "ur5", "columns": "t,q:6"}


def test_an_entry_has_the_keys_of_its_arm_and_its_own_go_before(tmp_path: Path) -> None:
    arm = '[[arm]]\nname = "UR5"\nrobot = "ur5"\nlicence = "MIT"\nfree = ["0:0.1"]\n'
    text = arm + ENTRY + other("b", "tuesday") + 'licence = "GPL-3.0"\n'
    theirs, own = made(tmp_path, text).logs.values()
    assert dict(theirs.options) == dict(own.options) == {"robot": "ur5"}
    assert (theirs.free, theirs.protocols) == (("0:0.1",), ("alone", "free"))
    assert (theirs.licence, own.licence) == ("MIT", "GPL-3.0")


@pytest.mark.parametrize("name", ["sim", "field"])
def test_built_in_manifests_are_whole(name: str, tmp_path: Path) -> None:
    manifest = load_manifest(name, tmp_path)
    logs = manifest.logs.values()
    for log in logs:
        assert log.source or log.scenario
        assert log.licence or log.scenario
        assert len(log.sha256) == 64 or log.scenario or log.parts
    assert len(manifest.absent()) == len([x for x in logs if x.file or x.parts]) - sum(
        bool(x.pushes) for x in logs if not x.scenario
    )


@pytest.mark.parametrize(("text", "complaint"), [
    ("", "no [[log]]"),
    ("[[logs]]\n", "Did you mean log?"),
    ("[log]\n", "log is not a list of tables; write [[log]]"),
    ("log = [3]\n", "log is not a list of tables; write [[log]]"),
    (ENTRY + '[[arm]]\nname = "UR3"\n', "no log of arm 'UR3'; there is UR5"),
    (ENTRY + '[[arm]]\nrobot = "ur3"\n', "no log of arm ''; there is UR5"),
    (ENTRY + '[[arm]]\nname = "UR5"\nfole = 3\n', "log a.fole"),
    (ENTRY.replace("free", "guess"), "truth 'guess'"),
    (ENTRY + "fole = 3\n", "log a.fole"),
    (ENTRY + 'scenario = "ur5-circle"\n', "one of file, parts, scenario"),
    (ENTRY + "score = [[1]]\n", "log a.score"),
    (ENTRY + ENTRY, "two logs are called a"),
    (ENTRY + 'free = ["z"]\n', "no free log 'z'"),
    (ENTRY + 'identified = "z"\n', "no [[robot]] 'z'"),
    ('[[log]]\narm = "x"\ntruth = "free"\n', "log.name is missing"),
    (ENTRY.replace('"a"', '"../a"'), "a name has letters"),
    ("x = \n", "not valid TOML"),
    (ENTRY.replace("free", "weight"), "weight_N is missing"),
    (ENTRY + 'protocols = ["identified"]\n', "identified is missing"),
    (ENTRY + 'protocols = ["both"]\n', "protocol 'both'"),
    (ENTRY + "score = [[20, 10]]\n", "last longer than 0 s"),
    (ENTRY + "score = [[10, 10]]\n", "last longer than 0 s"),
    (ENTRY + "contacts = [[5, 4]]\n", "last longer than 0 s"),
    (ENTRY + "contacts = [[1]]\n", "log a.contacts[0] has 1 entries; it must have 3"),
    (ENTRY + "pushes = [[1, 0, [1, 0, 0]]]\n", "longer than 0 s"),
    (ENTRY.replace('file = "a.csv"', 'parts = ["t"]'), "t=time.txt"),
])  # fmt: skip
def test_a_wrong_entry_is_refused_in_one_line(tmp_path: Path, text: str, complaint: str) -> None:
    with pytest.raises(ParameterError) as error:
        made(tmp_path, text)
    assert complaint in str(error.value)
    assert "\n" not in str(error.value)


def test_a_manifest_that_is_not_there_names_the_nearest(tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match="Did you mean field"):
        load_manifest("fild", None)
    with pytest.raises(ParameterError, match="cannot be read"):
        load_manifest(str(tmp_path / "no.toml"), None)


ROBOT = '[[robot]]\nname = "r"\ntrain = ["{}"]\n'
IDENTIFIED, SCORED = ENTRY + 'identified = "r"\n', ENTRY + "score = [[10, 20]]\n"


@pytest.mark.parametrize(("text", "line"), [
    # Another name for the scored file.
    (ROBOT.format("b") + IDENTIFIED + other("b", "tuesday"), "another name"),
    (ENTRY + 'free = ["b"]\n' + other("b", "tuesday"), "another name"),
    # The same day.
    (ROBOT.format("c") + IDENTIFIED + other("c", "monday"), "same day"),
    # The log itself, less than a second from what is scored.
    (ROBOT.format("a") + IDENTIFIED, "(0 s to the end) must stay 1 s away from score (1 s to"),
    (SCORED + 'free = ["20.9:30"]\n', "free (20.9 s to 30 s) must stay 1 s away from score"),
    (SCORED + 'free = ["0:9.5"]\n', "free (0 s to 9.5 s) must stay 1 s away from score (10 s"),
])  # fmt: skip
def test_what_would_be_unfair_is_one_line(tmp_path: Path, text: str, line: str) -> None:
    (found,) = lines(made(tmp_path, text))
    assert found.startswith("a")
    assert line in found


def test_what_is_fair_has_no_line(tmp_path: Path) -> None:
    earlier = ROBOT.format("a").replace("train", 'interval = "0:8"\ntrain')
    later = ENTRY + 'identified = "r"\nscore = [[9, 20]]\nfree = ["0:8", "21:30"]\n'
    assert not lines(made(tmp_path, earlier + later))
    another_day = ROBOT.format("c") + IDENTIFIED + other("c", "tuesday")
    assert not lines(made(tmp_path, another_day))


def test_a_wrong_hash_and_a_missing_log(tmp_path: Path) -> None:
    text = ENTRY + f'sha256 = "{"0" * 64}"\n' + other("z", "tuesday") + 'source = "a page"\n'
    manifest = made(tmp_path, text)
    (line,) = lines(manifest)
    assert "sha256" in line
    assert manifest.absent() == [f"z: no {tmp_path / 'z.csv'}; source: a page"]


def test_a_log_with_pushes_has_every_line_once(tmp_path: Path) -> None:
    text = ENTRY + f'sha256 = "{"0" * 64}"\nfree = ["0:9.5"]\npushes = [[4, 0.5, [10, 0, 0]]]\n'
    near, sha = lines(made(tmp_path, text))
    assert near.startswith(
        "a: free (0 s to 9.5 s) must stay 1 s away from score (1 s to the end)"
    )
    assert "sha256" in sha


def test_a_rival_says_what_it_was_trained_on(tmp_path: Path) -> None:
    manifest = made(tmp_path, ENTRY)
    (tmp_path / "est").mkdir()
    (tmp_path / "est" / "a.csv").write_text("t\n")
    fair = Rival(name="next", folder=str(tmp_path / "est"))
    unfair = replace(fair, training=(digest_of(CIRCLE),))
    assert not lines(manifest, (fair,))
    (line,) = lines(manifest, (unfair,))
    assert line.startswith("a: next was trained on it")


@pytest.mark.parametrize(("words", "complaint"), [
    ("next", "not NAME=DIR"),
    ("best={}", "one of our rows"),
    ("next={}/none", "no folder"),
    ("next={}", "protocol 'magic'"),
    ("next={}/empty", "empty has no file; LOG.csv or LOG.parquet is looked for"),
    ("next={}/other", "other has zz.csv; LOG.csv"),
])  # fmt: skip
def test_a_wrong_rival_is_refused(tmp_path: Path, words: str, complaint: str) -> None:
    (tmp_path / "rival.toml").write_text('protocol = "magic"\n')
    manifest = made(tmp_path, ENTRY)
    for name in ("empty", "other"):
        (tmp_path / name).mkdir()
    (tmp_path / "other" / "zz.csv").write_text("t\n")
    with pytest.raises(ParameterError, match=complaint):
        rival_of(words.format(tmp_path), manifest.logs)
