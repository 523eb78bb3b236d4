"""From a log to filtered, decimated signals."""

import numpy as np
import pytest

from vftcli.identification.training import (
    prepare,
    settings_record,
    stride,
    usable_samples,
)
from vftcli.robots import load_robot
from vftcli.signals.recording import Recording

PANDA = load_robot("panda")


def log(rate=500.0, seconds=8.0, joints=7):
    """Half a second of rest, sines of 0.4 Hz, half a second of rest."""
    t = np.arange(0, seconds, 1 / rate)
    w = 2 * np.pi * 0.4
    run = (t > 0.5) & (t < seconds - 0.5)
    phase = np.arange(joints)
    angle = w * (np.clip(t, 0.5, seconds - 0.5) - 0.5)[:, None] + phase
    q = 0.5 * np.sin(angle) - 0.7
    dq = np.where(run[:, None], 0.5 * w * np.cos(angle), 0.0)
    return Recording(t=t, q=q, dq=dq, torque=2.0 * q), w


def test_a_log_is_cut_to_its_motion_and_decimated_to_six_samples_a_period():
    recording, _ = log()
    motion = prepare(recording, PANDA)
    # 500 Hz over 6 · 8 Hz is 10.4: every tenth sample
    assert np.all(np.diff(motion.kept) == 10)
    assert motion.t[0] == pytest.approx(0.502)
    assert motion.t[-1] == pytest.approx(7.498, abs=0.021)
    np.testing.assert_array_equal(motion.t, recording.t[motion.kept])
    assert [stride(8.0, 1 / rate) for rate in (1000.0, 48.0, 20.0)] == [20, 1, 1]
    words = settings_record(4.0, 0.002)
    # 500 Hz over 24 Hz
    assert (words["cutoff_hz"], words["decimation"], words["kept_rate_hz"]) == (4.0, 20.0, 25.0)


def test_signals_of_the_band_pass_and_velocity_becomes_acceleration():
    recording, w = log()
    motion = prepare(recording, PANDA)
    inner = (motion.t > 1.5) & (motion.t < 6.5)
    angle = w * (motion.t[inner] - 0.5)[:, None] + np.arange(7)
    # two passes of a Butterworth filter of order 4 take (0.4 / 8)⁸ of the amplitude
    np.testing.assert_allclose(motion.q[inner], 0.5 * np.sin(angle) - 0.7, atol=1e-5)
    np.testing.assert_allclose(motion.tau[inner], 2 * motion.q[inner], atol=1e-9)
    # central differences over 4 ms: (w h)²/6 of it, 2e-5
    expected = -0.5 * w**2 * np.sin(angle)
    np.testing.assert_allclose(motion.ddq[inner], expected, atol=2e-4)
    filtered = motion.filtered(recording.dq)
    np.testing.assert_allclose(filtered, motion.dq, atol=1e-12)


def test_long_stops_and_gaps_tell_nothing():
    t = np.arange(0, 10, 0.01)
    t[500:] += 0.5  # a gap of half a second, 50 steps
    dq = np.full((len(t), 2), 0.5)
    dq[100:129, 0] = 0.0  # 0.28 s: short
    dq[200:232, 0] = 0.0  # 0.31 s: long
    usable = usable_samples(t, dq, 8.0)
    lost = np.flatnonzero(~usable[:, 0])
    # 1/16 s to either side of the gap: 4.9275 to 4.99 and 5.50 to 5.5625
    gap = list(range(493, 507))
    assert lost.tolist() == [*range(200, 232), *gap]
    assert np.flatnonzero(~usable[:, 1]).tolist() == gap


def test_chunks_cover_every_sample_once_and_of_a_log_at_rest_none():
    recording, _ = log(seconds=60.0)
    motion = prepare(recording, PANDA)
    rows = np.concatenate([np.arange(motion.samples)[span] for span in motion.chunks()])
    assert motion.samples > 2 * 1024
    np.testing.assert_array_equal(rows, np.arange(motion.samples))
    still = prepare(Recording(t=recording.t, q=0 * recording.q, dq=0 * recording.q,
                              torque=0 * recording.q), PANDA)  # fmt: skip
    assert (still.samples, list(still.chunks())) == (0, [])
