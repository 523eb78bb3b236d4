"""Proposal: the options for a log, each with its reason, for inspect."""

import textwrap
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from vftcli.doctor.causes import CORRECTIONS
from vftcli.doctor.examination import examine, in_words
from vftcli.doctor.fit import guess_robot
from vftcli.evaluation import ReferenceChoice
from vftcli.free_motion import FreeChoice
from vftcli.observers import ObserverChoice
from vftcli.pipeline import AnalysisChoice, analyse, list_touches, prepared, read
from vftcli.robots.robot import Robot
from vftcli.robots.robot_file import lines_of
from vftcli.robots.run import Run
from vftcli.signals.errors import MissingSignalError, RobotError, VftError
from vftcli.signals.parsing import printable
from vftcli.signals.recording import Recording

MOST_ROBOTS = 5  #: Most profiles named where none is settled.
#: References for estimates, the best first, and their reasons.
REFERENCES = {
    "sensor": "the log holds a wrench that was measured",
    "two-cycle": "the free motion is known too: the reference is the difference of the two",
    "vendor": "the log holds an external torque of its controller: an estimate as well",
}


class ProposedOption(NamedTuple):
    """One option for a file of options, or a remark alone."""

    why: str  #: Its reason.
    key: str = ""  #: The option without its dashes, or a setting; "" for a remark.
    value: str | list[str] = ""  #: Its value: a text or several.
    holds: bool = True  #: Whether it holds, or is only offered.


def propose(
    logs: Sequence[Path], choice: AnalysisChoice, given: Mapping[str, str | list[str]]
) -> Iterator[ProposedOption]:
    """The options for logs."""
    yield from (ProposedOption("as given", key, value) for key, value in given.items())
    recording = choice.library.open(logs[0], choice.read)
    for option in read_so(recording):
        if option.key not in given:
            yield option
    try:
        robot = choice.examiner.robot(recording, choice.robot)
    except RobotError as error:
        if choice.robot.name is not None:
            raise
        fits = guess_robot(recording)[1][:MOST_ROBOTS]
        unsettled = (
            "the log does not settle which arm it is: choose one, then inspect again with "
            "--robot. How well each fits:"
        )
        yield ProposedOption(unsettled if fits else str(error))
        for fit in fits:
            yield ProposedOption(str(fit), "robot", fit.robot, holds=False)
        return
    if "robot" not in given:
        guessed = (r.values["fit"] for r in robot.remarks if r.code == "robot-guessed")
        why = next((f"by {fit}" for fit in guessed), "the log names it")
        yield ProposedOption(why, "robot", robot.name)
    effort = None if "log.effort" in given else effort_of(recording, robot, choice)
    if effort is not None:
        yield effort
        choice = replace(choice, read=replace(choice.read, effort=str(effort.value)))
    arm = replace(choice.robot, name=choice.robot.name or robot.name)
    yield from of_known_arm(logs, replace(choice, robot=arm))


def of_known_arm(logs: Sequence[Path], choice: AnalysisChoice) -> Iterator[ProposedOption]:
    """The free motion and the references for logs of a known arm."""
    run = prepared(choice.library.open(logs[0], choice.read), choice)
    refused = examine(run.recording, run.robot).refusals()
    if refused:
        yield from (ProposedOption(f"MEANINGLESS unless mended: {in_words(f)}") for f in refused)
        return
    free = []
    for log in logs[1:]:
        option = free_log(log, choice)
        yield option
        free += [log] if option.holds else []
    if free:
        yield ProposedOption(
            "nothing touches the arm in them", "free", [str(log) for log in free]
        )
    choice = replace(choice, free=FreeChoice(logs=tuple(free)))
    try:
        found = read(run, choice).part.remarks
    except VftError:
        found = ()  # the reference that needs it says why there is none
    own = "" if free else "; found in each log"
    yield from (ProposedOption(f"{remark}{own}") for remark in found)
    yield from references(run, choice)


def read_so(recording: Recording) -> Iterator[ProposedOption]:
    """Options for the reading of a log."""
    source = recording.source
    for remark in source.remarks:
        if remark.code == "columns-by-value":
            yield ProposedOption(remark.values["why"], "columns", remark.values["columns"])
    if "dq" in source.derived:
        yield ProposedOption("the log has no velocities", "log.derive", "dq")
    if recording.payload_mass:
        words = f"the controller assumes {recording.payload_mass:.3g} kg"
        yield ProposedOption(words, "payload", "log", holds=False)


def effort_of(
    recording: Recording, robot: Robot, choice: AnalysisChoice
) -> ProposedOption | None:
    """The kind of a log's effort, if its robot's model finds another."""
    as_called = choice.examiner.read_as(recording, robot, replace(choice.read, effort=None))
    for finding in examine(as_called, robot).findings:
        if (right := CORRECTIONS.get(finding.code)) is not None:
            # A sign or a unit has no own name.
            named = right.kind.replace("_", "-") if right.factor == 1.0 else "auto"
            return ProposedOption(in_words(finding).evidence, "log.effort", named)
    return None


def free_log(log: Path, choice: AnalysisChoice) -> ProposedOption:
    """A further log as free motion, if untouched; else a remark."""
    label = choice.library.label(log)
    try:
        run = prepared(choice.library.open(log, choice.read.whole), choice)
        contacts = list_touches(run, choice).contacts
    except VftError as error:
        return ProposedOption(f"{label} is left out: {error}", holds=False)
    count = len(contacts.contacts) if contacts is not None else 0
    if count:
        words = (
            f"{label}: {count} contacts by this robot's model; take it if nobody touched the arm"
        )
        return ProposedOption(words, "free", [str(log)], holds=False)
    return ProposedOption(f"{label}: no contact in {run.recording.duration:.3g} s")


#: Reason that a difference of cycles may be meaningless.
ONE_CYCLE = (
    "the log holds one whole cycle, which has to be free of contact: say so with "
    "two-cycle.free-cycles"
)


def references(run: Run, choice: AnalysisChoice) -> Iterator[ProposedOption]:
    """References, each tried; the first that works holds."""
    plain = replace(choice, observers=ObserverChoice(names=("gmo",)), contacts=False)
    found = False
    for name, why in reasons(run.recording).items():
        asked = replace(plain, reference=ReferenceChoice(name=name))
        try:
            motion = analyse(run, asked).motion
            given = name != "two-cycle" or motion.choice.is_given
            doubt = "" if given or motion.cycles.whole > 1 else ONE_CYCLE
        except MissingSignalError:
            continue
        except VftError as error:
            yield ProposedOption(f"no reference {name}: {error}")
        else:
            yield ProposedOption(doubt or why, "reference", name, holds=not (found or doubt))
            found = found or not doubt


def reasons(recording: Recording) -> dict[str, str]:
    """Each reference and its reason, the best first."""
    frame, others = recording.wrench_frame, dict(REFERENCES)
    if frame is None or frame.axes != "base":
        return others
    # A sensor measures in its own axes; base axes are a controller's.
    del others["sensor"]
    words = "the log holds a wrench of its controller: an estimate as well where no sensor is"
    return {"two-cycle": others.pop("two-cycle"), "sensor": words, **others}


#: Begins a file of options.
HEADING = """\
# Options for every command that reads a log, without dashes. Typed options override them;
# --config none ignores this file. File names are relative to this file's folder. A table
# holds the options of one command, as [compare], or settings. More: vftcli help config
"""
WIDTH = 98  #: Letters of a reason's line.


def config_text(options: Iterable[ProposedOption]) -> str:
    """A file of options, each under its reason, a mere offer behind a ``#``.

    Settings come last, in the table of their group.
    """
    parts, table = [HEADING], ""
    for option in sorted(options, key=lambda option: option.key.rpartition(".")[0]):
        group, _, key = option.key.rpartition(".")
        if group != table:
            parts.append(f"[{group}]\n")
            table = group
        why = printable(" ".join(option.why.split()))
        part = "".join(f"# {line}\n" for line in textwrap.wrap(why, WIDTH))
        if option.key:
            line = "".join(lines_of({key: option.value}))
            part += line if option.holds else f"# {line}"
        parts.append(part)
    return "\n".join(parts)
