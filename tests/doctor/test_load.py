"""Payload and drive constants, from what the controller expects, with known faults."""

from dataclasses import replace

import numpy as np
import pytest

from vftcli.doctor import examine, in_words
from vftcli.doctor.load import controller_findings, temperature_findings
from vftcli.robots import Robot, load_robot
from vftcli.signals.recording import Recording
from vftcli.signals.remarks import Remark
from vftcli.simulation import load_scenario, simulate

T = 0.01 * np.arange(400)
UR10E = load_robot("ur10e")
PROFILE = np.asarray(UR10E.torque_constant)


def log(*extra: float) -> Recording:
    """An arm at rest whose joints carry more current than is expected, by so much. [A]"""
    rest = np.zeros((400, 6))
    return Recording(t=T, q=rest, dq=rest, current=rest + np.array(extra), target_current=rest)


def with_constants(still: Recording, constant: float) -> Recording:
    """A controller that has these drive constants, by an expected ampere on every joint. [N·m/A]"""
    one = np.ones((400, 6))
    return replace(
        still, current=still.current + one, target_current=one, target_torque=constant * one
    )


def mismatches(still: Recording) -> list[Remark]:
    return list(controller_findings(still, None))


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
@pytest.mark.parametrize("constant", [0.0, 5.0, 20.0])
def test_two_heavy_joints_tell_a_load(torques, joints, constant):
    """Each of more than 4 N·m; an unknown constant is taken for a large drive's, 10 N·m/A."""
    still = log(*(np.array(torques) / (constant or 10.0)))
    found = mismatches(with_constants(still, constant) if constant else still)
    assert [remark.where.joints for remark in found] == ([] if joints is None else [joints])


def test_the_numbers_of_a_mismatch():
    still = with_constants(log(0, 1.0, -2.0, 0.1, 0, 0), 10.0)
    for payload in (None, 0.0):
        (finding,) = mismatches(replace(still, payload_mass=payload))
        assert (finding.code, finding.level) == ("payload-mismatch", "warning")
        assert finding.where.joints == (2, 3)
        assert dict(finding.values) == {
            "carried_A": pytest.approx([2.0, -1.0]),
            "expected_A": pytest.approx([1.0, 1.0]),
            "extra_Nm": pytest.approx([10.0, -20.0]),
            "payload_kg": payload,
        }


@pytest.mark.parametrize(("samples", "reported"), [(19, False), (20, True)])
@pytest.mark.parametrize(
    ("rest", "motion"),
    [
        # measured alone, up to 2 mrad/s
        ((1.9e-3, None), (2.1e-3, None)),
        ((-1.9e-3, None), (-2.1e-3, None)),
        # commanded, which has no noise, up to 2 mrad/s, and measured up to 10
        ((0.0, 1.9e-3), (0.0, 2.1e-3)),
        ((9e-3, 0.0), (-11e-3, 0.0)),
    ],
)
def test_a_mismatch_needs_twenty_samples_at_rest(samples, reported, rest, motion):
    """Speeds at rest and in motion: measured, and commanded if there is any. [rad/s]"""
    rests = (np.arange(400) < samples)[:, None] & np.ones(6, bool)
    still = replace(log(0, 1, 1, 0, 0, 0), dq=np.where(rests, rest[0], motion[0]))
    if rest[1] is not None:
        still = replace(still, target_dq=np.where(rests, rest[1], motion[1]))
    assert len(mismatches(still)) == reported


@pytest.mark.parametrize("name", ["current", "target_current", "dq"])
def test_a_mismatch_needs_both_currents_and_a_rest(name):
    assert not mismatches(replace(log(0, 1, 1, 0, 0, 0), **{name: None}))


def constants_found(constants, current=None, **changes) -> list[Remark]:
    """What is reported of a controller of these constants beside the UR10e profile's."""
    if current is None:
        # slowly changing loads of 1 to 3 A, as in a series of held poses
        current = 2 + np.sin(np.outer(T, np.arange(1, 7)))
    current = np.broadcast_to(current, (400, 6))
    still = replace(log(0, 0, 0, 0, 0, 0), current=current, target_current=current)
    still = replace(still, target_torque=current * constants)
    found = controller_findings(replace(still, **changes), UR10E)
    return [remark for remark in found if remark.code == "drive-constants"]


OTHER = np.array([11.976, 11.976, 9.839, 7.7, 7.7, 7.7])
"""The UR10e's, its wrists with the constants of a smaller joint. [N·m/A]"""


def test_constants_are_the_controller_s_torque_per_current():
    (found,) = constants_found(OTHER)
    assert found.where.joints == (4, 5, 6)
    assert found.values["found_Nm_A"] == pytest.approx([7.7] * 3, rel=1e-12)
    assert not constants_found(OTHER, target_torque=None)
    assert not constants_found(OTHER, target_current=None)


@pytest.mark.parametrize(("current", "known"), [(0.019, False), (0.021, True), (-0.021, True)])
def test_constants_need_a_fiftieth_of_an_ampere(current, known):
    assert bool(constants_found(OTHER, current)) == known


@pytest.mark.parametrize(("samples", "known"), [(9, False), (10, True)])
def test_constants_need_ten_samples(samples, known):
    current = np.where(np.arange(400) < samples, 1.0, 0.0)[:, None]
    assert bool(constants_found(OTHER, current)) == known


@pytest.mark.parametrize(("noise", "known"), [(0.04, True), (0.06, False)])
def test_constants_need_torques_that_are_proportional_to_the_currents(noise, known):
    """Up to a twentieth of the torque, as with an offset or friction that the drive model adds."""
    wave = np.where(np.arange(400) % 2, 1 + noise, 1 - noise)[:, None]
    found = constants_found(OTHER, 1.0, target_torque=OTHER * wave)
    assert bool(found) == known
    if known:
        assert found[0].values["found_Nm_A"] == pytest.approx([7.7] * 3)


def test_constants_come_from_resting_samples_only():
    moves = (np.arange(400) >= 200)[:, None] * np.ones(6)
    (found,) = constants_found(
        OTHER, 1.0, dq=0.5 * moves, target_torque=np.where(moves > 0, 3.0, 1.0) * OTHER
    )
    assert found.values["found_Nm_A"] == pytest.approx([7.7] * 3)


@pytest.mark.parametrize(
    ("wrist", "reported"), [(10.9, False), (7.7, True), (7.6, True), (8.5, False)]
)
def test_constants_of_another_joint_size_are_reported(wrist, reported):
    """Of UR's sizes 7.7 N·m/A is one, 10.9 the UR10e's own to 2 %, and 8.5 is none."""
    found = constants_found(np.where(np.arange(6) == 4, wrist, PROFILE))
    assert len(found) == reported
    for remark in found:
        assert (remark.level, remark.where.joints) == ("warning", (5,))
        assert dict(remark.values) == {
            "robot": "ur10e",
            "found_Nm_A": pytest.approx([wrist]),
            "profile_Nm_A": pytest.approx([10.763]),
            "worst_percent": pytest.approx(100 * (1 - wrist / 10.763)),
        }


def test_no_constants_are_compared_without_a_robot_that_has_them():
    arm = with_constants(log(0, 0, 0, 0, 0, 0), 10.0)
    assert list(controller_findings(arm, None)) == []
    assert list(controller_findings(arm, replace(UR10E, torque_constant=None))) == []


@pytest.mark.slow
def test_a_load_is_off_by_its_deviation():
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


# What the doctor says of joint temperatures: far from the model's, beyond the law, or missing


TIMES = 0.008 * np.arange(500)
SPEED = np.array([1.0, 1.0, 1.0, 1.0, 1.0, 0.0])
"""Joint 6 rests. [rad/s]"""
UR5E = load_robot("ur5e")
LAWLESS = replace(UR5E, friction=tuple(replace(f, temperature=()) for f in UR5E.friction))


def warm_log(temperature: float | None, changes: float = 0.0) -> Recording:
    """An arm that moves to and fro at a temperature that changes by so much. [°C, K]"""
    q = SPEED * np.sin(TIMES)[:, None]
    warm = (
        None
        if temperature is None
        else temperature + changes * TIMES[:, None] / TIMES[-1] + 0.0 * q
    )
    return Recording(t=TIMES, q=q, dq=SPEED * np.cos(TIMES)[:, None], temperature=warm)


def found(recording: Recording, robot: Robot = UR5E) -> list[Remark]:
    return list(temperature_findings(recording, robot))


@pytest.mark.parametrize("temperature", [5.0, 20.0, 60.0, 80.0])
def test_where_the_law_holds_there_is_nothing_to_say(temperature):
    if 15.0 < temperature < 65.0:
        assert found(warm_log(temperature)) == []
        return
    (remark,) = found(warm_log(temperature))
    assert (remark.code, remark.level) == ("temperature-beyond-law", "warning")
    assert remark.values["seen_C"][0] == temperature


def test_a_log_without_temperatures_is_reported_with_the_one_assumed():
    (remark,) = found(warm_log(None))
    assert (remark.code, remark.level) == ("no-temperature", "fact")
    # s(25)/s(35) worked by hand: size 3 2.9177/2.5366, size 1 .64593/.52003
    assert remark.values["least_percent"] == pytest.approx(15.02, abs=0.01)
    assert remark.values["most_percent"] == pytest.approx(24.21, abs=0.01)
    assert "35 °C" in str(remark)
    (same,) = found(warm_log(0.0))  # a controller that measures none writes zeros
    assert same == remark


def test_gaps_are_reported_with_their_share():
    recording = warm_log(30.0)
    gaps = recording.temperature.copy()
    gaps[:125, 2] = np.nan
    (remark,) = found(replace(recording, temperature=gaps))
    assert (remark.code, remark.where.joints) == ("temperature-gaps", (3,))
    assert remark.values["share_percent"] == 25.0


def test_without_a_law_a_cold_log_is_reported_with_what_it_means():
    (remark,) = found(warm_log(25.0), LAWLESS)
    assert (remark.code, remark.level) == ("far-temperature", "warning")
    assert remark.where.joints == (1, 2, 3, 4, 5)  # the sixth rests
    # 10 K at 1.5 % a kelvin of 12.9 N·m at the median speed of |cos|, about .8 rad/s
    assert remark.values["wrong_Nm"][0] == pytest.approx(0.162 * 12.4, rel=0.1)
    assert "temperature law" in in_words(remark).remedy
    assert found(warm_log(30.0), LAWLESS) == []


def test_a_log_that_warms_up_is_far_at_its_cold_end():
    (remark,) = found(warm_log(26.0, changes=10.0), LAWLESS)
    # a twentieth of the samples lie below
    assert remark.values["seen_C"][0] == pytest.approx(26.5, abs=0.2)


def test_a_temperature_that_nobody_stated_is_assumed():
    silent = tuple(replace(f, temperature=(), temperature_at=None) for f in UR5E.friction)
    (remark,) = found(warm_log(22.0), replace(UR5E, friction=silent))
    assert (remark.code, remark.level) == ("far-temperature-assumed", "caution")
    assert found(warm_log(27.0), replace(UR5E, friction=silent)) == []


def test_an_arm_without_friction_and_another_arm_s_log_say_nothing():
    assert found(warm_log(None), UR5E.without_friction()) == []
    assert found(warm_log(5.0), UR5E.without_friction()) == []
    assert found(warm_log(5.0), load_robot("panda")) == []
