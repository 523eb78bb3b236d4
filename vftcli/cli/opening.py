"""`vftcli open`, and what `--open` does: the page in the browser, else the recording."""

import subprocess
import sys
import webbrowser
from pathlib import Path
from typing import Annotated

from vftcli.cli.options import command
from vftcli.signals.option import Option

PAGE, RECORDING = ".html", ".rrd"  #: Endings of what can be opened, the one that goes before first.


@command
def open_folder(
    folder: Annotated[
        Path, Option("", "DIR", "A folder that a command wrote, or one page or recording in it.")
    ],
) -> None:
    """Open the page of a folder that a command wrote.

    How to open its recording is said; without a page its recording is opened in the Rerun viewer.

    Example: vftcli open out
    """
    open_made(folder)


def open_made(path: Path) -> None:
    """Open a page in the browser, else a recording in the viewer, and say what was opened."""
    from vftcli.cli.console import say
    from vftcli.signals.errors import OutputError
    from vftcli.signals.packages import check_installed

    page, recording = found_at(path, PAGE), found_at(path, RECORDING)
    if page is not None:
        if not webbrowser.open(page.resolve().as_uri()):
            say(f"no browser could be started: open {page} in one")
        if recording is not None:
            say(f"the recording: vftcli open {recording}")
    elif recording is not None:
        check_installed("rerun", f"the viewer of {recording}")
        words = [sys.executable, "-m", "rerun", str(recording)]
        quiet = subprocess.DEVNULL
        # It goes on when the command has ended.
        subprocess.Popen(words, stdin=quiet, stdout=quiet, stderr=quiet, start_new_session=True)
        say(f"{recording} opens in the Rerun viewer; a click on a time of its log goes there")
    else:
        what = "holds no page and no recording" if path.exists() else "does not exist"
        raise OutputError(
            f"{path} {what}; `vftcli report LOG -o DIR` writes both, `vftcli estimate LOG --rrd "
            "-o DIR` a recording"
        )


def found_at(path: Path, ending: str) -> Path | None:
    """The file of this ending: itself, the one of its name beside it, or the first of a folder."""
    if path.is_dir():
        # index.html goes before pages that other tools may have left there.
        files = sorted(path.glob(f"*{ending}"), key=lambda file: (file.stem != "index", file.name))
        return files[0] if files else None
    if not path.is_file():
        return None
    if path.suffix == ending:
        return path
    # Of two that were named one after the other the recording is the one that was asked for.
    if path.suffix == RECORDING:
        return None
    beside = path.with_suffix(ending)
    return beside if beside.is_file() else None
