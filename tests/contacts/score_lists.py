"""Score lists of contacts on simulated arms: found, rows, false, onset, peak, direction, bands.

Example: python tests/contacts/score_lists.py --seeds 31,32,33 ur5-circle ur5-table1 taps
"""

import argparse
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))

from contact_scores import angle, score, true_contacts

from vftcli.contacts.listing import list_contacts
from vftcli.repetition.choice import FreeChoice
from vftcli.repetition.free_motion import FreeMotion
from vftcli.repetition.free_run import ModelledRun
from vftcli.simulation import load_scenario, simulate

SCENARIOS = {
    "ur5-circle": ("ur5-circle", (), "0.3:4"),
    "ur5-table1": ("ur5-table1", (), "0.3:4"),
    "taps": ("ur5-circle", ("contacts.hand.style=taps",), "0.3:4"),
    "panda-bearing": ("panda-bearing", ("sensing.rate=100",), "0.3:3.9"),
    "ur5-sensor": ("ur5-sensor", (), "0.3:3"),
    "ur5-drag": ("ur5-drag", (), "0.3:6"),
}
"""Name → scenario, settings, and the span that nobody touches. [s]"""


def main() -> None:
    """Simulate, list, score, and print one line a scenario."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scenario", nargs="*", default=["ur5-circle", "ur5-table1", "taps"])
    parser.add_argument("--seeds", default="41,42,43")
    chosen = parser.parse_args()
    for name in chosen.scenario:
        scenario, settings, free = SCENARIOS[name]
        scores = []
        for seed in map(int, chosen.seeds.split(",")):
            made = simulate(load_scenario(scenario, list(settings)), seed)
            log = ModelledRun(recording=made.recording, robot=made.robot)
            rows = np.unique(np.array(made.measured.rows))
            true = true_contacts(made.recording.t, made.truth.wrench[rows])
            choice = FreeChoice.parsed(free_part=free)
            scores.append(score(list_contacts(FreeMotion(log=log, choice=choice)).contacts, true))
        print(name, line(scores))


def line(scores: list) -> str:
    """The figures of some lists on one line."""
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
    places = [row.where for row, _ in pairs]
    return (
        f"true {true} found {len(pairs)} rows {sum(each.rows for each in scores)} "
        f"false {sum(len(each.false) for each in scores)} | "
        f"onset median {np.median(onset):.3f} p90 {np.quantile(np.abs(onset), 0.9):.3f} s | "
        f"peak rms {np.sqrt(np.mean(peak**2)):.1f} N | direction {np.median(turn):.1f} deg | "
        f"impulse {100 * np.median(impulse):.0f} % | band holds {np.mean(np.abs(peak) <= band):.2f}"
        f", half width {band.mean():.1f} N | "
        + ", ".join(f"{place} {places.count(place)}" for place in sorted(set(places)))
    )


if __name__ == "__main__":
    main()
