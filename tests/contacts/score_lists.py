"""Score lists of contacts, and the wrench beside them, on simulated arms, as a user would get them.

Example: python tests/contacts/score_lists.py --seeds 61,62,63 ur5-circle ur5-table1 taps

The bars were set for arms that stick, and for taps of up to 136 N: `--set friction.presliding=0.65`
takes the built-in scenarios' joints, `--set contacts.hand.force=[10,122]` ur5-table1's taps.
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
from vftcli.free_motion.choice import FreeChoice
from vftcli.observers.choice import ObserverChoice
from vftcli.pipeline import AnalysisChoice, analyse, run_of
from vftcli.signals.arrays import Array, Mask
from vftcli.simulation import load_scenario, simulate

STICKS = ("friction.presliding=0",)
TAPS = ("contacts.hand.style=taps",)
KNOCKS = (*TAPS, "contacts.hand.length=[0.04,0.12]")
FOREARM = ("contacts.hand.link=3", "contacts.hand.point=[-0.2,0,0]")
UPPER = ("contacts.hand.link=2", "contacts.hand.point=[-0.2,0,0]")
SCENARIOS = {
    "ur5-circle": ("ur5-circle", (), "0.3:4"),
    "ur5-table1": ("ur5-table1", ("contacts.hand.force=[10,136]",), "0.3:4"),
    "taps": ("ur5-circle", TAPS, "0.3:4"),
    "panda-bearing": ("panda-bearing", ("sensing.rate=100",), "0.3:3.9"),
    "ur5-sensor": ("ur5-sensor", (), "0.3:3"),
    "ur5-drag": ("ur5-drag", (), "0.3:6"),
    "knocks": ("ur5-circle", KNOCKS, "0.3:4"),
    "knocks-500": ("ur5-circle", (*KNOCKS, "sensing.rate=500"), "0.3:4"),
    "forearm": ("ur5-circle", FOREARM, "0.3:4"),
    "upper arm": ("ur5-circle", UPPER, "0.3:4"),
}
"""Name → scenario, settings, and the span that nobody touches. [s]"""


class LogScore(NamedTuple):
    """One log: how its list was scored, and where the bands of `best` held the wrench.

    Attributes:
        list: Rows and the true contacts they are credited to.
        held: Samples in contact and in a row in which each axis' 95 % band held. (S, 6)
        smallest: The smallest force that the list shows. [N]
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
    parser.add_argument("--seeds", default="61,62,63")
    parser.add_argument("--set", action="append", default=list(STICKS), help="of the scenario")
    parser.add_argument("--details", action="store_true", help="print every row too")
    chosen = parser.parse_args()
    for name in chosen.scenario:
        logs = [scored(name, int(seed), chosen.set) for seed in chosen.seeds.split(",")]
        if chosen.details:
            print(*(text for log in logs for text in details(log.list)), sep="\n")
        part = name if name in {"forearm", "upper arm"} else "wrist"
        print(name, line(figures(logs, part)), flush=True)


def scored(name: str, seed: int, more: Sequence[str] = STICKS) -> LogScore:
    """Simulate a scenario, analyse it as `estimate` does, and hold it against the truth."""
    scenario, settings, free = SCENARIOS[name]
    made = simulate(load_scenario(scenario, [*settings, *more]), seed)
    rows = np.unique(np.array(made.measured.rows))
    # A hand on a link has a wrench of its own, about its point.
    hand = made.truth.contacts.get("hand", made.truth.wrench)
    truth, recording = hand[rows], made.recording
    choice = AnalysisChoice(
        observers=ObserverChoice(names=("best",)),
        free=FreeChoice.parsed(free=[free] if free else ()),
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
        analysis = analyse(run_of(recording, made.robot, choice), choice)
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
    from vftcli.robots.chain import link_poses

    R = link_poses(robot.chain, q).rotation[:, -1]  # type: ignore[attr-defined]
    turned = [np.einsum("tji,tj->ti", R, part) for part in (wrench[:, :3], wrench[:, 3:])]
    return np.hstack(turned)


def within(t: Array, rows: Sequence[Contact]) -> Mask:
    """Samples that lie in a row. (T,)"""
    inside = np.zeros(len(t), dtype=bool)
    for row in rows:
        inside |= (t >= row.start) & (t <= row.stop)
    return inside


class Figures(NamedTuple):
    """What some logs of a scenario reached together.

    Attributes:
        true: True contacts.
        found: Those that a row is credited to.
        rows: Rows of the lists.
        false: Rows beside every true contact.
        onset: 90 % of the rows begin so near to their contact. [s]
        onset_median: Median of how much later rows begin. [s]
        peak: Root mean square error of |F| at the peak. [N]
        peak_mean: Its mean error. [N]
        size: Mean true |F|. [N]
        direction: Median angle between the forces at the peak. [deg]
        impulse: Median error of the impulse, as a share of it.
        held: Share of the peaks that their 95 % band holds.
        width: Mean half width of that band. [N]
        brief: Contacts shorter than .25 s, ...
        brief_held: ... the share of their peaks that the band holds, ...
        brief_mean: ... and the mean error of these. [N]
        anywhere: Share of the peaks within the range over every place that fits.
        axes: Share of the samples in contact whose band of `best` holds, per axis. (6,)
        right: Rows placed on the part of the arm that was touched.
        unsure: Rows without a place.
        smallest: Mean of the smallest force that the list shows. [N]
        agree: Share of the rows whose band holds |F| of `best` at the peak.
        seconds: What the list took for 60 s of log, on average. [s]
    """

    true: int
    found: int
    rows: int
    false: int
    onset: float
    onset_median: float
    peak: float
    peak_mean: float
    size: float
    direction: float
    impulse: float
    held: float
    width: float
    brief: int
    brief_held: float
    brief_mean: float
    anywhere: float
    axes: Array
    right: int
    unsure: int
    smallest: float
    agree: float
    seconds: float

    @property
    def wrong(self) -> int:
        """Rows placed on a part of the arm that was not touched."""
        return self.found - self.right - self.unsure


def figures(logs: Sequence[LogScore], part: str = "wrist") -> Figures:
    """What some logs reached, `part` of the arm having been touched."""
    scores = [log.list for log in logs]
    pairs = [pair for each in scores for pair in each.pairs]
    onset = np.array([row.start - met.start for row, met in pairs])
    peak = np.array([row.peak_force - met.size for row, met in pairs])
    band = np.array([row.peak_band for row, _ in pairs])
    impulse = [
        np.linalg.norm(row.impulse - met.impulse) / np.linalg.norm(met.impulse)
        for row, met in pairs
    ]
    anywhere = [row.anywhere[0] <= met.size <= row.anywhere[1] for row, met in pairs]
    places = [row.where for row, _ in pairs]
    brief = np.array([met.stop - met.start < 0.25 for _, met in pairs])
    holds = np.abs(peak) <= band
    return Figures(
        true=len(pairs) + sum(len(each.missed) for each in scores),
        found=len(pairs),
        rows=sum(each.rows for each in scores),
        false=sum(len(each.false) for each in scores),
        onset=float(np.quantile(np.abs(onset), 0.9)),
        onset_median=float(np.median(onset)),
        peak=float(np.sqrt(np.mean(peak**2))),
        peak_mean=float(peak.mean()),
        size=float(np.mean([met.size for _, met in pairs])),
        direction=float(np.median([angle(row.wrench[:3], met.force) for row, met in pairs])),
        impulse=float(np.median(impulse)),
        held=float(holds.mean()),
        width=float(band.mean()),
        brief=int(np.count_nonzero(brief)),
        brief_held=float(holds[brief].mean()) if brief.any() else np.nan,
        brief_mean=float(peak[brief].mean()) if brief.any() else np.nan,
        anywhere=float(np.mean(anywhere)),
        axes=np.concatenate([log.held for log in logs]).mean(axis=0),
        right=places.count(part),
        unsure=places.count("cannot tell"),
        smallest=float(np.mean([log.smallest for log in logs])),
        agree=float(np.mean([x for log in logs for x in log.agree])),
        seconds=float(np.mean([log.seconds for log in logs])),
    )


def line(of: Figures) -> str:
    """The figures of some logs."""
    return (
        f"true {of.true} found {of.found} rows {of.rows} false {of.false} | "
        f"onset median {of.onset_median:.3f} p90 {of.onset:.3f} s | "
        f"peak rms {of.peak:.2f} of {of.size:.0f} N mean {of.peak_mean:+.1f} | "
        f"direction {of.direction:.2f} deg | impulse {100 * of.impulse:.1f} %\n"
        f"    band holds {of.held:.2f}, half width {of.width:.2f} N, shorter than .25 s: "
        f"{of.brief}, held {of.brief_held:.2f}, mean {of.brief_mean:+.1f} N; "
        f"anywhere holds {of.anywhere:.2f} | "
        f"axes held {' '.join(f'{x:.3f}' for x in of.axes)}\n    place right {of.right}, wrong "
        f"{of.wrong}, cannot tell {of.unsure} | smallest {of.smallest:.1f} N | best agrees with "
        f"{of.agree:.2f} of the rows | {of.seconds:.1f} s for 60 s"
    )


def details(found: Score) -> list[str]:
    """A line a row, and one a missed contact."""
    reported = [
        f"  {row.start:6.2f}-{row.stop:6.2f} (true {met.start:6.2f}-{met.stop:6.2f}) "
        f"{row.peak_force:5.1f} ± {row.peak_band:4.1f} (true {met.size:5.1f}) N "
        f"{row.evidence:7.1f} nats {row.where} {row.lead:.0f} {row.places}"
        for row, met in found.pairs
    ]
    credited = {id(row) for row, _ in found.pairs}
    return [
        *reported,
        *(f"  missed {met.start:6.2f}-{met.stop:6.2f} {met.size:5.1f} N" for met in found.missed),
        *(f"  false {row.start:.2f}-{row.stop:.2f}" for row in found.false),
        *(() if credited else ("  nothing credited",)),
    ]


if __name__ == "__main__":
    main()
