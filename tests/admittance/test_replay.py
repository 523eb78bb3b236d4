"""Replay: forces from every source, joints, comparison figures, remarks."""

from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from vftcli.admittance import replay
from vftcli.admittance.law import UnstableError, controllers, from_table, parse_settings
from vftcli.admittance.motion import AxisMotion, Drag, JointPath, follow, largest_speed
from vftcli.robots import load_robot
from vftcli.robots.chain import flange_jacobian, link_poses
from vftcli.robots.robot import FlangeSolver
from vftcli.signals import errors
from vftcli.signals.pose import exp_matrix
from vftcli.signals.recording import Recording
from vftcli.signals.remarks import fact
from vftcli.signals.wrench import Wrench, WrenchFrame
from vftcli.wrench import WrenchChoice, ZeroChoice

UR5 = load_robot("ur5")
START = np.array([0.0, -1.35, 1.9, -2.1208, -1.5708, 0.0])


def parameters(*assignments: str):
    """The UR5's parameters with assignments."""
    return from_table(UR5.admittance, "ur5", parse_settings(assignments))


Force = tuple[Wrench, np.ndarray]  # A wrench and the joint positions along it.


def push(force: float = 24.0, axis: int = 1, length: float = 14.0) -> Force:
    """A constant force from 1 s to 3 s on an arm at rest."""
    t = np.arange(round(length / 0.008)) * 0.008
    wrench = np.zeros((len(t), 6))
    wrench[(t >= 1.0) & (t < 3.0), axis] = force
    return Wrench(name="push", t=t, values=wrench, frame="base"), np.tile(START, (len(t), 1))


def run(force: Force, *assignments: str, alphas: tuple[float, ...] = ()) -> replay.Replay:
    p = parameters(*assignments)
    source = fact("force-of-sensor", frame="a push")
    return replay.replay(*force, UR5, controllers(p, alphas=alphas), source=source)


def codes(found: replay.Replay) -> set[str]:
    assert all(str(remark) for remark in found.remarks)  # the catalogue has words for each
    return {remark.code for remark in found.remarks}


def test_soft_travel_is_plausible_and_hard_is_said_not_to_be():
    """24 N for 2 s: 4 N of excess move K = 8 N/m by ≈ 0.6 m at most; the whole 24 N by metres."""
    soft = run(push(), "threshold_mode=soft", alphas=(1.0, 1.9))
    hard = run(push(), alphas=(1.0, 1.9))
    assert np.abs(soft.motion.x[:, :, 1]).max() < 0.65
    assert np.all(soft.path.reached)
    assert not {"travel-implausible", "travel-implausible-hard"} & codes(soft)
    assert 1.4 < np.abs(hard.motion.x[:, :, 1]).max() < 2.5  # the science: 1.6–2.2 m above 20 N
    assert "travel-implausible-hard" in codes(hard)


def test_rows_say_what_happened():
    found = run(push(), "threshold_mode=soft", alphas=(1.0, 1.9))
    named = [(r["controller"], r["alpha"]) for r in found.rows]
    assert named == [("traditional", None), ("variable", 1.0), ("variable", 1.9)]
    assert {r["axis"] for r in found.rows} == {"y"}
    for n, row in enumerate(found.rows):
        x, t = found.motion.x[:, n, 1], found.motion.t
        assert row["start_s"] == pytest.approx(1.0, abs=1e-9)
        assert row["release_s"] == pytest.approx(3.0, abs=1e-9)
        assert row["peak"] == pytest.approx(x.max())
        assert row["time_to_peak_s"] == pytest.approx(t[np.argmax(x)] - 1.0)
        after = t > 3.0 + row["return_2_s"] + 1e-6
        at_release = x[np.searchsorted(t, 3.0 - 1e-9)]
        assert np.all(np.abs(x[after]) <= 0.02 * at_release)
        assert row["idle_s"] == pytest.approx(2.0 + row["return_2_s"])
        assert row["overshoot"] == pytest.approx(-x[t > 3.0].min() / at_release)
    variables = [row["return_2_s"] for row in found.rows]
    assert variables == sorted(variables, reverse=True)
    assert found.rows[2]["peak_advance_s"] > 0.0  # the release's brake acts sooner


def test_as_printed_a_force_below_the_threshold_moves_the_arm():
    """5 N of 20 for 20 s: to F/K_d and F/(αK_d); as corrected not at all.

    The slower decays with B/2M = .83 1/s: after 20 s 6e-8 is left.
    """
    record, q = push(5.0, length=21.0)
    values = np.where(record.t[:, None] >= 1.0, record.values[200], 0.0)
    literal = run((replace(record, values=values), q), "threshold_mode=literal")
    np.testing.assert_allclose(literal.motion.x[-1, :, 1], [5 / 8, 5 / (1.6 * 8)], rtol=1e-6)
    assert not literal.phases.dragged.any()
    assert not run((record, q)).motion.x.any()


def test_work_of_a_constant_force_is_force_times_way():
    found = run(push(), "threshold_mode=soft")
    x = found.motion.x[:, 0, 1]
    way = x[round(3.0 / 0.008)] - x[round(1.0 / 0.008)]
    assert found.rows[0]["work_J"] == pytest.approx(24.0 * way, rel=1e-9)  # a sum of equal terms


def test_joints_follow_the_flange():
    """The joint positions put the flange where the deviation says, rotation included."""
    record, q = push(21.0)
    wrench = record.values.copy()
    wrench[:, 3:] = 0.30 * wrench[:, 1:2] * np.array([1.0, 0.0, -0.99])
    found = run((replace(record, values=wrench), q), "threshold_mode=soft", alphas=(1.6,))
    R, p = FlangeSolver(UR5).pose(START)
    for n in range(2):
        poses = link_poses(UR5.chain, found.path.q[:, n])
        x = found.motion.x[:, n]
        good = found.path.reached[:, n]
        assert good.mean() > 0.99
        # REACHED is 1e-6 m, rad
        np.testing.assert_allclose(poses.translation[good, -1] - p, x[good, :3], atol=1e-6)
        turned = exp_matrix(x[good, 3:]) @ R
        np.testing.assert_allclose(poses.rotation[good, -1], turned, atol=2e-6)
    assert np.abs(found.motion.x[:, :, 3:]).max() > 0.05
    assert np.max(np.abs(np.diff(found.path.q, axis=0))) < 0.1  # no branch is changed


def test_the_arm_waits_where_it_cannot_follow():
    x = np.zeros((30, 1, 6))
    x[10:19, 0, 0] = 3.0  # out of reach for nine rows, and one that is nowhere
    x[19] = np.nan
    x[20:, 0, 1] = 0.01
    path = follow(UR5, START, x, 0.008)
    waits = np.r_[[False] * 10, [True] * 10, [False] * 10]
    np.testing.assert_array_equal(path.reached[:, 0], ~waits)
    np.testing.assert_array_equal(path.q[10:20, 0], np.tile(path.q[9, 0], (10, 1)))
    assert not np.allclose(path.q[25, 0], START)


def test_speed_is_a_share_of_the_limit_between_reached_samples():
    q = np.zeros((4, 2, 6))
    q[1:, 0, 2] = 0.02
    q[2:, 0, 4] = 5.0  # a leap to a pose that is not reached
    reached = np.array([[True, True], [True, True], [False, True], [False, True]])
    share = largest_speed(UR5, q, reached, 0.01)
    assert share[0] == pytest.approx(0.02 / 0.01 / UR5.limits.qd_max[2])
    assert share[1] == 0.0
    assert np.isnan(largest_speed(UR5, q, np.zeros((4, 2), dtype=bool), 0.01)).all()


def test_redundant_arm_stays_inside_its_limits():
    panda = load_robot("panda")
    q = np.array(panda.admittance["start"])
    x = np.zeros((400, 1, 6))
    x[:, 0, 1] = np.linspace(0.0, 1.2, 400)  # leaves the workspace
    path = follow(panda, q, x, 0.0025)
    assert path.reached[0, 0]
    assert not path.reached[-1, 0]
    assert np.all((path.q >= panda.limits.q_min) & (path.q <= panda.limits.q_max))
    lost = int(np.argmin(path.reached[:, 0]))
    np.testing.assert_array_equal(path.q[lost:, 0], np.tile(path.q[lost - 1, 0], (400 - lost, 1)))


def test_a_start_outside_the_limits_and_no_deviation_are_refused():
    record, q = push()
    q[:, 5] = 7.0
    with pytest.raises(
        errors.ParameterError, match=r"joint 6 is at 7 rad and may be -6\.283 to 6\.283"
    ):
        run((record, q))
    p = parameters()
    with pytest.raises(errors.ParameterError, match=r"the start pose has 5 joints; ur5 has 6"):
        replay.replay_release(0.3 * np.eye(6)[0], UR5, controllers(p), start=np.zeros(5))
    with pytest.raises(errors.ParameterError, match=r"--release x=0\.3"):
        replay.replay_release(np.zeros(6), UR5, controllers(p), start=START)


def test_a_log_that_is_nearly_all_gap_is_refused():
    """An hour in a log of seconds would be replayed at the control period."""
    record, q = push()
    late = replace(record, t=record.t + 3600.0 * (np.arange(len(record.t)) > 20))
    with pytest.raises(errors.ClockError, match=r"the log waits 36\d\d s after .*--interval"):
        run((late, q))


def test_quiet_log_moves_nothing_and_says_so():
    found = run(push(19.0))
    assert found.rows == ()
    np.testing.assert_array_equal(found.motion.x, 0.0)
    (remark,) = found.remarks
    assert remark.code == "no-drag"
    assert remark.values["axis"] == "y"
    assert remark.values["share"] == pytest.approx(19.0 / 20.0)


def test_w_never_rises_in_a_replay():
    record, q = push(30.0)
    wrench = record.values.copy()
    wrench[:, 4] = 0.3 * wrench[:, 1]
    found = run((replace(record, values=wrench), q), "threshold_mode=soft", alphas=(1.0, 1.9))
    (W, _), dragged = found.lyapunov, found.phases.dragged
    assert np.all(np.isnan(W[1:][dragged[:, None].repeat(3, axis=1)]))
    for own in (*np.moveaxis(W[..., :3], 2, 0), W[..., 3:].sum(axis=2)):
        assert np.nanmax(np.diff(own, axis=0)) <= 1e-12 * np.nanmax(own)


def test_release_without_a_limit_inside_the_bound_is_let_pass():
    p = parameters("position.speed_limit=none")
    x = np.array([0.2, 0, 0, 0, 0, 0])
    found = replay.replay_release(x, UR5, controllers(p), start=START)
    assert not np.any(found.motion.escaped)
    # Watched for six time constants of the slower, e⁻⁶ = .0025, or as long as you say.
    assert 1e-3 < np.max(np.abs(found.motion.x[-1, :, 0])) / 0.2 < 0.01
    second = replay.replay_release(x, UR5, controllers(p), start=START, duration=1.0)
    np.testing.assert_allclose(second.motion.t, 0.008 * np.arange(126), atol=1e-12)
    with pytest.raises(UnstableError, match=r"beyond 0\.385 m"):
        replay.replay_release(2.0 * x, UR5, controllers(p), start=START)
    studied = replay.replay_release(3.0 * x, UR5, controllers(p), start=START, anyway=True)
    assert studied.motion.escaped[1]
    assert {"motion-escaped", "law-escapes"} <= codes(studied)


def test_a_force_that_is_not_known_counts_as_none_and_is_reported():
    wrench, q = push()
    hidden = (wrench.t > 1.5) & (wrench.t < 1.7)
    found = run((replace(wrench, masked=hidden), q), "threshold_mode=soft")
    (remark,) = [remark for remark in found.remarks if remark.code == "force-unknown"]
    assert remark.values["samples"] == np.count_nonzero(hidden)
    assert not found.phases.dragged[hidden].any()


def test_control_clock_takes_the_newest_sample():
    t = np.arange(41) * 0.001
    clock, seen = replay.on_control_clock(t, 0.0025)
    np.testing.assert_allclose(clock, np.arange(17) * 0.0025, atol=1e-15)
    np.testing.assert_array_equal(seen, np.floor(np.arange(17) * 2.5 + 1e-9))
    printed = np.round(100.0 + np.arange(500) * 0.008, 6)  # a log's stamps, in step with control
    _, kept = replay.on_control_clock(printed - printed[0], 0.008)
    np.testing.assert_array_equal(kept, np.arange(500))


PARAMETERS = parameters()
TWO = controllers(PARAMETERS)
ROWS = 51
REST = np.zeros((ROWS, 2, 6))


def motion_of(x: np.ndarray = REST, v: np.ndarray = REST) -> AxisMotion:
    """Five seconds of two controllers, at rest unless something is given."""
    return AxisMotion(t=np.arange(ROWS) * 0.1, x=x, v=v)


def path_of(reached: np.ndarray | None = None, speed: float = 0.5) -> JointPath:
    good = np.ones((ROWS, 2), dtype=bool) if reached is None else reached
    return JointPath(q=np.zeros((ROWS, 2, 6)), reached=good, speed=np.array([speed, np.nan]))


def replayed(made=None, way=None, *, parameters=PARAMETERS, **others) -> replay.Replay:
    """A replay without trouble, but for what is given."""
    zero = np.zeros((ROWS - 1, 6))
    given = {"start": zero[0], "wrench": zero, "drags": (), **others}
    given |= {"controllers": controllers(parameters), "motion": made or motion_of()}
    found = replay.Replay(robot=UR5, **given)
    vars(found).update(path=way or path_of())
    return found


def test_the_travel_of_a_log_that_moves_is_reported_and_nothing_without_trouble():
    assert not [*replay.trouble(replayed())]
    logged = np.full((5, 6), 0.005)
    assert not [*replay.trouble(replayed(logged=logged))]
    logged[:, :3], logged[3, :3] = 0.0, [0.03, 0.0, 0.04]
    (remark,) = replay.trouble(replayed(logged=logged))
    assert remark.values["distance_m"] == pytest.approx(0.05)


def test_each_limit_is_reported_with_its_number_and_its_controller():
    (x, v), reached = np.zeros((2, ROWS, 2, 6)), np.ones((ROWS, 2), bool)
    x[20:, 1, 0] = v[20:, 1, 0] = np.inf
    limit = PARAMETERS.speed_limit
    v[3:6, 0, 2], v[5, 0, 3], v[7, 0, 3] = limit[2], -limit[3], 0.99 * limit[3]
    reached[30:40, 1] = False
    found = [*replay.trouble(replayed(motion_of(x, v), path_of(reached, 1.5)))]
    assert "the first at 3.000 s" in " ".join(str(remark) for remark in found)
    reported = {(r.code, r.where.about): dict(r.values) for r in found}
    first, second = (controller.name for controller in TWO)
    assert reported.pop(("travel-implausible-hard", ""))["travel_m"] > 1e300  # it escaped
    lost = {"lost": 10, "poses": ROWS, "first_s": pytest.approx(3.0)}
    assert reported == {
        ("speed-limit-acted", first): {"periods": 3},
        ("joint-too-fast", first): {"share": 1.5},
        ("motion-escaped", second): {"time_s": pytest.approx(2.0)},
        ("poses-out-of-reach", second): lost,
    }


@pytest.mark.parametrize(
    ("mode", "code"), [("hard", "travel-implausible-hard"), ("soft", "travel-implausible")]
)
def test_travel_counts_where_poses_are_out_of_reach(mode, code):
    x = np.zeros((ROWS, 2, 6))
    x[10, 0, :3], x[10, 1, :3] = [9.0, 0, 0], [0.6, 0.8, 0]
    reached = np.ones((ROWS, 2), dtype=bool)
    reached[10, 1] = False
    parameters = replace(PARAMETERS, threshold_mode=mode)
    _, remark = replay.trouble(replayed(motion_of(x), path_of(reached), parameters=parameters))
    assert remark.code == code
    assert remark.values["travel_m"] == pytest.approx(1.0)  # not the other controller's 9 m


def test_the_axis_nearest_to_its_threshold_is_named():
    wrench = np.zeros((10, 6))
    wrench[4, 0], wrench[5, 4] = -10.0, 0.75 * PARAMETERS.threshold[4]
    wrench[6] = np.nan
    (remark,) = replay.drag_remarks(replayed(wrench=wrench, logged=wrench))
    assert remark.values["axis"] == "ry"
    assert remark.values["share"] == pytest.approx(0.75)
    assert not [*replay.drag_remarks(replayed(wrench=wrench, logged=wrench, drags=[drag(4, 5)]))]
    assert not [*replay.drag_remarks(replayed(wrench=wrench[:0], logged=wrench))]


def drag(begin: int, release: int, axis: int = 2) -> Drag:
    return Drag(axis=axis, number=1, begin=begin, release=release, end=release)


TIMES = np.arange(0.0, 4.0, 0.01)
SWING = np.sin(np.outer(TIMES, np.arange(1, 7) / 3))
POSES = np.array([0.3, -1.2, 1.4, -1.7, -1.5, 0.2]) + 0.2 * SWING
LOADED = np.where(TIMES[:, None] > 2.0, 10.0, 0.0) + np.array([1.0, -2.0, 3.0, 0.1, 0.2, -0.3])


def choice(**zero: object) -> WrenchChoice:
    return WrenchChoice(frame="base", zero=ZeroChoice(**zero))


def test_a_stored_torque_is_turned_into_its_wrench_and_zeroed():
    tau = np.einsum("tij,ti->tj", flange_jacobian(UR5.chain, POSES), LOADED)
    log = Recording(t=TIMES, q=POSES, tau_ext=tau)
    found = replay.stored_force(log, UR5, choice(spans=((0.0, 1.9),)), "kfo-fe")
    expected = np.where(TIMES[:, None] > 2.0, 10.0, 0.0) * np.ones(6)
    np.testing.assert_allclose(found.wrench.known, expected, atol=1e-8)  # κ(J)² times rounding
    assert found.source.values == {"observer": "kfo-fe"}
    assert [remark.code for remark in found.wrench.remarks] == ["zero-removed"]
    with pytest.raises(errors.MissingSignalError):
        replay.stored_force(Recording(t=TIMES, q=POSES), UR5, choice(), "kfo-fe")
    with pytest.raises(errors.ParameterError, match="needs the log itself"):
        replay.stored_force(log, UR5, WrenchChoice(frame="base", solver="smoother"), "kfo-fe")


def test_the_logs_sensor_drives_as_the_log_states_it():
    frame = WrenchFrame("base", "flange", "by-robot")
    log = Recording(t=TIMES, q=POSES, wrench=-LOADED, wrench_frame=frame)
    found = replay.sensor_force(log, UR5, choice())
    np.testing.assert_array_equal(found.wrench.values, LOADED)
    assert found.wrench.remarks == ()
    assert "BY the robot" in found.source.values["frame"]
    unstated = replay.sensor_force(Recording(t=TIMES, q=POSES, wrench=LOADED), UR5, choice())
    assert unstated.source.values["frame"] == "frame not stated"
    codes = [remark.code for remark in unstated.wrench.remarks]
    assert codes == ["wrench-frame-unstated", "sensor-pose-unstated"]


def test_a_truth_file_s_wrench_is_the_force_and_torques_alone_are_none(tmp_path):
    file, axes = tmp_path / "truth.parquet", ("fx", "fy", "fz", "mx", "my", "mz")
    columns = {f"wrench/{axis}": LOADED[:, k] for k, axis in enumerate(axes)}
    pl.DataFrame({"t": TIMES, **columns}).write_parquet(file)
    force = replay.truth_force(Recording(t=TIMES, q=POSES), UR5, choice(), file)
    np.testing.assert_allclose(force.wrench.known, LOADED, atol=1e-12)
    assert force.source.values == {"file": "truth.parquet"}
    columns = {f"tau_ext/{j}": np.zeros(len(TIMES)) for j in range(1, 7)}
    pl.DataFrame({"t": TIMES, **columns}).write_parquet(file)
    with pytest.raises(errors.ReferenceTorqueError, match="it has no wrench"):
        replay.truth_force(Recording(t=TIMES, q=POSES), UR5, choice(), file)
