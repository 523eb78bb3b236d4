"""Payload and drive constants, from what the controller expects, with known faults."""

from dataclasses import replace

import numpy as np
import pytest

from vftcli.doctor import examine
from vftcli.doctor.load import controller_findings, drive_constants, payload_mismatch, resting
from vftcli.robots import load_robot
from vftcli.signals.arrays import Array
from vftcli.signals.recording import Recording
from vftcli.signals.remarks import Remark
from vftcli.simulation import load_scenario, simulate

T = 0.01 * np.arange(400)
TEN = np.full(6, 10.0)
"""Drive constants of 10 N·m/A, so that currents in A are a tenth of the torques in N·m."""


def log(*extra: float) -> Recording:
    """An arm at rest whose joints carry more current than is expected, by so much. [A]"""
    rest = np.zeros((400, 6))
    return Recording(t=T, q=rest, dq=rest, current=rest + np.array(extra), target_current=rest)


@pytest.mark.parametrize(
    ("torques", "joints"),
    [
        ((0.0, 8.0, 8.0, 0.0, 0.0, 0.0), (2, 3)),
        ((0.0, 8.0, -8.0, 8.0, 0.0, 0.0), (2, 3, 4)),
        ((0.0, 4.1, 0.0, -4.1, 0.0, 0.0), (2, 4)),
        ((0.0, 4.1, 3.9, -3.9, 0.0, 0.0), None),  # one joint alone may be its own drive's
        ((36.0, 8.0, 0.0, 0.0, 36.0, 36.0), None),  # the base and the wrist do not tell a load
    ],
)
def test_two_heavy_joints_tell_a_load(torques: tuple, joints: tuple | None) -> None:
    """Each of more than 4 N·m. [N·m]"""
    found = list(payload_mismatch(log(*(np.array(torques) / TEN)), TEN))
    assert [remark.where.joints for remark in found] == ([] if joints is None else [joints])


@pytest.mark.parametrize(("current", "reported"), [(0.39, False), (0.41, True)])
def test_an_unknown_constant_is_taken_for_a_large_drive_s(current: float, reported: bool) -> None:
    """Ten newton metres an ampere, so 0.4 A are the 4 N·m that tell."""
    nowhere = np.full(6, np.nan)
    assert len(list(payload_mismatch(log(0, current, current, 0, 0, 0), nowhere))) == reported
    weak = np.full(6, 5.0)
    assert not list(payload_mismatch(log(0, current, current, 0, 0, 0), weak))


def test_the_numbers_of_a_mismatch() -> None:
    still = log(0, 1.0, -2.0, 0.1, 0, 0)
    assert still.target_current is not None
    still = replace(still, current=2.0 + np.array([0, 1.0, -2.0, 0.1, 0, 0]) + 0 * still.q)
    still = replace(still, target_current=still.target_current + 2.0)
    (unstated,) = payload_mismatch(still, TEN)
    assert (unstated.code, unstated.level) == ("payload-mismatch", "warning")
    assert unstated.where.joints == (2, 3)
    assert dict(unstated.values) == {
        "carried_A": pytest.approx([3.0, 0.0]),
        "expected_A": pytest.approx([2.0, 2.0]),
        "extra_Nm": pytest.approx([10.0, -20.0]),
        "payload_kg": None,
    }
    (reported,) = payload_mismatch(replace(still, payload_mass=0.0), TEN)
    assert (reported.code, reported.values["payload_kg"]) == ("payload-mismatch", 0.0)


@pytest.mark.parametrize(("samples", "reported"), [(19, False), (20, True)])
def test_a_mismatch_needs_twenty_samples_at_rest(samples: int, reported: bool) -> None:
    still = log(0, 1, 1, 0, 0, 0)
    dq = np.where(np.arange(400) < samples, 0.0, 1.0)[:, None] * np.ones(6)
    assert len(list(payload_mismatch(replace(still, dq=dq), TEN))) == reported


def test_a_mismatch_needs_both_currents() -> None:
    still = log(0, 1, 1, 0, 0, 0)
    assert not list(payload_mismatch(replace(still, current=None), TEN))
    assert not list(payload_mismatch(replace(still, target_current=None), TEN))
    assert not list(payload_mismatch(replace(still, dq=None), TEN))


def test_an_arm_rests_where_no_joint_is_meant_to_move_and_none_does() -> None:
    """By what is commanded, which has no noise, up to 2 mrad/s; by what is measured to 10."""

    def speeds(*values: float) -> Array:
        dq = np.zeros((len(values), 6))
        dq[:, 4] = values
        return dq

    def rest(measured: Array, commanded: Array | None) -> list[bool]:
        q = np.zeros_like(measured)
        clock = T[: len(q)]
        return resting(Recording(t=clock, q=q, dq=measured, target_dq=commanded)).tolist()

    around = speeds(1.9e-3, 2.1e-3, -1.9e-3, -2.1e-3)
    assert rest(around, None) == [True, False, True, False]
    assert rest(speeds(0, 0, 0, 0), around) == [True, False, True, False]
    assert rest(speeds(9e-3, 11e-3, -9e-3, -11e-3), speeds(0, 0, 0, 0)) == [True, False] * 2


def controlled(constants: Array, current: Array | None = None) -> Recording:
    """An arm at rest whose controller expects currents and torques of these constants."""
    still = log(0, 0, 0, 0, 0, 0)
    if current is None:
        # slowly changing loads of 1 to 3 A, as in a series of held poses
        current = 2 + np.sin(np.outer(T, np.arange(1, 7)))
    return replace(
        still, current=current, target_current=current, target_torque=current * constants
    )


def test_constants_are_the_controller_s_torque_per_current() -> None:
    planted = np.array([14.0, 13.0, 10.0, 9.5, 9.0, -8.0])
    found = drive_constants(controlled(planted))
    assert found == pytest.approx(planted, rel=1e-12)
    for name in ("target_torque", "target_current"):
        assert np.isnan(drive_constants(replace(controlled(planted), **{name: None}))).all()


@pytest.mark.parametrize(("current", "known"), [(0.019, False), (0.021, True), (-0.021, True)])
def test_constants_need_a_fiftieth_of_an_ampere(current: float, known: bool) -> None:
    found = drive_constants(controlled(TEN, np.full((400, 6), current)))
    assert np.isfinite(found).all() == known


@pytest.mark.parametrize(("samples", "known"), [(9, False), (10, True)])
def test_constants_need_ten_samples(samples: int, known: bool) -> None:
    current = np.where(np.arange(400) < samples, 1.0, 0.0)[:, None] * np.ones(6)
    found = drive_constants(controlled(TEN, current))
    assert np.isfinite(found).all() == known


@pytest.mark.parametrize(("noise", "known"), [(0.04, True), (0.06, False)])
def test_constants_need_torques_that_are_proportional_to_the_currents(
    noise: float, known: bool
) -> None:
    """Up to a twentieth of the torque, as with an offset or friction that the drive model adds."""
    arm = controlled(TEN, np.ones((400, 6)))
    assert arm.target_torque is not None
    wave = np.where(np.arange(400) % 2, 1 + noise, 1 - noise)[:, None]
    found = drive_constants(replace(arm, target_torque=arm.target_torque * wave))
    assert np.isfinite(found).all() == known
    if known:
        assert found == pytest.approx(TEN)


def test_constants_come_from_resting_samples_only() -> None:
    arm = controlled(TEN)
    assert arm.target_torque is not None
    moves = (np.arange(400) >= 200)[:, None]
    found = drive_constants(
        replace(
            arm,
            dq=np.where(moves, 0.5, 0.0) * np.ones(6),
            target_torque=np.where(moves, 3.0, 1.0) * arm.target_torque,
        )
    )
    assert found == pytest.approx(TEN)


def reported_constants(factors: Array) -> list[Remark]:
    """What is reported of a controller that has the UR10e profile's times these."""
    robot = load_robot("ur10e")
    assert robot.torque_constant is not None
    found = controller_findings(controlled(robot.torque_constant * factors), robot)
    return [remark for remark in found if remark.code == "drive-constants"]


@pytest.mark.parametrize(
    ("wrist", "reported"), [(10.9, False), (7.7, True), (7.6, True), (8.5, False)]
)
def test_constants_of_another_joint_size_are_reported(wrist: float, reported: bool) -> None:
    """Of UR's sizes 7.7 N·m/A is one, 10.9 the UR10e's own to 2 %, and 8.5 is none."""
    profile = np.asarray(load_robot("ur10e").torque_constant)
    factors = np.ones(6)
    factors[4] = wrist / profile[4]
    found = reported_constants(factors)
    assert len(found) == reported
    for remark in found:
        assert (remark.level, remark.where.joints) == ("warning", (5,))
        assert dict(remark.values) == {
            "robot": "ur10e",
            "found_Nm_A": pytest.approx([wrist]),
            "profile_Nm_A": pytest.approx([10.763]),
            "worst_percent": pytest.approx(100 * (1 - wrist / 10.763)),
        }


def test_no_constants_are_compared_without_a_robot_that_has_them() -> None:
    arm = controlled(TEN)
    assert list(controller_findings(arm, None)) == []
    assert (
        list(controller_findings(arm, replace(load_robot("ur10e"), torque_constant=None))) == []
    )
    unknown = replace(arm, target_torque=None)
    assert list(controller_findings(unknown, load_robot("ur10e"))) == []


@pytest.mark.slow
def test_a_load_is_off_by_its_deviation() -> None:
    """Simulated UR5s with links 5 % wrong, as their scenarios state.

    Of four normal errors the root mean square is beyond 1.8 deviations once in a hundred.
    """
    errors = []
    for seed, kg in enumerate((0.8, 1.3)):
        for name in ("free-excitation", "ur5-circle"):
            carried = [f"payload.mass={kg}", "payload.com=[0.02,-0.01,0.06]"]
            made = simulate(load_scenario(name, carried), 40 + seed)
            found = examine(made.recording, load_robot("ur5")).findings
            (load,) = (f.values for f in found if f.code in {"light-load", "unmodelled-load"})
            errors.append((load["load_kg"] - kg) / load["sd_kg"])
    assert np.sqrt(np.mean(np.square(errors))) < 1.8
