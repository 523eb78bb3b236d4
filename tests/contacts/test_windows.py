"""Where and how hard: the place that a torque tells, and the prior learned from the contacts."""

import numpy as np
import pytest
from drawn_blocks import B, blocks, noise

from vftcli.contacts.windows import (
    START,
    arm_parts,
    contact_lanes,
    learn_prior,
    likelihoods,
    point_fits,
    smooth_lanes,
)
from vftcli.robots import load_robot
from vftcli.robots.chain import link_jacobian, link_poses
from vftcli.signals.arrays import covered
from vftcli.wrench.model_error import ErrorProcess, TorqueNoise, error_process
from vftcli.wrench.smoother import BlockLog, Lane, in_blocks

Q = np.array([0.3, -1.2, 1.6, -1.9, -1.4, 0.5])


@pytest.mark.parametrize("link", [2, 3, 4])
def test_a_points_jacobian_is_how_it_moves(link):
    """Against Pinocchio's Jacobian of a frame at the same point."""
    import pinocchio as pin

    robot = load_robot("ur5")
    model = robot.chain.to_pinocchio()
    half = 0.5 * np.array(robot.chain.translation[link])
    frame = pin.Frame("point", link, pin.SE3(np.eye(3), half), pin.FrameType.OP_FRAME)
    number = model.addFrame(frame)
    data, axes = model.createData(), pin.LOCAL_WORLD_ALIGNED
    exact = pin.computeFrameJacobian(model, data, Q, number, axes)
    found = link_jacobian(link_poses(robot.chain, Q[None]), link, 0.5)[0]
    np.testing.assert_allclose(found, exact, atol=1e-12)


def test_every_link_belongs_to_a_part():
    assert [arm_parts(6)[k] for k in range(7)] == [
        "wrist", "upper arm", "upper arm", "forearm", "wrist", "wrist", "wrist",
    ]  # fmt: skip
    assert [arm_parts(7)[k] for k in (3, 4, 5, 6, 7)] == [
        "upper arm", "forearm", "forearm", "wrist", "wrist",
    ]  # fmt: skip


def test_a_force_on_the_forearm_is_distinct_from_one_on_the_flange():
    chain = load_robot("ur5").chain
    force = np.array([20.0, -40.0, 30.0])
    for link, share in ((3, 0.5), (6, 1.0)):
        torque = link_jacobian(link_poses(chain, Q[None]), link, share)[0, :3].T @ force
        fits = point_fits(chain, Q, torque, np.full(6, 0.05))
        assert fits[0].misfit < 1.0
        # The prior of 100 N draws by (sd over lever over 100)², a millionth.
        assert link in {fit.link for fit in fits}
        best = next(fit for fit in fits if (fit.link, fit.share) == (link, share))
        np.testing.assert_allclose(best.force, force, rtol=1e-2)
        assert best.size == pytest.approx(np.linalg.norm(force), rel=1e-2)
    parts = {arm_parts(6)[fit.link] for fit in fits}
    assert parts == {"wrist"}


def test_a_force_and_its_band_are_drawn_to_zero_by_the_prior_of_100_N():
    """Against least squares with three more rows, 0 = F/100, for torques of 30 N·m sd."""
    chain, sd = load_robot("ur5").chain, 30.0
    torque = np.array([10.0, -60.0, -30.0, 20.0, 5.0, 0.0])
    for fit in point_fits(chain, Q, torque, np.full(6, sd)):
        J = link_jacobian(link_poses(chain, Q[None]), fit.link, fit.share)[0, :3].T
        rows, values = np.vstack([J / sd, np.eye(3) / 100.0]), np.append(torque / sd, np.zeros(3))
        np.testing.assert_allclose(fit.force, np.linalg.lstsq(rows, values)[0], rtol=1e-9)
        # The size's variance is |rows⁺ᵀ u|², u the force's direction.
        along = np.linalg.pinv(rows).T @ (fit.force / fit.size)
        assert fit.band == pytest.approx(1.96 * np.linalg.norm(along), rel=1e-9)


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
