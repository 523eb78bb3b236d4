"""A load that the controller does not know: currents at rest beside those it expects."""

import numpy as np
import pytest

from vftcli.doctor.load import MISMATCH, payload_mismatch
from vftcli.signals.recording import Recording

T = 0.01 * np.arange(400)


def log(*extra: float) -> Recording:
    """An arm at rest whose joints carry more current than is expected, by so much. [A]"""
    rest = np.zeros((400, 6))
    return Recording(t=T, q=rest, dq=rest, current=rest + np.array(extra), target_current=rest)


@pytest.mark.parametrize(
    ("share", "joints"),
    [
        ((0.0, 2.0, 2.0, 0.0, 0.0, 0.0), (2, 3)),
        ((0.0, 2.0, -2.0, 2.0, 0.0, 0.0), (2, 3, 4)),
        ((9.0, 2.0, 0.0, 0.0, 9.0, 9.0), None),  # the base and the wrist do not tell a load
        ((0.0, 2.0, 0.9, 0.9, 0.0, 0.0), None),  # one joint alone may be its own drive's
    ],
)
def test_two_heavy_joints_tell_a_load(share: tuple, joints: tuple | None) -> None:
    constants = np.full(6, 10.0)
    found = list(payload_mismatch(log(*(MISMATCH * np.array(share) / 10.0)), constants))
    assert [remark.where.joints for remark in found] == ([] if joints is None else [joints])
