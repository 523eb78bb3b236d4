"""What drives a replay: an observer's torque of a file, the log's sensor, or the truth."""

from pathlib import Path

import numpy as np
import polars as pl
import pytest

from vftcli.admittance.replay import sensor_force, stored_force, truth_force
from vftcli.robots import load_robot
from vftcli.robots.chain import flange_jacobian
from vftcli.signals.errors import MissingSignalError, ParameterError, ReferenceTorqueError
from vftcli.signals.recording import Recording
from vftcli.signals.wrench import WrenchFrame
from vftcli.wrench import WrenchChoice, ZeroChoice

UR5 = load_robot("ur5")
T = np.arange(0.0, 4.0, 0.01)
Q = np.array([0.3, -1.2, 1.4, -1.7, -1.5, 0.2]) + 0.2 * np.sin(np.outer(T, np.arange(1, 7) / 3))
WRENCH = np.where(T[:, None] > 2.0, 10.0, 0.0) + np.array([1.0, -2.0, 3.0, 0.1, 0.2, -0.3])


def choice(**zero: object) -> WrenchChoice:
    return WrenchChoice(frame="base", zero=ZeroChoice(**zero))  # type: ignore[arg-type]


def test_a_stored_torque_is_turned_into_its_wrench_and_zeroed() -> None:
    tau = np.einsum("tij,ti->tj", flange_jacobian(UR5.chain, Q), WRENCH)
    log = Recording(t=T, q=Q, tau_ext=tau)
    found = stored_force(log, UR5, choice(spans=((0.0, 1.9),)), "kfo-fe")
    expected = np.where(T[:, None] > 2.0, 10.0, 0.0) * np.ones(6)
    np.testing.assert_allclose(found.wrench.known, expected, atol=1e-8)  # κ(J)² times rounding
    assert found.source.values == {"observer": "kfo-fe"}
    assert [remark.code for remark in found.wrench.remarks] == ["zero-removed"]
    with pytest.raises(MissingSignalError):
        stored_force(Recording(t=T, q=Q), UR5, choice(), "kfo-fe")
    with pytest.raises(ParameterError, match="needs the log itself"):
        stored_force(log, UR5, WrenchChoice(frame="base", solver="smoother"), "kfo-fe")


def test_the_logs_sensor_drives_as_the_log_states_it() -> None:
    log = Recording(
        t=T, q=Q, wrench=-WRENCH, wrench_frame=WrenchFrame("base", "flange", "by-robot")
    )
    found = sensor_force(log, UR5, choice())
    np.testing.assert_array_equal(found.wrench.values, WRENCH)
    assert found.wrench.remarks == ()
    assert "BY the robot" in found.source.values["frame"]
    unstated = sensor_force(Recording(t=T, q=Q, wrench=WRENCH), UR5, choice())
    assert unstated.source.values["frame"] == "frame not stated"
    codes = [remark.code for remark in unstated.wrench.remarks]
    assert codes == ["wrench-frame-unstated", "sensor-pose-unstated"]


def test_a_truth_file_s_wrench_is_the_force_and_torques_alone_are_none(tmp_path: Path) -> None:
    file, axes = tmp_path / "truth.parquet", ("fx", "fy", "fz", "mx", "my", "mz")
    columns = {f"wrench/{axis}": WRENCH[:, k] for k, axis in enumerate(axes)}
    pl.DataFrame({"t": T, **columns}).write_parquet(file)
    force = truth_force(Recording(t=T, q=Q), UR5, choice(), file)
    np.testing.assert_allclose(force.wrench.known, WRENCH, atol=1e-12)
    assert force.source.values == {"file": "truth.parquet"}
    columns = {f"tau_ext/{j}": np.zeros(len(T)) for j in range(1, 7)}
    pl.DataFrame({"t": T, **columns}).write_parquet(file)
    with pytest.raises(ReferenceTorqueError, match="it has no wrench"):
        truth_force(Recording(t=T, q=Q), UR5, choice(), file)
