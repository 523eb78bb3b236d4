"""Score lists of contacts, and the wrench beside them, on simulated arms, as a user would get them.

Example: python tests/contacts/score_lists.py --seeds 51,52,53 ur5-circle ur5-table1 taps
"""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from time import process_time
from typing import NamedTuple

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))

from contact_scores import Score, angle, score, touched, true_contacts

from vftcli import pipeline
from vftcli.contacts.contact_list import Contact
from vftcli.observers.choice import ObserverChoice
from vftcli.pipeline import AnalysisChoice, analyse
from vftcli.repetition.choice import FreeChoice
from vftcli.signals.arrays import Array, Mask
from vftcli.simulation import load_scenario, simulate

TAPS = ("contacts.hand.style=taps",)
FOREARM = ("contacts.hand.link=3", "contacts.hand.point=[-0.2,0,0]")
SCENARIOS = {
    "ur5-circle": ("ur5-circle", (), "0.3:4"),
    "ur5-table1": ("ur5-table1", (), "0.3:4"),
    "taps": ("ur5-circle", TAPS, "0.3:4"),
    "panda-bearing": ("panda-bearing", ("sensing.rate=100",), "0.3:3.9"),
    "ur5-sensor": ("ur5-sensor", (), "0.3:3"),
    "ur5-drag": ("ur5-drag", (), "0.3:6"),
    "forearm": ("ur5-circle", FOREARM, "0.3:4"),
}
"""Name → scenario, settings, and the span that nobody touches. [s]"""

BANDS = {"wrist": "wrist", "forearm": "forearm"}


class LogScore(NamedTuple):
    """One log: how its list was scored, and where the bands of `best` held the wrench.

    Attributes:
        list: Rows and the true contacts they are credited to.
        held: Samples in contact and in a row in which each axis' 95 % band held. (S, 6)
        smallest: The smallest force that is told. [N]
        seconds: What the list took, for 60 s of log. [s]
        agree: Of each credited row whether |F| of `best` at the peak lies in the row's band.
    """

    list: Score
    held: Mask
    smallest: float
    seconds: float
    agree: list[bool]


def main() -> None:
    """Simulate, list, score, and print the figures of each scenario."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scenario", nargs="*", default=["ur5-circle", "ur5-table1", "taps"])
    parser.add_argument("--seeds", default="51,52,53")
    parser.add_argument("--details", action="store_true", help="print every row too")
    chosen = parser.parse_args()
    for name in chosen.scenario:
        logs = [scored(name, int(seed)) for seed in chosen.seeds.split(",")]
        if chosen.details:
            print(*(text for log in logs for text in details(log.list)), sep="\n")
        print(name, line(logs, part="forearm" if name == "forearm" else "wrist"), flush=True)


def scored(name: str, seed: int) -> LogScore:
    """Simulate a scenario, analyse it as `estimate` does, and hold it against the truth."""
    scenario, settings, free = SCENARIOS[name]
    made = simulate(load_scenario(scenario, list(settings)), seed)
    rows = np.unique(np.array(made.measured.rows))
    truth, recording = made.truth.wrench[rows], made.recording
    choice = AnalysisChoice(
        observers=ObserverChoice(names=("best",)), free=FreeChoice.parsed(free_part=free)
    )
    took: list[float] = []
    plain = pipeline.find_contacts

    def timed(*words: object) -> object:
        begin = process_time()
        made = plain(*words)  # type: ignore[arg-type]
        took.append(process_time() - begin)
        return made

    pipeline.find_contacts = timed  # type: ignore[assignment]
    try:
        analysis = analyse(recording, made.robot, choice)
    finally:
        pipeline.find_contacts = plain
    assert analysis.contacts is not None
    assert analysis.virtual_sensor is not None
    (wrench,) = analysis.virtual_sensor.wrenches
    scores = score(analysis.contacts.contacts, true_contacts(recording.t, truth))
    # The wrench of `best` is in flange axes where nothing else is asked.
    turned = in_flange_axes(analysis.robot, recording.q, truth)
    assert wrench.sd is not None
    inside = touched(truth) & within(recording.t, analysis.contacts.contacts)
    held = (np.abs(wrench.values - turned) <= 1.96 * wrench.sd)[inside]
    size = np.linalg.norm(wrench.values[:, :3], axis=1)
    agree = [
        abs(np.interp(row.peak, recording.t, size) - (row.peak_force or 0.0))
        <= (row.peak_band or 0.0)
        for row, _ in scores.pairs
    ]
    smallest = analysis.contacts.smallest_force or np.nan
    return LogScore(scores, held, smallest, 60.0 * sum(took) / recording.duration, agree)


def in_flange_axes(robot: object, q: Array, wrench: Array) -> Array:
    """A wrench in base axes about the flange point as the flange's axes see it. (T, 6)"""
    from vftcli.robots.kinematics import link_poses

    R = link_poses(robot.chain, q).rotation[:, -1]  # type: ignore[attr-defined]
    turned = [np.einsum("tji,tj->ti", R, part) for part in (wrench[:, :3], wrench[:, 3:])]
    return np.hstack(turned)


def within(t: Array, rows: Sequence[Contact]) -> Mask:
    """Samples that lie in a row. (T,)"""
    inside = np.zeros(len(t), dtype=bool)
    for row in rows:
        inside |= (t >= row.start) & (t <= row.stop)
    return inside


def line(logs: Sequence[LogScore], part: str) -> str:
    """The figures of some logs."""
    scores = [log.list for log in logs]
    pairs = [pair for each in scores for pair in each.pairs]
    true = len(pairs) + sum(len(each.missed) for each in scores)
    onset = [row.start - met.start for row, met in pairs]
    peak = np.array([row.peak_force - met.size for row, met in pairs])
    band = np.array([row.peak_band for row, _ in pairs])
    turn = [angle(row.wrench[:3], met.force) for row, met in pairs]
    impulse = [
        np.linalg.norm(row.impulse - met.impulse) / np.linalg.norm(met.impulse)
        for row, met in pairs
    ]
    anywhere = [row.anywhere[0] <= met.size <= row.anywhere[1] for row, met in pairs]
    places = [row.where for row, _ in pairs]
    right, unsure = places.count(part), places.count("cannot tell")
    short = np.array([met.stop - met.start < 0.25 for _, met in pairs])
    held = np.concatenate([log.held for log in logs]).mean(axis=0)
    holds = np.abs(peak) <= band
    return (
        f"true {true} found {len(pairs)} rows {sum(each.rows for each in scores)} "
        f"false {sum(len(each.false) for each in scores)} | "
        f"onset median {np.median(onset):.3f} p90 {np.quantile(np.abs(onset), 0.9):.3f} s | "
        f"peak rms {np.sqrt(np.mean(peak**2)):.1f} of {np.mean([m.size for _, m in pairs]):.0f} N "
        f"mean {peak.mean():+.1f} | direction {np.median(turn):.1f} deg | "
        f"impulse {100 * np.median(impulse):.0f} %\n    band holds {np.mean(holds):.2f}, "
        f"half width {band.mean():.1f} N, shorter than .25 s: {np.count_nonzero(short)}, "
        f"held {np.mean(holds[short]) if short.any() else np.nan:.2f}, "
        f"mean {peak[short].mean() if short.any() else np.nan:+.1f} N; "
        f"anywhere holds {np.mean(anywhere):.2f} | "
        f"axes held {' '.join(f'{x:.2f}' for x in held)}\n    place right {right}, wrong "
        f"{len(pairs) - right - unsure}, cannot tell {unsure} | "
        f"smallest {np.mean([log.smallest for log in logs]):.1f} N | best agrees with "
        f"{np.mean([x for log in logs for x in log.agree]):.2f} of the rows | "
        f"{np.mean([log.seconds for log in logs]):.1f} s for 60 s"
    )


def details(found: Score) -> list[str]:
    """A line a row, and one a missed contact."""
    told = [
        f"  {row.start:6.2f}-{row.stop:6.2f} (true {met.start:6.2f}-{met.stop:6.2f}) "
        f"{row.peak_force:5.1f} ± {row.peak_band:4.1f} (true {met.size:5.1f}) N "
        f"{row.evidence:7.1f} nats {row.where} {row.lead:.0f} {row.places}"
        for row, met in found.pairs
    ]
    credited = {id(row) for row, _ in found.pairs}
    return [
        *told,
        *(f"  missed {met.start:6.2f}-{met.stop:6.2f} {met.size:5.1f} N" for met in found.missed),
        *(f"  false {row.start:.2f}-{row.stop:.2f}" for row in found.false),
        *(() if credited else ("  nothing credited",)),
    ]


if __name__ == "__main__":
    main()
