"""An effort that is late by a known time is found by that alone, not by what else may be odd."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from swinging import Said, only

from vftcli.doctor import examine
from vftcli.doctor.lateness import effort_lag
from vftcli.robots import load_robot
from vftcli.robots.kernels import chain_parameters, torque_regressor
from vftcli.signals.recording import Recording
from vftcli.signals.remarks import Remark

ARM = load_robot("ur5e")
STEP = 0.01
T = STEP * np.arange(2000)
RATES = 0.9 + 0.3 * np.arange(6)
"""Every joint turns round every one to three seconds. [rad/s]"""


def log_of(late=0.0, push=0.0, scale=1.0, *, rate=0.0, clock=T) -> Recording:
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
    phi = chain_parameters(ARM.chain)
    torque = torque_regressor(ARM.chain, 0.6 * x, 0.6 * dx, 0.6 * ddx) @ phi
    torque += 4 * np.tanh(60 * dx) + 3 * dx
    torque += push * np.clip(np.sin(2 * np.pi * t / 4) - 0.6, 0, None)[:, None] / 0.4
    torque += np.random.default_rng(0).normal(0, 0.3, torque.shape)
    return Recording(t=clock, q=q, dq=dq, torque=scale * torque)


def reported(log: Recording) -> dict[str, Remark]:
    found = {finding.code: finding for finding in effort_lag(log, ARM)}
    assert len(found) <= 1
    return found


def lag(late: float, order: str) -> Said:
    """To a hundredth of a second: lags are tried that far apart."""
    lag_ms = pytest.approx(1e3 * late, abs=10.1)
    return only("effort-lag", level="warning", lag_ms=lag_ms, order=order)


def drift(rate: float, pace: str) -> Said:
    """To half of the .05 s by which tried growths of the lag lie apart within 19.5 s: .13 %."""
    percent = pytest.approx(100 * rate, abs=0.13)
    return only("effort-drift", level="warning", drift_percent=percent, pace=pace)


def moving_on(joints: int) -> Recording:
    log = log_of(0.06)
    return replace(log, dq=log.require("dq") * (np.arange(6) < joints))


def thinned(every: int) -> Recording:
    log = log_of(0.12)
    return replace(log, **{name: getattr(log, name)[::every] for name in ("t", *log.signals)})


def as_current(log: Recording) -> Recording:
    return replace(log, torque=None, current=log.torque)


def with_offset(log: Recording) -> Recording:
    return replace(log, torque=log.require("torque") + 10.0)


CASES = [
    *((partial(log_of, late), lag(late, "later")) for late in (0.05, 0.1, 0.2)),
    (partial(log_of, -0.06), lag(0.06, "earlier")),
    (partial(log_of, 0.06, 5.0), lag(0.06, "later")),  # pushes hide none
    # as real friction and drivers have it
    *((partial(log_of, late), only()) for late in (0.0, 0.01, 0.03, -0.03)),
    (partial(log_of, rate=0.001), only()),
    # a wrong unit or sign, pushes of 5 N·m on every joint for a fifth of the time
    *((partial(log_of, scale=scale), only()) for scale in (-1.0, 0.1, 100.0)),
    (partial(log_of, push=5.0), only()),
    *((partial(log_of, rate=0.005, push=push), drift(0.005, "slow")) for push in (0.0, 5.0)),
    *((partial(log_of, rate=-0.01, push=push), drift(0.01, "fast")) for push in (0.0, 5.0)),
    # .5 % of 200 s is a second, more than any lag that is tried: the first minute shows it
    (partial(log_of, rate=0.005, clock=STEP * np.arange(20000)), drift(0.005, "slow")),
    # a second without samples every two: no window reaches across
    (partial(log_of, 0.1, clock=T + np.arange(2000) // 200), lag(0.1, "later")),
    (lambda: with_offset(log_of()), only()),
    (lambda: as_current(log_of(0.06, scale=0.1)), lag(0.06, "later")),
    (lambda: replace(log_of(0.06), torque=None), only()),
    # three joints have to agree: noise and contact on two may look like a lag
    (partial(moving_on, 2), only()),
    (partial(moving_on, 3), lag(0.06, "later")),
    # below thirty samples a second none is reported
    (partial(thinned, 3), lag(0.12, "later")),
    (partial(thinned, 4), only()),
    (partial(log_of, 0.06, clock=STEP * np.arange(30)), only()),  # nor of a short log
]


@pytest.mark.parametrize(("log", "said"), CASES)
def test_a_late_effort_is_reported_with_its_lag_or_drift(log, said):
    found = reported(log())
    said.check(found)
    if "effort-lag" in found:
        assert found["effort-lag"].values["ratio"] > 1.45


def test_an_arm_of_other_joints_tells_nothing():
    assert not list(effort_lag(log_of(0.06), load_robot("panda")))


def test_an_effort_beside_late_velocities_is_not_called_early():
    """Whichever is late, it is reported once: by the velocity, which the position judges."""
    log = log_of()
    late = log.require("dq")[np.maximum(np.arange(2000) - 6, 0)]
    codes = {finding.code for finding in examine(replace(log, dq=late), ARM).findings}
    assert "velocity-lag" in codes
    assert "effort-lag" not in codes
    codes = {finding.code for finding in examine(log_of(0.06), ARM).findings}
    assert "effort-lag" in codes
    assert "velocity-lag" not in codes
