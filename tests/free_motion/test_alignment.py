"""Two logs of one motion: shift, clock rate, shared part, and refusals."""

from dataclasses import replace

import numpy as np
import pytest
from sound_logs import UR10E

from vftcli.free_motion.alignment import align
from vftcli.readers.reading import read
from vftcli.signals.errors import ReferenceTorqueError
from vftcli.signals.recording import Recording


def wandering(samples: int = 2000, seed: int = 3) -> Recording:
    """A smooth motion that never returns."""
    rng = np.random.default_rng(seed)
    t = 0.01 * np.arange(samples)
    q = sum(
        rng.uniform(0.1, 0.4, 6) * np.sin(2 * np.pi * f * t[:, None] + rng.uniform(0, 6, 6))
        for f in (0.05, 0.083, 0.14, 0.23)
    )
    return Recording(t=t, q=np.asarray(q), dq=np.gradient(q, t, axis=0))


def cut(log: Recording, first: int, last: int) -> Recording:
    """A part of a log, on its own clock."""
    part = slice(first, last)
    return replace(log, t=log.t[part] - log.t[first], q=log.q[part], dq=log.dq[part])


def test_shift_below_the_sample_time_and_rates_that_differ_a_little():
    log = wandering()
    found = align(cut(log, 300, 1800), replace(log, t=log.t + 0.1234))
    assert found.shift == pytest.approx(3.1234, abs=1e-6)  # linear interpolation of smooth paths
    assert found.overlap.all()
    found = align(log, replace(log, t=1.004 * log.t))
    assert found.rate == pytest.approx(1.004, rel=1e-6)
    assert found.deviation < 1e-4  # interpolation between samples 10 ms apart


@pytest.mark.parametrize("rate", [0.75, 1.05, 1.5, 1000.0])
def test_rates_that_differ_much_are_refused(rate):
    log = wandering()
    log = replace(log, t=log.t[::10], q=log.q[::10], dq=log.dq[::10])
    with pytest.raises(ReferenceTorqueError, match=r"clocks .* run at different rates"):
        align(log, replace(log, t=rate * log.t))


@pytest.mark.parametrize(
    ("rate", "said"), [(1.02, "2 % slower"), (1.3, "30 % slower"), (0.9, "10 % faster")]
)
def test_the_same_motion_at_another_speed_is_no_wrong_clock(rate, said):
    """A speed slider: stamps and velocities agree with each other."""
    log = wandering()
    with pytest.raises(ReferenceTorqueError, match=rf"ran {said}.*speed slider"):
        align(log, replace(log, t=rate * log.t, dq=log.dq / rate))


def test_the_log_with_the_wrong_clock_is_named():
    log = wandering()
    log = replace(log, source=replace(log.source, label="a"))
    slow = replace(log, t=1.05 * log.t, source=replace(log.source, label="b"))
    for own, free in ((log, slow), (slow, log)):
        with pytest.raises(
            ReferenceTorqueError, match=r"velocities in b say.* at (100|99\.99|100\.\d) Hz"
        ):
            align(own, free)


def test_without_velocities_both_causes_are_named():
    log = replace(wandering(), dq=None)
    with pytest.raises(ReferenceTorqueError, match=r"5 % slower, or a clock is wrong.*t@125Hz"):
        align(log, replace(log, t=1.05 * log.t))
    # As well where one log begins 300 of 2000 samples later.
    with pytest.raises(ReferenceTorqueError, match="30 % slower, or a clock is wrong"):
        align(replace(log, t=log.t[:1700], q=log.q[300:]), replace(log, t=1.3 * log.t))


def test_another_small_motion_is_neither_slower_nor_on_another_clock():
    """Both stay within the .05 rad of one trajectory, at any rate that is tried."""
    log, other = wandering(seed=3), wandering(seed=5)
    small, still = (replace(x, q=0.08 * x.q, dq=0.08 * x.dq) for x in (log, other))
    with pytest.raises(ReferenceTorqueError, match="not a free run of the trajectory"):
        align(small, still)


def sixth_joint_off(rate: float, begin: float, off: float) -> tuple[Recording, Recording]:
    """Two logs at 10 Hz of one motion, but for a joint 6 that rests `off` away. [rad]"""
    log = wandering()
    t, moves = log.t[::10] + 2.0, log.q[::10] * [1, 1, 1, 1, 1, 0]
    return Recording(t=t, q=moves), Recording(t=rate * t + begin, q=moves + off * np.eye(6)[5])


def test_other_trajectories_are_refused_with_what_is_left_at_equal_clocks():
    """At 1.02 times the rate and 5 s later the middles, at 11.95 s, lie 5.239 s apart."""
    log, free = sixth_joint_off(1.02, 5.0, 0.5)
    there = np.column_stack([np.interp(log.t + 5.239, free.t, x) for x in free.q.T])
    left = np.sqrt(np.mean((there - log.q) ** 2))
    said = rf"shift \(5\.239 s\) the joint positions still differ by {left:.3g} rad rms"
    with pytest.raises(ReferenceTorqueError, match=said):
        align(log, free)


@pytest.mark.parametrize(
    ("off", "said"), [(0.055, "ran 50 % faster, or"), (0.07, "not a free run")]
)
def test_at_half_the_rate_paths_agree_within_25_mrad(off, said):
    """One joint of six off by 55 or 70 mrad: 22 or 29 mrad rms."""
    with pytest.raises(ReferenceTorqueError, match=said):
        align(*sixth_joint_off(0.5, 3.0, off))


def test_other_arms_are_refused():
    log = wandering()
    seven = Recording(t=log.t, q=np.column_stack([log.q, log.q[:, 0]]))
    with pytest.raises(ReferenceTorqueError, match="7 joints"):
        align(log, seven)
    for own, other in (("ur5", "ur3"), ("ur3", "ur5")):
        with pytest.raises(ReferenceTorqueError, match=f"a log of {other}"):
            align(replace(log, robot_hint=own), replace(log, robot_hint=other))
    align(replace(log, robot_hint="ur5"), log)  # which says nothing of its arm


def test_a_motion_that_hardly_overlaps_at_its_best_shift_is_refused(part_of, circle):
    log = part_of(circle.recording, 4.0, 8.0)
    with pytest.raises(ReferenceTorqueError, match="not a free run of the trajectory"):
        align(log, replace(log, q=log.q[:, ::-1] + 0.5))


def test_a_shared_part():
    """The first 12 of 20 s are the same motion, then the logs part."""
    log, other = wandering(), wandering(seed=4)
    step = np.concatenate([np.zeros(1200), np.linspace(0.0, 1.0, 100), np.ones(700)])[:, None]
    free = replace(log, q=(1.0 - step) * log.q + step * (other.q + 0.7))
    found = align(log, free)
    assert found.shift == pytest.approx(0.0, abs=1e-3)
    shared = np.flatnonzero(found.overlap)
    last = np.flatnonzero(abs(free.q - log.q).max(axis=1) > 0.05)[0] - 1
    # One sample, as the shift is known to 1 ms.
    np.testing.assert_allclose(shared[[0, -1]], [0, last], atol=1)
    rms = np.sqrt(np.mean((free.q - log.q)[: last + 1] ** 2))
    assert found.deviation == pytest.approx(rms, rel=0.05)


def test_the_ur10e_pair_with_a_payload(logs):
    """Documented: after a shift of 1.18 s the positions agree to 0.10 mrad rms."""
    folder = logs / "ur10e"
    loaded, free = (read(folder / f"{k}_14harm.csv", columns=UR10E) for k in ("load", "free"))
    found = align(loaded, free)
    assert found.shift == pytest.approx(-1.18, abs=0.005)
    assert found.deviation == pytest.approx(0.10e-3, rel=0.1)


def test_the_ur3_bags_share_a_part(logs):
    """Documented: they follow the same free motion for 9.8 s within 7 mrad."""
    first, second = (read(logs / "ur3" / f"repeat_{name}.bag") for name in "ab")
    found = align(first, second)
    assert np.count_nonzero(found.overlap) * first.median_step > 9.8
    assert found.deviation < 7e-3


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(("first", "last"), [(0, 1850), (450, 1850), (0, 1400)])
def test_of_equal_fits_the_longest_overlap_counts(repeated, seed, first, last):
    """Five periods of 3.7 s: noise alone decided which whole period was taken, a part was lost."""
    free = repeated(cycles=5.0, seed=seed)
    loaded = cut(repeated(cycles=5.0, seed=seed + 10, push=0.03), first, last)
    found = align(loaded, free)
    assert np.count_nonzero(found.overlap) >= loaded.samples - 40  # noise moves the ends
    # Any whole period that leaves nothing out is right; the push pulls by its own share.
    off = (found.shift - free.t[first] + 0.5 * 3.7) % 3.7 - 0.5 * 3.7
    assert off == pytest.approx(0.0, abs=5e-3)


def test_a_path_that_nearly_repeats_is_laid_where_it_is_the_same():
    """A spiral, 3 % wider with each turn of 4 s: turns 1 to 3 on turns 2 to 4.

    One turn off, all three would overlap, but 3 % apart: thirty times what a servo repeats within.
    """
    t = 0.01 * np.arange(1600)
    phase = 0.5 * np.pi * t[:, None] + np.array([0.0, 1.0, 2.0])
    log = Recording(t=t, q=0.3 * (1.0 + 0.03 * t[:, None] / 4.0) * np.sin(phase))
    first = replace(log, t=t[:1200], q=log.q[:1200])
    later = replace(log, t=t[400:] - t[400], q=log.q[400:])
    found = align(first, later)
    assert found.shift == pytest.approx(-4.0, abs=1e-6)  # both logs hold the same samples
    assert found.deviation < 1e-6
