"""What the terminal shows of five logs: screens.md is made, and tested, by running them.

Example: VFT_LOGS=logs python tests/outputs/screens.py
"""

import contextlib
import os
import re
import shlex
from collections.abc import Iterator, Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

from typer.testing import CliRunner

from vftcli.cli import make_app

app = make_app()

ROOT = Path(__file__).parents[2]
PAGE = Path(__file__).parent / "screens.md"
COLUMNS = "88"
"""Width of the terminal."""


class Screen(NamedTuple):
    """One command of the page."""

    command: str  # as it is typed, beside the logs
    files: Mapping[str, str]  # that it names → where they are, under fixtures or the real logs
    real: bool


SCREENS = {
    **{
        log: Screen(
            f"vftcli report {log}.csv --robot ur10e --free free_14harm.csv -o {folder}",
            {name: f"ur10e/{name}" for name in (f"{log}.csv", "free_14harm.csv")},
            real=True,
        )
        for log, folder in (("push_pose", "push"), ("load_14harm", "load"))
    },
    "ur5_circle": Screen(
        "vftcli report ur5_circle.csv --robot ur5 --free 0.3:4 --reference two-cycle -o circle",
        {"ur5_circle.csv": "ur5_circle.csv"},
        real=False,
    ),
    "libfranka_sim": Screen(
        "vftcli report pushes.csv.gz --robot robot.toml --free 0.3:4 -o franka",
        {name: f"libfranka_sim/{name}" for name in ("pushes.csv.gz", "robot.toml")},
        real=True,
    ),
    "panda_bearing": Screen(
        "vftcli report panda_bearing.csv --robot panda --free 0.3:3.9 -o bearing",
        {"panda_bearing.csv": "panda_bearing.csv"},
        real=False,
    ),
}
"""Name of the log → what is run."""
OF_STORY = {
    "ur10_exciting.db3": "salerno_ur10/ur10_exciting.db3",
    "traj_raw.csv": "panda_ati/traj_raw.csv",
}
"""Name of a log in docs/story.md → where it is among the real logs."""


def shown(screen: Screen, logs: Path, folder: Path) -> str:
    """What a command prints, run in an empty folder that gets the logs it names."""
    for name, place in screen.files.items():
        (folder / name).symlink_to((logs / place).resolve())
    with contextlib.chdir(folder):
        result = CliRunner(env={"COLUMNS": COLUMNS}).invoke(app, shlex.split(screen.command)[1:])
    assert result.exit_code == 0, result.output
    return result.stdout


def printed() -> dict[str, str]:
    """What the page says of each command. Command → output."""
    text = PAGE.read_text(encoding="utf-8")
    blocks = re.findall(r"^```console\n\$ (.*?)\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)
    return dict(blocks)


def pages(logs: Path) -> Iterator[str]:
    """The text of the page with every command run anew."""
    text = PAGE.read_text(encoding="utf-8")
    yield text[: text.index("## ")]
    for name, screen in SCREENS.items():
        with TemporaryDirectory() as folder:
            output = shown(screen, logs if screen.real else ROOT / "fixtures", Path(folder))
        yield f"## {name}\n\n```console\n$ {screen.command}\n{output.rstrip()}\n```\n\n"


def main() -> None:
    """Write the page anew."""
    text = "".join(pages(Path(os.environ["VFT_LOGS"]))).rstrip() + "\n"
    PAGE.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
