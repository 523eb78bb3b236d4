"""The two-cycle difference against the simulated truth, and on real pairs of logs."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from sound_logs import UR10E

from vftcli.free_motion import FreeChoice
from vftcli.free_motion.cycles import find_period
from vftcli.free_motion.difference import RUNGS, Difference, ErrorModel
from vftcli.free_motion.free_motion import FreeMotion, FreeRun
from vftcli.free_motion.two_cycle import (
    error_ratio,
    floor_remarks,
    friction_change,
    two_cycle_reference,
)
from vftcli.readers.reading import read
from vftcli.robots import load_robot
from vftcli.robots.run import Run
from vftcli.signals.arrays import Array
from vftcli.signals.errors import ReferenceTorqueError
from vftcli.signals.external_torque import ExternalTorque
from vftcli.signals.recording import Recording
from vftcli.signals.remarks import Remark
from vftcli.simulation import Simulation, load_scenario, simulate

UR5 = load_robot("ur5")
MOVING = [0, 1, 2, 3, 5]  # J5 of the circle rests; it is not judged.

HONEST = (0.7, 1.4)  # Required: true over reported error.


@pytest.fixture(scope="module")
def repeats(logs: Path) -> dict[str, Recording]:
    folder = logs / "ur10e"
    return {k: read(folder / f"free_repeat_{k}.csv", columns=UR10E) for k in "abc"}


def two_cycle_difference(recording, free, robot, choice=None) -> ExternalTorque:
    """The reference of a log by its own cycles, or by one or several free logs."""
    log = Run(recording=recording, robot=robot)
    others = (free,) if isinstance(free, Recording) else tuple(free)
    runs = tuple(FreeRun(run=Run(recording=r, robot=robot), log=log) for r in others)
    return two_cycle_reference(FreeMotion(log=log, choice=choice or FreeChoice(), runs=runs))


def error_of(reference: ExternalTorque, truth: Array) -> Array:
    """True root-mean-square error of a reference. (n,) [N·m]"""
    return np.asarray(np.sqrt(np.nanmean((reference.tau - truth) ** 2, axis=0)))


def test_default_beats_the_commanded_period(circle):
    """Required: at most 0.6 times its error, mean over J1–J4 and J6."""
    best = two_cycle_difference(circle.recording, (), UR5)
    plain = FreeChoice(period=4.0, alignment="commanded", low_pass=None)
    commanded = two_cycle_difference(circle.recording, (), UR5, plain)
    errors = [error_of(r, circle.truth)[MOVING].mean() for r in (best, commanded)]
    assert errors[0] <= 0.6 * errors[1]


@pytest.mark.parametrize("low_pass", [None, 12.0, 6.0])
@pytest.mark.parametrize("rung", RUNGS)
def test_every_rung_knows_its_error(circle, rung, low_pass):
    choice = FreeChoice(period=4.0, alignment=rung, low_pass=low_pass)
    reference = two_cycle_difference(circle.recording, (), UR5, choice)
    ratio = (error_of(reference, circle.truth) / reference.floor)[MOVING]
    # Required of the default rung; the others take J4's short stops for worse than they are.
    least = HONEST[0] if (rung, low_pass) == ("model", 12.0) else 0.6
    assert np.all((ratio >= least) & (ratio <= HONEST[1])), ratio


def test_free_cycle_and_joint_at_rest_are_reported(circle):
    reference = two_cycle_difference(circle.recording, (), UR5)
    t = circle.recording.t
    assert np.isnan(reference.tau[t < 3.99]).all()  # the free cycle has no reference of its own
    assert np.isfinite(reference.tau[(t > 4.01) & (t < 19.9)]).all()
    rests = reference.moving[reference.known.all(axis=1)].mean(axis=0) < 0.5
    assert rests.tolist() == [False, False, False, False, True, False]
    remarks = {remark.code: remark for remark in reference.remarks if isinstance(remark, Remark)}
    assert remarks["period"].values["period_s"] == pytest.approx(4.0, rel=2e-4)
    assert remarks["free-cycles-found"].values["cycles"] == [1]
    assert remarks["free-cycles-found"].values["whole"] == 5
    assert remarks["joint-stands"].where.joints == (5,)
    assert remarks["joint-stands"].values["share"] == 1.0
    assert remarks["alignment-chosen"].values["rung"].endswith(" Hz low-pass")


def test_two_free_cycles_measure_the_floor(circle):
    """Given cycles 2 and 3, both pushed, the measured floor must say how wrong that is."""
    choice = FreeChoice(cycles=(2, 3))
    pushed = two_cycle_difference(circle.recording, (), UR5, choice)
    free = two_cycle_difference(circle.recording, (), UR5)
    assert np.all(pushed.floor[MOVING] > 1.5 * free.floor[MOVING])
    assert "floor-measured" in {r.code for r in pushed.remarks if isinstance(r, Remark)}


def test_missing_samples(circle):
    """Five per cent lost at random and a gap of 0.2 s: still honest, and the gap is left out."""
    log = circle.recording
    keep = np.random.default_rng(2).random(log.samples) > 0.05
    keep[100:125] = False
    names = ("t", "q", "dq", "current")
    cut = Recording(**{n: getattr(log, n)[keep] for n in names}, robot_hint=log.robot_hint)
    reference = two_cycle_difference(cut, (), UR5)
    ratio = (error_of(reference, circle.truth[keep]) / reference.floor)[MOVING]
    assert np.all((ratio >= HONEST[0]) & (ratio <= HONEST[1])), ratio
    hole = (cut.t > 4.0 + 0.85) & (cut.t < 4.0 + 0.95)  # samples 100 to 124 one cycle later
    assert np.isnan(reference.tau[hole]).all()


def test_options_that_do_not_go_with_the_logs(circle):
    with pytest.raises(ReferenceTorqueError, match=r"between 0 and 62\.5 Hz"):
        two_cycle_difference(circle.recording, (), UR5, FreeChoice(low_pass=80.0))
    source = replace(circle.recording.source, path=Path("other.csv"), t0=1.0)  # another run
    other = replace(circle.recording, source=source)
    with pytest.raises(ReferenceTorqueError, match="leave them out with --free"):
        two_cycle_difference(circle.recording, other, UR5, FreeChoice(period=4.0))


@pytest.mark.parametrize("pair", ["ab", "ac", "ba", "bc", "ca", "cb"])
@pytest.mark.parametrize("low_pass", [None, "auto"])
def test_floor_covers_real_free_pairs(repeats, pair, low_pass):
    """The same free motion twice: what the difference shows on moving samples is its error."""
    robot = load_robot("ur10e")
    choice = FreeChoice(low_pass=low_pass)
    reference = two_cycle_difference(repeats[pair[0]], repeats[pair[1]], robot, choice)
    moving, all_of_it = shares_of_error(reference)
    assert np.all((moving >= HONEST[0]) & (moving <= HONEST[1])), moving
    # At rest the stiction of one motion repeats better on one joint than on another: .05 to .5 of
    # the dry friction for an expected .13, in three pairs of two joints' worth of samples.
    assert np.all((all_of_it >= 0.4) & (all_of_it <= 3.0)), all_of_it
    assert 0.6 < all_of_it.mean() < 1.4


def shares_of_error(reference: ExternalTorque) -> tuple[np.ndarray, np.ndarray]:
    """What a difference of free runs shows over what it expects: in motion, and over all. (n,)"""
    known = reference.known
    found = []
    for used in (reference.moving & known, known):
        both = reference.tau, reference.sd
        shown, expected = (np.nanmean(np.where(used, x, np.nan) ** 2, axis=0) for x in both)
        found.append(np.sqrt(shown / expected))
    np.testing.assert_allclose(expected, reference.floor**2, rtol=1e-9)  # the floor's own samples
    return found[0], found[1]


def test_three_free_runs_measure_the_floor(repeats):
    free = [repeats["b"], repeats["c"]]
    reference = two_cycle_difference(repeats["a"], free, load_robot("ur10e"))
    moving, _ = shares_of_error(reference)
    assert np.all((moving >= HONEST[0]) & (moving <= HONEST[1])), moving


def test_a_payload_is_seen(logs):
    """Documented: the difference correlates 0.986 (J2) and 0.977 (J3) with the load's gravity."""
    import pinocchio as pin

    robot = load_robot("ur10e")
    folder = logs / "ur10e"
    loaded, free = (read(folder / f"{k}_14harm.csv", columns=UR10E) for k in ("load", "free"))
    reference = two_cycle_difference(loaded, free, robot)
    model, data = robot.model, robot.model.createData()
    frame = model.getFrameId("flange")
    weight = []
    for q in loaded.q[::10]:
        pin.computeJointJacobians(model, data, q)
        pin.updateFramePlacements(model, data)
        axes = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        jacobian = pin.getFrameJacobian(model, data, frame, axes)
        weight.append(-9.81 * jacobian[2])
    gravity, shown = np.array(weight), reference.tau[::10]
    known = np.isfinite(shown[:, 1]) & (np.abs(loaded.dq[::10]).max(axis=1) > 0.01)
    for joint, least in ((1, 0.97), (2, 0.95)):
        assert np.corrcoef(gravity[known, joint], shown[known, joint])[0, 1] > least
    mass = np.sum(gravity[known, 1] * shown[known, 1]) / np.sum(gravity[known, 1] ** 2)
    # 2.805 kg with its centre of mass anywhere near the flange: a lever of 1 m, give or take 0.1 m.
    assert mass == pytest.approx(2.805, rel=0.1)


def test_at_a_low_rate_the_low_pass_is_two_fifths_of_nyquist(circle):
    """Every fourth of 125 samples a second: .4 · 15.625 Hz."""
    log = circle.recording
    thin = Recording(t=log.t[::4], q=log.q[::4], dq=log.dq[::4], current=log.current[::4])
    remarks = two_cycle_difference(thin, (), UR5).remarks
    floors = [r for r in remarks if r.code == "alignment-floor"]
    assert floors[1].values["rung"].endswith(" + 6.25 Hz low-pass")


def test_the_error_s_remarks_and_its_measured_ratio():
    """Of 100 samples joint 1 rests in 52, joint 2 in 51, joint 3 in 3, joint 4 in 2."""
    sd, rests = np.ones((100, 4)), np.arange(100)[:, None] < [52, 51, 3, 2]
    sd[:2] = np.nan  # without a partner: 50, 49, 1 and none of the other 98 at rest
    sd[rests] *= 3.0
    tau = 2.0 * np.ones((100, 4)) * [1.0, 0.1, 1.0, 2.0]
    found = Difference("model", None, tau, ErrorModel(sd, rests))
    ratio = error_ratio(found, found.error.known)
    np.testing.assert_allclose(ratio, [2.0, 0.3, 2.0, 3.0])  # held from .3 to 3
    origin, *others = floor_remarks(found, ratio, np.array([0.0, 0.4, 0.0, 0.0]))
    assert (origin.code, list(origin.values["ratio"])) == ("floor-measured", list(ratio))
    said = [(r.code, r.where.joints, *r.values.values()) for r in others]
    assert said[0] == ("joint-stands", (1,), 50 / 98, 3.0)
    assert said[1] == ("joint-stands-at-times", (2,), 49 / 98, 3.0)
    assert [s[:2] for s in said[2:]] == [("friction-changed", (2,))]
    np.testing.assert_array_equal(said[2][2], [0.4])


@pytest.fixture
def swing(drive_of: Callable[..., Run]) -> Run:
    """Two joints swinging at 0.4 and 0.7 Hz for 20 s."""
    t = 0.008 * np.arange(2500)
    dq = np.sin(2.0 * np.pi * t[:, None] * np.array([0.4, 0.7]))
    return drive_of(t, np.zeros_like(dq), dq)


@pytest.mark.parametrize("seed", range(5))
def test_a_change_is_found(swing, seed):
    """0.4 N·m of friction under 0.3 N·m of noise: 2500 samples tell it to 0.006 N·m."""
    motion, rng = swing, np.random.default_rng(seed)
    tau = 0.4 * np.sign(motion.dq) * [1.0, 0.0] + 0.3 * rng.standard_normal(motion.dq.shape)
    found = friction_change(motion, tau, np.ones_like(tau, bool))
    assert found[0] == pytest.approx(0.4, abs=0.03)
    assert found[1] == 0.0
    for seconds, known in ((3.9, False), (4.9, True)):  # four pieces of a second are too few
        assert friction_change(motion, tau, motion.t[:, None] < [seconds] * 2).any() == known


@pytest.mark.parametrize("seed", range(5))
def test_pushes_are_not_taken_for_it(swing, seed):
    """Pushes of 10 N·m, a second each, at random times and either way."""
    motion, rng = swing, np.random.default_rng(seed)
    tau = 0.3 * rng.standard_normal(motion.dq.shape)
    for start in rng.uniform(0.0, 19.0, 8):
        pushed = (motion.t >= start) & (motion.t < start + 1.0)
        tau[pushed] += 10.0 * rng.choice([-1, 1], 2)
    assert np.array_equal(friction_change(motion, tau, np.ones_like(tau, bool)), [0.0, 0.0])


STICKS = "friction.presliding=0"  # The joints that the figures are required of.
SETTINGS = {name: [f"servo.stiffness={name}"] for name in ("stiff", "soft")}
SETTINGS["drift"] = ["sensing.clock_drift=0.003"]

OVERSTATED = pytest.mark.xfail(
    strict=True, reason="the floor of joint 4 is stated too large there: it errs by .65 of it"
)
RUNS = [
    pytest.param(name, seed, marks=OVERSTATED if (name, seed) == ("soft", 2) else ())
    for name in SETTINGS
    for seed in range(1, 6)
]


def errors_of(run: Simulation, choice: FreeChoice) -> tuple[Array, Array]:
    """True and reported error of the moving joints. (5,), (5,) [N·m]"""
    log = run.recording
    truth = np.column_stack([np.interp(log.t, run.truth.t, x) for x in run.truth.tau_ext.T])
    reference = two_cycle_difference(log, (), load_robot("ur5"), choice)
    shown = np.sqrt(np.nanmean((reference.tau - truth) ** 2, axis=0))
    return shown[MOVING], reference.floor[MOVING]


@pytest.mark.statistical
@pytest.mark.parametrize(("name", "seed"), RUNS)
def test_required_figures(name, seed):
    run = simulate(load_scenario("ur5-circle", [*SETTINGS[name], STICKS]), seed)
    wanted = 4.0 * (1.003 if name == "drift" else 1.0)
    assert find_period(run.recording).seconds == pytest.approx(wanted, rel=2e-4)

    best, floor = errors_of(run, FreeChoice())
    plain = FreeChoice(period=4.0, alignment="commanded", low_pass=None)
    commanded, _ = errors_of(run, plain)
    assert best.mean() <= 0.6 * commanded.mean()
    assert np.all((best / floor >= 0.7) & (best / floor <= 1.4)), best / floor

    for low_pass in (None, 12.0):
        chosen, _ = errors_of(run, FreeChoice(period=4.0, low_pass=low_pass))
        lowest, _ = errors_of(run, replace(plain, low_pass=low_pass))
        assert chosen.mean() <= 1.05 * lowest.mean(), RUNGS
