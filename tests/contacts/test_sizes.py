"""How hard: splitting, and the prior that is learned from the contacts."""

import numpy as np
import pytest
from drawn_blocks import B, blocks, noise

from vftcli.contacts.search import split_at_turns, split_run
from vftcli.contacts.windows import (
    START,
    WindowWrench,
    contact_lanes,
    learn_prior,
    likelihoods,
    smooth_lanes,
)
from vftcli.signals.arrays import covered
from vftcli.wrench.model_error import ErrorProcess, TorqueNoise, error_process
from vftcli.wrench.smoother import BlockLog, Lane, in_blocks


@pytest.mark.parametrize(
    ("pause", "force", "sd", "felt", "pieces"),
    [
        (6, 0.5, 2.0, 0.0, [(0, 10), (16, 26)]),
        (2, 0.5, 2.0, 0.0, [(0, 22)]),  # a hand that slips for a moment has not let go
        (6, 0.5, 2.0, 20.0, [(0, 26)]),  # the force turns while the joints feel it
        (6, 10.0, 20.0, 0.0, [(0, 26)]),  # noise hides the force
    ],
)
def test_two_pushes_are_split_where_force_and_torque_pause(pause, force, sd, felt, pieces):
    """Ten blocks of 30 N and ten of 40 N along x; joint 1 feels the force, joint 4 so much more."""
    size = [30.0] * 10 + [force] * pause + [40.0] * 10
    count = len(size)
    values = np.tile([0.0, 0.0, 0.0, felt, 0.0, 0.0], (count, 1))
    values[:, 0] = size
    wrench = WindowWrench(0, values, np.tile(np.eye(6) * sd**2 / 3.0, (count, 1, 1)))
    found = split_run(B * np.arange(count), wrench, (0, count), np.tile(np.eye(6), (count, 1, 1)))
    assert found == pieces


def known_noise(variance: float) -> TorqueNoise:
    values = {"white": 0.01, "variance": variance, "time": 0.5, "dry": 1.0}
    values |= {"at_rest": 0.09, "pushed": 0.36}
    return noise(6)._replace(**{name: np.full(6, value) for name, value in values.items()})


def test_a_drawn_wrench_is_measured_and_its_prior_learned():
    """Twelve pushes drawn with σ_f = 30 N, a random well-posed Jacobian, little noise."""
    rng = np.random.default_rng(7)
    count, runs = 900, [(start, start + 20) for start in range(50, 850, 66)]
    jacobian = np.tile(rng.standard_normal((6, 6)), (count, 1, 1))
    true = np.zeros((count, 6))
    for start, stop in runs:
        w = np.repeat([30.0, 3.0], 3) * rng.standard_normal(6)
        for k in range(start, stop):
            g = np.exp(-B / 0.3)
            w = g * w + np.repeat([30.0, 3.0], 3) * np.sqrt(1 - g * g) * rng.standard_normal(6)
            true[k] = w
    d = np.einsum("ki,kij->kj", true, jacobian) + 0.1 * rng.standard_normal((count, 6))
    moving = blocks(d, np.full((count, 6), 0.5))
    log = BlockLog(moving, error_process(known_noise(variance=1e-4), moving))
    prior = learn_prior(log, in_blocks(jacobian), runs, START, rounds=2)
    assert prior.time == 0.3
    # A dozen pushes of 1.6 correlation times and three axes: some 60 numbers, 10 %; two of these.
    assert abs(prior.force / 30.0 - 1.0) < 0.25
    assert abs(prior.moment / 3.0 - 1.0) < 0.25
    lanes = contact_lanes(log, runs, in_blocks(jacobian))
    for run, course in zip(runs, smooth_lanes(lanes, [prior] * len(runs)), strict=True):
        inside = course.within(run)
        sd = np.sqrt(np.diagonal(inside.covariance, axis1=1, axis2=2))
        assert np.mean(np.abs(inside.values - true[slice(*run)]) < 1.96 * sd) > 0.85


def test_two_blocks_say_what_all_quiet_ones_beside_a_contact_do():
    """Evidence and wrench are those of the window with every block of it."""
    rng = np.random.default_rng(4)
    count, runs = 160, [(0, 12), (50, 70), (84, 92), (140, 160)]
    d = 0.3 * rng.standard_normal((count, 6)).cumsum(axis=0)
    d[50:70] += 20.0
    rests = np.where(rng.random((count, 6)) < 0.3, 0.0, 0.5)
    resting = blocks(d, rests, rng.random(count) > 0.05)
    log = BlockLog(resting, error_process(known_noise(variance=0.04), resting))
    jacobian = in_blocks(rng.standard_normal((count, 6, 6)))
    for run, lane in zip(runs, contact_lanes(log, runs, jacobian), strict=True):
        first, last = resting.t.searchsorted(resting.t[[run[0], run[1] - 1]] + [-1.0, 1.0 + 1e-9])
        gate = covered([run], count, 1)
        hidden = covered(runs, count, 1) & ~gate
        some = slice(first, last)
        own = ErrorProcess(*(x[some] for x in log.process.hiding(hidden)))
        whole = Lane(BlockLog(resting.part(some), own), (first, last), gate[some], jacobian, None)
        each = [lane, whole]
        touched = [one._replace(prior=START) for one in each]
        bare, nats = ([likelihoods([one])[0] for one in lanes] for lanes in (each, touched))
        assert nats[0] - bare[0] == pytest.approx(nats[1] - bare[1], rel=1e-8, abs=1e-6)
        short, long = (one.within(run) for one in smooth_lanes(each, [START] * 2))
        np.testing.assert_allclose(short.values, long.values, rtol=1e-7, atol=1e-7)
        np.testing.assert_allclose(short.covariance, long.covariance, rtol=1e-6, atol=1e-7)


def test_pushes_from_different_sides_are_two_contacts():
    t = B * np.arange(200)
    force = np.zeros((200, 3))
    force[:100, 0] = 40.0 * np.sin(np.pi * np.arange(100) / 100)
    force[100:, 1] = 40.0 * np.sin(np.pi * np.arange(100) / 100)
    load = 0.5 * np.linalg.norm(force, axis=1)
    (first, second) = split_at_turns(t, force, load, (0, 200))
    assert first[1] == second[0] == pytest.approx(100, abs=1)
    # From one side, or where the joints are loaded all the while, it is one.
    same = np.roll(force[:, ::-1], 0, axis=1).copy()
    same[:, 0] = np.linalg.norm(force, axis=1)
    same[:, 1:] = 0.0
    assert split_at_turns(t, same, load, (0, 200)) == [(0, 200)]
    assert split_at_turns(t, force, np.full(200, 20.0), (0, 200)) == [(0, 200)]
    # A hand that has just begun is none of its own.
    brief = force[94:]
    assert split_at_turns(t[94:], brief, load[94:], (0, 106)) == [(0, 106)]
