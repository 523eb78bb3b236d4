"""The smoothed wrench: its prior, simulated truth, blind poses, gaps, a real payload."""

from pathlib import Path

import numpy as np
import polars as pl
import pytest
from drawn_blocks import blocks, noise
from made_runs import run_of
from sound_logs import UR10E

from vftcli.readers.reader import ReadChoice
from vftcli.readers.reading import Library
from vftcli.robots import load_robot
from vftcli.robots.chain import flange_jacobian
from vftcli.robots.robot import Robot
from vftcli.robots.run import Run, RunSamples
from vftcli.robots.terms import Blocks
from vftcli.signals.arrays import Array
from vftcli.signals.errors import RobotError
from vftcli.signals.external_torque import DynamicsTerms
from vftcli.signals.wrench import AXES
from vftcli.wrench.smoother import (
    BLOCK,
    GRID,
    LEVER,
    MOST_BLOCKS,
    UNLISTED,
    BlockModel,
    WrenchPrior,
    block_length,
    contact_block,
    gated,
    hidden_by_blocks,
    smooth_wrench,
    unlisted,
)
from vftcli.wrench.solvers import LEAST_SIGMA, decompose

FIXTURES = Path(__file__).parents[2] / "fixtures"
STEP = 0.01


def simulated(robot: Robot, q: Array, wrench: Array, t: Array, seed: int = 1) -> Run:
    """An arm without dynamics under a wrench (T, 6), its error .3 N·m that wanders over .5 s."""
    rng = np.random.default_rng(seed)
    error, a = np.zeros((len(t), robot.joints)), np.exp(-STEP / 0.5)
    for k in range(1, len(t)):
        error[k] = a * error[k - 1] + 0.3 * np.sqrt(1 - a * a) * rng.standard_normal(robot.joints)
    torque = np.einsum("tij,ti->tj", flange_jacobian(robot.chain, q), wrench) + error
    gained = 0.5 * (torque[1:] + torque[:-1]) * np.diff(t)[:, None]
    p = np.concatenate([np.zeros((1, robot.joints)), np.cumsum(gained, axis=0)])
    return run_of(DynamicsTerms(t=t, p=p, mu=np.zeros_like(p)), q, robot)


def swing(robot: Robot, t: Array) -> Array:
    """A motion of all joints about a regular pose. (T, n) [rad]"""
    six, seven = [0.3, -1.2, 1.5, -1.0, 1.2, 0.4], [0, 0.3, 0, -1.8, 0, 2, 0.7]
    phases = np.arange(robot.joints)
    return np.array(six if robot.joints == 6 else seven) + 0.3 * np.sin(0.9 * t[:, None] + phases)


def load(t: Array) -> Array:
    """25 N down all the time. (T, 6)"""
    return np.tile([0.0, 0, -25, 0, 0, 0], (len(t), 1))


def untouched(robot: Robot, q: Array, t: Array) -> RunSamples:
    """All of another log of this motion, with another error."""
    free = simulated(robot, q, np.zeros((len(t), 6)), t, seed=2)
    return RunSamples(free, np.ones(len(t), dtype=bool))


@pytest.mark.parametrize("name", ["ur5", "panda"])
def test_a_steady_load_is_found_to_be_one_and_weighed(name):
    """25 N for 30 s of motion against .3 N·m of error; the band says what is left."""
    robot, t = load_robot(name), np.arange(0.0, 30.0, STEP)
    q = swing(robot, t)
    found = smooth_wrench(simulated(robot, q, load(t), t), [untouched(robot, q, t)])
    assert found.prior.is_steady
    assert found.seconds == pytest.approx(0.1)
    error = found.values - load(found.t)
    assert np.all(np.abs(error) <= 3.0 * found.sd)
    assert np.all(found.sd[:, :3] < 5.0)
    assert np.sqrt(np.mean(error[:, 2] ** 2)) < 2.0


def test_pushes_are_followed_in_short_blocks():
    robot, t = load_robot("ur5"), np.arange(0.0, 30.0, STEP)
    q, push = swing(robot, t), load(t) * (np.sin(2.0 * t) > 0.6)[:, None]
    found = smooth_wrench(simulated(robot, q, push, t), [untouched(robot, q, t)])
    assert not found.prior.is_steady
    assert found.seconds == pytest.approx(0.024)
    moved, sd = found.at(t)
    inside = np.abs(moved - push) <= 1.96 * sd
    # widened beyond the model's own 95 %, but 25 N come and go within one sample, 20 times
    assert np.all(inside.mean(axis=0) >= 0.9)


def test_the_gate_leaves_no_wrench_where_nothing_touches():
    """Outside of the listed contact the wrench is zero within a band, and the model error known."""
    robot, t = load_robot("ur5"), np.arange(0.0, 20.0, STEP)
    q, push = swing(robot, t), load(t) * ((t > 8.0) & (t < 11.0))[:, None]
    run, prior = simulated(robot, q, push, t), WrenchPrior(3.0, 30.0)
    free = RunSamples(run, t < 7.0)
    gate, whole = (smooth_wrench(run, [free], g, prior) for g in ([(8.0, 11.0)], None))
    assert not gate.values[~gate.inside].any()
    assert gate.sd.min() > 0.0
    np.testing.assert_allclose(gate.t[gate.inside][[0, -1]], [8.0, 11.0], atol=2 * gate.seconds)
    assert gate.unlisted(np.array([5.0, 9.0, 15.0, 25.0])).tolist() == [True, False, True, True]
    assert not whole.unlisted(t).any()
    assert whole.inside.all()
    touched = (gate.t > 8.2) & (gate.t < 10.8)
    # Stiction gives way under a listed contact: the same where nearly all of the log is one.
    wide = smooth_wrench(run, [free], [(0.0, 19.5)], prior)
    assert np.all(gate.sd[touched].mean(axis=0) < wide.sd[touched].mean(axis=0))
    assert np.mean(gate.values[touched, 2]) == pytest.approx(-25.0, abs=3.0)


@pytest.mark.parametrize("at", [4.0, 9.0])
def test_the_band_where_nothing_is_listed_is_that_of_a_contact_there(at):
    """As the smoother itself gives it where .6 s are listed there.

    It takes every block for itself, the band their mean weight: the two agree within a quarter
    (measured .90 to .99), near the reversal of a joint at 4.1 s too.
    """
    robot, t, prior = load_robot("ur5"), np.arange(0.0, 12.0, STEP), WrenchPrior(1.0, 30.0)
    run = simulated(robot, swing(robot, t), 0 * load(t), t)
    free, half = RunSamples(run, np.ones(len(t), dtype=bool)), 0.5 * UNLISTED
    never = smooth_wrench(run, [free], [], prior)
    # A block on either side is inside of the gate, too.
    edge = half - 1.5 * never.seconds
    once = smooth_wrench(run, [free], [(at - edge, at + edge)], prior)
    k = int(np.argmin(np.abs(never.t - at)))
    assert once.inside[k]
    np.testing.assert_allclose(never.sd[k], once.sd[k], rtol=0.25)


def test_the_band_grows_where_the_pose_is_blind_and_nothing_is_missing():
    """q5 goes to zero and stays: the wrists' axes align, and force along one line turns nothing."""
    robot, t = load_robot("ur5"), np.arange(0.0, 30.0, STEP)
    q = swing(robot, t)
    blind = (t > 12.0) & (t < 18.0)
    q[:, 4] *= np.clip(np.maximum(11.0 - t, t - 19.0), 0.0, 1.0)
    sigma = decompose(flange_jacobian(robot.chain, q)).sigma_min
    assert np.all(sigma[blind] < LEAST_SIGMA)
    push = load(t) * (np.sin(1.3 * t) > 0.3)[:, None]
    free = untouched(robot, q, t)
    found = smooth_wrench(simulated(robot, q, push, t), [free], prior=WrenchPrior(1, 30))
    moved, sd = found.at(t)
    assert np.isfinite(moved).all()
    assert np.isfinite(sd).all()
    clear = sigma > 2 * LEAST_SIGMA
    assert np.max(sd[blind].mean(axis=0) / sd[clear].mean(axis=0)) > 2.0
    inside = np.abs(moved - push)[blind] <= 1.96 * sd[blind]
    assert np.all(inside.mean(axis=0) >= 0.9)


def test_a_gap_of_the_clock_is_bridged_with_a_band_that_grows():
    robot, t = load_robot("ur5"), np.arange(0.0, 20.0, STEP)
    there = (t < 8.0) | (t > 12.0)
    q, prior = swing(robot, t), WrenchPrior(3.0, 30.0)
    whole = simulated(robot, q, load(t), t).terms
    # μ says nothing of the gap: what p gained in it is not the mean of two samples' torque
    p = whole.p[there] + 50.0 * (t[there] > 12)[:, None]
    cut = DynamicsTerms(t=t[there], p=p, mu=whole.mu[there])
    found = smooth_wrench(run_of(cut, q[there]), [untouched(robot, q, t)], prior=prior)
    values, sd = found.at(np.array([5.0, 10.0, 15.0]))
    assert np.isfinite(values).all()
    assert np.all(sd[1] > 1.5 * sd[[0, 2]])
    assert np.all(np.abs(values - load(t[:3])) <= 3.0 * sd)


def test_a_log_of_one_sample_leaves_the_prior():
    nothing = np.zeros((1, 6))
    run = run_of(DynamicsTerms(t=np.zeros(1), p=nothing, mu=nothing), nothing)
    found = smooth_wrench(run)
    assert not found.values.any()
    np.testing.assert_allclose(found.sd[0, :3], 1.5 * found.prior.force)
    unlisted_there = smooth_wrench(run, gate=[], prior=WrenchPrior(1.0, 30.0))
    np.testing.assert_allclose(unlisted_there.sd[0], np.repeat([45.0, 6.0], 3))


def test_fewer_than_six_joints_tell_no_wrench():
    nothing = np.zeros((9, 5))
    terms = DynamicsTerms(t=np.arange(9.0), p=nothing, mu=nothing)
    with pytest.raises(RobotError, match="5 joint torques cannot determine"):
        smooth_wrench(run_of(terms, nothing))


@pytest.mark.parametrize(
    ("step", "jitter", "seconds"),
    [(0.002, 0.0, 0.024), (0.008, 0.002, 0.04), (0.03, 0.01, 0.1), (0.2, 0, 0.1)],
)
def test_short_blocks_hold_five_samples_of_an_uneven_clock(step, jitter, seconds):
    t = step * np.arange(100.0) + jitter * np.random.default_rng(1).random(100)
    # the median of a drawn clock
    assert block_length(t, fine=True) == pytest.approx(seconds, rel=0.1)
    assert block_length(t, fine=False) == pytest.approx(0.1)


def test_a_clock_is_uneven_by_more_than_a_tenth_of_its_steps():
    even = 0.01 * np.arange(500)
    assert contact_block(np.delete(even, np.arange(20, 500, 20))) == BLOCK  # samples are lost
    # A third of the steps 2 ms off, as on the UR10e logs.
    rough = even + np.where(np.arange(500) % 3 == 0, 0.002, 0.0)
    assert contact_block(rough) == pytest.approx(0.05, rel=0.21)
    # blocks of a very long log are longer
    t = np.linspace(0.0, 7200.0, 1000)
    assert block_length(t, fine=False) == pytest.approx(7200.0 / MOST_BLOCKS)
    assert block_length(t[:1], fine=True) == pytest.approx(0.1)


def test_a_circle_under_pushes_reads_its_truth():
    """Simulated UR5 with errors of its model, noise from the free 3.7 s before the first push.

    Measured 3.9 3.2 1.5 N and .62 .44 .14 N·m rms, of joints that give before they slide (the bars
    are a fifth above); the bands hold .93 and more on every axis.
    """
    path = FIXTURES / "ur5_circle.csv"
    recording, robot = Library([path]).open(path, ReadChoice()), load_robot("ur5")
    run, t = Run(recording=recording, robot=robot), recording.t
    moved, sd = smooth_wrench(run, [RunSamples(run, (t > 0.3) & (t < 4.0))]).at(t)
    table = pl.read_parquet(f"{path}.truth.parquet")
    truth = table.select([f"wrench/{axis}" for axis in AXES]).to_numpy()
    error = moved - truth
    assert np.all(np.sqrt(np.mean(error**2, axis=0)) <= [4.6, 3.9, 1.8, 0.75, 0.55, 0.2])
    assert np.all(np.mean(np.abs(error) <= 1.96 * sd, axis=0) >= 0.93)


def test_a_real_payload_is_read_in_every_pose(logs):
    """UR10e with 2.805 kg, (0, 0, −27.52) N in every sample; noise from a free log.

    Measured 3.7 3.5 3.5 N rms, mean error −.9 −.6 1.0 N, coverage .92 1.0 .97; the pseudo-inverse
    can tell 54 % of the samples.
    """
    robot, folder = load_robot("ur10e"), logs / "ur10e"
    choice = ReadChoice.parsed(columns=UR10E)
    paths = [folder / "load_14harm.csv", folder / "free_14harm.csv"]
    log, free = (Library([path]).open(path, choice) for path in paths)
    run, other = (Run(recording=recording, robot=robot) for recording in (log, free))
    found = smooth_wrench(run, [RunSamples(other, np.ones(free.samples, dtype=bool))])
    assert found.prior.is_steady
    moved, sd = found.at(log.t)
    error = moved[:, :3] - [0.0, 0.0, -27.52]
    assert np.all(np.sqrt(np.mean(error**2, axis=0)) <= 4.0)
    assert np.all(np.abs(error.mean(axis=0)) <= 1.5)
    assert np.all(np.mean(np.abs(error) <= 1.96 * sd[:, :3], axis=0) >= 0.88)


def test_blocks_hide_a_share_of_a_bend_and_drives_one_of_the_reading():
    """A tooth of 40 N: it stands 40 N above its neighbours' mean, they 20 N below theirs."""
    values = np.zeros((5, 6))
    values[2, 0] = 40.0
    hidden = hidden_by_blocks(values)
    assert hidden[2, 0, 0] == pytest.approx((0.25 * 40.0) ** 2 + (0.03 * 40.0) ** 2)
    assert hidden[1, 0, 0] == pytest.approx((0.25 * 20.0) ** 2)
    steady = hidden_by_blocks(np.tile([0.0, 3.0, 4.0, 0.0, 0.0, 0.0], (9, 1)))
    along = np.array([0.0, 0.6, 0.8, 0.0, 0.0, 0.0])
    np.testing.assert_allclose(steady @ along @ along, (0.03 * 5.0) ** 2)


@pytest.mark.parametrize("near", [0.0, 0.3])
def test_the_band_where_nothing_is_listed_is_one_around_a_rest_too(near):
    """A joint's error is 100 × as uncertain at rest as just before and behind: no block has none.

    Where free motion is assumed a rest counts for .3 s more. The band is at most what the error at
    rest under a contact gives, .1 + (.6/.5)² 10 and the white noise. Far from the rest it is what
    motion gives, which within .3 s forgets what quiet blocks show.
    """
    t, nothing = 0.024 * (np.arange(200) + 0.5), np.zeros((200, 6))
    log = blocks(nothing, nothing + ((t < 2.0) | (t > 2.4))[:, None])
    numbers = {"white": 1e-2, "variance": 0.1, "time": 0.05, "at_rest": 9.9, "pushed": 14.4}
    each = {name: np.full(6, value) for name, value in numbers.items()}
    J, error = np.array([np.eye(6)] * 200), noise(6)._replace(**each, near=near)
    found = unlisted(BlockModel(log, J, error, t < 0.0), WrenchPrior(1.0, 1e3))
    variance = np.diagonal(found, axis1=1, axis2=2)[:, :3]
    assert np.all(variance > 0.0)
    assert np.all(variance <= 0.1 + 1.44 * 10.0 + 1e-2)
    away = (t < 1.0) | (t > 3.5)
    np.testing.assert_allclose(variance[away], 0.1 + 1e-2 * 0.024 / 0.6, rtol=0.01)


COUNT, SECONDS = 30, 0.1
T = SECONDS * (np.arange(COUNT) + 0.5)
NOTHING = np.zeros((COUNT, 6))
BLOCKS = Blocks(T, np.full(COUNT, SECONDS), NOTHING, NOTHING, NOTHING + 1.0, T > 0.0)
NOISE = noise(6)._replace(variance=np.full(6, 4.0), time=np.full(6, 0.5))
PRIOR = WrenchPrior(2.0, 30.0)


def test_a_listed_contact_opens_its_blocks_and_one_on_either_side():
    # .55 to .85 s touches blocks 5 to 8
    assert np.flatnonzero(gated(BLOCKS, [(0.55, 0.85)])).tolist() == list(range(4, 10))
    assert np.flatnonzero(gated(BLOCKS, [(0.0, 0.05), (2.95, 9.0)])).tolist() == [0, 1, 28, 29]
    assert not gated(BLOCKS, []).any()
    assert gated(BLOCKS, None).all()


def test_wrench_and_model_error_keep_their_variance_while_they_last():
    """A contact starts afresh, and a gap of 3 s lets both decay by its own length."""
    late = BLOCKS._replace(t=np.concatenate([T[:10], T[10:] + 3.0]))
    inside = gated(late, [(0.55, 2.0), (5.0, 5.2)])
    model = BlockModel(late, np.zeros((COUNT, 6, 6)), NOISE, inside).under([PRIOR])
    decay, added = model.decay[:, 0], model.added[:, 0]
    stationary = np.repeat([900.0, (LEVER * 30.0) ** 2, 4.0, 4.0], 3)
    assert not decay[~inside, :6].any()
    assert not added[~inside, :6].any()
    starts = [np.flatnonzero(inside)[0], np.flatnonzero(np.diff(inside * 1) > 0)[-1] + 1]
    assert not decay[starts, :6].any()
    assert not decay[0].any()
    there = np.hstack([np.repeat(inside[:, None], 6, axis=1), np.ones((COUNT, 6), bool)])
    kept = decay**2 * stationary + added
    np.testing.assert_allclose(kept[there], np.broadcast_to(stationary, kept.shape)[there])
    length = np.where(np.arange(COUNT) == 10, 3.1, SECONDS)[1:, None]
    np.testing.assert_allclose(decay[1:, 6:], np.repeat(np.exp(-length / 0.5), 6, axis=1))
    np.testing.assert_allclose(decay[[5, 10], 0], np.exp([-SECONDS / 2.0, -3.1 / 2.0]))


def test_what_keeps_for_half_a_minute_and_hardly_changes_in_a_second_is_a_load():
    """σ_f √(2/τ_w) is 15 N for (30 s, 60 N), pushes in a row, and 5 N for (300 s, 60 N)."""
    steady = [(prior.time, prior.force) for prior in GRID if prior.is_steady]
    assert steady == [(30, 10), (100, 10), (100, 30), (300, 10), (300, 30), (300, 60)]
