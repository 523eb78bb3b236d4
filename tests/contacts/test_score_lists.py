"""What lists of contacts reach on simulated arms that no constant was chosen on: the bars.

They were set for arms that stick, and for taps of up to 136 N.
"""

from functools import cache
from typing import Any

import numpy as np
import pytest
from contact_scores import Score, angle, score, touched, true_contacts

from vftcli.notebook import report
from vftcli.robots.chain import link_poses
from vftcli.signals.arrays import Mask
from vftcli.simulation import load_scenario, simulate

SEEDS = 61, 62, 63
NINE = "ur5-circle", "ur5-table1", "taps"
TAPS = "contacts.hand.style=taps"
SCENARIOS = {
    "ur5-circle": ("ur5-circle", (), "0.3:4"),
    "ur5-table1": ("ur5-table1", ("contacts.hand.force=[10,136]",), "0.3:4"),
    "taps": ("ur5-circle", (TAPS,), "0.3:4"),
    "panda-bearing": ("panda-bearing", ("sensing.rate=100",), "0.3:3.9"),
    "ur5-sensor": ("ur5-sensor", (), "0.3:3"),
    "ur5-drag": ("ur5-drag", (), "0.3:6"),
    "knocks": ("ur5-circle", (TAPS, "contacts.hand.length=[0.04,0.12]"), "0.3:4"),
}
"""Name → scenario, settings, and the span that nobody touches. [s]"""


def scored(name: str, seed: int) -> tuple[Score, Mask]:
    """Simulate a scenario, analyse it as `estimate` does, and hold it against the truth.

    The list's score, and the samples in contact and in a row in which each axis' 95 % band of the
    wrench of `best` held. (S, 6)
    """
    scenario, settings, free = SCENARIOS[name]
    made = simulate(load_scenario(scenario, [*settings, "friction.presliding=0"]), seed)
    truth = made.truth.contacts.get("hand", made.truth.wrench)
    truth = truth[np.unique(np.array(made.measured.rows))]
    t = made.recording.t
    analysis = report(made.recording, made.robot, observer="best", free=free)
    wrench = analysis.wrench
    inside = np.zeros(len(t), dtype=bool)
    for row in analysis.contacts.contacts:
        inside |= (t >= row.start) & (t <= row.stop)
    # The wrench of `best` is in flange axes where nothing else is asked.
    R = link_poses(analysis.robot.loaded_chain, made.recording.q).rotation[:, -1]
    turned = np.einsum("tji,tkj->tki", R, truth.reshape(-1, 2, 3)).reshape(-1, 6)
    held = (np.abs(wrench.values - turned) <= 1.96 * wrench.sd)[inside & touched(truth)]
    return score(analysis.contacts.contacts, true_contacts(t, truth)), held


Figures = dict[str, Any]  # What some logs of a scenario reached together.


@cache
def reached(name: str, seeds: tuple[int, ...] = SEEDS) -> Figures:
    """The figures of some seeds of a scenario, of which the wrist was touched."""
    scores, held = zip(*(scored(name, seed) for seed in seeds), strict=True)
    pairs = [pair for each in scores for pair in each.pairs]
    onset = np.array([row.start - met.start for row, met in pairs])
    peak = np.array([row.peak_force - met.size for row, met in pairs])
    band = np.array([row.peak_band for row, _ in pairs])
    norm = np.linalg.norm
    impulse = [norm(row.impulse - met.impulse) / norm(met.impulse) for row, met in pairs]
    places = [row.where for row, _ in pairs]
    return {
        "true": len(pairs) + sum(len(each.missed) for each in scores),
        "found": len(pairs),  # true contacts that a row is credited to
        "rows": sum(each.rows for each in scores),
        "false": sum(len(each.false) for each in scores),  # beside every true contact
        "onset": np.quantile(np.abs(onset), 0.9),  # rows begin so near to their contact [s]
        "peak": np.sqrt(np.mean(peak**2)),  # error of |F| at the peak [N]
        "peak_mean": peak.mean(),
        "direction": np.median([angle(row.wrench[:3], met.force) for row, met in pairs]),  # [deg]
        "impulse": np.median(impulse),  # error as a share of it
        "held": np.mean(np.abs(peak) <= band),  # peaks in their 95 % band
        "width": band.mean(),  # half of it [N]
        "axes": np.concatenate(held).mean(axis=0),  # (6,)
        "unsure": places.count("cannot tell"),
        "wrong": sum(place not in {"wrist", "cannot tell"} for place in places),
    }


@pytest.mark.statistical
def test_simulated_pushes_are_listed_one_by_one_and_hardly_ever_placed_elsewhere():
    nine = [reached(name) for name in NINE]
    true, found = sum(each["true"] for each in nine), sum(each["found"] for each in nine)
    assert found >= 0.97 * true
    assert abs(sum(each["rows"] for each in nine) - true) <= 0.03 * true
    assert sum(each["false"] for each in nine) <= 1
    assert sum(each["wrong"] for each in nine) <= 0.02 * found
    assert sum(each["unsure"] for each in nine) <= 0.35 * found


@pytest.mark.statistical
@pytest.mark.parametrize(
    ("name", "figure", "bar"),
    [
        *((name, "onset", 0.2) for name in NINE),
        ("ur5-circle", "peak", 9.0),
        ("ur5-table1", "peak", 6.0),
        ("taps", "peak", 6.0),
        ("ur5-circle", "direction", 5.0),
        ("ur5-table1", "direction", 3.0),
        ("taps", "direction", 3.0),
        ("ur5-circle", "impulse", 0.15),
        ("ur5-table1", "impulse", 0.08),
        ("taps", "impulse", 0.08),
        ("ur5-circle", "width", 10.0),  # 9.6: what the places that fit differ by is in the band
        ("ur5-table1", "width", 10.5),  # 10.0 likewise; 8 and 9 held .76 and .90 of the peaks
        ("taps", "width", 10.5),
        ("ur5-sensor", "false", 1),
        ("ur5-drag", "false", 1),
    ],
)
def test_a_list_errs_by_no_more_than_its_bar(name, figure, bar):
    assert reached(name)[figure] <= bar


@pytest.mark.statistical
@pytest.mark.parametrize(
    ("name", "bar"),
    [("ur5-circle", 0.93), ("ur5-table1", 0.95), ("taps", 0.88), ("panda-bearing", 0.80)],
)
def test_a_peak_lies_in_its_band(name, bar):
    assert reached(name)["held"] >= bar


@pytest.mark.statistical
@pytest.mark.parametrize(
    ("name", "axes", "bar"),
    [
        *((name, slice(3), 0.88) for name in NINE),
        ("ur5-circle", slice(3, 6), 0.65),
        ("ur5-table1", slice(3, 6), 0.85),
        ("taps", slice(3, 6), 0.85),
        ("panda-bearing", slice(3), 0.88),
        ("ur5-sensor", slice(3), 0.80),
    ],
)
def test_bands_of_best_hold_in_contact(name, axes, bar):
    assert np.all(reached(name)["axes"][axes] >= bar)


@pytest.mark.statistical
def test_knocks_shorter_than_the_blocks_keep_most_of_their_peaks_and_a_band():
    """Knocks of 40 to 120 ms: blocks of 24 ms lost a fifth of the peak, and held one in five."""
    knocked = reached("knocks", (51,))
    assert knocked["peak_mean"] > -13.0
    assert knocked["held"] >= 0.6


@pytest.mark.statistical
def test_drags_a_tenth_of_a_second_apart_are_rows_of_their_own():
    """Beside a free part at rest, from different sides: 12 of 15; they were six rows."""
    assert reached("ur5-sensor")["found"] >= 12
