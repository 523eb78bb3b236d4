"""An effort that is late by a known time is found by that alone, not by what else may be odd."""

from dataclasses import replace

import numpy as np
import pytest

from vftcli.doctor import examine
from vftcli.doctor.lateness import effort_lag
from vftcli.robots import load_robot
from vftcli.robots.kernels import chain_parameters, torque_regressor
from vftcli.signals.arrays import Array
from vftcli.signals.recording import Recording
from vftcli.signals.remarks import Remark

ARM = load_robot("ur5e")
STEP = 0.01
T = STEP * np.arange(2000)
RATES = 0.9 + 0.3 * np.arange(6)
"""Every joint turns round every one to three seconds. [rad/s]"""


def log_of(
    late: float = 0.0,
    push: float = 0.0,
    scale: float = 1.0,
    *,
    rate: float = 0.0,
    clock: Array = T,
) -> Recording:
    """20 s of motion under the arm's own torque, friction and noise of 0.3 N·m.

    Args:
        late: By how much the torque is logged later. [s]
        push: Height of a push of 0.8 s every 4 s on each joint. [N·m]
        scale: Factor of the torque.
        rate: By how much it is later still with every second. [s/s]
        clock: When the samples are. (T,) [s]
    """
    angle = np.outer(clock, RATES) + np.arange(6)
    q, dq = 0.6 * np.sin(angle), 0.6 * RATES * np.cos(angle)
    t = clock - late - rate * clock
    angle = np.outer(t, RATES) + np.arange(6)
    x, dx, ddx = np.sin(angle), RATES * np.cos(angle), -(RATES**2) * np.sin(angle)
    torque = torque_regressor(ARM.chain, 0.6 * x, 0.6 * dx, 0.6 * ddx) @ chain_parameters(
        ARM.chain
    )
    torque += 4 * np.tanh(60 * dx) + 3 * dx
    torque += push * np.clip(np.sin(2 * np.pi * t / 4) - 0.6, 0, None)[:, None] / 0.4
    torque += np.random.default_rng(0).normal(0, 0.3, torque.shape)
    return Recording(t=clock, q=q, dq=dq, torque=scale * torque)


def reported(log: Recording) -> Remark | None:
    """The finding, None without one."""
    found = list(effort_lag(log, ARM))
    assert len(found) <= 1
    return found[0] if found else None


@pytest.mark.parametrize(
    ("late", "push"), [(0.05, 0.0), (0.1, 0.0), (0.2, 0.0), (-0.06, 0.0), (0.06, 5.0)]
)
def test_the_lag_is_reported(late: float, push: float) -> None:
    """To a hundredth of a second: lags are tried that far apart. Pushes hide none."""
    finding = reported(log_of(late, push))
    assert finding is not None
    assert (finding.code, finding.level) == ("effort-lag", "warning")
    assert finding.values["lag_ms"] == pytest.approx(1e3 * abs(late), abs=10.1)
    assert finding.values["order"] == ("later" if late > 0 else "earlier")
    assert finding.values["ratio"] > 1.45
    assert set(finding.where.joints) <= {1, 2, 3, 4, 5, 6}


@pytest.mark.parametrize(
    "log",
    [
        # as real friction and drivers have it
        *({"late": late} for late in (0.0, 0.01, 0.03, -0.03)),
        {"rate": 0.001},
        *({"scale": scale} for scale in (-1.0, 0.1, 100.0)),
        {"push": 5.0},
    ],
    ids=str,
)
def test_what_is_no_lag_is_not_reported(log: dict[str, float]) -> None:
    """A small lag, a wrong unit or sign, pushes of 5 N·m on every joint for a fifth of the time."""
    assert reported(log_of(**log)) is None


@pytest.mark.parametrize("push", [0.0, 5.0])
@pytest.mark.parametrize(("rate", "pace"), [(0.005, "slow"), (-0.01, "fast")])
def test_a_clock_of_the_effort_is_reported_by_its_rate(
    rate: float, pace: str, push: float
) -> None:
    """To half of the .05 s by which tried growths of the lag lie apart within 19.5 s: .13 %."""
    finding = reported(log_of(rate=rate, push=push))
    assert finding is not None
    assert (finding.code, finding.level) == ("effort-drift", "warning")
    assert finding.values["drift_percent"] == pytest.approx(100 * abs(rate), abs=0.13)
    assert finding.values["pace"] == pace


def test_the_first_minute_shows_a_drift_in_a_long_log() -> None:
    """.5 % of 200 s is a second, more than any lag that is tried."""
    finding = reported(log_of(rate=0.005, clock=STEP * np.arange(20000)))
    assert finding is not None
    assert finding.code == "effort-drift"
    assert finding.values["drift_percent"] == pytest.approx(0.5, abs=0.05)


def test_gaps_hide_no_lag() -> None:
    """A second without samples every two: no window reaches across."""
    finding = reported(log_of(0.1, clock=T + np.arange(2000) // 200))
    assert finding is not None
    assert finding.values["lag_ms"] == pytest.approx(100.0, abs=10.1)


def test_an_offset_is_no_lag() -> None:
    log = log_of()
    assert reported(replace(log, torque=log.require("torque") + 10.0)) is None


def test_a_current_is_judged_as_a_torque_is() -> None:
    log = log_of(0.06, scale=0.1)
    assert reported(replace(log, torque=None, current=log.torque)) is not None
    assert reported(replace(log, torque=None)) is None


@pytest.mark.parametrize(("joints", "agreed"), [(2, False), (3, True)])
def test_two_joints_tell_no_lag(joints: int, agreed: bool) -> None:
    """Three have to agree: noise and contact on two may look like a lag."""
    log = log_of(0.06)
    moving = np.arange(6) < joints
    finding = reported(replace(log, dq=log.require("dq") * moving))
    assert (finding is not None) == agreed


@pytest.mark.parametrize(("thinned", "reported_by"), [(3, True), (4, False)])
def test_below_thirty_samples_a_second_no_lag_is_reported(
    thinned: int, reported_by: bool
) -> None:
    log = log_of(0.12)
    rows = slice(None, None, thinned)
    signals = {name: getattr(log, name)[rows] for name in ("t", *log.signals)}
    assert (reported(replace(log, **signals)) is not None) == reported_by


def test_an_arm_of_other_joints_tells_nothing() -> None:
    assert not list(effort_lag(log_of(0.06), load_robot("panda")))
    assert reported(log_of(0.06, clock=STEP * np.arange(30))) is None  # nor does a short log


def test_an_effort_beside_late_velocities_is_not_called_early() -> None:
    """Whichever is late, it is reported once: by the velocity, which the position judges."""
    log = log_of()
    late = log.require("dq")[np.maximum(np.arange(2000) - 6, 0)]
    codes = {finding.code for finding in examine(replace(log, dq=late), ARM).findings}
    assert "velocity-lag" in codes
    assert "effort-lag" not in codes
    codes = {finding.code for finding in examine(log_of(0.06), ARM).findings}
    assert "effort-lag" in codes
    assert "velocity-lag" not in codes
