"""Examiner: who examines the logs of a command, each once, and turns the meaningless ones away."""

from collections.abc import Iterable

from vftcli.doctor.examination import Examination, examine
from vftcli.doctor.findings import in_words
from vftcli.robots.robot import Robot
from vftcli.signals.errors import ExaminationError
from vftcli.signals.recording import Recording
from vftcli.signals.remarks import Remark


class Examiner:
    """Examines the logs of one command.

    Args:
        anyway: Whether results are wanted even where a finding makes them meaningless.
        fitting: Whether the robot must be the log's; identification makes it so.
    """

    def __init__(self, *, anyway: bool = False, fitting: bool = True) -> None:
        self._anyway, self._fitting = anyway, fitting
        self._made: list[tuple[Recording, Robot, Examination]] = []

    def examine(self, recording: Recording, robot: Robot) -> Examination:
        """The examination of a log as this arm's, made once.

        Raises:
            ExaminationError: If a finding makes every result meaningless, unless results are wanted
                anyway.
        """
        for known, arm, examination in self._made:
            if known is recording and arm is robot:
                return examination
        found = examine(recording, robot)
        if not self._anyway:
            refuse(recording.name, found.refusals(fitting=self._fitting))
        self._made.append((recording, robot, found))
        return found

    @property
    def examinations(self) -> tuple[Examination, ...]:
        """All that were made, in their order."""
        return tuple(made for _, _, made in self._made)


def refuse(name: str, findings: Iterable[Remark]) -> None:
    """Raise an error that says the first of some findings with its remedy, if there is one.

    Args:
        name: The log's.
        findings: Those that make every result meaningless.

    Raises:
        ExaminationError: If there is one.
    """
    found = [in_words(finding) for finding in findings]
    if not found:
        return
    others = list(dict.fromkeys(other.name for other in found[1:]))
    more = f" Also: {', '.join(others)}." if others else ""
    raise ExaminationError(f"{name}: {found[0]}{more} With --anyway it goes on all the same.")
