"""From logs to their lists of contacts: what a command or a notebook asks."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from vftcli.contacts.contact_list import ContactList
from vftcli.contacts.listing import list_contacts
from vftcli.doctor.examiner import Examiner
from vftcli.readers.library import Library
from vftcli.readers.reader import ReadChoice
from vftcli.repetition.choice import FreeChoice
from vftcli.repetition.free_motion import FreeMotion
from vftcli.repetition.free_run import FreeRun, Models
from vftcli.robots.choice import RobotChoice
from vftcli.robots.robot import Robot
from vftcli.signals.recording import Recording


@dataclass(frozen=True, kw_only=True)
class ContactChoice:
    """What a user asks of the contacts of logs.

    Attributes:
        read: How the logs are read, and which part of them is used.
        robot: Which arm made them, and how it is modelled.
        free: What motion nobody touched.
        library: Where the logs are read, each once.
        examiner: Who examines them, each once, and says whether results mean anything.
    """

    read: ReadChoice = field(default_factory=ReadChoice)
    robot: RobotChoice = field(default_factory=RobotChoice)
    free: FreeChoice = field(default_factory=FreeChoice)
    library: Library = field(default_factory=Library, repr=False, compare=False)
    examiner: Examiner = field(default_factory=Examiner, repr=False, compare=False)


def contact_lists(logs: Iterable[Path], choice: ContactChoice) -> Iterator[ContactList]:
    """The contacts of each log; what they share is made once.

    Raises:
        VftError: If a log cannot be read, is meaningless with this robot, or named twice.
    """
    models = Models()
    for recording in choice.library.open_logs(list(logs), choice.read):
        robot = choice.examiner.robot(recording, choice.robot)
        yield list_contacts(motion_of(recording, robot, choice, models))


def motion_of(
    recording: Recording, robot: Robot, choice: ContactChoice, models: Models
) -> FreeMotion:
    """A log and its free runs, examined.

    Raises:
        ExaminationError: If a finding makes every result meaningless.
    """
    examiner = choice.examiner
    log = models.of(examiner.taken(recording, robot, choice.read), robot)
    runs = []
    for path in choice.free.logs:
        free = examiner.taken(choice.library.open(path, choice.read.whole), robot, choice.read)
        runs.append(FreeRun(run=models.of(free, robot), log=log))
    for run in (log, *(free.run for free in runs)):
        examiner.examine(run.recording, robot)
    return FreeMotion(log=log, choice=choice.free, runs=tuple(runs))


def contacts_of_log(
    log: str | Path,
    robot: str | None = None,
    *,
    free: Sequence[str | Path] = (),
    free_part: str | None = None,
    columns: str | None = None,
    interval: str | None = None,
) -> ContactList:
    """What touched the arm along a log, for notebooks.

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
    choice = ContactChoice(
        read=ReadChoice.parsed(columns=columns, interval=interval),
        robot=RobotChoice.parsed(robot=robot),
        free=FreeChoice.parsed(free=free, free_part=free_part),
        library=Library([log]),
    )
    return next(contact_lists([Path(log)], choice))
