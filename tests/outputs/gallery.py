"""Pictures of what vftcli makes: docs/gallery.md and docs/pictures are made by running commands.

It needs the extras figures and browser, a Chromium, and xvfb-run and xdotool for the recording.
Example: python tests/outputs/gallery.py
"""

import os
import pty
import shlex
import shutil
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "gallery.md"
PICTURES = ROOT / "docs" / "pictures"
LARGEST = 150_000
"""Bytes of a picture."""
WINDOW = (1440, 800)
"""Pixels of the Rerun viewer."""
HARDEST = (11.1, 11.5)
"""Within the hardest contact of the recording that is shown. [s]"""
HEAD = """# Gallery

What the terminal, pages, recordings and figures look like. All logs here are simulated; those under
`fixtures/` come with vftcli.
`tests/outputs/gallery.py` runs the commands and takes the pictures.
"""


class Picture(NamedTuple):
    """One picture of what a command made.

    Attributes:
        name: File in docs/pictures, without `.png`.
        source: File that the commands made; none for what the terminal shows.
        text: What is seen, for those who do not see it too.
        height: How much of a page is shown [px].
    """

    name: str
    source: str
    text: str
    height: int = 0


class Exhibit(NamedTuple):
    """Commands and the pictures of what they make."""

    title: str
    commands: tuple[str, ...]
    pictures: tuple[Picture, ...]


EXHIBITS = (
    Exhibit(
        "A log, reported",
        (
            "vftcli report fixtures/ur5_circle.csv --robot ur5 --reference two-cycle"
            " --figures png -o circle",
        ),
        (
            Picture(
                "terminal",
                "",
                "The terminal: the force over time, the contacts, what may be believed",
            ),
            Picture(
                "report",
                "circle/index.html",
                "The page: the contacts on a line of time, and a table of them",
                1162,
            ),
            Picture(
                "recording",
                "circle/recording.rrd",
                "The recording: the arm, the force where it is touched, and the force over time",
            ),
            Picture(
                "torque",
                "circle/figures/torque-double.png",
                "The torque of every joint: the best estimate with its band, and the reference",
            ),
            Picture(
                "wrench",
                "circle/figures/wrench-double.png",
                "The force at the flange with its band, and the contacts by number",
            ),
            Picture(
                "errors",
                "circle/figures/errors-double.png",
                "RMSE of every observer and joint, and the floor of the reference",
            ),
            Picture(
                "spectra",
                "circle/figures/spectra-double.png",
                "Spectra of contact and noise, and what every observer passes",
            ),
        ),
    ),
    Exhibit(
        "Several logs",
        ("vftcli report fixtures/ur5_circle.csv fixtures/ur5_table1.csv --robot ur5 -o logs",),
        (
            Picture(
                "index",
                "logs/index.html",
                "The index over several logs: a line each, the worst first",
                360,
            ),
        ),
    ),
    Exhibit(
        "An arm, identified",
        (
            "vftcli simulate free-excitation -o excitation.csv",
            "vftcli identify excitation.csv --robot ur5 -o arm.toml",
        ),
        (Picture("identify", "arm.html", "The page of an identification", 985),),
    ),
    Exhibit(
        "Controllers, compared",
        (
            "vftcli admit --release x=0.3 --robot ur5 --alpha 1,1.3,1.6,1.9"
            " --figures png -o release",
        ),
        (
            Picture(
                "admit",
                "release/index.html",
                "The page of a release under the paper's controllers",
                1062,
            ),
            Picture(
                "release", "release/figures/release-double.png", "The figure of the same release"
            ),
        ),
    ),
)
"""What is shown, in order."""


def page() -> str:
    """The text of the page."""
    parts = [HEAD]
    for exhibit in EXHIBITS:
        typed = "\n".join(f"$ {command}" for command in exhibit.commands)
        parts.append(f"## {exhibit.title}\n\n```console\n{typed}\n```\n")
        parts += [
            f"{each.text}.\n\n![{each.text}](pictures/{each.name}.png)\n"
            for each in exhibit.pictures
        ]
    return "\n".join(parts)


def launch_touched() -> None:
    """Run vftcli; a recording plays the middle of the hardest contact instead of resting at zero.

    Rerun lets no file say where its time cursor stands, and at the first sample nothing touches the
    arm. The picture is taken within a second or so of its clock: the playing is quick.
    """
    import rerun.blueprint as rrb

    from vftcli.cli import launch
    from vftcli.outputs import rerun_file

    def playing(marked: tuple[float, float] | None) -> rrb.TimePanel:
        del marked
        span = rrb.components.AbsoluteTimeRange(*(round(1e9 * t) for t in HARDEST))
        return rrb.TimePanel(
            timeline="t",
            state="collapsed",
            play_state="playing",
            playback_speed=100.0,
            loop_mode="selection",
            time_selection=span,
        )

    rerun_file.time_panel = playing
    launch()


def screen_of(command: str, folder: Path) -> str:
    """What a command prints into a terminal of 100 columns, colours in it.

    Raises:
        SystemExit: The command failed.
    """
    kept = bytearray()

    def keep(terminal: int) -> bytes:
        block = os.read(terminal, 65536)
        kept.extend(block)
        return block

    code = "from gallery import launch_touched; launch_touched()"
    words = shlex.join([code, *shlex.split(command)[1:]])
    line = f"cd {shlex.quote(str(folder))} && {sys.executable} -c {words} 2> /dev/null"
    paths = os.pathsep.join([str(ROOT), str(Path(__file__).parent)])
    os.environ |= {"COLUMNS": "100", "TERM": "xterm-256color", "PYTHONPATH": paths}
    if pty.spawn(["sh", "-c", line], keep):
        raise SystemExit(f"failed: {command}")
    return kept.decode().replace("\r", "")


def terminal_page(command: str, screen: str, path: Path) -> None:
    """Write a terminal as a page of a browser."""
    from rich.console import Console
    from rich.terminal_theme import MONOKAI
    from rich.text import Text

    with Path(os.devnull).open("w", encoding="utf-8") as nowhere:
        console = Console(record=True, width=100, file=nowhere, force_terminal=True)
        console.print(Text.from_ansi(f"$ {command}\n{screen}".rstrip()))
    style = "body{padding:16px}pre{font:15px/1.17 'DejaVu Sans Mono',monospace!important}"
    html = console.export_html(theme=MONOKAI, inline_styles=True)
    path.write_text(html.replace("</head>", f"<style>{style}</style></head>"), encoding="utf-8")


def photograph(page_path: Path, height: int, path: Path) -> None:
    """Take the picture of a page: its first pixels, or all of it for a height of zero."""
    from playwright.sync_api import sync_playwright

    program = shutil.which("chromium") or shutil.which("google-chrome")
    with sync_playwright() as running:
        browser = running.chromium.launch(executable_path=program, args=["--no-sandbox"])
        tab = browser.new_page(
            viewport={"width": 980 if not height else 1180, "height": height or 400}
        )
        tab.goto(page_path.as_uri())
        tab.wait_for_timeout(1000)
        tab.screenshot(path=path, full_page=not height)
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


def take(picture: Picture, command: str, screen: str, folder: Path) -> None:
    """Take one picture of what a command made in a folder."""
    source, path = folder / picture.source, PICTURES / f"{picture.name}.png"
    if not picture.source:
        terminal_page(command, screen, folder / "terminal.html")
        photograph(folder / "terminal.html", 0, path)
    elif source.suffix == ".html":
        photograph(source, picture.height, path)
    elif source.suffix == ".rrd":
        photograph_recording(source, path)
    else:
        shutil.copyfile(source, path)
    shrink(path)


def main() -> None:
    """Write the page and its pictures anew."""
    PAGE.write_text(page(), encoding="utf-8")
    PICTURES.mkdir(exist_ok=True)
    with TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "fixtures").symlink_to(ROOT / "fixtures")
        for exhibit in EXHIBITS:
            for command in exhibit.commands:
                screen = screen_of(command, folder)
            for picture in exhibit.pictures:
                take(picture, command, screen, folder)


if __name__ == "__main__":
    main()
