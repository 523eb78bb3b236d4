"""The bearing of Sec. IV-D, simulated: what hangs on the flange is what is read."""

from dataclasses import replace

import numpy as np
import pytest

from vftcli.pipeline import Request, analyse, choose_robot
from vftcli.simulation import load_scenario, simulate
from vftcli.wrench.measurement import WrenchRequest

WEIGHT = 9.2
"""Weight of the bearing, Sec. IV-D. [N]"""


@pytest.fixture(scope="module", params=["exact profile", "profile with errors"])
def bearing(request: pytest.FixtureRequest):
    """The first 9 s: moved unloaded from 0.5 to 3.5 s, the bearing hung on at 4 s."""
    scenario = replace(load_scenario("panda-bearing"), duration=9.0)
    if request.param == "exact profile":
        scenario = replace(scenario, mismatch=type(scenario.mismatch)())
    return request.param, simulate(scenario).recording


def test_after_zeroing_the_bearing_weighs_what_it_weighs(bearing) -> None:
    """Within 2 % of 9.2 N by every observer; the paper reads 9.66 N.

    With errors in the profile the state in which stiction holds the loaded arm adds to it: 0.2 N
    (measured 9.00, 9.16 and 9.15 N with seeds 1 to 3).
    """
    kind, recording = bearing
    share = 0.02 if kind == "exact profile" else 0.025
    asked = Request(robot="panda", wrench=WrenchRequest(frame="base", zero=((2.0, 3.9),)))
    analysis = analyse(recording, choose_robot(asked, recording), asked)
    hung = (recording.t > 6.0) & (recording.t < 8.7)
    for wrench in analysis.wrenches:
        assert wrench.force[hung, 2].mean() == pytest.approx(-WEIGHT, rel=share), wrench.name
    assert analysis.virtual_sensor is not None
    assert not analysis.virtual_sensor.warnings
    assert all(drift.removed for drift in analysis.virtual_sensor.drifts)


def test_a_zero_under_the_bearing_is_suspected(bearing) -> None:
    _, recording = bearing
    asked = Request(
        robot="panda", observers=("gmo",), wrench=WrenchRequest(zero=((6.0, 8.0),), frame="base")
    )
    sensed = analyse(recording, choose_robot(asked, recording), asked).virtual_sensor
    assert sensed is not None
    assert "looks like a contact" in sensed.warnings[0]


def test_with_the_exact_profile_the_moving_arm_reads_nothing(bearing) -> None:
    """F_z ≤ 0.6 N rms while moving unloaded: what is left is stiction the profile has not."""
    kind, recording = bearing
    if kind != "exact profile":
        pytest.skip("a claim about the exact profile")
    asked = Request(robot="panda", wrench=WrenchRequest(frame="base"))
    analysis = analyse(recording, choose_robot(asked, recording), asked)
    moving = (recording.t > 0.5) & (recording.t < 3.5)
    for wrench in analysis.wrenches:
        rms = np.sqrt(np.mean(wrench.force[moving, 2] ** 2))
        assert rms <= 0.6, f"{wrench.name}: {rms:.3f} N"
