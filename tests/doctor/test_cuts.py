"""Bad samples and bad spans inside a sound log: cut out, said once, and no force."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from vftcli.doctor import Examiner, examine
from vftcli.notebook import contacts
from vftcli.readers.reader import ReadChoice
from vftcli.readers.reading import read
from vftcli.robots import load_robot
from vftcli.robots.kernels import momentum_terms
from vftcli.signals.arrays import Array
from vftcli.signals.recording import Recording
from vftcli.signals.repairs import with_velocity

FIXTURES = Path(__file__).parents[2] / "fixtures"
ROBOT = load_robot("ur5")
AT = 2007
"""The sample from which on faults are planted: the arm moves. The log has 2501 at 125 Hz."""

Signals = dict[str, Array]


@pytest.fixture(scope="module")
def circle() -> Recording:
    return read(FIXTURES / "ur5_circle.csv")


def changed(name: str, rows: int, change: Callable[[Array], Array], *joints: int) -> Any:
    """What changes some rows of a signal, of all joints or of some, counted from 1."""

    def plant(signals: Signals) -> None:
        columns = [j - 1 for j in joints] or list(range(signals[name].shape[1]))
        place = np.ix_(np.arange(AT, min(AT + rows, len(signals["t"]))), columns)
        signals[name][place] = change(signals[name][place])

    return plant


def glued(signals: Signals) -> None:
    """Two sessions on one clock: the rows of 1.5 s are missing."""
    keep = np.r_[0 : AT - 190, AT : len(signals["t"])]
    t = signals["t"][: len(keep)]
    signals |= {name: value[keep] for name, value in signals.items()} | {"t": t}


def packets(value: float) -> Any:
    def plant(signals: Signals) -> None:
        for name in ("q", "dq", "current"):
            changed(name, 3, lambda x: 0 * x + value)(signals)

    return plant


def frozen(signals: Signals) -> None:
    for name in ("q", "dq", "current"):
        signals[name][AT : AT + 375] = signals[name][AT]


def planted(recording: Recording, *plants: Callable[[Signals], None]) -> Recording:
    signals = {name: getattr(recording, name).copy() for name in ("t", *recording.signals)}
    for plant in plants:
        plant(signals)
    return replace(recording, **signals)


def examined(recording: Recording) -> tuple[Recording, dict[str, Any]]:
    """The log as every command gets it, and the warnings of its examination."""
    sound = Examiner().read_as(recording, ROBOT, ReadChoice())
    return sound, {f.code: f for f in examine(sound, ROBOT).warnings}


@pytest.mark.parametrize(
    ("plant", "code", "rows", "joints"),
    [
        # K of J3 is 10 N·m/A and more: 100 A are beyond 1.5 · 150 N·m.
        (changed("current", 1, lambda x: x + 100, 3), "effort-beyond-drive", 1, (3,)),
        (changed("current", 1, lambda x: x + 1000, 3), "effort-beyond-drive", 1, (3,)),
        (changed("current", 3, lambda x: 0 * x - 9999), "effort-beyond-drive", 3, None),
        (changed("current", 1, lambda x: x + 12, 3), "isolated-effort", 1, (3,)),
        (changed("current", 10, lambda x: 0 * x), "zero-burst", 10, None),
        (changed("current", 10, lambda x: 0 * x, 2), "zero-burst", 10, (2,)),
        (packets(0.0), "position-slip", 3, None),
        (packets(-9999.0), "position-slip", 3, None),
        (changed("q", 1, lambda x: x + 0.05, 3), "position-slip", 1, (3,)),
        (changed("q", 1, lambda x: x - 0.3, 3), "position-slip", 1, (3,)),
        (changed("dq", 1, lambda x: x + 2, 3), "isolated-velocity", 1, (3,)),
        (changed("dq", 1, lambda x: x + 10, 3), "isolated-velocity", 1, (3,)),
        # Four samples of 0.4 rad/s at rest are 5 N·m·s that no force gave.
        (changed("dq", 4, lambda x: x + 0.4, 3), "isolated-velocity", 4, (3,)),
        (changed("dq", 25, lambda x: x + 0.4), "isolated-velocity", 25, None),
        # .25 s before and behind, and the two samples between which it is: 64 at 125 Hz.
        (changed("q", 9999, lambda x: x + 0.05, 3), "position-jump", 64, (3,)),
        (glued, "position-jump", 64, None),
        (frozen, "frozen-rows", 374, None),
        (changed("q", 375, lambda x: 0 * x + x[0], 3), "frozen-position", 374, (3,)),
        # Three seconds: of all joints at once nothing else is asked but that the arm moves.
        (
            changed("current", 375, lambda x: 0 * x + x[0]),
            "frozen-effort",
            374,
            (1, 2, 3, 4, 5, 6),
        ),
        (
            changed("current", 375, lambda x: 0 * x + x[0], 1, 2, 3, 4, 6),
            "frozen-effort",
            374,
            (1, 2, 3, 4, 6),
        ),
    ],
)
def test_bad_samples_are_cut_out_and_said_once(circle, plant, code, rows, joints):
    bad = planted(circle, plant)
    sound, found = examined(bad)
    assert set(found) == {code}
    assert bad.samples - sound.samples == found[code].values["rows"] == rows
    assert joints is None or found[code].where.joints == joints
    (cut,) = sound.source.cuts
    where = bad.t[min(AT, bad.samples - 1)] if plant is not glued else bad.t[AT - 190]
    assert cut.start - 0.01 <= where <= cut.stop + 0.01
    assert not np.isin(sound.t, bad.t[(bad.t >= cut.start) & (bad.t <= cut.stop)]).any()


@pytest.mark.parametrize("rows", [1, 3])
def test_a_bad_position_is_in_no_derived_velocity(circle, rows):
    """Spread by the filter, three samples of .5 rad gave a real log a contact of 15 kN."""
    bare = replace(circle, dq=None)
    bad = planted(bare, changed("q", rows, lambda x: x + 0.5, 3))
    sound, found = examined(with_velocity(bad))
    assert found["position-slip"].values["rows"] == rows
    at = np.isin(bare.t, sound.t)
    # The missing samples' part in the filter: .5 rad would give 5 rad/s.
    np.testing.assert_allclose(sound.dq, with_velocity(bare).dq[at], rtol=0, atol=0.02)


@pytest.mark.parametrize("rows", [1, 9999], ids=["one sample", "from then on"])
@pytest.mark.parametrize("turns", [1, -2])
def test_a_count_that_begins_anew_is_unwrapped(circle, rows, turns):
    bad = planted(circle, changed("q", rows, lambda x: x + 2 * np.pi * turns, 6))
    sound, found = examined(bad)
    assert (found, sound.samples) == ({}, circle.samples)
    assert "turn-unwrapped" in [remark.code for remark in sound.source.remarks]
    # Adding 2π and taking it off again rounds twice.
    np.testing.assert_allclose(sound.q, circle.q, rtol=0, atol=1e-14)


def test_brakes_are_cut_out_with_the_half_second_beside():
    """An arm that rests half of the time; its drives are off for five seconds of it."""
    t = 0.008 * np.arange(5000)
    moves = (t > 10) & (t < 30)
    phase = np.where(moves, 0.5 * (t - 10), 0.0)
    rate = np.where(moves, 0.5, 0.0)
    reach = np.array([0.3, 0.4, 0.5, 0.3, 0.3, 0.3])
    q = np.array([0.0, -1.0, 1.2, -0.5, 0.4, 0.0]) + reach * (1 - np.cos(np.pi * phase))[:, None]
    dq = reach * (np.pi * rate * np.sin(np.pi * phase))[:, None]
    noise = np.random.default_rng(7).normal(0, 0.02, q.shape)
    current = momentum_terms(ROBOT.loaded_chain, q, dq).gravity / ROBOT.torque_constant + noise
    log = Recording(t=t, q=q, dq=dq, current=current)
    assert Examiner().read_as(log, ROBOT, ReadChoice()).samples == log.samples
    off = (t >= 33) & (t < 38)
    idle = replace(log, current=np.where(off[:, None], noise, current))
    sound = Examiner().read_as(idle, ROBOT, ReadChoice())
    (cut,) = sound.source.cuts
    assert (cut.code, cut.start <= 33, cut.stop >= 38 - 0.008) == ("brakes", True, True)
    assert cut.stop - cut.start < 5 + 4 * 0.5
    bare = replace(log, current=None, torque_without_gravity=noise)  # which never carries it
    assert Examiner().read_as(bare, ROBOT, ReadChoice()).source.cuts == ()


def test_a_blow_is_no_bad_sample(circle):
    """As large and as short as a bad sample, but the arm's speed changes with it."""
    blow = [changed("current", 1, lambda x: x + 12, 3), changed("dq", 9999, lambda x: x - 0.2, 3)]
    assert "isolated-effort" not in examined(planted(circle, *blow))[1]


def test_no_sample_is_cut_out_of_another_unit(circle):
    """mA called A are beyond every drive in most samples: that is a unit."""
    sound, found = examined(planted(circle, changed("current", 0, lambda x: x)))
    assert (sound.samples, found) == (circle.samples, {})
    large = replace(circle, current=1e3 * circle.require("current"))
    sound, found = examined(large)
    assert sound.samples == circle.samples
    assert "milliamperes" in found


@pytest.mark.slow
def test_one_bad_sample_is_no_contact(circle):
    """One sample of 1000 A read 3302 N, good: the list is that of the log without the sample."""
    touched = contacts(circle, ROBOT)[0]
    row = int(np.searchsorted(circle.t, touched.peak))
    current = circle.require("current").copy()
    current[row, 2] = 1000.0
    made = contacts(replace(circle, current=current), ROBOT)
    known = contacts(circle.without(np.arange(circle.samples) == row), ROBOT)
    assert [c.peak_force for c in made.contacts] == [c.peak_force for c in known.contacts]
    (near,) = [c for c in made.contacts if c.start <= circle.t[row] <= c.stop]
    assert near.trust == "weak"
    assert "samples-cut-inside" in [remark.code for remark in near.remarks]


def test_rows_of_the_file_know_their_samples(circle):
    """Row 3 is cut out: what is written back to it is unknown, and the next is sample 3."""
    rows = np.arange(circle.samples) == 3
    twice = circle.without(rows).between(circle.t[2], circle.t[6])
    samples = twice.source.row_samples
    assert samples[:8].tolist() == [-1, -1, 0, -1, 1, 2, 3, -1]


@pytest.mark.slow
def test_a_log_that_waits_a_minute_is_listed_like_one_that_does_not(circle):
    """A cycle that lies in the gap has no residual, and no mode is certain behind it."""
    later = np.where(np.arange(circle.samples) > AT, 60.0, 0.0)
    made = contacts(replace(circle, t=circle.t + later), ROBOT)
    known = [c for c in contacts(circle, ROBOT) if c.stop < circle.t[AT] - 1.0]
    assert len(known) > 1
    for one, other in zip(known, made, strict=False):
        assert other.start == pytest.approx(one.start, abs=0.2)  # a block is .05 to .1 s long
