"""Loads and joint temperatures, with known faults."""

from dataclasses import replace

import numpy as np
import pytest
from swinging import Said, only

from vftcli.doctor import examine, in_words
from vftcli.doctor.load import temperature_findings
from vftcli.robots import Robot, load_robot
from vftcli.signals.recording import Recording
from vftcli.signals.remarks import Remark
from vftcli.simulation import load_scenario, simulate


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


def far(temperature: float) -> Said:
    """The sixth joint rests."""
    seen = pytest.approx([temperature] * 5, abs=0.2)
    return only("far-temperature", 1, 2, 3, 4, 5, level="warning", seen_C=seen)


# s(25)/s(35) worked by hand: size 3 2.9177/2.5366, size 1 .64593/.52003
SHARES = {"least_percent": 15.02, "most_percent": 24.21}
ROUNDED = {name: pytest.approx(percent, abs=0.01) for name, percent in SHARES.items()}
NONE = only("no-temperature", level="fact", reference_C=[35.0], **ROUNDED)


@pytest.mark.parametrize(
    ("recording", "robot", "said"),
    [
        # a law follows the temperature
        (warm_log(20.0), UR5E, only()),
        (warm_log(60.0), UR5E, only()),
        (warm_log(None), UR5E, NONE),
        (warm_log(0.0), UR5E, NONE),  # a controller that measures none writes zeros
        (with_gaps(warm_log(30.0)), UR5E, only()),
        (with_gaps(warm_log(25.0)), LAWLESS, far(25.0)),
        (warm_log(30.0), LAWLESS, only()),
        # one that warms up is far at its cold end: a twentieth of the samples lie below
        (warm_log(26.0, changes=10.0), LAWLESS, far(26.5)),
        # a temperature that nobody stated is far from none
        (warm_log(22.0), SILENT, only()),
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
