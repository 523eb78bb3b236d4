"""What a free run reads: removed where the trajectory is the same, its mean where it is not."""

import numpy as np
import pytest

from vftcli.signals.external_torque import ExternalTorque
from vftcli.signals.remarks import fact
from vftcli.virtual_sensor.free_run_torque import FreeRunTorque, less_free_run

T = np.arange(5.0)
REMARK = fact("zero-mean-of-free-run")


def torque(name: str, value: float) -> ExternalTorque:
    return ExternalTorque(name=name, t=T, tau=np.full((5, 2), value))


def test_without_a_free_run_nothing_changes() -> None:
    one = torque("gmo", 1.0)
    assert less_free_run([one], None) == (one,)


def test_the_torque_at_the_same_place_goes_before_the_mean() -> None:
    there = np.tile([[0.5, 1.0]], (5, 1))
    there[4] = np.nan
    read = FreeRunTorque(
        there={"gmo": there},
        mean={"gmo": np.array([9.0, 9.0]), "fdo": np.array([0.25, -1.0])},
        rms={},
        remark=REMARK,
    )
    gmo, fdo = less_free_run([torque("gmo", 2.0), torque("fdo", 2.0)], read)
    np.testing.assert_array_equal(gmo.tau[:4], np.tile([[1.5, 1.0]], (4, 1)))
    assert np.isnan(gmo.tau[4]).all()  # beyond the free run nothing is known
    np.testing.assert_array_equal(fdo.tau, np.tile([[1.75, 3.0]], (5, 1)))


def test_an_observer_that_did_not_run_over_it_is_no_guess() -> None:
    read = FreeRunTorque(there={}, mean={}, rms={}, remark=REMARK)
    with pytest.raises(KeyError):
        less_free_run([torque("gmo", 2.0)], read)


def test_where_the_free_run_does_not_reach_its_mean_stands() -> None:
    there = np.array([[0.5, 1.0], [np.nan, 2.0]])
    mean = {"gmo": np.array([9.0, 8.0]), "fdo": np.array([0.25, -1.0])}
    read = FreeRunTorque(there={"gmo": there}, mean=mean, rms={}, remark=REMARK)
    np.testing.assert_array_equal(read.everywhere("gmo"), [[0.5, 1.0], [9.0, 2.0]])
    np.testing.assert_array_equal(read.everywhere("fdo"), [0.25, -1.0])
