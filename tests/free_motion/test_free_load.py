"""A payload that nobody named: weighed in the free part, and not mistaken for noise."""

from dataclasses import replace

import numpy as np
import pytest

from vftcli.bias.baseline import Baseline, baseline_of, free_reading
from vftcli.free_motion import FreeChoice
from vftcli.free_motion.free_motion import FreeLoad, FreeMotion, columns, free_load
from vftcli.observers.tuning import tune_to_spectra
from vftcli.robots import load_robot
from vftcli.robots.chain import flange_jacobian
from vftcli.robots.kernels import load_regressor
from vftcli.robots.run import Run, RunSamples
from vftcli.robots.terms import gain_sd
from vftcli.signals.arrays import rms_of_known
from vftcli.signals.external_torque import DynamicsTerms
from vftcli.signals.recording import Recording

ROBOT = load_robot("ur5")
PAYLOAD = np.array([2.8, 0.05, 0.02, 0.17])
"""Mass and first moment. [kg, kg·m]"""


@pytest.fixture
def log(circle) -> Recording:
    return circle.recording


def carrying(log: Recording) -> Recording:
    """The log as it were had the arm carried the payload: its drives hold the weight."""
    weight = load_regressor(ROBOT.chain, log.q) @ PAYLOAD
    return replace(log, current=log.current - weight / ROBOT.torque_constant)


def baseline(log: Recording) -> Baseline:
    run = Run(recording=log, robot=ROBOT)
    return baseline_of(FreeMotion(log=run, choice=FreeChoice(cycles=(1,))))


def test_a_payload_is_weighed_and_reported(log: Recording) -> None:
    """Friction the profile misses is 10 % of its own here: some 1 N·m, .2 kg at the elbow.

    The drives' constants are known to a share of what they read: mass and moment alike.
    """
    found = baseline(carrying(log))
    load, gain = found.load, gain_sd(log, ROBOT)
    assert load is not None
    assert load.mass == pytest.approx(2.8, abs=0.3)
    assert load.sd >= gain * load.mass
    assert np.all(load.moment_sd >= gain * np.abs(load.moment))
    (remark,) = [r for r in found.remarks if r.code == "free-part-loaded"]
    assert remark.values["load_kg"] == load.mass
    assert str(remark)


def test_its_wrench_is_what_its_torque_comes_from(log: Recording) -> None:
    """τ = Jᵀw; of 2.8 ± .1 kg each axis of the force is known to .1 kg of weight."""
    load = FreeLoad(
        mass=2.8, moment=PAYLOAD[1:], sd=0.1, moment_sd=np.array([0.01, 0.02, 0.03]), share=0.5
    )
    run, q = Run(recording=log, robot=ROBOT), log.q
    wrench, covariance = load.wrench(ROBOT.chain, q)
    J = flange_jacobian(ROBOT.chain, q)
    np.testing.assert_allclose(np.einsum("tij,ti->tj", J, wrench), load.torque(run), atol=1e-10)
    sd = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
    np.testing.assert_allclose(sd[:, :3], np.broadcast_to([0, 0, 0.981], (len(q), 3)), rtol=1e-3)
    assert not sd[:, 5].any()  # weight turns about no vertical line
    assert np.all(sd[:, 3:5] <= 9.81 * 0.03 * np.sqrt(2.0))


def test_no_load_is_found_where_there_is_none(log: Recording) -> None:
    """In a simulation without noise or torque no joint has anything left over to divide by."""
    assert baseline(log).load is None
    assert free_load(()) is None
    still = replace(
        log, q=np.zeros_like(log.q), dq=np.zeros_like(log.q), current=0.0 * log.current
    )
    weightless = replace(ROBOT, chain=replace(ROBOT.chain, gravity=np.zeros(3)))
    run = Run(recording=still, robot=weightless)
    assert free_load((RunSamples(run, log.t > 1.0),)) is None


def test_a_payload_is_torque_and_no_noise(log: Recording) -> None:
    """Gains and free error stay those of the unloaded arm, and the weight stays in the estimate."""
    plain, loaded = baseline(log), baseline(carrying(log))
    blind = replace(loaded, load=None)
    moving = [0, 1, 2, 3, 5]
    rms, weight = {}, load_regressor(ROBOT.chain, log.q) @ PAYLOAD
    for name, found in (("plain", plain), ("loaded", loaded), ("blind", blind)):
        observer = tune_to_spectra("rts-auto", found.spectra)
        reading = free_reading(
            found, observer, observer.estimate(found.of(found.motion.log).terms)
        )
        rms[name] = rms_of_known(reading.samples)[moving]
        if found is loaded:
            # what the arm carries is in the estimate, free part and all
            mean = reading.estimate.tau.mean(axis=0)
            np.testing.assert_allclose(mean[1:3], weight.mean(axis=0)[1:3], rtol=0.2)
    assert np.all(rms["loaded"] < 1.5 * rms["plain"])
    assert np.max(rms["blind"] / rms["plain"]) > 3.0


@pytest.mark.parametrize(
    ("mass", "ratio", "seconds", "is_found"),
    [
        (3.0, 1.0, 20.0, True),  # 1/√2 of the disturbance is left
        (0.5, 0.05, 20.0, True),
        (0.3, 0.05, 20.0, False),  # lighter than what drive constants look like
        (3.0, 2.0, 60.0, False),  # 2/√5 is left, whatever the standard deviation
        (3.0, 1.0, 1.1, False),  # four such stretches of .3 s: 3 ± .9 kg
    ],
)
def test_a_load_is_believed_by_its_mass_its_sd_and_what_it_leaves(
    mass: float, ratio: float, seconds: float, is_found: bool
) -> None:
    """A disturbance of 3.2 Hz beside the load's torque, `ratio` times as large on each joint."""
    t, k = 0.008 * np.arange(round(seconds / 0.008)), np.arange(6.0)
    phase = t[:, None] * (1.0 + 0.3 * k) + k
    q = np.array([0.0, -1.35, 1.9, -2.1, -1.57, 0.0]) + 0.6 * np.sin(phase)
    dq = 0.6 * (1.0 + 0.3 * k) * np.cos(phase)
    load = load_regressor(ROBOT.chain, q) @ (PAYLOAD * mass / 2.8)
    beside = np.sqrt(2.0 * np.mean(load**2, axis=0)) * np.sin(20.0 * t[:, None] + 2.0 * k)
    still = Run(recording=Recording(t=t, q=q, dq=dq, torque=np.zeros_like(q)), robot=ROBOT)
    offset = 0.05 * still.dry_friction * (-1.0) ** k  # each joint's own, and no load
    terms = DynamicsTerms(t=t, p=np.zeros_like(q), mu=-(load + ratio * beside + offset))
    found = free_load((RunSamples(still.holding(terms=terms), t >= 0.0),))
    assert (found is not None) == is_found
    if found is not None:
        assert found.mass == pytest.approx(mass, rel=0.01)  # ends of the filter
        assert found.share == pytest.approx(ratio / np.hypot(1.0, ratio), abs=0.05)


def test_what_lies_far_from_a_piece_is_not_heard(
    log: Recording, monkeypatch: pytest.MonkeyPatch
) -> None:
    """e^(−2π 6 Hz · sin(π/8) · 2 s) = 3e-13 of signals up to 100 N·m, forward and back."""
    piece = RunSamples(Run(recording=log, robot=ROBOT), (log.t > 8) & (log.t < 9))
    near = columns(piece)
    monkeypatch.setattr("vftcli.free_motion.free_motion.HEARD", 100.0)
    whole = columns(piece)
    for found, expected in zip(near, whole, strict=True):
        np.testing.assert_allclose(found, expected, atol=1e-9)
    dq, friction = log.dq[near[0]], np.diagonal(near[2][:, :, 4:10], axis1=1, axis2=2)
    fast = abs(dq) > 0.1  # tanh(5) is 1 − 1e-4; the filter takes less than .02 rad/s
    np.testing.assert_allclose(friction[fast], np.sign(dq[fast]), atol=1e-3)
