"""Whether the vendor's external torque has our sign: torque ON the robot."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from vftcli.doctor.case import Case, size_of
from vftcli.signals.recording import Recording
from vftcli.signals.remarks import Remark, warning

CLEARLY = 0.6
"""Share of what one sign leaves that the other may leave at most to be the right one."""
FELT = 0.02
"""Size of the vendor's torque, relative to the effort, from which it tells its sign."""


def vendor_sign(recording: Recording, case: Case) -> Iterator[Remark]:
    """That the vendor's torque fits the arm's only with its sign turned.

    The effort plus the torque ON the robot is what moving and holding the arm takes; with the other
    sign the pushes stand in it twice.
    """
    if recording.tau_ext is None or recording.torque is None:
        return
    vendor = case.windows.mean(recording.tau_ext)
    # A load that the vendor's model knows and the robot file does not is in neither of them.
    vendor = vendor - np.median(vendor, axis=0)
    if size_of(vendor) < FELT * case.size:
        return
    straight = left_over(case, case.given + vendor)
    turned = left_over(case, case.given - vendor)
    if turned < CLEARLY * straight:
        yield warning(
            "vendor-sign",
            straight_Nm=straight,
            turned_Nm=turned,
            width=recording.joints,
        )


def left_over(case: Case, given: np.ndarray) -> float:
    """What the arm leaves over of a torque in all windows, contact among them. [N·m]"""
    with_torque = replace(case, given=given)
    rest = with_torque.best.rest
    return float(np.sqrt(np.mean(rest**2)))
