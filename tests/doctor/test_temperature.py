"""What the doctor says of joint temperatures: far from the model's, beyond the law, or missing."""

from dataclasses import replace

import numpy as np
import pytest

from vftcli.doctor import in_words
from vftcli.doctor.load import temperature_findings
from vftcli.robots import Robot, load_robot
from vftcli.signals.recording import Recording
from vftcli.signals.remarks import Remark

T = 0.008 * np.arange(500)
SPEED = np.array([1.0, 1.0, 1.0, 1.0, 1.0, 0.0])
"""Joint 6 rests. [rad/s]"""
UR5E = load_robot("ur5e")
LAWLESS = replace(UR5E, friction=tuple(replace(f, temperature=()) for f in UR5E.friction))


def log(temperature: float | None, changes: float = 0.0) -> Recording:
    """An arm that moves to and fro at a temperature that changes by so much. [°C, K]"""
    q = SPEED * np.sin(T)[:, None]
    warm = None if temperature is None else temperature + changes * T[:, None] / T[-1] + 0.0 * q
    return Recording(t=T, q=q, dq=SPEED * np.cos(T)[:, None], temperature=warm)


def found(recording: Recording, robot: Robot = UR5E) -> list[Remark]:
    return list(temperature_findings(recording, robot))


@pytest.mark.parametrize("temperature", [5.0, 20.0, 60.0, 80.0])
def test_where_the_law_holds_there_is_nothing_to_say(temperature: float) -> None:
    if 15.0 < temperature < 65.0:
        assert found(log(temperature)) == []
        return
    (remark,) = found(log(temperature))
    assert (remark.code, remark.level) == ("temperature-beyond-law", "warning")
    assert remark.values["seen_C"][0] == temperature


def test_a_log_without_temperatures_is_reported_with_the_one_assumed() -> None:
    (remark,) = found(log(None))
    assert (remark.code, remark.level) == ("no-temperature", "fact")
    # s(25)/s(35) worked by hand: size 3 2.9177/2.5366, size 1 .64593/.52003
    assert remark.values["least_percent"] == pytest.approx(15.02, abs=0.01)
    assert remark.values["most_percent"] == pytest.approx(24.21, abs=0.01)
    assert "35 °C" in str(remark)
    (same,) = found(log(0.0))  # a controller that measures none writes zeros
    assert same == remark


def test_gaps_are_reported_with_their_share() -> None:
    recording = log(30.0)
    assert recording.temperature is not None
    gaps = recording.temperature.copy()
    gaps[:125, 2] = np.nan
    (remark,) = found(replace(recording, temperature=gaps))
    assert (remark.code, remark.where.joints) == ("temperature-gaps", (3,))
    assert remark.values["share_percent"] == 25.0


def test_without_a_law_a_cold_log_is_reported_with_what_it_means() -> None:
    (remark,) = found(log(25.0), LAWLESS)
    assert (remark.code, remark.level) == ("far-temperature", "warning")
    assert remark.where.joints == (1, 2, 3, 4, 5)  # the sixth rests
    # 10 K at 1.5 % a kelvin of 12.9 N·m at the median speed of |cos|, about .8 rad/s
    assert remark.values["wrong_Nm"][0] == pytest.approx(0.162 * 12.4, rel=0.1)
    assert "temperature law" in in_words(remark).remedy
    assert found(log(30.0), LAWLESS) == []


def test_a_log_that_warms_up_is_far_at_its_cold_end() -> None:
    (remark,) = found(log(26.0, changes=10.0), LAWLESS)
    # a twentieth of the samples lie below
    assert remark.values["seen_C"][0] == pytest.approx(26.5, abs=0.2)


def test_a_temperature_that_nobody_stated_is_assumed() -> None:
    silent = tuple(replace(f, temperature=(), temperature_at=None) for f in UR5E.friction)
    (remark,) = found(log(22.0), replace(UR5E, friction=silent))
    assert (remark.code, remark.level) == ("far-temperature-assumed", "caution")
    assert found(log(27.0), replace(UR5E, friction=silent)) == []


def test_an_arm_without_friction_and_another_arm_s_log_say_nothing() -> None:
    assert found(log(None), UR5E.without_friction()) == []
    assert found(log(5.0), UR5E.without_friction()) == []
    assert found(log(5.0), load_robot("panda")) == []
