"""Examiner: examines each log of a command once and refuses the meaningless ones."""

from collections.abc import Callable, Iterable
from dataclasses import replace

from vftcli.doctor.causes import CORRECTIONS
from vftcli.doctor.cuts import without_bad_samples
from vftcli.doctor.examination import Examination, examine
from vftcli.doctor.findings import in_words
from vftcli.doctor.fit import guess_robot
from vftcli.readers.reader import ReadChoice
from vftcli.robots.choice import RobotChoice, choices_for
from vftcli.robots.drive import effort_name
from vftcli.robots.pairing import paired
from vftcli.robots.robot import Robot
from vftcli.robots.winding import unwound
from vftcli.signals.errors import ExaminationError, RobotError
from vftcli.signals.recording import Recording
from vftcli.signals.remarks import Remark, fact

#: Samples of a block of a long log in which bad ones are looked for.
BLOCK = 1 << 14


class Examiner:
    """Loads the robots of a command and examines its logs, each once.

    Args:
        anyway: Whether results are wanted even where a finding makes them meaningless.
        fitting: Whether the robot must be the log's; identification makes it so.
        tell: What is done with every examination that refuses nothing, as soon as it is made: what
            is wrong with a log is said even if nothing comes of it.
    """

    def __init__(
        self,
        *,
        anyway: bool = False,
        fitting: bool = True,
        tell: Callable[[Examination], None] | None = None,
    ) -> None:
        self._anyway, self._fitting, self._tell = anyway, fitting, tell
        self._made: list[tuple[Recording, Robot, Examination]] = []
        self._robots: dict[tuple[str, RobotChoice, float | None, bool], Robot] = {}

    def robot(self, recording: Recording, choice: RobotChoice) -> Robot:
        """The robot that is chosen, that the log says, or that its maker's own model tells.

        Raises:
            RobotError: If none of these names one; with what each profile leaves unexplained.
        """
        name, remarks = choice.name or recording.robot_hint, tuple[Remark, ...]()
        if name is None:
            name, remarks = guessed(recording)
        # The log may be what says which load is mounted.
        key = (name, choice, recording.payload_mass, bool(remarks))
        if key not in self._robots:
            robot = choice.load(recording, name)
            self._robots[key] = replace(robot, remarks=(*robot.remarks, *remarks))
        return self._robots[key]

    @property
    def robots(self) -> tuple[Robot, ...]:
        """All that were loaded, in their order."""
        return tuple(self._robots.values())

    def taken(
        self,
        recording: Recording,
        robot: Robot,
        choice: ReadChoice,
        *,
        in_stretches: bool = False,
    ) -> Recording:
        """A log in its robot's joints, its effort read as the model explains it best if it is open.

        Joints go by name, endless ones are unwound, samples that no arm can have made are cut out.

        Raises:
            RobotError: If the names of its joints are not the robot's.
        """
        recording = unwound(paired(recording, robot), robot)
        # What no block of a long log shows has no room to be looked for in all of it at once.
        blocks = recording.blocks(BLOCK) if in_stretches else ()
        if not in_stretches or any(without_bad_samples(b, robot) is not b for b in blocks):
            recording = without_bad_samples(recording, robot)
        if choice.effort != "auto":
            return recording
        for finding in examine(recording, robot, in_stretches=in_stretches).findings:
            if (right := CORRECTIONS.get(finding.code)) is not None:
                name = effort_name(recording, robot)
                return recording.with_effort(right.kind or name, source=name, factor=right.factor)
        return recording

    def examine(
        self,
        recording: Recording,
        robot: Robot,
        *,
        in_stretches: bool = False,
    ) -> Examination:
        """The examination of a log as this arm's, made once.

        Raises:
            ExaminationError: If a finding makes every result meaningless, unless results are wanted
                anyway.
        """
        for known, arm, examination in self._made:
            if known is recording and arm is robot:
                return examination
        found = examine(recording, robot, in_stretches=in_stretches)
        if not self._anyway:
            refuse(recording.name, found.refusals(fitting=self._fitting))
        self._made.append((recording, robot, found))
        if self._tell is not None:
            self._tell(found)
        return found

    @property
    def examinations(self) -> tuple[Examination, ...]:
        """All that were made, in their order."""
        return tuple(made for _, _, made in self._made)


def guessed(recording: Recording) -> tuple[str, tuple[Remark, ...]]:
    """The profile that the maker's own model in a log tells, and on what grounds."""
    found, fits = guess_robot(recording)
    if found is None:
        ranked = f": {'; '.join(map(str, fits))}" if fits else ""
        raise RobotError(
            f"{recording.name} does not say which arm it is, and no profile settles it{ranked}; "
            f"{choices_for(recording)}"
        )
    others = [str(fit) for fit in fits if fit is not found]
    remark = fact("robot-guessed", robot=found.robot, fit=str(found), others=others or ["none"])
    return found.robot, (remark,)


def refuse(name: str, findings: Iterable[Remark]) -> None:
    """Raise an error that says the first of some findings with its remedy, if there is one."""
    found = [in_words(finding) for finding in findings]
    if not found:
        return
    others = list(dict.fromkeys(other.name for other in found[1:]))
    more = f" Also: {', '.join(others)}." if others else ""
    raise ExaminationError(f"{name}: {found[0]}{more} With --anyway it goes on all the same.")
