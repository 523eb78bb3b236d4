"""The bearing of Sec. IV-D, simulated: what hangs on the flange is what is read."""

from dataclasses import replace

import numpy as np
import pytest

from vftcli.notebook import report
from vftcli.signals.arrays import Z_95
from vftcli.simulation import load_scenario, simulate

pytestmark = pytest.mark.slow

WEIGHT = 9.2  # Weight of the bearing, Sec. IV-D. [N]


def recorded(scenario):
    """The first 9 s: moved unloaded from 0.5 to 3.5 s, the bearing hung on at 4 s."""
    return simulate(replace(scenario, duration=9.0)).recording


@pytest.fixture(scope="module")
def exact():
    """The arm is what its profile says, but for the stiction that no profile has."""
    scenario = load_scenario("panda-bearing")
    return recorded(replace(scenario, mismatch=type(scenario.mismatch)()))


@pytest.fixture(scope="module")
def erring():
    """The arm differs from its profile, as the scenario says."""
    return recorded(load_scenario("panda-bearing"))


def sensed(recording, **zero):
    # The file's R and Q as densities: as a sample's variances they let more of the noise through.
    density = {"kfo.noise_convention": "density"}
    return report(recording, "panda", frame="base", settings=density, **zero)


@pytest.mark.parametrize(("log", "share"), [("exact", 0.02), ("erring", 0.025)])
def test_after_zeroing_the_bearing_weighs_what_it_weighs(log, share, request):
    """Within 2 % of 9.2 N by every observer of the paper; the paper reads 9.66 N.

    The smoothed wrench of `best` shares a force that stays with the error of the model, since these
    9 s do not tell them apart: what it misses in the mean, 2.9 N, its band of ± 3.2 N holds.

    With errors in the profile the state in which stiction holds the loaded arm adds to it: 0.2 N
    (measured 9.00, 9.16 and 9.15 N with seeds 1 to 3).
    """
    recording = request.getfixturevalue(log)
    analysis = sensed(recording, zero="2:3.9")
    hung = (recording.t > 6.0) & (recording.t < 8.7)
    best, *others = analysis.wrenches
    for wrench in others:
        assert wrench.force[hung, 2].mean() == pytest.approx(-WEIGHT, rel=share), wrench.name
    assert best.name == "best"
    missed = abs(best.force[hung, 2].mean() + WEIGHT)
    assert missed <= Z_95 * best.sd[hung, 2].mean()
    assert not any(r.level == "warning" for r in analysis.virtual_sensor.remarks)
    assert all(drift.removed for drift in analysis.virtual_sensor.drifts)


def test_with_the_exact_profile_the_moving_arm_reads_nothing(exact):
    """F_z ≤ 0.6 N rms while moving unloaded: what is left is stiction the profile has not."""
    moving = (exact.t > 0.5) & (exact.t < 3.5)
    for wrench in sensed(exact).wrenches:
        rms = np.sqrt(np.mean(wrench.force[moving, 2] ** 2))
        assert rms <= 0.6, f"{wrench.name}: {rms:.3f} N"
