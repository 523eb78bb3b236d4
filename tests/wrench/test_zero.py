"""Zero drift: removed, reported, and suspected where it is a contact."""

from dataclasses import replace

import numpy as np
import pytest

from vftcli.signals.errors import ParameterError
from vftcli.signals.wrench import Wrench
from vftcli.wrench import ZeroChoice
from vftcli.wrench.sensor import (
    unloaded_start,
    without_drift,
    without_zero,
    zero_drift,
    zero_moved,
    zero_spans,
    zero_warning,
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
    assert clean.remarks[-1].code == "zero-removed"
    assert "drift of 1 to 4.5 s removed (base axes)" in str(clean.remarks[-1])


def test_the_change_between_two_spans_is_reported() -> None:
    wrench = hung(noise=0.0)
    moved = zero_moved(zero_drift(wrench, (1, 2)), zero_drift(wrench, (6, 7)))
    np.testing.assert_allclose(moved.values["force_N"], [0.0, 0.0, -9.2], atol=1e-12)
    np.testing.assert_allclose(moved.values["moment_Nm"], np.zeros(3), atol=1e-12)
    assert moved.where.span == (6, 7)


@pytest.mark.parametrize(
    ("lasts", "size", "stop"),
    [(0, 0.0, 12.99), (0.09, 9, 12.99), (0.11, 9, 7.7), (2, 2.8, 12.99), (2, 3.2, 7.7)],
)
def test_what_is_short_or_light_does_not_end_the_unloaded_start(
    lasts: float, size: float, stop: float
) -> None:
    """From a second after the log's begin at 3 s to .3 s before a load of .1 s and 3 N, if any."""
    t = 3.0 + np.arange(0.0, 10.0, 0.01)
    values = DRIFT + 0.05 * np.random.default_rng(0).standard_normal((len(t), 6))
    values[(t > 7.995) & (t < 7.995 + lasts), 1] += size
    span = unloaded_start(Wrench(name="kfo-fe", t=t, values=values, frame="base"))
    assert span == (pytest.approx(4.0), pytest.approx(stop))


def test_a_log_too_short_or_masked_has_no_unloaded_start() -> None:
    assert unloaded_start(hung(masked=True)) is None
    t = np.arange(0.0, 1.2, 0.01)
    short = Wrench(name="x", t=t, values=np.zeros((len(t), 6)), frame="base")
    assert unloaded_start(short) is None


def test_a_zero_inside_a_contact_is_suspected_and_an_unloaded_one_is_not() -> None:
    wrench = hung()
    assert zero_warning(wrench, zero_drift(wrench, (2.0, 4.0))) == ()
    (remark,) = zero_warning(wrench, zero_drift(wrench, (6.0, 8.0)))
    assert (remark.code, remark.level) == ("zero-far-from-start", "warning")
    assert (remark.values["axis"], remark.values["unit"]) == ("fz", "N")
    # the load less six standard deviations of .05 N of noise
    assert remark.values["size"] == pytest.approx(9.2 - 0.3, abs=0.05)


def test_a_zero_across_the_begin_of_a_contact_swings() -> None:
    no_start = replace(hung(), masked=np.arange(1000) < 300)
    twice = replace(no_start, values=no_start.values + (no_start.values - DRIFT))
    (remark,) = zero_warning(twice, zero_drift(twice, (4.0, 6.0)))
    assert (remark.code, remark.values["axis"]) == ("zero-swings", "fz")
    # 18.4 N exceed the 12 N that are four times a step of load; 9.2 N do not
    assert zero_warning(no_start, zero_drift(no_start, (4.0, 6.0))) == ()


@pytest.mark.parametrize(
    ("span", "masked", "words"),
    [
        ((20.0, 30.0), False, "zero interval 20:30 is outside the log"),
        ((-np.inf, -3.0), False, "zero interval :-3 is outside the log"),
        ((1.0, 4.0), True, "no two of its samples have a known wrench"),
    ],
)
def test_a_zero_outside_the_log_or_in_a_masked_span_is_refused(
    span: tuple[float, float], masked: bool, words: str
) -> None:
    with pytest.raises(ParameterError, match=words):
        zero_drift(hung(masked), span)


def test_the_zero_is_the_chosen_spans_or_the_start_where_it_is_chosen() -> None:
    wrench, spans = hung(), ((1.0, 2.0), (8.0, 9.0))
    start = (unloaded_start(wrench),)
    assert zero_spans(ZeroChoice(spans=spans), wrench) == (spans, spans)
    assert zero_spans(ZeroChoice(start=True), wrench) == (start, start)
    assert zero_spans(ZeroChoice(), wrench) == ((), start)
    with pytest.raises(ParameterError, match=r"--zero start: .*--zero A:B"):
        zero_spans(ZeroChoice(start=True), hung(masked=True))


def test_a_sensors_own_zero_is_removed_by_the_same_choice() -> None:
    wrench = hung(noise=0.0)
    clean = without_zero(wrench, ZeroChoice(spans=((1.0, 4.0), (6.0, 7.0))))
    np.testing.assert_allclose(clean.values, wrench.values - DRIFT, atol=1e-12)
    by_start = without_zero(wrench, ZeroChoice(start=True))
    np.testing.assert_allclose(by_start.values, clean.values, atol=1e-12)
    assert without_zero(wrench, ZeroChoice()) is wrench
