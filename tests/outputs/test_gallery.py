"""docs/pictures holds what its script takes; every picture is shown on a page, and is small."""

import json
import shlex

from gallery import EXAMPLE, EXHIBITS, LARGEST, PICTURES, ROOT

from vftcli.signals.packages import VERSION


def test_every_picture_is_taken_shown_and_small() -> None:
    names = {f"{picture.name}.png" for picture in EXHIBITS}
    sizes = {path.name: path.stat().st_size for path in PICTURES.iterdir()}
    assert set(sizes) == names
    assert max(sizes.values()) <= LARGEST
    pages = [ROOT / "README.md", *(ROOT / "docs").glob("*.md")]
    text = "".join(page.read_text("utf-8") for page in pages)
    assert not [name for name in names if f"pictures/{name})" not in text]


def test_the_example_is_of_this_version_complete_and_small() -> None:
    folder = ROOT / "docs" / "example"
    written = json.loads((folder / "run.json").read_text("utf-8"))
    assert written["versions"]["vftcli"] == VERSION
    assert {*shlex.split(written["command"]), "--force"} == set(shlex.split(EXAMPLE))
    assert {path.name for path in folder.iterdir()} == {"run.json", *written["files"]}
    assert sum((folder / f).stat().st_size for f in ("index.html", "recording.rrd")) <= 1_000_000
