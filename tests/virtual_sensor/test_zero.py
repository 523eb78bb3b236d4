"""Zero drift: removed, reported, and suspected where it is a contact."""

import numpy as np
import pytest

from vftcli.signals.errors import ParameterError
from vftcli.signals.wrench import Wrench
from vftcli.virtual_sensor.zero import (
    change,
    loaded_zero,
    unloaded_start,
    without_drift,
    zero_drift,
)

DRIFT = np.array([-0.43166, -0.53348, 0.83768, -0.16294, 0.13407, 0.09103])
"""The paper's zero drift of the Panda, Sec. IV-D. [N, N·m]"""


def hung(masked: bool = False, noise: float = 0.05) -> Wrench:
    """Ten seconds at 100 Hz: drift, then 9.2 N hang on the flange from 5 s on."""
    t = np.arange(0.0, 10.0, 0.01)
    rng = np.random.default_rng(0)
    values = DRIFT + noise * rng.standard_normal((len(t), 6))
    values[t >= 5.0, 2] -= 9.2
    return Wrench(name="kfo-fe", t=t, values=values, frame="base", masked=np.full(len(t), masked))


def test_the_drift_is_the_mean_of_the_span_and_its_removal_leaves_the_load() -> None:
    wrench = hung()
    drift = zero_drift(wrench, (1.0, 4.5))
    # the mean of 350 samples of 0.05 N noise: 0.003 N
    np.testing.assert_allclose(drift.mean, DRIFT, atol=0.015)
    clean = without_drift(wrench, drift)
    assert clean.force[wrench.t > 5.5, 2].mean() == pytest.approx(-9.2, rel=0.002)
    assert "zero drift over 1 to 4.5 s in base axes, removed" in clean.remarks[-1]


def test_the_change_between_two_spans_is_told() -> None:
    wrench = hung(noise=0.0)
    words = change(zero_drift(wrench, (1, 2)), zero_drift(wrench, (6, 7)))
    assert "fz -9.20000" in words


def test_the_unloaded_start_ends_where_the_load_begins() -> None:
    span = unloaded_start(hung())
    assert span is not None
    assert span[0] == pytest.approx(1.0)
    # the load begins at 5 s; 0.3 s are left out before it
    assert span[1] == pytest.approx(4.7, abs=0.02)


def test_a_log_too_short_or_masked_has_no_unloaded_start() -> None:
    assert unloaded_start(hung(masked=True)) is None
    t = np.arange(0.0, 1.2, 0.01)
    short = Wrench(name="x", t=t, values=np.zeros((len(t), 6)), frame="base")
    assert unloaded_start(short) is None


def test_a_zero_inside_a_contact_is_suspected_and_an_unloaded_one_is_not() -> None:
    wrench = hung()
    assert loaded_zero(wrench, zero_drift(wrench, (2.0, 4.0))) == ""
    words = loaded_zero(wrench, zero_drift(wrench, (6.0, 8.0)))
    assert "looks like a contact" in words
    assert "choose an unloaded span" in words


def test_a_zero_outside_the_log_is_refused() -> None:
    with pytest.raises(ParameterError, match="zero interval 20:30 lies outside the log"):
        zero_drift(hung(), (20.0, 30.0))


def test_a_zero_in_a_masked_span_is_refused() -> None:
    with pytest.raises(ParameterError, match="the pose cannot tell the wrench"):
        zero_drift(hung(masked=True), (1.0, 4.0))
