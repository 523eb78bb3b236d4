"""Where a contact may be: Jacobians along the links, and the place that a torque tells."""

import numpy as np
import pytest

from vftcli.contacts.windows import arm_parts, point_fits
from vftcli.robots import load_robot
from vftcli.robots.chain import link_jacobian, link_poses

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
