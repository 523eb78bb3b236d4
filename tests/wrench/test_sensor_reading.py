"""A reading beside a reference: which zero is removed, and what is said of the lag."""

from dataclasses import replace

import numpy as np
import pytest

from vftcli.signals.wrench import Wrench
from vftcli.wrench.sensor import (
    MARGIN,
    Drift,
    SensorReading,
    contact_elsewhere,
    with_reference,
    zero_drift,
)
from vftcli.wrench.solvers import VirtualSensor

T = np.arange(0.0, 20.0, 0.01)
SPAN = (1.0, 3.0)


def force(late: float = 0.0, offset: float = 0.0) -> np.ndarray:
    """A push along each axis after 5 s. (T, 6)"""
    shape = np.column_stack([np.sin((k + 1.0) * (T - late)) for k in range(6)])
    return np.where(T[:, None] > 5.0, shape * [20, 10, 15, 2, 1, 2], 0.0) + offset


def reading(*removed: bool) -> SensorReading:
    """One observer, 80 ms late; a drift of its unloaded span for each flag."""
    wrench = Wrench(name="gmo", t=T, values=force(0.08), frame="base", masked=T > 19.0)
    drifts: tuple[Drift, ...] = tuple(
        zero_drift(wrench, SPAN)._replace(removed=flag) for flag in removed
    )
    return SensorReading(
        sensor=VirtualSensor(frame="base"),
        wrenches=(wrench,),
        masked=wrench.hidden,
        drifts=drifts,
        free=T < 4.0,
    )


def test_a_sensors_own_zero_goes_where_the_readings_went() -> None:
    theirs = Wrench(name="sensor", t=T, values=force(offset=1.5), frame="base")
    found = with_reference(reading(True), theirs, of_sensor=True)
    np.testing.assert_allclose(found.reference.values, force(), atol=1e-12)
    zero, lag = found.remarks
    assert (zero.code, zero.where.about) == ("zero-removed", "sensor")
    np.testing.assert_allclose(zero.values["force_N"], 1.5)
    assert (lag.code, lag.where.about) == ("lag-behind-sensor", "gmo")
    assert lag.values["lag_ms"] == pytest.approx(80.0, abs=5.0)  # half a sample


@pytest.mark.parametrize(
    ("flags", "of_sensor", "codes"),
    [
        ((), True, ["lag-behind-sensor"]),
        ((False,), True, ["lag-behind-sensor"]),
        ((True,), False, []),  # another reference has no zero and no lag of its own
    ],
)
def test_without_a_zero_of_the_reading_the_sensor_keeps_its_own(
    flags: tuple[bool, ...], of_sensor: bool, codes: list[str]
) -> None:
    theirs = Wrench(name="sensor", t=T, values=force(offset=1.5), frame="base")
    found = with_reference(reading(*flags), theirs, of_sensor=of_sensor)
    assert found.reference is theirs
    assert [remark.code for remark in found.remarks] == codes


def test_what_is_masked_and_zeroed_can_be_asked() -> None:
    assert reading(True).masked_share == pytest.approx(0.05, abs=0.001)
    assert reading(False, True).zero_span == SPAN
    assert reading(False).zero_span is None


def test_which_solver_made_which_wrench() -> None:
    found = reading()
    assert (found.solver, found.hides) == ("pinv", True)
    one = found.wrenches[0]
    best = replace(one, name="best", masked=None)
    smoothed = {"best": object()}  # its numbers are not asked for here
    both = replace(found, wrenches=(best, one), smoothed=smoothed)  # type: ignore[arg-type]
    assert (both.solver, both.hides) == ("smoother for best, pinv for the others", True)
    alone = replace(both, wrenches=(best,))
    assert (alone.solver, alone.hides) == ("smoother", False)


def wrench(null_space: np.ndarray | None) -> Wrench:
    t = np.arange(1000.0)
    return Wrench(
        name="gmo", t=t, values=np.zeros((1000, 6)), frame="base", null_space=null_space
    )


FREE = np.arange(1000) < 500


def test_a_contact_elsewhere_is_what_exceeds_the_free_part() -> None:
    residual = np.full(1000, 0.8)
    residual[100], residual[600:650], residual[700:800], residual[10] = 1.0, 2.0, MARGIN, np.nan
    (remark,) = contact_elsewhere(wrench(residual), FREE)
    assert (remark.code, remark.where.about) == ("contact-elsewhere", "gmo")
    assert remark.values == {"share": pytest.approx(0.05), "threshold_Nm": pytest.approx(MARGIN)}
    # a stray sample is none
    stray = np.where(np.arange(1000) == 999, 5.0, 1.0)
    assert contact_elsewhere(wrench(stray), FREE) == ()
    assert contact_elsewhere(wrench(np.where(np.arange(1000) >= 998, 5.0, 1.0)), FREE)


def test_nothing_is_said_without_a_channel_or_a_free_part() -> None:
    residual = np.where(FREE, 1.0, 2.0)
    assert contact_elsewhere(wrench(None), FREE) == ()
    assert contact_elsewhere(wrench(residual), np.zeros(1000, dtype=bool)) == ()
    assert contact_elsewhere(wrench(np.where(FREE, np.nan, 2.0)), FREE) == ()
