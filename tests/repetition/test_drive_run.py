"""Drive torque and the model's, and where a joint stands."""

from dataclasses import replace

import numpy as np
import pytest

from vftcli.repetition.drive_run import drive_run_of
from vftcli.robots import load_robot
from vftcli.robots.terms import dynamics_terms
from vftcli.signals.recording import Recording

ROBOT = load_robot("ur5")
T = 0.002 * np.arange(2000)


def swing(speed: float = 1.0) -> Recording:
    """Six joints on smooth paths, with their own velocities and no current."""
    phase = speed * np.outer(T, np.linspace(0.4, 1.4, 6)) + np.arange(6.0)
    slope = speed * np.linspace(0.4, 1.4, 6)
    q = 0.5 * np.sin(phase) + np.array([0.3, -1.2, 1.4, -1.7, -1.5, 0.2])
    return Recording(t=T, q=q, dq=0.5 * slope * np.cos(phase), current=np.zeros_like(q))


def test_the_model_s_torque_does_not_depend_on_the_currents() -> None:
    """It is what the motion takes; the drive's torque is what the currents say."""
    log = swing()
    loud = replace(log, current=np.ones_like(log.q))
    quiet = drive_run_of(log, ROBOT, dynamics_terms(log, ROBOT))
    driven = drive_run_of(loud, ROBOT, dynamics_terms(loud, ROBOT))
    np.testing.assert_allclose(driven.model, quiet.model, atol=1e-9)
    assert np.all(quiet.torque == 0.0)
    assert np.all(driven.torque != 0.0)


def test_a_joint_that_stands_is_marked() -> None:
    log = swing()
    dq = log.dq.copy()
    dq[500:800, 2] = 0.0
    log = replace(log, dq=dq)
    run = drive_run_of(log, ROBOT, dynamics_terms(log, ROBOT))
    assert run.standstill_s[600, 2] == pytest.approx(0.6)
    assert run.standing[600].tolist() == [False, False, True, False, False, False]


def test_a_part_of_a_run_keeps_what_belongs_to_joints() -> None:
    log = swing()
    run = drive_run_of(log, ROBOT, dynamics_terms(log, ROBOT))
    part = run.taken(slice(100, 300))
    for name in ("t", "q", "dq", "standing", "standstill_s", "torque", "model", "momentum"):
        np.testing.assert_array_equal(getattr(part, name), getattr(run, name)[100:300])
    assert part.coulomb is run.coulomb
    assert part.name == run.name
