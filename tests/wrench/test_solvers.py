"""Solvers: against NumPy's pseudo-inverse, near singularities, and what the null space sees."""

import numpy as np
import pinocchio as pin
import pytest

from vftcli.observers import KalmanObserver
from vftcli.robots import load_robot
from vftcli.robots.chain import flange_jacobian, link_poses
from vftcli.signals.errors import ParameterError, RobotError
from vftcli.signals.external_torque import DynamicsTerms, ExternalTorque
from vftcli.signals.pose import IDENTITY, Pose, rpy_matrix
from vftcli.wrench.solvers import (
    FRAMES,
    LEAST_SIGMA,
    PRIOR,
    SCALE,
    SOLVERS,
    Mounting,
    VirtualSensor,
    decompose,
    from_base,
    null_space,
    read_pose,
    wrench_of,
)

REGULAR = np.array([0.3, -1.2, 1.4, -1.7, -1.5, 0.2])
"""A UR5 pose far from every singularity. [rad]"""


def torque_of(robot: str, q: np.ndarray, wrench: np.ndarray) -> np.ndarray:
    """τ = Jᵀw by Pinocchio, for a wrench in base axes about the flange."""
    model, axes = load_robot(robot).model, pin.LOCAL_WORLD_ALIGNED
    data, frame = model.createData(), model.getFrameId("flange")
    J = [pin.computeFrameJacobian(model, data, row, frame, axes).copy() for row in q]
    return np.einsum("tij,ti->tj", np.array(J), np.broadcast_to(wrench, (len(q), 6)))


def reported(robot: str, q: np.ndarray, tau: np.ndarray, **how):
    torque = ExternalTorque(name="x", t=np.arange(len(q)) * 0.01, tau=tau)
    known = {"x": how.pop("sd")} if "sd" in how else {}
    sensor, chain = VirtualSensor(frame="base", **how), load_robot(robot).chain
    return sensor.wrenches((torque,), q, chain, known)[0]


def poses(robot: str, samples: int = 60, seed: int = 2) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-2.0, 2.0, (samples, load_robot(robot).joints))


@pytest.mark.parametrize("robot", ["ur5", "ur10e", "panda", "fr3"])
def test_a_wrench_at_the_flange_comes_back(robot):
    q, wrench = poses(robot), np.array([10.0, -20.0, 5.0, 1.0, -0.5, 2.0])
    found = reported(robot, q, torque_of(robot, q, wrench))
    regular = ~found.hidden
    assert regular.sum() > 20
    # normal equations square the condition number, at most (2 m / 0.05 m)² ~ 2e3: 1e-12 of 20 N
    expected = np.tile(wrench, (regular.sum(), 1))
    np.testing.assert_allclose(found.values[regular], expected, atol=1e-9)


def test_sigma_min_is_that_of_the_jacobian_with_angular_rows_times_0_3():
    q = poses("ur5")
    J = flange_jacobian(load_robot("ur5").chain, q)
    expected = np.linalg.svd(SCALE[:, None] * J, compute_uv=False)[:, -1]
    # σ² is what the decomposition knows to 1e-15 of the largest, σ hence to 3e-8 near zero
    np.testing.assert_allclose(decompose(J).sigma_min, expected, atol=1e-7)
    # .042 and .059 m: below .05 a pose hides the wrench
    edge = np.tile(REGULAR, (2, 1))
    edge[:, 4] = [0.25, 0.35]
    assert reported("ur5", edge, np.ones_like(edge)).hidden.tolist() == [True, False]


@pytest.mark.parametrize("solver", SOLVERS)
def test_the_answer_and_its_covariance_are_those_of_the_textbook(solver):
    """One sample, dense: cov = A Σ Aᵀ, and the posterior covariance for the MAP solver."""
    q, tau = REGULAR[None], np.array([[1.0, -2.0, 3.0, 0.5, -0.5, 0.2]])
    sd = np.array([0.3, 0.5, 0.4, 0.1, 0.2, 0.15])
    found = reported("ur5", q, tau, solver=solver, sd=sd)
    J = flange_jacobian(load_robot("ur5").chain, q)[0]
    prior = np.diag((PRIOR * SCALE) ** -2.0)
    information = J @ np.diag(sd**-2) @ J.T + prior
    weighed = np.linalg.inv(information) @ J @ np.diag(sd**-2)
    gain = {"pinv": np.linalg.pinv(J.T), "map": weighed}[solver]
    covariance = gain @ np.diag(sd**2) @ gain.T
    if solver == "map":
        covariance = np.linalg.inv(information)
    np.testing.assert_allclose(found.values[0], gain @ tau[0], rtol=1e-9)
    np.testing.assert_allclose(found.sd[0], np.sqrt(np.diag(covariance)), rtol=1e-9)


NEAR_WRIST = np.array([0.3, -1.2, 1.4, -1.7, 0.02, 0.2])
STRAIGHT_ELBOW = np.array([0.3, -1.2, 1e-3, -1.7, -1.5, 0.2])


@pytest.mark.parametrize(
    "pose", [NEAR_WRIST, STRAIGHT_ELBOW], ids=["q5 = 0.02", "straight elbow"]
)
def test_near_a_singularity_pinv_blows_up_and_map_does_not(pose):
    """0.3 N·m of joint noise: masked, tens of newtons of pinv, the prior's width at most of map."""
    rng = np.random.default_rng(11)
    q = np.tile(pose, (200, 1))
    tau = 0.3 * rng.standard_normal(q.shape)
    sd = np.full(6, 0.3)
    blown, held = reported("ur5", q, tau, sd=sd), reported("ur5", q, tau, solver="map", sd=sd)
    assert blown.hidden.all()
    assert np.isnan(blown.known).all()
    assert blown.sigma_min.max() < LEAST_SIGMA
    assert np.max(np.abs(held.values[:, :3])) < 4.0 * PRIOR[0]
    assert np.all(held.sd[:, :3] <= PRIOR[0] * (1 + 1e-9))
    rms = [np.sqrt(np.mean(one.values[:, :3] ** 2)) for one in (blown, held)]
    assert rms[0] > 3 * rms[1]


@pytest.mark.parametrize("robot", ["panda", "fr3"])
def test_a_tip_wrench_leaves_the_null_space_and_a_link_wrench_does_not(robot):
    q = poses(robot, samples=30)
    chain = load_robot(robot).chain
    parts = decompose(flange_jacobian(chain, q))
    base = np.random.default_rng(4).normal(size=q.shape)
    before = null_space(parts, base[:, :, None])[:, :, 0]
    regular = parts.sigma_min > LEAST_SIGMA
    tip = base + torque_of(robot, q, np.array([30.0, -20.0, 25.0, 3.0, -2.0, 4.0]))
    after = null_space(parts, tip[:, :, None])[:, :, 0]
    np.testing.assert_allclose(after[regular], before[regular], atol=1e-9)

    where = link_poses(chain, q)
    axes = where.rotation[:, :4, :, 2]
    arms = where.translation[:, 4:5] - where.translation[:, :4]
    lever = np.cross(axes, arms)
    elsewhere = base.copy()
    elsewhere[:, :4] += lever @ np.array([30.0, -20.0, 25.0])
    moved = np.linalg.norm(null_space(parts, elsewhere[:, :, None])[:, :, 0] - before, axis=1)
    # a 44 N push on link 4; in some poses its torque happens to be that of some tip wrench
    assert np.median(moved) > 0.1
    assert np.max(moved) > 1.0


def test_directions_that_are_left_out_read_nothing_and_the_others_stay():
    """Against the SVD with its small singular values cut, the textbook's way to the same."""
    rng = np.random.default_rng(5)
    J, tau = rng.standard_normal((60, 6, 6)), rng.standard_normal((60, 6))
    found, _ = wrench_of(tau, J, left_out=0.3)
    U, s, Vt = np.linalg.svd(SCALE[:, None] * J)
    cut = np.where(s > 0.3, 1.0 / s, 0.0)
    expected = SCALE * np.einsum("kij,kj->ki", U, cut * np.einsum("kij,kj->ki", Vt, tau))
    assert np.any(cut == 0.0)
    np.testing.assert_allclose(found, expected, atol=1e-10)


def test_chunks_do_not_show(monkeypatch):
    q = poses("panda", samples=50)
    tau = np.random.default_rng(1).normal(size=q.shape)
    whole = reported("panda", q, tau)
    monkeypatch.setattr("vftcli.wrench.solvers.CHUNK", 7)
    pieces = reported("panda", q, tau)
    np.testing.assert_array_equal(pieces.values, whole.values)


@pytest.mark.parametrize("frame", ["base", "flange", "tool"])
def test_a_force_acts_at_the_point_of_its_frame_along_its_axes(frame):
    """A tool of 3-4-0 cm that is turned by a quarter about the flange's z axis."""
    tool = Pose(rpy_matrix((0.0, 0.0, 0.5 * np.pi)), np.array([0.03, 0.04, 0.0]))
    chain, q = load_robot("ur5").chain, np.random.default_rng(4).uniform(-2.0, 2.0, (3, 6))
    force, poses = np.tile([1.0, 2.0, 3.0], (3, 1)), link_poses(chain, q)
    found = VirtualSensor(frame=frame, mounting=Mounting(tool=tool)).arrow(force, q, chain)
    fixed = tool if frame == "tool" else IDENTITY
    for k, (R, p) in enumerate(zip(poses.rotation[:, -1], poses.translation[:, -1], strict=True)):
        there = Pose(R, p) @ fixed
        np.testing.assert_allclose(found[0][k], there.translation, atol=1e-14)
        along = force[k] if frame == "base" else there.rotation @ force[k]
        np.testing.assert_allclose(found[1][k], along, atol=1e-14)


def test_a_five_joint_arm_is_refused():
    with pytest.raises(RobotError, match="5 joint torques cannot determine"):
        decompose(np.zeros((3, 6, 5)))


@pytest.mark.parametrize("robot", ["ur5", "panda"])
@pytest.mark.parametrize("frame", FRAMES)
def test_an_answer_and_its_band_are_numpys_in_the_frame_that_is_asked_for(frame, robot):
    """By `from_base`, which a log's wrench is held against Pinocchio with (test_log_wrench.py)."""
    tool = Pose(rpy_matrix((0.2, 0.5, -0.4)), np.array([0.05, -0.1, 0.15]))
    sensor = Pose(rpy_matrix((0.7, -0.3, 1.9)), np.array([0.0, 0.02, 0.03]))
    mounting, chain = Mounting(tool=tool, sensor=sensor), load_robot(robot).chain
    q = np.random.default_rng(3).uniform(-1.5, 1.5, (40, chain.joints))
    tau = np.random.default_rng(5).normal(size=q.shape)
    torque = ExternalTorque(name="x", t=np.arange(len(q)) * 0.01, tau=tau)
    asked = VirtualSensor(frame=frame, mounting=mounting)
    (found,) = asked.wrenches((torque,), q, chain, {"x": np.ones(chain.joints)})
    X = from_base(frame, link_poses(chain, q).rotation[:, -1], mounting)
    A = X @ np.linalg.pinv(flange_jacobian(chain, q).swapaxes(1, 2))
    known = ~found.hidden
    expected = np.einsum("tij,tj->ti", A, tau)
    np.testing.assert_allclose(found.values[known], expected[known], rtol=1e-9, atol=1e-9)
    sd = np.sqrt(np.sum(A**2, axis=2))
    np.testing.assert_allclose(found.sd[known], sd[known], rtol=1e-9)


def test_a_frame_without_its_pose_says_how_to_give_it():
    with pytest.raises(ParameterError, match=r"no tool, so there is no .*virtual-sensor.tool"):
        VirtualSensor(frame="tool")
    with pytest.raises(ParameterError, match=r"virtual-sensor\.sensor"):
        VirtualSensor(frame="sensor")


def test_poses_are_read_as_three_or_six_numbers_or_a_name(tmp_path):
    robot = load_robot("ur5")
    short = read_pose("0.1,0,0.2", robot, "tool", "virtual-sensor.tool")
    long = read_pose("0.1,0,0.2,0.1,0.2,0.3", robot, "tool", "virtual-sensor.tool")
    np.testing.assert_array_equal(short.translation, [0.1, 0.0, 0.2])
    np.testing.assert_allclose(long.rotation, rpy_matrix((0.1, 0.2, 0.3)))
    for text, words in (
        ("1,2,3,4,5", "5 numbers"),
        ("0,nan,0", "finite"),
        ("gripper", r"no \[tool.gripper\]"),
    ):
        with pytest.raises(ParameterError, match=words):
            read_pose(text, robot, "tool", "virtual-sensor.tool")
    path = tmp_path / "mine.toml"
    own = "\n[tool.gripper]\nxyz = [0, 0, 0.15]\n"
    path.write_text(robot.path.read_text(encoding="utf-8") + own)
    named = read_pose("gripper", load_robot(path), "tool", "virtual-sensor.tool")
    np.testing.assert_array_equal(named.translation, [0.0, 0.0, 0.15])


STEP = 0.008
POSE = np.array([0.3, -1.2, 1.4, -1.7, -1.5, 0.2])
R = np.array([0.5, 0.5, 0.5, 1.3, 1.3, 1.3])
Q_P = np.array([0.01, 0.01, 0.01, 0.02, 0.02, 0.02])
Q_TAU = np.full(6, 5000.0)  # The paper's gains of the UR5, Sec. IV-A.


def drawn(observer: KalmanObserver, samples: int, rng: np.random.Generator):
    """One run of the filter's own model: a random-walk torque, and its noisy momentum.

    x_{k+1} = A x_k + w with cov(w) = Q, y_k = p_k + v with var(v) = R of the discrete model; μ = 0.
    """
    model = observer.model(STEP, 6)
    x = np.zeros((2, 6))
    p, tau = np.empty((samples, 6)), np.empty((samples, 6))
    l11 = np.sqrt(model.q11)
    l21 = model.q12 / l11
    l22 = np.sqrt(model.q22 - l21**2)
    for k in range(samples):
        a, b = rng.standard_normal((2, 6))
        x = np.array([x[0] + model.a12 * x[1] + l11 * a, model.a22 * x[1] + l21 * a + l22 * b])
        p[k] = x[0] + np.sqrt(model.r) * rng.standard_normal(6)
        tau[k] = x[1]
    t = np.arange(samples) * STEP
    return DynamicsTerms(t=t, p=p, mu=np.zeros_like(p)), tau


SCHEMES = ["fe", pytest.param("zoh", marks=pytest.mark.statistical)]


@pytest.mark.slow
@pytest.mark.parametrize("scheme", SCHEMES)
def test_over_200_simulations_the_band_holds_the_truth_in_93_to_97_percent(scheme):
    """200 runs of 100 samples, correlated over about 25: 800 independent ones, ± 0.8 % each way."""
    first, last, runs = 150, 250, 200
    observer = KalmanObserver(discretisation=scheme, r_diag=R, q_p_diag=Q_P, q_tau_diag=Q_TAU)
    chain, sensor = load_robot("ur5").chain, VirtualSensor(frame="flange")
    held = np.zeros(6)
    for seed in range(runs):
        terms, tau = drawn(observer, last, np.random.default_rng(seed))
        q = np.tile(POSE, (last, 1))
        estimate = observer.estimate(terms)
        truth = ExternalTorque(name="truth", t=terms.t, tau=tau)
        own = {estimate.name: estimate.sd}
        reported, true = sensor.wrenches((estimate, truth), q, chain, own)
        inside = np.abs(reported.values - true.values) <= 1.96 * reported.sd
        held += inside[first:].mean(axis=0)
    share = held / runs
    assert np.all((share > 0.93) & (share < 0.97)), share
