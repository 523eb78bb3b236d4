"""Thresholds learned on the first half of long free logs, counted on the second: the bars.

    vftcli simulate ur5-circle --seed 31 --set trajectory.cycles=450 \
        --set contacts.hand.begin=100000 --set friction.presliding=0 \
        --as parquet -o free_31.parquet
    python tests/contacts/thresholds_run.py --robot ur5 free_31.parquet free_32.parquet

Another seed is another arm, so that each log is learned and counted for itself. At 60 per hour and
joint every joint has to be within × 2 of what is due, at 12 per hour the sum over the joints within
× 2 and each joint at most 9 (three times its due in 15 min), at 1 per hour the sum over all logs at
most 3 (what is due on twelve joints). Exits with 1 if one does not hold.
"""

import argparse
import sys
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from vftcli.contacts.threshold_check import compared_signals
from vftcli.contacts.thresholds import BLOCK, SETTLING, ComparedSignals, events, find_thresholds
from vftcli.readers.reading import read
from vftcli.robots import load_robot
from vftcli.robots.run import Run
from vftcli.signals.recording import Recording

RATES = (60.0, 12.0, 1.0)  # False alarms of one joint. [1/h]


def part(signals: ComparedSignals, start: float, stop: float) -> ComparedSignals:
    """A span of what was estimated along the whole log. [s]"""
    inside = (signals.t >= start) & (signals.t < stop)
    whole = signals.recording
    taken = Recording(t=whole.t[inside], q=whole.q[inside], source=whole.source)
    torque, wrench = signals.torque[inside], signals.wrench[inside]
    return replace(signals, recording=taken, torque=torque, wrench=wrench)


class Count(NamedTuple):
    """Passages of the thresholds of a log."""

    log: str
    due: float  # Those of any joint that the rate allows.
    joints: tuple[int, ...]  # Those of every joint.


def counts(path: Path, robot: str) -> dict[float, Count]:
    """What the second half counts at the thresholds of the first, by the rate of one joint."""
    # As RTDE has it, without an estimate of the robot's own: the momentum observer stands for it.
    recording = replace(read(path), tau_ext=None)
    run = Run(recording=recording, robot=load_robot(robot))
    signals = compared_signals(run)
    t0, middle = float(signals.t[0]), 0.5 * float(signals.t[0] + signals.t[-1])
    learn = part(signals, t0, middle)
    # Nothing settles in the middle of a log: what the counting leaves out lies before it.
    count = part(signals, middle - SETTLING, float(signals.t[-1]) + BLOCK)
    hours, found = (count.recording.duration - SETTLING) / 3600.0, {}
    for rate in RATES:
        thresholds = find_thresholds([learn], rate * signals.torque.shape[1])
        level = thresholds.level("joints", count)
        passages = tuple(len(events(count.t, column)) for column in level.T)
        found[rate] = Count(path.name, hours * thresholds.rate, passages)
        values = " ".join(f"{one.value:6.2f}" for one in thresholds.joints)
        sys.stdout.write(f"{path.name} {rate:4g}/h  N·m {values}  counted {found[rate].joints}\n")
    return found


def failures(found: list[dict[float, Count]]) -> list[str]:
    wrong = []
    for one in found:
        often, rare = one[60.0], one[12.0]
        due = often.due / len(often.joints)
        wrong += [
            f"{often.log}: J{j} {count} where {due:.3g} are due at 60/h"
            for j, count in enumerate(often.joints, start=1)
            if not 0.5 * due <= count <= 2.0 * due
        ]
        total = sum(rare.joints)
        if not 0.5 * rare.due <= total <= 2.0 * rare.due or max(rare.joints) > 9:
            wrong.append(f"{rare.log}: {rare.joints} where {rare.due:.3g} are due at 12/h")
    seldom = int(np.sum([one[1.0].joints for one in found]))
    if seldom > 3:
        wrong.append(f"{seldom} events at 1/h")
    return wrong


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("logs", nargs="+", type=Path, metavar="LOG")
    parser.add_argument("--robot", default="ur5")
    given = parser.parse_args()
    wrong = failures([counts(path, given.robot) for path in given.logs])
    sys.stdout.write("\n".join(wrong or ["every bar holds"]) + "\n")
    return int(bool(wrong))


if __name__ == "__main__":
    sys.exit(main())
