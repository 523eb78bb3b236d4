"""Payload and drive constants, from what the controller expects, with known faults."""

from dataclasses import replace

import numpy as np
import pytest
from swinging import Said, only

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
    targets = {"target_current": one, "target_torque": constant * one}
    return replace(still, current=still.current + one, **targets)


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
        numbers = {"carried_A": [2.0, -1.0], "expected_A": [1.0, 1.0], "extra_Nm": [10.0, -20.0]}
        expected = {name: pytest.approx(values) for name, values in numbers.items()}
        assert dict(finding.values) == expected | {"payload_kg": payload}


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


LOADS = 2 + np.sin(np.outer(T, np.arange(1, 7)))
"""Slowly changing, 1 to 3 A, as in a series of held poses."""
OTHER = np.array([11.976, 11.976, 9.839, 7.7, 7.7, 7.7])
"""The UR10e's, its wrists with the constants of a smaller joint. [N·m/A]"""
ODD = np.where(np.arange(400) % 2, 1.0, -1.0)[:, None]
LATE = (np.arange(400) >= 200)[:, None] * np.ones(6)


def constants_found(constants, current=LOADS, **changes) -> list[Remark]:
    """What is reported of a controller of these constants beside the UR10e profile's."""
    current = np.broadcast_to(current, (400, 6))
    still = replace(log(0, 0, 0, 0, 0, 0), current=current, target_current=current)
    still = replace(still, target_torque=current * constants)
    found = controller_findings(replace(still, **changes), UR10E)
    return [remark for remark in found if remark.code == "drive-constants"]


@pytest.mark.parametrize(
    ("current", "changes", "known"),
    [
        (LOADS, {}, True),
        (LOADS, {"target_torque": None}, False),
        (LOADS, {"target_current": None}, False),
        # of a fiftieth of an ampere and more, in ten samples
        (0.019, {}, False),
        (0.021, {}, True),
        (-0.021, {}, True),
        ((np.arange(400) < 9)[:, None], {}, False),
        ((np.arange(400) < 10)[:, None], {}, True),
        # a twentieth of the torque may be an offset or friction that the drive model adds
        (1.0, {"target_torque": OTHER * (1 + 0.04 * ODD)}, True),
        (1.0, {"target_torque": OTHER * (1 + 0.06 * ODD)}, False),
        # of resting samples only
        (1.0, {"dq": 0.5 * LATE, "target_torque": OTHER * (1 + 2 * LATE)}, True),
    ],
)
def test_constants_are_the_controller_s_torque_per_current(current, changes, known):
    found = constants_found(OTHER, current, **changes)
    assert [remark.where.joints for remark in found] == [(4, 5, 6)] * known
    for remark in found:
        assert remark.values["found_Nm_A"] == pytest.approx([7.7] * 3)


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


TIMES = 0.008 * np.arange(500)
SPEED = np.array([1.0, 1.0, 1.0, 1.0, 1.0, 0.0])  # Joint 6 rests. [rad/s]
UR5E = load_robot("ur5e")
LAWLESS = replace(UR5E, friction=tuple(replace(f, temperature=()) for f in UR5E.friction))
SILENT = replace(UR5E, friction=tuple(replace(f, temperature_at=None) for f in LAWLESS.friction))


def warm_log(temperature: float | None, changes: float = 0.0) -> Recording:
    """An arm that moves to and fro at a temperature that changes by so much. [°C, K]"""
    q = SPEED * np.sin(TIMES)[:, None]
    warm = None
    if temperature is not None:
        warm = temperature + changes * TIMES[:, None] / TIMES[-1] + 0.0 * q
    return Recording(t=TIMES, q=q, dq=SPEED * np.cos(TIMES)[:, None], temperature=warm)


def with_gaps(recording: Recording) -> Recording:
    missing = (np.arange(500)[:, None] < 125) & (np.arange(6) == 2)
    return replace(recording, temperature=np.where(missing, np.nan, recording.temperature))


def found(recording: Recording, robot: Robot = UR5E) -> dict[str, Remark]:
    return {remark.code: remark for remark in temperature_findings(recording, robot)}


def far(code: str, temperature: float, level: str = "warning") -> Said:
    """The sixth joint rests."""
    seen = pytest.approx([temperature] * 5, abs=0.2)
    return only(code, 1, 2, 3, 4, 5, level=level, seen_C=seen)


# s(25)/s(35) worked by hand: size 3 2.9177/2.5366, size 1 .64593/.52003
SHARES = {"least_percent": 15.02, "most_percent": 24.21}
ROUNDED = {name: pytest.approx(percent, abs=0.01) for name, percent in SHARES.items()}
NONE = only("no-temperature", level="fact", reference_C=[35.0], **ROUNDED)


@pytest.mark.parametrize(
    ("recording", "robot", "said"),
    [
        # where the law holds there is nothing to say
        (warm_log(20.0), UR5E, only()),
        (warm_log(60.0), UR5E, only()),
        (warm_log(5.0), UR5E, far("temperature-beyond-law", 5.0)),
        (warm_log(80.0), UR5E, far("temperature-beyond-law", 80.0)),
        (warm_log(None), UR5E, NONE),
        (warm_log(0.0), UR5E, NONE),  # a controller that measures none writes zeros
        (with_gaps(warm_log(30.0)), UR5E, only("temperature-gaps", 3, share_percent=25.0)),
        (warm_log(30.0), LAWLESS, only()),
        # one that warms up is far at its cold end: a twentieth of the samples lie below
        (warm_log(26.0, changes=10.0), LAWLESS, far("far-temperature", 26.5)),
        # a temperature that nobody stated is assumed
        (warm_log(22.0), SILENT, far("far-temperature-assumed", 22.0, level="caution")),
        (warm_log(27.0), SILENT, only()),
        (warm_log(None), replace(UR5E, friction=()), only()),
        (warm_log(5.0), replace(UR5E, friction=()), only()),
        (warm_log(5.0), load_robot("panda"), only()),
    ],
)
def test_joint_temperatures_far_from_the_model_s_are_reported(recording, robot, said):
    said.check(found(recording, robot))


def test_without_a_law_a_cold_log_is_reported_with_what_it_means():
    remark = found(warm_log(25.0), LAWLESS)["far-temperature"]
    # 10 K at 1.5 % a kelvin of 12.9 N·m at the median speed of |cos|, about .8 rad/s
    assert remark.values["wrong_Nm"][0] == pytest.approx(0.162 * 12.4, rel=0.1)
    assert "temperature law" in in_words(remark).remedy
