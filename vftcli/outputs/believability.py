"""Can it be believed? What supports an answer and what limits it, each with its remedy.

Everything is told from the analysis' data: the examinations, the contact list, the robot's
friction, the clock, which joints rest, and whether anything measures the force independently. The
terminal, the page and ``run.json`` show the same items.
"""

import shlex
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from vftcli.analysis import Analysis
from vftcli.contacts.contact_list import ContactList
from vftcli.doctor.examination import REFUSING, Examination
from vftcli.doctor.findings import in_words
from vftcli.doctor.fit import RobotMatch
from vftcli.outputs.contacts import answer, free_words
from vftcli.outputs.remedies import (
    LOADS,
    command,
    is_profile,
    path_of,
    payload_command,
    remedy_of,
    robot_option,
    subject_of,
)
from vftcli.robots.friction import dry_friction
from vftcli.signals.arrays import Mask
from vftcli.signals.recording import Recording
from vftcli.signals.remarks import sentence
from vftcli.signals.rest import slower

#: How far an item lets the answer be believed.
Standing = Literal["good", "caution", "bad", "unknown"]
#: The sign of each standing; the page and the terminal use the same.
MARKS = {"good": "✓", "caution": "△", "bad": "✗", "unknown": "–"}
#: The standings, the worst first.
SEVERITY: tuple[Standing, ...] = ("bad", "caution", "unknown", "good")


@dataclass(frozen=True, kw_only=True)
class Ground:
    """One reason to believe an answer, or not to."""

    standing: Standing  #: What it does to the answer.
    subject: str  #: What it is about, in one to three words.
    sentence: str  #: What is known of it.
    remedy: str | None = None  #: A command that would mend it, None where there is none.
    #: Whether it was found in this log, rather than true of every log like it: what the one line of
    #: a log among several tells.
    of_log: bool = True

    @property
    def mark(self) -> str:
        """Its sign."""
        return MARKS[self.standing]


def headline(analysis: Analysis) -> str:
    """The answer in one sentence."""
    if analysis.contacts is not None:
        return f"{answer(analysis.contacts)} {load_doubt(analysis)}".rstrip()
    names = ", ".join(estimate.name for estimate in analysis.estimates)
    return f"External torque of {analysis.robot.joints} joints by {names}; no contacts are listed."


def load_doubt(analysis: Analysis) -> str:
    """What is said where rows may be the weight of a load that the doctor found; else ""."""
    contacts = analysis.contacts.contacts if analysis.contacts is not None else ()
    found = {f.code for one in analysis.examinations[:1] for f in one.warnings}
    if analysis.contacts is not None and analysis.contacts.load is not None:
        return ""
    if not contacts or any(c.is_load for c in contacts) or not found & LOADS:
        return ""
    return "But the arm bears a load that nobody told: they may be its weight."


def otherwise(found: ContactList) -> str:
    """What can be said of the rest of the log, where no contact is listed; "" for nothing.

    A load leaves no rest, and an arm of few joints tells no force.
    """
    least = found.told_force
    if found.smallest_force is None or any(c.is_load for c in found.contacts):
        return ""
    if least is None and np.isnan(found.smallest_force):
        return ""
    if least is None:
        return "A push along one axis may go unseen: the pose hardly shows it."
    if found.basis != "free motion":
        count = len(found.candidates)
        more = f" {count} candidate{'s' * (count != 1)} more: --all." if count else ""
        return f"Pushes below {least:.0f} N do not show.{more}"
    rest = "Nothing else" if found.contacts else "Nothing"
    if any(c.peak_force is not None and c.peak_force < least for c in found.contacts):
        # Along the axes that are felt best less shows than along all.
        return f"{rest} above {least:.0f} N (less at good poses)."
    return f"{rest} above {least:.0f} N. Weaker pushes would not show."


def grounds(analysis: Analysis) -> tuple[Ground, ...]:
    """Every reason to believe an analysis or not, what is wrong before what limits it."""
    found = [
        robot_ground(analysis),
        *finding_grounds(analysis),
        clock_ground(analysis.recording),
        *list_grounds(analysis),
        *friction_grounds(analysis),
        reference_ground(analysis),
    ]
    found.sort(key=lambda ground: ground.standing != "bad")
    # One remedy stands where it is first needed.
    said = [ground.remedy for ground in found]
    return tuple(
        replace(ground, remedy=None) if ground.remedy in said[:k] else ground
        for k, ground in enumerate(found)
    )


def health(found: Sequence[Ground]) -> Ground:
    """The worst of what was found in a log itself, the first of several equally bad."""
    return min((g for g in found if g.of_log), key=lambda ground: SEVERITY.index(ground.standing))


def grounds_record(found: Iterable[Ground]) -> list[dict[str, Any]]:
    """The grounds for machines."""
    return [
        {"standing": g.standing, "subject": g.subject, "sentence": g.sentence, "remedy": g.remedy}
        for g in found
    ]


#: Share of a log's torques beyond which what the model leaves is no contact's: the arm, a sign or
#: the effort is another.
MOST_UNEXPLAINED = 0.5


def robot_ground(analysis: Analysis) -> Ground:
    """How well the arm's model explains the log."""
    subject, name = "robot, gravity", analysis.robot.name
    own = own_match(analysis)
    if own is None:
        return Ground(
            standing="unknown",
            subject=subject,
            sentence="the log does not let the model be checked",
        )
    listed = analysis.contacts.load if analysis.contacts is not None else None
    load = f" with {own.load:.2g} kg on the flange" if own.load and listed is None else ""
    percent = percent_words(own.misfit)
    if not own.fits:
        return Ground(
            standing="bad" if own.misfit > MOST_UNEXPLAINED else "caution",
            subject=subject,
            sentence=f"{name} leaves {percent} of {own.evidence} unexplained{load}",
            remedy=command("inspect", analysis.recording, "--robot", name),
        )
    verb = "agrees" if own.by_maker else "agrees with the model"
    evidence = own.evidence if own.by_maker else f"the {own.evidence}"
    return Ground(
        standing="good", subject=subject, sentence=f"{evidence} {verb} to {percent}{load}"
    )


def own_match(analysis: Analysis) -> RobotMatch | None:
    """How well the arm of an analysis fits its log, None where that could not be checked."""
    matches = analysis.examinations[0].robots if analysis.examinations else ()
    return next((match for match in matches if match.robot == analysis.robot.name), None)


def percent_words(share: float) -> str:
    """A share in per cent, with one digit behind the point, or one that is not zero."""
    percent = 100.0 * share
    return f"{percent:.1f} %" if percent >= 0.095 else f"{percent:.1g} %"


def finding_grounds(analysis: Analysis) -> Iterator[Ground]:
    """What the examinations of the log and of its free runs warn of, and the wrench's warnings."""
    for k, examination in enumerate(analysis.examinations):
        yield from warned(analysis, examination, own=k == 0)
    if analysis.virtual_sensor is not None:
        for remark in analysis.virtual_sensor.remarks:
            if remark.level == "warning":
                yield Ground(
                    standing="caution", subject=subject_of(remark.code), sentence=sentence(remark)
                )


def warned(analysis: Analysis, examination: Examination, *, own: bool) -> Iterator[Ground]:
    """What the log's own examination warns of, or that of a free run, under its name."""
    log = examination.recording
    other = "" if own else f"{log.name}: "
    for finding in examination.warnings:
        if finding.code == "gaps" and own:
            continue  # the line on the clock tells it
        yield Ground(
            standing="bad" if finding.code in REFUSING | LOADS else "caution",
            subject=subject_of(finding.code),
            sentence=f"{other}{in_words(finding).evidence}",
            remedy=remedy_of(finding, log, analysis),
            of_log=own,
        )


def clock_ground(recording: Recording) -> Ground:
    """Gaps in the clock, and what was dropped, turned or derived in reading."""
    t, steps = recording.t, np.diff(recording.t)
    longest, at = (steps.max(), t[np.argmax(steps)]) if len(steps) else (0.0, 0.0)
    gaps = int(np.count_nonzero(steps > 0.1))
    odd = [r for r in recording.source.remarks if r.level != "fact"]
    repaired = [r for r in recording.source.remarks if r.level == "fact"]
    words = f"no gap above {1e3 * longest:.0f} ms"
    if gaps:
        words = f"{gaps} gap{'s' * (gaps > 1)}, the longest {longest:.2g} s at {at:.1f} s"
    told = [sentence(remark) for remark in (*odd, *repaired)]
    more = f", and {len(told) - 1} more" if len(told) > 1 else ""
    words += f"; {told[0]}{more}" if told else ", nothing repaired"
    return Ground(
        standing="caution" if gaps or odd else "good",
        subject="clock",
        sentence=words,
        remedy=command("inspect", recording) if gaps or odd else None,
    )


def list_grounds(analysis: Analysis) -> Iterator[Ground]:
    """What the list of contacts rests on."""
    found, subject = analysis.contacts, "free motion"
    if found is None:
        told = [r for r in analysis.remarks if r.code == "contacts-not-told"]
        if told:
            yield Ground(standing="unknown", subject="contacts", sentence=sentence(told[0]))
        return
    if found.basis == "none":
        yield Ground(
            standing="unknown",
            subject=subject,
            sentence="none is given, and the robot has no friction model: no contact is listed",
            remedy=command("contacts", analysis.recording, "--robot", robot_option(analysis),
                           "--free", "free.csv"),
            of_log=False,
        )  # fmt: skip
    elif found.basis != "free motion":
        yield Ground(
            standing="caution",
            subject=subject,
            sentence="none is given: pushes weaker than friction are missed, sizes are unchecked",
            remedy=command("contacts", analysis.recording, "--robot", robot_option(analysis),
                           "--free", "free.csv"),
            of_log=False,
        )  # fmt: skip
    else:
        false = found.false_on_free or 0
        listed = f"{false} contact{'s' * (false != 1)} listed in its {found.free_seconds:.0f} s"
        yield Ground(
            standing="caution" if false else "good",
            subject=subject,
            sentence=f"{free_words(found)}; {listed}",
        )
    for remark in found.remarks:
        load = remark.code == "contact-is-load"
        yield Ground(
            standing="bad" if load else "caution",
            subject=LIST_SUBJECTS.get(remark.code, "contacts"),
            sentence=sentence(remark),
            remedy=payload_command(analysis) if load else None,
            of_log=load,
        )


#: What the remarks of a list are about.
LIST_SUBJECTS = {
    "contact-is-load": "load",
    "arm-stopped-abruptly": "stop",
    "free-part-rests": "free motion",
    "free-part-misses-joints": "free motion",
    "no-wrench-of-few-joints": "wrench",
}


def friction_grounds(analysis: Analysis) -> Iterator[Ground]:
    """What rests, where the friction model comes from, and at which temperature it is taken."""
    robot = analysis.robot
    dry = dry_friction(robot.friction, robot.joints)
    rests = resting(analysis.recording)
    if rests.any():
        joints = np.flatnonzero(rests)
        sizes = ", ".join(f"{dry[j]:.2g}" for j in joints)
        yield Ground(
            standing="caution",
            subject="the arm is still" if rests.all() else "joints at rest",
            sentence=f"friction hides up to {sizes} N·m on {joint_words(joints.tolist())}"
            if robot.friction
            else f"friction holds {joint_words(joints.tolist())} against what touches",
            of_log=False,
        )
    name, own = robot_option(analysis), f"my_{robot.name}.toml"
    free = next((path_of(run.recording) for run in analysis.motion.runs), "free.csv")
    if not robot.friction or is_profile(analysis):
        whose = "the profile's" if robot.friction else "none is modelled"
        yield Ground(
            standing="caution",
            subject="friction",
            sentence=f"{whose}; your own arm's from one free minute:",
            remedy=shlex.join(["vftcli", "identify", free, "--robot", name, "-o", own]),
            of_log=False,
        )
    else:
        yield Ground(standing="good", subject="friction", sentence=f"from {name}", of_log=False)
    for examination in analysis.examinations[:1]:
        for finding in examination.assumptions:
            yield Ground(
                standing="caution", subject="temperature", sentence=sentence(finding), of_log=False
            )


FULL_OF_REST = 0.5  #: A joint that rests in more than this share of the log is said to rest.


def resting(recording: Recording) -> Mask:
    """The joints that rest in most of a log. (n,)"""
    if recording.dq is None:
        return np.zeros(recording.joints, dtype=bool)
    return np.asarray(slower(recording.dq).mean(axis=0) > FULL_OF_REST)


def joint_words(joints: Sequence[int]) -> str:
    """Joints given from zero as ``J1…J6``, or one by one where some between are left out."""
    if len(joints) > 2 and joints[-1] - joints[0] == len(joints) - 1:
        return f"J{joints[0] + 1}…J{joints[-1] + 1}"
    return ", ".join(f"J{j + 1}" for j in joints)


def reference_ground(analysis: Analysis) -> Ground:
    """Whether anything measures the force independently of the observers."""
    if analysis.reference is not None:
        floor = analysis.reference.floor
        known = "" if floor is None else f", its own error {np.nanmean(floor):.2g} N·m a joint"
        doubts = [sentence(r) for r in analysis.reference.remarks if r.level == "warning"]
        return Ground(
            standing="caution" if doubts else "good",
            subject="reference",
            sentence="; ".join(doubts) or f"{analysis.reference.name}{known}",
            of_log=False,
        )
    contacts = analysis.contacts.contacts if analysis.contacts is not None else ()
    for kind in ("sensor", "vendor"):
        forces = [getattr(contact, f"{kind}_force") for contact in contacts]
        if any(force is not None for force in forces):
            whose = "the log's own sensor" if kind == "sensor" else "the vendor's own estimate"
            sizes = ", ".join("–" if f is None else f"{f:.0f}" for f in forces[:8])
            more = ", …" if len(forces) > 8 else ""
            return Ground(
                standing="good" if kind == "sensor" else "unknown",
                subject="no reference",
                sentence=f"{whose} reads {sizes}{more} N at the peaks",
                remedy=command("compare", analysis.recording, "--reference", kind, "--robot",
                               robot_option(analysis)),
                of_log=False,
            )  # fmt: skip
    if not contacts and analysis.recording.tau_ext is not None:
        return Ground(
            standing="unknown",
            subject="no reference",
            sentence="the log holds the vendor's own estimate",
            remedy=command("compare", analysis.recording, "--reference", "vendor", "--robot",
                           robot_option(analysis)),
            of_log=False,
        )  # fmt: skip
    return Ground(
        standing="unknown",
        subject="no reference",
        sentence="nothing here measures the force; sizes are checked by nothing",
        of_log=False,
    )
