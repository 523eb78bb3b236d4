"""Drive torque: from currents, torques, or torques without gravity."""

import numpy as np
import pytest

from vftcli.robots import Payload, load_robot
from vftcli.robots.drive import drive_torque, effort_name
from vftcli.robots.kernels import momentum_terms
from vftcli.signals.errors import MissingSignalError
from vftcli.signals.recording import Recording

T = np.arange(3.0)
Q = np.linspace(0.2, 1.3, 18).reshape(3, 6)
EFFORT = np.linspace(-4.0, 5.0, 18).reshape(3, 6)
UR5E, FR3 = load_robot("ur5e"), load_robot("fr3")


def test_torque_without_gravity_gets_that_of_the_arm_and_its_payload() -> None:
    load = Payload(mass=2.0, com=np.array([0.0, 0.0, 0.1]), inertia=np.zeros((3, 3)))
    arm = UR5E.with_payload(load)
    log = Recording(t=T, q=Q, torque_without_gravity=EFFORT)
    held = momentum_terms(arm.loaded_chain, Q, np.zeros_like(Q)).gravity
    assert effort_name(log, arm) == "torque_without_gravity"
    assert drive_torque(log, arm) == pytest.approx(EFFORT + held, abs=1e-12)  # rounding
    assert np.abs(drive_torque(log, arm) - drive_torque(log, UR5E)).max() > 2.0  # 2 kg on an arm


@pytest.mark.parametrize(
    ("signals", "of_ur", "of_franka"),
    [
        (("current", "torque", "torque_without_gravity"), "current", "torque"),
        (("torque", "torque_without_gravity"), "torque", "torque"),
        (("current", "torque_without_gravity"), "current", "torque_without_gravity"),
        (("current",), "current", "current"),
    ],
)
def test_an_arm_takes_what_its_makers_logs_hold(
    signals: tuple[str, ...], of_ur: str, of_franka: str
) -> None:
    """UR measures currents, Franka torques; what is not there is made up for by the other."""
    log = Recording(t=T, q=Q, **dict.fromkeys(signals, EFFORT))  # type: ignore[arg-type]
    assert effort_name(log, UR5E) == of_ur
    assert effort_name(log, FR3) == of_franka


def test_without_any_effort_a_signal_is_asked_for() -> None:
    with pytest.raises(MissingSignalError, match="no motor currents"):
        drive_torque(Recording(t=T, q=Q), UR5E)
