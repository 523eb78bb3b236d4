"""Whole experiments: repeatable, true to themselves, and as hard as the real thing."""

import numpy as np
import pinocchio as pin
import pytest

from vftcli.observers.paper import MomentumObserver
from vftcli.robots import load_robot
from vftcli.robots.chain import flange_jacobian
from vftcli.robots.friction import COLDEST, WARMEST, friction_factor
from vftcli.robots.terms import dynamics_terms
from vftcli.signals.arrays import root_mean_squares as rms
from vftcli.signals.errors import ParameterError
from vftcli.signals.progress import heard_by
from vftcli.simulation import Arm, Simulation, load_scenario, observe, prepare, simulate
from vftcli.simulation.arm import build_arm
from vftcli.simulation.experiment import simulate_pair
from vftcli.wrench.solvers import wrench_of

EXACT = [
    *(f"mismatch.{k}=0" for k in ("mass", "com", "rotor_inertia", "friction", "torque_constant")),
    *("friction.stribeck=0", "friction.presliding=0"),  # of both the profile knows nothing
]
ELSEWHERE = """
name = "many"
robot = "panda"
duration = 2.0
[trajectory]
kind = "hold"
[[contacts]]
name = "tip"
kind = "profile"
spans = [[0.2, 1.4]]
force = [5.0, -3.0, 8.0]
torque = [0.5, 0.2, -0.4]
point = [0.0, 0.03, 0.1]
[[contacts]]
name = "elbow"
kind = "profile"
spans = [[0.6, 1.8]]
force = [0.0, 9.0, 4.0]
link = 4
point = [0.05, 0.0, 0.02]
[sensing]
torque = "instant"
"""


@pytest.fixture(scope="module")
def many(tmp_path_factory: pytest.TempPathFactory) -> Simulation:
    path = tmp_path_factory.mktemp("scenario") / "many.toml"
    path.write_text(ELSEWHERE)
    return simulate(load_scenario(path), 4)


def test_true_torque_is_that_of_the_contacts(many: Simulation) -> None:
    """τ_ext = Σ Jᵢᵀ wᵢ from the truth's own columns, through Pinocchio's frame Jacobians."""
    truth, samples, model = many.truth, many.samples, load_robot("panda").model
    place = pin.SE3(np.eye(3), np.array([0.05, 0.0, 0.02]))
    elbow = model.addFrame(pin.Frame("elbow", 4, place, pin.FrameType.OP_FRAME))
    data, axes = model.createData(), pin.LOCAL_WORLD_ALIGNED
    for k, q in enumerate(samples.q):
        tip = pin.computeFrameJacobian(model, data, q, model.getFrameId("flange"), axes)
        link = pin.computeFrameJacobian(model, data, q, elbow, axes)
        there = tip.T @ truth.wrench[k] + link.T @ truth.contacts["elbow"][k]
        # required 1e-9
        np.testing.assert_allclose(truth.tau_ext[k], there, rtol=0, atol=1e-9)
    # the force along the profile of the file: half a cosine of .2 s up and down, read off between
    # the middles of steps of 1 ms, (π/.2)²·12 N/8 of them
    up, down = (np.clip(each / 0.2, 0.0, 1.0) for each in (truth.t - 0.2, 1.4 - truth.t))
    size = 0.25 * (1.0 - np.cos(np.pi * up)) * (1.0 - np.cos(np.pi * down))
    np.testing.assert_allclose(truth.wrench[:, :3], np.outer(size, [5, -3, 8]), atol=5e-4)
    assert np.max(np.abs(truth.wrench)) > 5.0
    assert np.max(np.abs(truth.contacts["elbow"])) > 5.0


def test_the_flange_is_where_pinocchio_has_it(many: Simulation) -> None:
    """By measured and by commanded positions, its twist through Pinocchio's Jacobian."""
    model, seen, samples = load_robot("panda").model, many.measured.signals, many.samples
    data, frame, axes = model.createData(), model.getFrameId("flange"), pin.LOCAL_WORLD_ALIGNED
    actual, target = many.flanges()
    asked = samples.target_q, samples.target_dq
    for flange, q, dq in ((actual, seen["q"], seen["dq"]), (target, *asked)):
        for k in (0, 700, 1500):
            J = pin.computeFrameJacobian(model, data, q[k], frame, axes)
            np.testing.assert_allclose(flange.jacobian[k], J, atol=1e-12)
            np.testing.assert_allclose(flange.twist[k], J @ dq[k], atol=1e-12)
            np.testing.assert_allclose(flange.rotation[k], data.oMf[frame].rotation, atol=1e-12)
            place = data.oMf[frame].translation
            np.testing.assert_allclose(flange.position[k], place, atol=1e-12)


def test_truth_closes_the_equation_of_motion(many: Simulation) -> None:
    """M q̈ + C q̇ + g + τ_f = τ + τ_ext with the true arm, from the truth's pieces alone."""
    scenario = load_scenario("ur5-circle", ["duration=6.0", "sensing.torque=instant"])
    # the torque is that of the step before the sample, q̈ and friction the mean of both sides:
    # half a step's change of a torque that moves by up to 2 N·m a step while pushed
    for run, most in ((simulate(scenario, 2), 0.3), (many, 0.05)):
        rng = np.random.default_rng(np.random.SeedSequence(run.seed).spawn(3)[0])
        model = build_arm(run.scenario, run.robot, rng).chain.to_pinocchio()
        data, samples = model.createData(), run.samples
        states = zip(samples.q, samples.v, samples.a, strict=True)
        needed = np.array([pin.rnea(model, data, *state) for state in states])
        gap = needed + samples.friction - samples.tau - run.truth.tau_ext
        assert np.all(rms(gap[10:-10]) < most)
        assert np.median(np.abs(gap)) < 0.02


@pytest.mark.slow
def test_momentum_observer_is_as_late_as_it_must_be() -> None:
    """Exact profile, noise on: GMO(30) misses the truth by at most 1.2 times its own lag."""
    run = simulate(load_scenario("ur5-circle", EXACT), 1)
    estimate = MomentumObserver(gain=30.0).estimate(dynamics_terms(run.recording, run.robot)).tau
    truth, a = run.truth.tau_ext, 0.5 * 30.0 * 0.008
    lagged = np.zeros_like(truth)
    for k in range(1, len(truth)):
        pushed = a * (truth[k] + truth[k - 1])
        lagged[k] = ((1 - a) * lagged[k - 1] + pushed) / (1 + a)
    ratio = rms(estimate - truth) / rms(lagged - truth)
    # joint 5 rests in its stiction during the whole circle: no observer sees what that takes up
    moving = [0, 1, 2, 3, 5]
    assert np.all(ratio[moving] <= 1.2), ratio


@pytest.mark.slow
def test_free_residual_is_of_the_size_seen_on_real_logs() -> None:
    """With the mismatch on, the free round's residual on J1–J3 is 0.5–2 N·m."""
    sizes = []
    for seed in range(1, 6):
        run = simulate(load_scenario("ur5-circle", ["duration=4.0"]), seed)
        terms = dynamics_terms(run.recording, run.robot)
        sizes.append(rms(MomentumObserver(gain=30.0).estimate(terms).tau)[:3])
    per_seed = np.mean(sizes, axis=1)
    assert np.all((per_seed > 0.5) & (per_seed < 2.0)), per_seed
    assert np.all(np.max(sizes, axis=1) < 2.0), sizes


@pytest.mark.slow
@pytest.mark.parametrize(("stiffness", "low", "high"), [("stiff", 0.5, 5.0), ("soft", 8.0, 35.0)])
def test_a_push_moves_the_arm_by_millimetres(stiffness: str, low: float, high: float) -> None:
    run = simulate(load_scenario("ur5-circle", [f"servo.stiffness={stiffness}"]), 1)
    off = 1e3 * np.max(np.abs(run.samples.q - run.samples.target_q), axis=0)
    assert np.all((off[:3] > low) & (off[:3] < high)), off


def test_stepping_the_arm_oneself_gives_the_same_log() -> None:
    scenario = load_scenario("ur5-circle", ["duration=0.4"])
    arm, reference = prepare(scenario, 3)
    for k in range(arm.steps):
        arm.command(reference.q[k], reference.dq[k], reference.ddq[k])
    mine, theirs = observe(arm).recording, simulate(scenario, 3).recording
    np.testing.assert_allclose(mine.q, theirs.q, atol=1e-12)
    np.testing.assert_allclose(mine.require("current"), theirs.require("current"), atol=1e-12)


def test_controller_in_the_loop_reads_what_it_needs() -> None:
    arm, reference = prepare(load_scenario("ur5-drag", ["duration=0.1"]), 1)
    assert isinstance(arm, Arm)
    seen = []
    for _ in range(50):
        arm.command(reference.q[0])
        seen.append((arm.mean_torque(0.001) - arm.true.offset) * arm.true.gain)
    assert arm.t == pytest.approx(0.05)
    np.testing.assert_array_equal([arm.q, arm.v], [arm.plant.q, arm.plant.v])
    # the mean of the last steps, as the drives' gain and offset show it; of all, of one at least
    for interval, steps in ((0.008, 8), (0.0124, 12), (9.0, 50), (0.0, 1)):
        mean = np.mean(seen[-steps:], axis=0) / arm.true.gain + arm.true.offset
        np.testing.assert_allclose(arm.mean_torque(interval), mean, rtol=1e-9)
    # at rest the drives hold the arm against gravity within the stiction
    data = arm.robot.model.createData()
    weight = pin.computeGeneralizedGravity(arm.robot.model, data, arm.q)
    assert np.all(np.abs(arm.mean_torque(0.008) - weight) < 10.0)
    for _ in range(50):
        arm.command(reference.q[0])
    with pytest.raises(ParameterError, match="prepared for 100 steps and has made them"):
        arm.command(reference.q[0])


@pytest.mark.parametrize(("duration", "steps"), [(0.07, 70), (0.0702, 71), (0.3, 300)])
def test_a_run_has_as_many_steps_as_fit_and_tells_of_them(duration: float, steps: int) -> None:
    """.07/.001 is a little more than 70 in doubles."""
    arm, reference = prepare(load_scenario("ur5-circle", [f"duration={duration}"]), 1)
    assert arm.steps == steps
    assert len(reference.q) == steps + 1


def test_every_step_says_how_far_the_run_is() -> None:
    heard: list[tuple[str, float]] = []
    scenario = load_scenario("ur5-circle", ["duration=0.06", "contacts=[]"])
    with heard_by(lambda *words: heard.append(words)):
        simulate(scenario, 1)
    assert heard == [("simulating", 0.0), *(("", k / 60) for k in range(60))]


def test_pair_is_one_motion_with_and_without_the_payload() -> None:
    loaded, free = simulate_pair(load_scenario("payload-pair", ["duration=2.0"]), 1)
    np.testing.assert_array_equal(loaded.samples.target_q, free.samples.target_q)
    heavier = loaded.recording.require("current") - free.recording.require("current")
    assert np.max(np.abs(heavier[:, 1])) > 1.0
    # two sensors' noise, not one
    assert np.any(loaded.recording.q - loaded.samples.q != free.recording.q - free.samples.q)


def test_a_joint_is_as_warm_as_the_scenario_says_between_start_and_end() -> None:
    for begin, end in ((COLDEST, WARMEST), (30.0, None), (None, 45.0), (None, None)):
        stated = {"temperature_begin": begin, "temperature_end": end}
        settings = [f"friction.{k}={v}" for k, v in stated.items() if v is not None]
        arm, _ = prepare(load_scenario("ur5-circle", ["robot=ur5e", "duration=8", *settings]), 1)
        first = 35.0 if begin is None else begin  # of the profile's friction
        last = first if end is None else end
        found = arm.temperature(np.array([0.0, 2.0, 8.0]))
        expected = [first, 0.75 * first + 0.25 * last, last]
        np.testing.assert_allclose(found, np.tile(expected, (6, 1)).T)


def test_friction_follows_the_temperature_every_quarter_of_a_second() -> None:
    span = ["friction.temperature_begin=25", "friction.temperature_end=45"]
    scenario = load_scenario("ur5-circle", ["robot=ur5e", "duration=1", "contacts=[]", *span])
    arm, reference = prepare(scenario, 1)
    for k in range(251):
        arm.command(reference.q[k])
        if k in {0, 249, 250}:
            middle = np.array([0.0005 if k < 250 else 0.2505])  # of the step that looks
            factor = friction_factor(arm.robot.friction, arm.temperature(middle))[0]
            rubs = arm.plant.true_friction.presliding / arm.true.friction.presliding
            np.testing.assert_allclose(rubs, factor, rtol=1e-12)
            assert np.all(rubs > 1.02)


@pytest.mark.slow
def test_bearing_weighs_what_it_should_and_the_arm_does_not_chatter() -> None:
    """Exact profile: GMO(30) through Jᵀ reads the 9.2 N, and nothing while unloaded."""
    kinds = ("mass", "com", "friction", "torque_constant", "torque_offset")
    settings = [*(f"mismatch.{k}=0" for k in kinds), "friction.stribeck=0", "friction.sticking=0"]
    run = simulate(load_scenario("panda-bearing", settings), 1)
    slip = np.max(np.abs(run.samples.v - run.samples.target_dq), axis=0)
    assert np.all(slip < 0.1), slip  # knocks shake the wrist by 0.05 rad/s
    log = run.recording
    tau = MomentumObserver(gain=30.0).estimate(dynamics_terms(log, run.robot)).tau
    jacobian = flange_jacobian(run.robot.chain, log.q)
    wrench, _ = wrench_of(tau, jacobian)
    moving, hung = (log.t > 0.6) & (log.t < 3.4), (log.t > 5.0) & (log.t < 8.5)
    assert rms(wrench[moving])[2] < 0.6
    # required 2 %; the noise of a mean over 3.5 s is 0.01 N
    assert np.mean(wrench[hung, 2]) == pytest.approx(-9.2, rel=0.005)
