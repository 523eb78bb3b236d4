"""A run: what the model says of a recording, of a part of it, and less an error of the model."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from vftcli.readers import read
from vftcli.robots import load_robot
from vftcli.robots.run import SERIES, Run, Runs
from vftcli.signals.recording import Recording

FIXTURE = Path(__file__).parents[2] / "fixtures" / "ur5_circle.csv"
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
    quiet = Run(recording=log, robot=ROBOT)
    driven = Run(recording=replace(log, current=np.ones_like(log.q)), robot=ROBOT)
    np.testing.assert_allclose(driven.model_torque, quiet.model_torque, atol=1e-9)
    assert np.all(quiet.drive_torque == 0.0)
    assert np.all(driven.drive_torque != 0.0)


def test_a_joint_that_stands_is_marked() -> None:
    log = swing()
    dq = log.dq.copy()
    dq[500:800, 2] = 0.0
    run = Run(recording=replace(log, dq=dq), robot=ROBOT)
    assert run.standstill[600, 2] == pytest.approx(0.6)
    assert run.standing[600].tolist() == [False, False, True, False, False, False]
    assert run.step == pytest.approx(0.002)


def test_a_part_of_a_run_keeps_what_belongs_to_joints() -> None:
    run = Run(recording=swing(), robot=ROBOT)
    part = run.part(slice(100, 300))
    for name in ("t", "q", "dq", *SERIES):
        np.testing.assert_array_equal(getattr(part, name), getattr(run, name)[100:300])
    np.testing.assert_array_equal(part.dry_friction, run.dry_friction)
    assert part.name == run.name


def test_a_run_less_a_torque_is_a_run_whose_disturbance_is_less_by_it() -> None:
    """ṗ = μ + τ_ext: with μ larger by τ the disturbance is smaller by τ; the motion stays."""
    run, torque = Run(recording=swing(), robot=ROBOT), np.linspace(0.0, 3.0, 12000).reshape(-1, 6)
    less = run.less(torque)
    np.testing.assert_array_equal(less.terms.mu, run.terms.mu + torque)
    np.testing.assert_array_equal(less.terms.p, run.terms.p)
    assert less.recording is run.recording
    assert less is not run


def test_a_run_is_made_once_for_a_recording_and_a_robot() -> None:
    circle, runs = read(FIXTURE), Runs()
    first = runs.of(circle, ROBOT)
    assert runs.of(circle, ROBOT) is first
    assert first.terms is first.terms
    assert runs.of(circle, ROBOT, literal=True) is not first
    assert runs.of(circle, replace(ROBOT)) is not first
    assert runs.of(replace(circle), ROBOT) is not first
