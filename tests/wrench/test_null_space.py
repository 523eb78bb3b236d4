"""The null-space channel: a threshold learned where nothing touches the arm."""

import numpy as np
import pytest

from vftcli.signals.wrench import Wrench
from vftcli.wrench.sensor_reading import MARGIN, contact_elsewhere


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
