"""Signals that stand still, are zero, clipped or coarse: each inside and outside of its limits."""

import numpy as np
import pytest
from swinging import DQ, STEP, TORQUE, Q, T, found, scaled

from vftcli.signals.arrays import Array


def standing(x: Array, joint: int, start: float, seconds: float) -> Array:
    """A signal whose column, counted from 1, keeps one value for some time. [s]"""
    still = np.array(x)
    rows = (start - 1e-9 <= T) & (start + seconds + 1e-9 >= T)
    still[rows, joint - 1] = still[np.argmax(rows), joint - 1]
    return still


@pytest.mark.parametrize(("seconds", "reported"), [(0.45, False), (0.55, True), (20.0, True)])
@pytest.mark.parametrize(
    ("name", "code"),
    [("q", "stuck-position"), ("dq", "stuck-velocity"), ("torque", "stuck-effort")],
)
def test_a_signal_that_stands_still_for_half_a_second(
    name: str, code: str, seconds: float, reported: bool
) -> None:
    signals = {"q": Q, "dq": DQ, "torque": TORQUE}
    findings = found(**signals | {name: standing(signals[name], 4, 11.0, seconds)})
    assert (code in findings) == reported
    if reported:
        finding = findings[code]
        assert (finding.where.joints, finding.level) == ((4,), "warning")
        assert finding.values["longest_s"] == pytest.approx(seconds, abs=STEP)
        assert finding.values["at_s"] == pytest.approx(11.0, abs=STEP)


def test_a_current_that_stands_still_is_reported_as_one() -> None:
    still = standing(standing(TORQUE, 4, 11.0, 3.0), 2, 30.0, 5.0)
    finding = found(torque=None, current=still)["stuck-effort"]
    assert finding.where.joints == (2, 4)
    assert finding.values["signal"] == "current"
    assert finding.values["at_s"] == pytest.approx(30.0, abs=STEP)


def test_a_joint_that_is_held_is_not_stuck() -> None:
    """J4 rests in the second half, with one effort, and then an offset or noise on its velocity."""
    rest = T > 19.99
    q, dq, torque = Q.copy(), DQ.copy(), TORQUE.copy()
    q[rest, 3], dq[rest, 3] = q[1999, 3], 0.0
    torque[rest, 3] = 7.0  # the least of all: at an extreme
    noise = np.random.default_rng(1).normal(0, 0.02, rest.sum())
    for speed in (0.0, 5e-3, noise):  # ten times the offset of a real drive's velocity
        dq[rest, 3] = speed
        assert found(q=q, dq=dq, torque=torque) == {}


def test_a_constant_speed_and_a_constant_acceleration_take_a_constant_effort() -> None:
    """A simulated arm without noise turns about the vertical by a trapezoid of speed."""
    speed = np.clip(np.abs((T % 10) - 5) - 2.5, -1, 1)[:, None] * np.ones(6)
    turned = np.cumsum(speed, axis=0) * STEP
    torque = np.sign(speed) + 2 * np.round(np.gradient(speed, STEP, axis=0))
    assert "stuck-effort" not in found(q=turned, dq=speed, torque=torque)


def test_a_packet_that_is_late_makes_nothing_stuck() -> None:
    """A recorder that repeats whole rows for a second is another fault."""
    rows = np.arange(4001)
    rows[1500:1600] = 1500
    findings = found(q=Q[rows], dq=DQ[rows], torque=TORQUE[rows])
    assert not {"stuck-position", "stuck-velocity", "stuck-effort"} & set(findings)


def test_coarse_efforts_repeat_and_are_not_stuck() -> None:
    """Steps of 2 N·m of a torque that goes over 9 N·m: up to a second of one value at the turns."""
    assert "stuck-effort" not in found(torque=np.round(10 * np.cos(Q)) * 2)


@pytest.mark.parametrize(
    ("size", "joints", "code"),
    [
        (0.55e-3, (2,), ""),  # a milliradian of travel is motion; the swing is 2 rad
        (0.45e-3, (2,), "still-joint"),
        (0.45e-3, (2, 6), "still-joints"),
        (0.45e-3, (1, 2, 3, 4, 5, 6), "at-rest"),
    ],
)
def test_joints_that_never_move(size: float, joints: tuple[int, ...], code: str) -> None:
    findings = found(q=scaled(Q, size, *joints), dq=None)
    assert set(findings) - {"no-velocity"} == ({code} if code else set())
    if code == "at-rest":
        assert findings[code].values["travel_mrad"] == pytest.approx(0.9, rel=1e-3)
        assert findings[code].level == "fact"
    elif code:
        assert findings[code].where.joints == joints


def wave(peak: float = 1.0, low: float = -1.0, run: int = 0) -> Array:
    """A signal between two extremes each of which it takes once, the upper for a run at will."""
    value = np.linspace(0.9 * low, 0.9 * peak, 200)
    value[50] = low
    value[100 : 100 + max(run, 1)] = peak
    return value


def clipped(effort: Array, speed: float = 1e-2, step: float = STEP) -> bool:
    """Whether an effort is clipped on a joint that goes so fast. [rad/s, s]"""
    t = step * np.arange(len(effort))
    q, dq = speed * t[:, None], np.full((len(t), 1), speed)
    return "saturation" in found(t=t, q=q, dq=dq, torque=effort[:, None])


@pytest.mark.parametrize(("run", "reported"), [(1, False), (9, False), (10, True), (30, True)])
def test_ten_samples_in_a_row_at_the_extreme_are_clipped(run: int, reported: bool) -> None:
    """At 20 mrad/s 1.8 mrad in ten samples."""
    assert clipped(wave(run=run), speed=2e-2) == reported
    assert clipped(-wave(run=run), speed=2e-2) == reported


@pytest.mark.parametrize(("run", "reported"), [(98, False), (101, True)])
def test_at_a_kilohertz_ten_samples_are_no_time(run: int, reported: bool) -> None:
    """A tenth of a second at the extreme is: 99 samples are not, 101 are."""
    torque = np.cos(3e-3 * np.arange(4000))
    torque[1000 : 1000 + run] = 2.0
    assert clipped(torque, speed=0.5, step=1e-3) == reported


def test_what_is_not_clipped() -> None:
    assert not clipped(np.ones(200))
    assert not clipped(wave(run=30), speed=0.0)  # a joint that is held needs one effort
    scattered = wave()
    scattered[::10] = 1.0
    assert not clipped(scattered)
    # an effort that often reads the same small value rests: below half of its range
    assert not clipped(wave(peak=0.9, low=-1.0, run=30))
    assert clipped(wave(peak=1.1, low=-1.0, run=30))
    assert clipped(np.where(np.arange(200) < 150, 1.0, wave()))  # most of the time, and it moves


@pytest.mark.parametrize("step", [0.01, 0.1])
def test_the_top_of_a_smooth_effort_of_coarse_resolution_is_not_clipped(step: float) -> None:
    """It is wide on the level below too: (√2 − 1) times as wide, twice."""
    smooth = np.round(np.sin(0.002 * np.arange(4000)) / step) * step
    assert not clipped(smooth)
    assert clipped(np.clip(smooth, -0.8, 0.8))


def test_an_effort_that_came_to_stand_at_its_extreme_is_stuck_and_not_saturated() -> None:
    """From its largest value on to the end, a quarter of the log; twice there it is clipped."""
    torque = TORQUE.copy()
    torque[3000:, 3] = 25.0
    assert set(found(torque=torque)) == {"stuck-effort"}
    torque[2000:2100, 3] = 25.0
    findings = found(current=torque)
    assert set(findings) == {"saturation"}
    finding = findings["saturation"]
    assert (finding.where.joints, finding.values["signal"]) == ((4,), "current")
    assert finding.level == "warning"


@pytest.mark.parametrize("name", ["current", "torque"])
def test_efforts_that_are_all_zero(name: str) -> None:
    zeros = np.zeros_like(Q)
    finding = found(**{"torque": None, name: zeros})["zero-effort"]
    assert (finding.level, finding.where.joints) == ("warning", (1, 2, 3, 4, 5, 6))
    assert finding.values["signal"] == name
    zeros[-1] = 1e-9
    assert "zero-effort" not in found(**{"torque": None, name: zeros})


def test_an_effort_that_is_zero_on_one_joint() -> None:
    """Zero, not also stuck; on a joint at rest only where the others' noise shows a sensor."""
    findings = found(torque=scaled(TORQUE, 0.0, 5))
    assert set(findings) == {"zero-effort"}
    assert findings["zero-effort"].where.joints == (5,)
    rest = {"q": scaled(Q, 0.0, 5), "dq": scaled(DQ, 0.0, 5)}
    assert "zero-effort" in found(torque=scaled(TORQUE, 0.0, 5), **rest)
    assert "zero-effort" not in found(torque=scaled(20 * np.cos(Q), 0.0, 5), **rest)


@pytest.mark.parametrize(
    ("name", "level"),
    [("tau_ext", "warning"), ("wrench", "warning"), ("target_torque", "fact"), ("dq", "fact")],
)
def test_signals_that_are_all_zero(name: str, level: str) -> None:
    code = f"zero-{name.replace('_', '-')}"
    zeros = np.zeros_like(Q)
    assert found(**{name: zeros})[code].level == level
    zeros[-1, 0] = 1e-9
    assert code not in found(**{name: zeros})


def test_a_zero_wrench_says_whether_the_torques_beside_it_are_zero() -> None:
    zeros = np.zeros((len(T), 6))
    assert "zero-wrench" in found(wrench=zeros, tau_ext=np.zeros_like(Q))
    assert "zero-wrench-beside-tau-ext" in found(wrench=zeros, tau_ext=TORQUE)


@pytest.mark.parametrize(("step", "reported"), [(1e-4, False), (1e-3, True)])
def test_positions_in_coarse_steps_are_reported(step: float, reported: bool) -> None:
    q = Q + 0.01 * T[:, None]  # no two swings alike
    q[:, [1, 4]] = np.round(q[:, [1, 4]] / step) * step
    findings = found(q=q, dq=DQ + 0.01)
    assert set(findings) == ({"coarse-positions"} if reported else set())
    if reported:
        finding = findings["coarse-positions"]
        assert (finding.where.joints, finding.level) == ((2, 5), "fact")
        assert finding.values["steps_mrad"] == pytest.approx([1e3 * step] * 2)


def test_fast_motion_of_few_samples_is_not_coarse() -> None:
    """At 25 Hz every step is large, but none is a multiple of the smallest."""
    rows = slice(None, None, 4)
    assert "coarse-positions" not in found(t=T[rows], q=Q[rows], dq=DQ[rows])
