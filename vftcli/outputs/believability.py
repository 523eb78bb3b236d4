"""Grounds to believe an answer or not, each with its remedy.

Terminal and page show the same.
"""

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np

from vftcli.analysis import Analysis
from vftcli.contacts.contact_list import Contact
from vftcli.doctor.examination import REFUSING, in_words
from vftcli.doctor.fit import RobotMatch
from vftcli.outputs import Record
from vftcli.outputs.contacts import answer
from vftcli.outputs.examination import command, path_of
from vftcli.outputs.grid import (
    DASH,
    Column,
    Entry,
    at_least_shown,
    banded,
    percent,
    ranged,
    significant,
)
from vftcli.robots import PROFILES
from vftcli.robots.friction import dry_friction
from vftcli.signals.arrays import Mask
from vftcli.signals.parsing import counted
from vftcli.signals.recording import Recording
from vftcli.signals.remarks import Remark, sentence
from vftcli.signals.rest import slower

if TYPE_CHECKING:
    import polars as pl

#: Subject → its findings; any other is about the drives' effort.
SUBJECTS = {
    "load": ("unmodelled-load", "light-load", "payload-not-mounted",
             "payload-not-carried", "load-changes"),
    "robot": ("other-robot", "no-robot-fits", "no-robot-fits-any", "no-profile"),
    "time stamps": ("time-unit", "clock-rate", "slow-rate", "gaps", "repeated-stamps",
                    "clock-gaps", "repeats-differ", "absurd-clock", "absurd-steps", "frozen-rows"),
    "base": ("upside-down", "tilted-base"),
    "positions": ("degrees", "stuck-position", "coarse-positions", "absurd-values",
                  "frozen-position", "position-slip", "position-jump"),
    "velocity": ("no-velocity", "velocity-unit", "velocity-mismatch", "velocity-sign",
                 "velocity-order", "velocity-lag", "velocity-filtered", "velocity-held",
                 "velocity-of-another-kind", "stuck-velocity", "zero-dq", "isolated-velocity"),
    "temperature": ("far-temperature", "no-temperature"),
    "wrench": ("zero-wrench", "zero-wrench-beside-tau-ext", "contact-elsewhere",
               "zero-far-from-start", "zero-swings"),
    "vendor's torque": ("vendor-sign", "zero-tau-ext"),
}  # fmt: skip
#: Findings that ``identify --method payload`` answers.
LOADS = {"unmodelled-load", "light-load", "contact-is-load"}


#: Remark of a list of contacts → its subject.
LIST_SUBJECTS = {
    "contact-is-load": "lasting contact",
    "arm-stopped-abruptly": "stop",
    "free-part-misses-joints": "not moved",
    "no-wrench-of-few-joints": "wrench",
}
#: Above this unexplained share arm, sign or effort is wrong.
MOST_UNEXPLAINED = 0.5
MOST_OFF = 4  #: Most rows named that miss their sensor reading.
FULL_OF_REST = 0.5  #: A joint rests if it does so in more than this share.

#: An item's effect on trust in the answer.
Standing = Literal["good", "caution", "bad", "unknown"]
#: The sign of each standing, on page and terminal.
MARKS = {"good": "✓", "caution": "△", "bad": "✗", "unknown": "–"}
#: The standings, the worst first.
SEVERITY: tuple[Standing, ...] = ("bad", "caution", "unknown", "good")


class Ground(NamedTuple):
    """One reason to believe an answer, or not to."""

    standing: Standing  #: Its effect on the answer.
    subject: str  #: Its subject, in one to three words.
    sentence: str
    remedy: str | None = None  #: A command that mends it, or None.
    #: Whether it is of this log, not of every log like it.
    of_log: bool = True


class LogSummary(NamedTuple):
    """One log among several; up to `detectable_N` a batch's columns."""

    log: str  #: Its label.
    robot: str
    duration_s: float
    health: Standing
    reason: str  #: Its worst ground, or "sound".
    contacts: int | None = None  #: Their number, None where none are listed.
    load: bool | None = None  #: Whether one of them is a load.
    hardest_N: float | None = None
    hardest_band_N: float | None = None  #: Half width of its 95 % band.
    hardest_s: float | None = None  #: Time of its peak.
    #: Its smallest and largest size, by an unknown place.
    hardest_anywhere_N: tuple[float, float] | None = None
    detectable_N: float | None = None  #: Least visible force, None if unknown.
    error: str = DASH  #: The least mean RMSE and its observer. [N·m]
    page: str = ""  #: Its own page, relative to that of all logs; "" without one.
    grounds: tuple[Ground, ...] = ()

    @property
    def rank(self) -> tuple[int, float]:
        """Sort key: worst health first, then hardest contact."""
        return SEVERITY.index(self.health), -(self.hardest_N or 0.0)

    @property
    def hardness(self) -> tuple[bool, float]:
        """Sort key: known size first, then force."""
        force, band = self.hardest_N or 0.0, self.hardest_band_N or 0.0
        return force > band and self.hardest_anywhere_N is None, force

    @property
    def hardest(self) -> str:
        """The hardest contact in a few words."""
        if self.hardest_N is None:
            return DASH
        ends, (known, _) = self.hardest_anywhere_N, self.hardness
        size = ranged(*ends) if ends else banded(self.hardest_N, self.hardest_band_N)
        text = f"{size} at {self.hardest_s:.1f} s"
        return text if known else f"unknown ({text})"

    def row(self, **entries: Entry) -> Record:
        """Entries by the keys of `LOG_COLUMNS`, some as given."""
        count = "load" if self.load else self.contacts
        return self._asdict() | {"contacts": count, "hardest": self.hardest} | entries


#: Field of a log's summary → its column.
LOG_COLUMNS = {
    "log": "log",
    "robot": "robot",
    "duration_s": Column("span", form="{:.1f} s".format, seldom=True),
    "contacts": Column("contacts"),
    "hardest": "hardest",
    "detectable_N": Column("detects above", form=at_least_shown, seldom=True),
    "error": Column("mean RMSE", "N·m"),
    "health": "health",
}


def headline(analysis: Analysis) -> str:
    """The answer in one sentence."""
    found, joints = analysis.contacts, analysis.robot.joints
    if found is None:
        names = ", ".join(estimate.name for estimate in analysis.estimates)
        return f"External torque of {joints} joints by {names}; no contacts are listed."
    findings = {f.code: f for one in analysis.examinations[:1] for f in one.warnings}
    if (dead := findings.get("zero-effort")) is not None:
        return f"No contact is listed: {dead}."
    text = answer(found)
    # Rows may be the weight of a load that was found.
    pushed = found.contacts and not any(contact.is_load for contact in found.contacts)
    if pushed and found.load is None and findings.keys() & LOADS:
        text += " But the arm carries an unknown load: they may be its weight."
    return text


def log_line(analysis: Analysis, page: str = "") -> LogSummary:
    """One log among several."""
    recording, listed, found = analysis.recording, analysis.contacts, grounds(analysis)
    worst = health(found)
    reason = "sound" if worst.standing == "good" else f"{worst.subject}: {worst.sentence}"
    known = recording.name, analysis.robot.name, recording.duration, worst.standing, reason
    line = LogSummary(*known, error=least_error(analysis.errors), page=page, grounds=found)
    if listed is None:
        return line
    line = line._replace(
        contacts=len(listed.contacts),
        load=any(contact.is_load for contact in listed.contacts),
        detectable_N=listed.detectable_force,
    )
    if (hardest := listed.hardest) is None:
        return line
    return line._replace(
        hardest_N=hardest.peak_force,
        hardest_band_N=hardest.peak_band,
        hardest_s=hardest.peak,
        hardest_anywhere_N=hardest.anywhere if hardest.place_unknown else None,
    )


def least_error(errors: "pl.DataFrame | None") -> str:
    """The least mean RMSE and its observer. [N·m]"""
    if errors is None:
        return DASH
    # Polars takes a tenth of the time of a list without a reference.
    from vftcli.evaluation.errors import joint_means

    least = joint_means(errors).least
    return DASH if least is None else f"{significant(least[1])} ({least[0]})"


def grounds(analysis: Analysis) -> tuple[Ground, ...]:
    """All grounds to believe an analysis or not, bad ones first."""
    found = [
        robot_ground(analysis),
        *finding_grounds(analysis),
        clock_ground(analysis.recording),
        *list_grounds(analysis),
        *friction_grounds(analysis),
        reference_ground(analysis),
    ]
    found.sort(key=lambda ground: ground.standing != "bad")
    # A remedy goes where it is first needed.
    said = [ground.remedy for ground in found]
    return tuple(
        ground._replace(remedy=None) if ground.remedy in said[:k] else ground
        for k, ground in enumerate(found)
    )


def health(found: Sequence[Ground]) -> Ground:
    """The worst ground of a log itself, the first of equals."""
    return min((g for g in found if g.of_log), key=lambda ground: SEVERITY.index(ground.standing))


def robot_ground(analysis: Analysis) -> Ground:
    """Fit of the arm's model to the log."""
    subject, name, own = "robot, gravity", analysis.robot.name, own_match(analysis)
    if own is None:
        return Ground("unknown", subject, "the log does not let the model be checked")
    listed = analysis.contacts and analysis.contacts.load
    less, left = "less " if own.load < 0 else "", percent(own.misfit)
    load = f" with {abs(own.load):.2g} kg {less}on the flange" if own.load and not listed else ""
    if not own.fits:
        return Ground(
            "bad" if own.misfit > MOST_UNEXPLAINED else "caution",
            subject,
            f"{name} leaves {left} of {own.evidence} unexplained{load}",
            command("inspect", analysis.recording, "--robot", robot_option(analysis)),
        )
    who = "{} agrees" if own.by_maker else "the {} agrees with the model"
    return Ground("good", subject, f"{who.format(own.evidence)} to {left}{load}")


def own_match(analysis: Analysis) -> RobotMatch | None:
    """Fit of an analysis' arm to its log, None if unchecked."""
    matches = analysis.examinations[0].robots if analysis.examinations else ()
    return next((match for match in matches if match.robot == analysis.robot.name), None)


def finding_grounds(analysis: Analysis) -> Iterator[Ground]:
    """Warnings on the log, on its free runs, and on the wrench."""
    for k, examination in enumerate(analysis.examinations):
        log = examination.recording
        other = f"{log.name}: " if k else ""
        for finding in examination.warnings:
            if finding.code == "gaps" and not k:
                continue  # the line on the clock tells it
            yield Ground(
                "bad" if finding.code in REFUSING | LOADS else "caution",
                subject_of(finding.code),
                f"{other}{in_words(finding).evidence}",
                remedy_of(finding, log, analysis),
                k == 0,
            )
    for remark in analysis.virtual_sensor.remarks if analysis.virtual_sensor is not None else ():
        if remark.level == "warning":
            yield Ground("caution", subject_of(remark.code), sentence(remark))


def clock_ground(recording: Recording) -> Ground:
    """Gaps in the clock, and repairs in reading."""
    t, steps = recording.t, np.diff(recording.t)
    longest, at = (steps.max(), t[np.argmax(steps)]) if len(steps) else (0.0, 0.0)
    gaps = int(np.count_nonzero(steps > 0.1))
    ranked = sorted(recording.source.remarks, key=lambda remark: remark.level == "fact")
    odd = gaps > 0 or any(remark.level != "fact" for remark in ranked)
    words = f"longest step {1e3 * longest:.0f} ms"
    if gaps:
        words = f"{counted(gaps, 'gap')}, the longest {longest:.2g} s at {at:.1f} s"
    more = f", and {len(ranked) - 1} more" if len(ranked) > 1 else ""
    if ranked:
        words += f"; {sentence(ranked[0])}{more}"
    elif not recording.source.cuts:
        words += ", nothing repaired"
    remedy = command("inspect", recording) if odd else None
    return Ground("caution" if odd else "good", "clock", words, remedy)


def list_grounds(analysis: Analysis) -> Iterator[Ground]:
    """Grounds of the list of contacts."""
    found, subject = analysis.contacts, "free motion"
    if found is None:
        for remark in analysis.remarks:
            if remark.code == "contacts-not-listed":
                yield Ground("unknown", "contacts", sentence(remark))
                break
        return
    name = robot_option(analysis)
    remedy = command("contacts", analysis.recording, "--robot", name, "--free", "free.csv")
    if found.basis == "none":
        words = "none is given, and the robot has no friction model: no contact is listed"
        yield Ground("unknown", subject, words, remedy, of_log=False)
    elif found.basis != "free motion":
        words = "none is given: sizes are unchecked"
        yield Ground("caution", subject, words, remedy, of_log=False)
    else:
        false = found.false_on_free or 0
        listed = f"{counted(false, 'contact')} listed in its {found.free_seconds:.0f} s"
        standing: Standing = "caution" if false else "good"
        words = "; ".join(map(sentence, found.free))
        yield Ground(standing, subject, f"{words}; {listed}")
    for remark in found.remarks:
        load = remark.code == "contact-is-load"
        yield Ground(
            "bad" if load else "caution",
            LIST_SUBJECTS.get(remark.code, "contacts"),
            sentence(remark),
            payload_command(analysis) if load else None,
            load,
        )


def friction_grounds(analysis: Analysis) -> Iterator[Ground]:
    """Joints at rest, the friction model, its temperature."""
    robot, rests = analysis.robot, resting(analysis.recording)
    if rests.any():
        dry, joints = dry_friction(robot.friction, robot.joints), np.flatnonzero(rests).tolist()
        sizes = ", ".join(f"{dry[j]:.2g}" for j in joints)
        hides = (
            f"pushes below {sizes} N·m do not show" if robot.friction else "friction hides pushes"
        )
        subject = "the arm is still" if rests.all() else "joints at rest"
        names = ", ".join(f"J{j + 1}" for j in joints)
        if len(joints) > 2 and np.ptp(joints) < len(joints):
            names = f"J{joints[0] + 1}…J{joints[-1] + 1}"
        yield Ground("caution", subject, f"{names}: {hides}", of_log=False)
    name = robot_option(analysis)
    if not robot.friction or robot.path in PROFILES.values():
        where = "a typical arm's" if robot.friction else "none is modelled"
        words = f"{where}. Measure yours (1 min contact-free):"
        free = next((run.recording for run in analysis.motion.runs), None)
        remedy = command("identify", free, "--robot", name, "-o", f"my_{robot.name}.toml")
        yield Ground("caution", "friction", words, remedy, of_log=False)
    else:
        yield Ground("good", "friction", f"from {name}", of_log=False)
    for examination in analysis.examinations[:1]:
        for finding in examination.assumptions:
            yield Ground("caution", "temperature", sentence(finding), of_log=False)


def resting(recording: Recording) -> Mask:
    """The joints that rest in most of a log. (n,)"""
    if recording.dq is None:
        return np.zeros(recording.joints, dtype=bool)
    return np.asarray(slower(recording.dq).mean(axis=0) > FULL_OF_REST)


def reference_ground(analysis: Analysis) -> Ground:
    """Whether anything else measures the force."""
    if analysis.reference is not None:
        known = ""
        if analysis.errors is not None:
            # Polars takes a tenth of the time of a list without a reference.
            from vftcli.evaluation.errors import joint_means

            means = joint_means(analysis.errors)
            if np.isfinite(means.floor):
                known = f"{means.left_out}, its own error {means.floor:.2g} N·m per joint"
        doubts = [sentence(r) for r in analysis.reference.remarks if r.level == "warning"]
        words = "; ".join(doubts) or f"{analysis.reference.name}{known}"
        return Ground("caution" if doubts else "good", "reference", words, of_log=False)
    contacts = analysis.listed
    for kind, subject, name in (
        ("sensor", "force sensor", "the log's own sensor"),
        ("vendor", "vendor", "the vendor's own estimate"),
    ):
        forces = [getattr(contact, f"{kind}_force") for contact in contacts]
        own = kind == "vendor" and not contacts and analysis.recording.tau_ext is not None
        if own or any(force is not None for force in forces):
            sizes = ", ".join(DASH if f is None else f"{f:.0f}" for f in forces[:8])
            more = ", …" if len(forces) > 8 else ""
            reads = f"{name} reads {sizes}{more} N at the peaks"
            missed = missed_words(contacts) if kind == "sensor" else ""
            options = ("--reference", kind, "--robot", robot_option(analysis))
            return Ground(
                "unknown" if kind == "vendor" else "caution" if missed else "good",
                subject,
                f"{reads}{missed}" if contacts else f"the log holds {name}",
                command("compare", analysis.recording, *options),
                # A missed reading is a fault of this log; no sensor is not.
                of_log=bool(missed),
            )
    words = "no force sensor in the log: sizes are unchecked"
    return Ground("unknown", "no reference", words, of_log=False)


def missed_words(contacts: Sequence[Contact]) -> str:
    """Rows off the sensor by more than their band; "" for none."""
    off = []
    for row in contacts:
        force, band, read = row.peak_force, row.peak_band, row.sensor_force
        # A flange sensor does not feel a push on a link before it.
        if row.is_load or not row.size_known or (row.places and 0 not in row.places):
            continue
        if read is not None and (miss := abs((force or 0.0) - read)) > (band or 0.0):
            off.append(f"row {row.number} by {miss:.2g} N")
    more = f" and {len(off) - MOST_OFF} more" if len(off) > MOST_OFF else ""
    return f"; off by more than the band: {', '.join(off[:MOST_OFF])}{more}" if off else ""


def subject_of(code: str) -> str:
    """Subject of a finding, in a word or two."""
    return next((subject for subject, codes in SUBJECTS.items() if code in codes), "effort")


def remedy_of(finding: Remark, log: Recording, analysis: Analysis) -> str:
    """The command that mends a finding, or says more."""
    robot = robot_option(analysis)
    if finding.code in LOADS:
        return payload_command(analysis)
    if finding.code == "payload-not-mounted":
        return command("contacts", log, "--robot", robot, "--payload", "log")
    if finding.code == "other-robot":
        return command("contacts", log, "--robot", str(finding.values["robot"]))
    if finding.code.startswith("no-robot-fits"):
        return command(
            "identify", None, "--robot", robot, "--method", "base", "-o", "my_robot.toml"
        )
    return command("inspect", log, "--robot", robot)


def payload_command(analysis: Analysis) -> str:
    """The command that finds the load on the flange."""
    runs = [run.recording for run in analysis.motion.runs]
    free = ["--free", path_of(runs[0])] if runs else []
    end = "--robot", robot_option(analysis), "-o", "loaded.toml"
    return command("identify", analysis.recording, *free, "--method", "payload", *end)


def robot_option(analysis: Analysis) -> str:
    """Value of ``--robot`` for an analysis: profile, or file."""
    robot = analysis.robot
    return robot.name if robot.path in {None, *PROFILES.values()} else str(robot.path)
