"""What motion that nobody touched tells."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from contact_logs import FIXTURES, motion
from scipy.signal import lfilter

import vftcli as vft
from vftcli.bias.whole_log import whole_log_bias
from vftcli.contacts import free_statistics as free_statistics_room
from vftcli.contacts.free_statistics import (
    beyond_threshold,
    free_part,
    free_statistics,
    observer_noise,
    torque_level,
)
from vftcli.free_motion import FreeChoice
from vftcli.free_motion.free_motion import FreeLoad, without_load
from vftcli.readers.reading import read
from vftcli.robots import load_robot
from vftcli.robots.run import Run, RunSamples
from vftcli.signals.arrays import runs_of
from vftcli.signals.errors import ParameterError, ReferenceTorqueError
from vftcli.signals.external_torque import DynamicsTerms
from vftcli.signals.recording import Recording

LOG = read(FIXTURES / "ur5_circle.csv")


def test_a_named_span_or_another_log_is_the_free_part():
    part = free_part(motion(LOG, "ur5", "0.3:4"))
    (piece,) = part.pieces
    t = LOG.t[piece.inside]
    assert (t[0], t[-1]) == (pytest.approx(0.304), pytest.approx(4.0))
    assert not part.doubted
    assert part.remarks[0].code == "free-span"
    part = free_part(motion(LOG, "ur5", run=read(FIXTURES / "ur5_table1.csv")))
    (piece,) = part.pieces
    assert piece.inside.all()
    assert not part.own.any()
    assert part.remarks[0].code == "free-log"


def test_what_repeats_nothing_has_no_free_part():
    short = read(FIXTURES / "ur5_taps_ur_rtde.csv")
    bare = motion(short, "ur5")
    assert free_statistics(bare, whole_log_bias(bare.log)) is None
    with pytest.raises(ParameterError, match="free part"):
        free_part(motion(short, "ur5", "90:95"))
    cycles = FreeChoice.parsed(settings={"two-cycle.free-cycles": "9"})
    with pytest.raises(ReferenceTorqueError):
        free_part(replace(bare, choice=cycles))


def test_cycles_of_which_none_was_recorded_are_no_free_part():
    """A pause of the recorder of one whole cycle: no sample of the quietest has a partner."""
    t = LOG.t - LOG.t[0]
    keep = (t < 4.79) | (t > 8.79)
    kept = Recording(t=LOG.t[keep], **{k: LOG.require(k)[keep] for k in ("q", "dq", "current")})
    assert free_part(motion(kept, "ur5")) is None


def test_the_level_is_that_of_the_free_samples_that_move():
    """2 N·m while J1 moves, 9 at rest, 20 in the first .1 s, in which the observer settles.

    Its gain of 30 1/s leaves 18 e^(−30 · .2) N·m of that after .3 s, .05.
    """
    t = 0.005 * np.arange(600)
    moves = (t < 2.0)[:, None] * (np.arange(6) == 0)
    torque = np.where(t[:, None] < 0.1, 20.0, np.where(moves, 2.0, 9.0))
    log = Recording(t=t, q=np.zeros((600, 6)), dq=0.5 * moves, torque=0.0 * torque)
    p = np.cumsum(0.005 * torque, axis=0)
    run = Run(recording=log, robot=load_robot("ur5"))
    run = run.holding(terms=DynamicsTerms(t=t, p=p, mu=np.zeros_like(p)))
    level = torque_level([RunSamples(run, t < 2.8)])
    np.testing.assert_allclose(level, np.array([2.0, 9.0, 9.0, 9.0, 9.0, 9.0]) / 1.96, rtol=0.02)


def test_a_threshold_takes_what_lasts(monkeypatch):
    """Beyond 8 N·m of a joint without friction; of one with 20 N·m beyond 16, 24.5 near rest."""
    torque, dq = np.zeros((400, 2)), np.ones((400, 2))
    torque[10:20, 0] = 9.0  # while the observer settles
    torque[50, 0] = 9.0  # one sample
    torque[100:110, 1] = 17.0  # .1 s
    torque[120:130, 1] = -17.0  # closer than .2 s: the same
    torque[250:260, 1] = 20.0  # .2 s before a rest
    torque[320:330, 1] = 25.0  # in it
    dq[280:, 1] = 0.0
    monkeypatch.setattr(free_statistics_room, "observed", lambda _: torque)
    monkeypatch.setattr(free_statistics_room, "dry_torques", lambda _: np.array([0.0, 20.0]))
    run = SimpleNamespace(t=0.01 * np.arange(400), dq=dq, robot=None)
    found = beyond_threshold(run, np.array([2.0, 2.0]))
    assert runs_of(found) == [(100, 130), (320, 330)]


def test_a_load_in_the_free_part_is_no_noise():
    """2.8 kg that the model lacks, in every sample: said, and off the noise and the log alike."""
    plain = motion(LOG, "ur5", "0.3:4")
    load = FreeLoad(mass=2.8, moment=np.zeros(3), sd=0.1, moment_sd=np.zeros(3), share=0.5)
    bare, carried = plain.log.terms, without_load(plain.log, load).terms
    hung = replace(bare, p=2.0 * bare.p - carried.p, mu=2.0 * bare.mu - carried.mu)
    run = plain.log.holding(terms=hung)
    bias = whole_log_bias(plain.log)
    heavy = free_statistics(replace(plain, log=run), bias)
    light = free_statistics(plain, bias)
    assert [remark.code for remark in heavy.remarks] == ["free-span", "free-part-loaded"]
    assert [remark.code for remark in light.remarks] == ["free-span"]
    known = bias.corrected(plain.log).terms.mu
    np.testing.assert_array_equal(light.log.terms.mu, known)
    # What the weighing leaves is a share of the model's own error, 0.5 N·m here.
    assert np.all(heavy.noise.variance < 4.0 * light.noise.variance + 0.3)
    left = heavy.log.terms.mu - known
    assert np.abs(left).mean() < 0.2 * np.abs(load.torque(plain.log)).mean()


def test_the_noise_is_that_of_the_observer_whatever_touches(monkeypatch):
    """White noise behind the observer's 30 1/s, and a push of .8 s a joint every 40 s.

    Twice its time apart samples still share e⁻² = .135: of 6 σ² there are 6 − 8·.135 + 2·.135².
    """
    t, sigma = 0.008 * np.arange(60_000), np.array([0.2, 0.5, 1.0])
    white = np.random.default_rng(8).standard_normal((len(t), 3))
    kept = np.exp(-30.0 * 0.008)
    noise = lfilter([np.sqrt(1.0 - kept**2)], [1.0, -kept], sigma * white, axis=0)
    push = 20.0 * np.maximum(np.sin(np.pi * (t % 40.0) / 0.8) * (t % 40.0 < 0.8), 0.0)
    monkeypatch.setattr(free_statistics_room, "observed", lambda _: noise + push[:, None])
    found = observer_noise(SimpleNamespace(t=t))
    # A push is in 2.7 % of the bends, which widens their median by 0 to 3.4 %; chance is 1 %.
    np.testing.assert_allclose(found / sigma, 0.909 * 1.017, rtol=0.03)


@pytest.mark.slow
def test_the_quietest_of_cycles_that_are_all_touched_is_not_free():
    """Pushes of 22 N to 86 N in each of three cycles; as free motion the quietest hid two."""
    log = vft.simulate("ur5-circle", seed=77)
    truth = log.truth
    size = np.linalg.norm(truth.select(f"wrench/f{k}" for k in "xyz").to_numpy(), axis=1)
    found = vft.contacts(log, robot="ur5", interval="5.7:20")
    assert found.basis == "whole log"
    assert len(found.contacts) == 8
    for row in found.contacts:
        true = size[truth["t"].is_between(row.start, row.stop)].max()
        assert abs(row.peak_force - true) < row.peak_band
