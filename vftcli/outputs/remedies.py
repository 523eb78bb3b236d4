"""What mends a finding: the command, as it is typed; and what the finding is about."""

import shlex

from vftcli.analysis import Analysis
from vftcli.robots import PROFILES
from vftcli.signals.recording import Recording
from vftcli.signals.remarks import Remark

#: Subject → the findings that are about it; any other is about the drives' effort.
SUBJECTS = {
    "load": ("unmodelled-load", "light-load", "payload-mismatch", "payload-mismatch-untold",
             "payload-not-mounted", "payload-differs", "load-changes"),
    "robot": ("other-robot", "no-robot-fits", "no-robot-fits-any", "no-robot-fits-at-rest",
              "no-profile"),
    "clock": ("time-unit", "clock-rate", "slow-rate", "gaps", "repeated-stamps", "clock-gaps",
              "clock-gap", "repeats-differ", "absurd-clock", "absurd-steps"),
    "base": ("upside-down", "tilted-base"),
    "positions": ("degrees", "stuck-position", "coarse-positions", "absurd-values"),
    "velocity": ("no-velocity", "velocity-unit", "velocity-mismatch", "velocity-sign",
                 "velocity-order", "velocity-lag", "velocity-filtered", "velocity-held",
                 "velocity-of-another-kind", "stuck-velocity", "zero-dq"),
    "temperature": ("far-temperature", "far-temperature-assumed", "temperature-beyond-law",
                    "no-temperature", "temperature-gaps"),
    "wrench": ("zero-wrench", "zero-wrench-beside-tau-ext", "contact-elsewhere",
               "zero-far-from-start", "zero-swings"),
    "vendor's torque": ("vendor-sign", "zero-tau-ext"),
}  # fmt: skip
#: Findings that ``identify --method payload`` answers.
LOADS = frozenset(SUBJECTS["load"]) - {"payload-not-mounted", "load-changes"} | {"contact-is-load"}


def subject_of(code: str) -> str:
    """Subject of a finding, in a word or two."""
    return next((subject for subject, codes in SUBJECTS.items() if code in codes), "effort")


def remedy_of(finding: Remark, log: Recording, analysis: Analysis) -> str:
    """The command that mends what a finding tells, else the one that says more about it."""
    robot = robot_option(analysis)
    if finding.code in LOADS:
        return payload_command(analysis)
    if finding.code == "payload-not-mounted":
        return command("contacts", log, "--robot", robot, "--payload", "log")
    if finding.code == "other-robot":
        return command("contacts", log, "--robot", str(finding.values["robot"]))
    if finding.code.startswith("no-robot-fits"):
        return f"vftcli identify free.csv --robot {robot} --method base -o my_robot.toml"
    return command("inspect", log, "--robot", robot)


def payload_command(analysis: Analysis) -> str:
    """The command that finds what hangs on the flange."""
    runs = [run.recording for run in analysis.motion.runs]
    free = ["--free", path_of(runs[0])] if runs else []
    found = ("--method", "payload", "--robot", robot_option(analysis), "-o", "loaded.toml")
    return command("identify", analysis.recording, *free, *found)


def command(name: str, log: Recording, *words: str) -> str:
    """A command on a log, as it is typed."""
    return shlex.join(["vftcli", name, path_of(log), *words])


def path_of(log: Recording) -> str:
    """A log's path as it was given, a stand-in for one made in memory."""
    return str(log.source.path or "LOG")


def robot_option(analysis: Analysis) -> str:
    """Value of ``--robot`` for an analysis' arm: profile name, or file."""
    robot = analysis.robot
    return robot.name if is_profile(analysis) or robot.path is None else str(robot.path)


def is_profile(analysis: Analysis) -> bool:
    """Whether the arm is a built-in profile."""
    return analysis.robot.path in PROFILES.values()
