"""The free part of a log: stated, other logs of the motion, or the free cycles it holds itself."""

from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from vftcli.repetition.alignment import align
from vftcli.repetition.choice import FreeChoice
from vftcli.repetition.cycles import segment
from vftcli.repetition.drive_run import DriveRun, drive_run_of
from vftcli.repetition.pairing import Pairing, pair_with_cycle, pair_with_run
from vftcli.repetition.periodicity import find_period
from vftcli.repetition.two_cycle import partners_in_log
from vftcli.robots.robot import Robot
from vftcli.signals.arrays import Mask
from vftcli.signals.errors import ParameterError, ReferenceTorqueError
from vftcli.signals.recording import Recording


@dataclass(frozen=True, kw_only=True)
class FreePart:
    """What is known to be free of contact.

    Attributes:
        inside: Samples of the log itself that are free. (T,)
        runs: Free runs in other logs.
        pairings: Where in a free motion each sample belongs, one a free cycle or run that repeats
            the log's motion; none where nothing repeats.
        note: What it is and how it was found.
    """

    inside: Mask
    runs: tuple[Recording, ...] = ()
    pairings: tuple[Pairing, ...] = ()
    note: str = ""


def find_free_part(
    recording: Recording, robot: Robot, choice: FreeChoice, runs: tuple[Recording, ...] = ()
) -> FreePart:
    """The free part as stated, else in other logs, else the free cycles of a repeated motion.

    Raises:
        ReferenceTorqueError: If nothing is stated and the log repeats nothing.
        ParameterError: If the stated span holds no samples.
    """
    if choice.spans:
        return stated_spans(recording, robot, choice.spans)
    if runs:
        return other_runs(recording, robot, runs)
    motion = drive_run_of(recording, robot)
    found = partners_in_log(recording, motion, choice)
    return FreePart(
        inside=found.free,
        pairings=tuple(found.clocks["found"]),
        note=f"free part: {found.notes[-1].removeprefix('free: ').split(';')[0]}",
    )


def stated_spans(
    recording: Recording, robot: Robot, spans: tuple[tuple[float, float], ...]
) -> FreePart:
    """Stated spans of the log, with the free cycles they hold if the motion repeats."""
    t = recording.t
    inside = np.zeros(recording.samples, dtype=bool)
    for first, last in spans:
        inside |= (t >= first) & (t <= last)
    listed = ", ".join(f"{max(a, t[0]):g} to {min(b, t[-1]):g} s" for a, b in spans)
    if np.count_nonzero(inside) < 2 or inside.all():
        raise ParameterError(
            f"{recording.name}: the free part {', '.join(f'{a:g}:{b:g}' for a, b in spans)} holds "
            f"{np.count_nonzero(inside)} of its {recording.samples} samples; it must be a part of "
            f"the log, which runs from {t[0]:g} to {t[-1]:g} s"
        )
    pairings: tuple[Pairing, ...] = ()
    with suppress(ReferenceTorqueError):
        pairings = cycles_within(recording, drive_run_of(recording, robot), spans)
    return FreePart(inside=inside, pairings=pairings, note=f"free part: {listed}, as given")


def cycles_within(
    recording: Recording, motion: DriveRun, spans: tuple[tuple[float, float], ...]
) -> tuple[Pairing, ...]:
    """The whole cycles inside any of the spans, each laid under the log."""
    cycles = segment(recording, find_period(recording))
    slack = 0.03 * cycles.period
    found = []
    for number in range(cycles.whole):
        first, last = cycles.span(number)
        if any(first >= a - slack and last <= b + slack for a, b in spans):
            found.append(pair_with_cycle(motion, cycles, number, cycles.period))
    return tuple(found)


def other_runs(recording: Recording, robot: Robot, runs: tuple[Recording, ...]) -> FreePart:
    """Free runs in other logs; those of the same motion are laid under the log."""
    motion = drive_run_of(recording, robot)
    pairings, words = [], []
    for run in runs:
        try:
            found = align(recording, run)
        except ReferenceTorqueError:
            words.append(f"{run.name} (another motion)")
            continue
        pairings.append(pair_with_run(motion, drive_run_of(run, robot), found.shift, found.rate))
        words.append(f"{run.name} (the same motion, shift {found.shift:+.3f} s)")
    return FreePart(
        inside=np.zeros(recording.samples, dtype=bool),
        runs=runs,
        pairings=tuple(pairings),
        note=f"free part: {', '.join(words)}",
    )
