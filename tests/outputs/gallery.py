"""What vftcli makes: docs/pictures and docs/example are made by running commands.

It needs the extras figures and browser, a Chromium, and xvfb-run and xdotool for the recording.
Example: VFT_LOGS=logs python tests/outputs/gallery.py
"""

import os
import shlex
import shutil
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

from screens import OF_STORY

ROOT = Path(__file__).parents[2]
PICTURES = ROOT / "docs" / "pictures"
LARGEST = 60_000
"""Bytes of a picture."""
WINDOW = (1440, 800)
"""Pixels of the Rerun viewer."""
TOUCHED = (11.1, 11.5)
"""Within a hard contact of the recording, on the side of the arm that is seen. [s]"""


class Picture(NamedTuple):
    """One picture of what a command made."""

    name: str  # of the file in docs/pictures, without `.png`
    source: str  # file that the commands made
    height: int = 0  # how much of a page is shown [px]


DRAWN = ("torque", "force", "errors")
COMMANDS = (
    "vftcli report fixtures/ur5_circle.csv --robot ur5 --reference two-cycle --figures png"
    " -o circle",
    "vftcli report fixtures/ur5_circle.csv fixtures/ur5_table1.csv --robot ur5 -o logs",
    "vftcli simulate free-excitation -o excitation.csv",
    "vftcli identify excitation.csv --robot ur5 -o arm.toml",
    "vftcli admit --release x=0.3 --robot ur5 --alpha 1,1.3,1.6,1.9 -o release",
    "vftcli identify ur10_exciting.db3 --columns tau=effort --robot ur10 --interval 0:13.7"
    " -o my_ur10.toml",
    "vftcli compare ur10_exciting.db3 --columns tau=effort --robot my_ur10.toml --reference zero"
    " --interval 13.7:27.5 --figures png -o after",
)
EXHIBITS = (
    Picture("report", "circle/index.html", 1040),
    Picture("recording", "circle/recording.rrd"),
    *(Picture(name, f"circle/figures/{name}-double.png") for name in DRAWN),
    Picture("index", "logs/index.html", 290),
    Picture("identify", "arm.html", 985),
    Picture("admit", "release/index.html", 1062),
    Picture("story", "after/figures/errors-double.png"),
)
"""Pictures of what the commands make, one after the other."""
EXAMPLE = (
    "vftcli report fixtures/ur5_circle.csv --robot ur5 --free 3:4 --interval 3:6.6"
    " --observer best --force -o docs/example"
)
"""Makes the example page, from the folder above docs: of 3.6 s, so that the recording is small."""


def launch_touched() -> None:
    """Run vftcli; a recording plays the middle of a hard contact instead of resting at zero.

    Rerun lets no file say where its time cursor is, and at the first sample nothing touches the
    arm. The picture is taken within a second or so of its clock: the playing is quick.
    """
    import rerun.blueprint as rrb

    from vftcli.cli import launch

    span = rrb.components.AbsoluteTimeRange(*(round(1e9 * t) for t in TOUCHED))
    playing = {"play_state": "playing", "playback_speed": 100.0}
    playing |= {"loop_mode": "selection", "time_selection": span}
    resting = rrb.TimePanel
    rrb.TimePanel = lambda **words: resting(**words | playing)
    launch()


def run(command: str, folder: Path) -> None:
    """Run a command in a folder."""
    code = "from gallery import launch_touched; launch_touched()"
    paths = os.pathsep.join([str(ROOT), str(Path(__file__).parent)])
    words = [sys.executable, "-c", code, *shlex.split(command)[1:]]
    subprocess.run(words, cwd=folder, env=os.environ | {"PYTHONPATH": paths}, check=True)


def photograph(page_path: Path, height: int, path: Path) -> None:
    """Take the picture of a page: its first pixels."""
    from playwright.sync_api import sync_playwright

    program = shutil.which("chromium") or shutil.which("google-chrome")
    with sync_playwright() as running:
        browser = running.chromium.launch(executable_path=program, args=["--no-sandbox"])
        tab = browser.new_page(viewport={"width": 1280, "height": height})
        tab.goto(page_path.as_uri())
        tab.wait_for_timeout(1000)
        tab.screenshot(path=path)
        browser.close()


def photograph_recording(recording: Path, path: Path) -> None:
    """Take the picture of a recording in the Rerun viewer."""
    width, height = WINDOW
    viewer = Path(sys.executable).parent / "rerun"
    words = ["--window-size", f"{width}x{height}", "--screenshot-to", str(path), str(recording)]
    place = ["xvfb-run", "-a", "-s", f"-screen 0 {width}x{height}x24"]
    # Where the pointer rests in the middle it opens a box over the arm; the viewer may begin late.
    corner = f"xdotool mousemove {width - 1} {height - 2} mousemove {width - 1} {height - 1}"
    away = f"(while {corner}; do sleep 0.3; done) 2> /dev/null &"
    aside = f"{corner}; {away} exec {shlex.join([str(viewer), *words])}"
    subprocess.run([*place, "sh", "-c", aside], check=True, capture_output=True)


def shrink(path: Path) -> None:
    """Make a picture of few colours of one, small enough for the repository."""
    from PIL import Image

    with Image.open(path) as opened:
        picture = opened.convert("RGB")
    if picture.width > WINDOW[0]:
        picture = picture.resize((WINDOW[0], picture.height * WINDOW[0] // picture.width))
    for colours in (256, 128, 64, 32, 16):
        few = picture.quantize(colours, Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE)
        few.save(path, optimize=True)
        if path.stat().st_size <= LARGEST:
            return


def take(picture: Picture, folder: Path) -> None:
    """Take one picture of what a command made in a folder."""
    source, path = folder / picture.source, PICTURES / f"{picture.name}.png"
    if source.suffix == ".html":
        photograph(source, picture.height, path)
    elif source.suffix == ".rrd":
        photograph_recording(source, path)
    else:
        shutil.copyfile(source, path)
    shrink(path)


def main() -> None:
    """Take every picture anew, and make the example."""
    run(EXAMPLE, ROOT)
    PICTURES.mkdir(exist_ok=True)
    with TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "fixtures").symlink_to(ROOT / "fixtures")
        for log, place in OF_STORY.items():
            (folder / log).symlink_to(Path(os.environ["VFT_LOGS"]) / place)
        for command in COMMANDS:
            run(command, folder)
        for picture in EXHIBITS:
            take(picture, folder)


if __name__ == "__main__":
    main()
