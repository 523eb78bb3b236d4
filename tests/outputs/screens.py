"""What the terminal shows of five logs: screens.md is made, and tested, by running them.

Example: VFT_LOGS=logs python tests/outputs/screens.py
"""

import contextlib
import os
import re
import shlex
from pathlib import Path
from tempfile import TemporaryDirectory

from typer.testing import CliRunner

from vftcli.cli import make_app

app = make_app()

ROOT = Path(__file__).parents[2]
PAGE = Path(__file__).parent / "screens.md"
COLUMNS = "88"
"""Width of the terminal."""
BLOCK = re.compile(r"^```console\n\$ (.*?)\n(.*?)^```$", re.MULTILINE | re.DOTALL)


REAL = {
    **{name: f"ur10e/{name}" for name in ("push_pose.csv", "load_14harm.csv", "free_14harm.csv")},
    **{name: f"libfranka_sim/{name}" for name in ("pushes.csv.gz", "robot.toml")},
}
"""Name of a file in a command of the page → where it is among the real logs, else in fixtures."""
OF_STORY = {
    "ur10_exciting.db3": "salerno_ur10/ur10_exciting.db3",
    "traj_raw.csv": "panda_ati/traj_raw.csv",
}
"""Name of a log in docs/story.md → where it is among the real logs."""


def shown(command: str, logs: Path | None, folder: Path) -> str:
    """What a command prints, run in an empty folder that gets the logs it names."""
    for word in shlex.split(command):
        if word in REAL and logs is not None:
            (folder / word).symlink_to((logs / REAL[word]).resolve())
        elif (ROOT / "fixtures" / word).exists():
            (folder / word).symlink_to(ROOT / "fixtures" / word)
    with contextlib.chdir(folder):
        result = CliRunner(env={"COLUMNS": COLUMNS}).invoke(app, shlex.split(command)[1:])
    assert result.exit_code == 0, result.output
    return result.stdout


def printed() -> dict[str, str]:
    """What the page says of each command. Command → output."""
    return dict(BLOCK.findall(PAGE.read_text(encoding="utf-8")))


def anew(block: re.Match[str]) -> str:
    with TemporaryDirectory() as folder:
        output = shown(block[1], Path(os.environ["VFT_LOGS"]), Path(folder))
    return f"```console\n$ {block[1]}\n{output.rstrip()}\n```"


def main() -> None:
    """Write the page anew."""
    PAGE.write_text(BLOCK.sub(anew, PAGE.read_text(encoding="utf-8")), encoding="utf-8")


if __name__ == "__main__":
    main()
