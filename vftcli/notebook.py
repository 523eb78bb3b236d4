"""One call a question, for notebooks: what a command answers, as objects."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from vftcli.pipeline import AnalysisChoice, analyse_logs, list_touches
from vftcli.readers.library import Library
from vftcli.readers.reader import ReadChoice
from vftcli.repetition.choice import FreeChoice
from vftcli.robots.choice import RobotChoice

if TYPE_CHECKING:
    from vftcli.contacts.contact_list import ContactList


def contacts(
    log: str | Path,
    robot: str | None = None,
    *,
    free: Sequence[str | Path] = (),
    free_part: str | None = None,
    columns: str | None = None,
    interval: str | None = None,
) -> "ContactList":
    """What touched the arm along a log.

    Args:
        log: A log file or bag directory.
        robot: A profile, FILE.toml or FILE.urdf; None where the log settles it.
        free: Motion that nobody touched: other logs, or spans ``A:B`` of this one. [s]
        free_part: The same as one span ``A:B``. [s]
        columns: Columns of a table, as ``--columns``.
        interval: The span ``A:B`` to use. [s]

    Raises:
        VftError: If the log cannot be read, or is meaningless with this robot.
    """
    choice = AnalysisChoice(
        read=ReadChoice.parsed(columns=columns, interval=interval),
        robot=RobotChoice.parsed(robot=robot),
        free=FreeChoice.parsed(free=free, free_part=free_part),
        library=Library([log]),
    )
    found = next(analyse_logs([Path(log)], choice, work=list_touches)).contacts
    assert found is not None, "a log that tells no contacts raises"
    return found
