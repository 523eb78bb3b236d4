"""References by name: what is checked before a log is read, and what each is made from."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from vftcli.evaluation import NAMES, ReferenceChoice, references
from vftcli.evaluation.references import judge, make_reference, reference_wrench
from vftcli.free_motion.free_motion import FreeMotion
from vftcli.readers.references import read_reference
from vftcli.robots import load_robot
from vftcli.robots.chain import flange_jacobian
from vftcli.robots.run import Run
from vftcli.signals.errors import ReferenceTorqueError
from vftcli.signals.external_torque import ExternalTorque
from vftcli.signals.recording import Recording
from vftcli.signals.wrench import AXES
from vftcli.wrench.sensor import SensorReading
from vftcli.wrench.solvers import VirtualSensor

ROBOT = load_robot("ur5")
T = 0.01 * np.arange(300)
RNG = np.random.default_rng(3)
Q = np.array([0.3, -1.2, 1.4, -1.7, -1.5, 0.2]) + 0.2 * np.sin(
    np.outer(T, RNG.uniform(0.3, 1, 6))
)
RECORDING = Recording(t=T, q=Q, tau_ext=RNG.standard_normal((300, 6)))
MOTION = FreeMotion(log=Run(recording=RECORDING, robot=ROBOT))
WRENCH = 5.0 * RNG.standard_normal((300, 6))


def write(
    path: Path, t: np.ndarray = T, wrench: np.ndarray | None = None, **groups: np.ndarray
) -> ReferenceChoice:
    """A reference file of groups of columns, chosen."""
    columns = {"t": t}
    for name, values in groups.items():
        columns |= {f"{name}/{k + 1}": values[:, k] for k in range(values.shape[1])}
    if wrench is not None:
        columns |= {f"wrench/{axis}": wrench[:, k] for k, axis in enumerate(AXES)}
    pl.DataFrame(columns).write_parquet(path)
    return ReferenceChoice(name=f"file:{path}")


def test_an_unknown_name_is_refused_before_any_log_is_read() -> None:
    with pytest.raises(
        ReferenceTorqueError, match="there is zero, vendor, two-cycle, sensor, file"
    ):
        ReferenceChoice(name="magic")
    assert [ReferenceChoice(name=name).path for name in NAMES] == [None] * len(NAMES)


def test_zero_is_zero_and_vendor_is_the_log_s_own() -> None:
    zero = make_reference(MOTION, ReferenceChoice(name="zero")).torque
    assert not zero.tau.any()
    assert zero.floor is None  # nobody knows how free the motion was
    vendor = make_reference(MOTION, ReferenceChoice(name="vendor")).torque
    np.testing.assert_array_equal(vendor.tau, RECORDING.tau_ext)
    assert vendor.floor is None  # its error is not known


def test_a_file_is_read_once_for_torque_and_wrench(tmp_path, monkeypatch) -> None:
    reads = []
    monkeypatch.setattr(
        references, "read_reference", lambda *a: reads.append(a) or read_reference(*a)
    )
    choice = write(tmp_path / "truth.parquet", wrench=WRENCH)
    reference = make_reference(MOTION, choice)
    wrench = reference_wrench(RECORDING, ROBOT, reference, VirtualSensor(frame="base"))
    assert len(reads) == 1
    # A file of base axes, asked for in base axes, comes back as it is.
    np.testing.assert_allclose(wrench.values, WRENCH, atol=1e-9)


def test_a_wrench_alone_gives_the_torque_of_its_transposed_jacobian(tmp_path) -> None:
    choice = write(tmp_path / "truth.parquet", wrench=WRENCH)
    tau = make_reference(MOTION, choice).torque.tau
    J = flange_jacobian(ROBOT.chain, Q)
    np.testing.assert_allclose(tau[7], J[7].T @ WRENCH[7], atol=1e-12)


def test_a_file_may_say_that_nobody_touched_the_arm(tmp_path) -> None:
    """Zero throughout is a truth; of a log's own wrench it means that nothing was measured."""
    zero = np.zeros((300, 6))
    both = make_reference(MOTION, write(tmp_path / "x.parquet", wrench=zero, tau_ext=zero))
    assert not both.torque.tau.any()
    assert not both.wrench.values.any()


def test_torques_of_a_file_go_before_its_wrench(tmp_path) -> None:
    tau = RNG.standard_normal((300, 6))
    choice = write(tmp_path / "truth.parquet", wrench=WRENCH, tau_ext=tau)
    reference = make_reference(MOTION, choice)
    np.testing.assert_allclose(reference.torque.tau, tau, atol=1e-12)
    assert reference.wrench is not None
    remark = reference.torque.remarks[0]
    assert remark.values["covered"] == remark.values["samples"] == 300


def test_samples_beyond_the_file_are_unknown_half_a_sample_allowed(tmp_path) -> None:
    """The file begins 4 ms after the log's 50th sample: half of the 10 ms step covers it."""
    t = T[50:200] + 0.004
    choice = write(tmp_path / "truth.parquet", t, tau_ext=np.repeat(t[:, None], 6, axis=1))
    tau = make_reference(MOTION, choice).torque.tau
    known = np.isfinite(tau).all(axis=1)
    np.testing.assert_array_equal(np.flatnonzero(known), np.arange(50, 200))
    np.testing.assert_allclose(tau[51:200, 0], T[51:200], atol=1e-12)  # linear between stamps


@pytest.mark.parametrize("what", ["tau_ext", "wrench"])
def test_a_clock_of_another_day_is_refused(tmp_path, what) -> None:
    path = tmp_path / "truth.parquet"
    choice = write(path, wrench=WRENCH) if what == "wrench" else write(path, tau_ext=WRENCH)
    pl.read_parquet(path).with_columns(pl.col("t") + 1e6).write_parquet(path)
    with pytest.raises(ReferenceTorqueError, match="does not overlap the log's"):
        make_reference(MOTION, choice)


def test_a_file_of_another_arm_is_refused(tmp_path) -> None:
    choice = write(tmp_path / "truth.parquet", tau_ext=np.zeros((300, 7)))
    with pytest.raises(ReferenceTorqueError, match="7 torque columns for a log of 6 joints"):
        make_reference(MOTION, choice)


def test_a_torque_becomes_a_wrench_by_least_squares(tmp_path) -> None:
    """Jᵀ w of a wrench, away from singular poses, gives the wrench back."""
    tau = np.einsum("tij,ti->tj", flange_jacobian(ROBOT.chain, Q), WRENCH)
    choice = write(tmp_path / "truth.parquet", tau_ext=tau)
    reference = make_reference(MOTION, choice)
    assert reference.wrench is None
    solved = reference_wrench(RECORDING, ROBOT, reference, VirtualSensor(frame="base"))
    assert not solved.hidden.any()
    np.testing.assert_allclose(solved.values, WRENCH, atol=1e-6)  # condition of J below 1e3


def test_a_lag_behind_the_sensor_is_said_where_the_sensor_is_the_reference(tmp_path) -> None:
    """A wrench equal to the sensor's: no lag. A file's wrench is no sensor's."""
    recording = Recording(t=T, q=Q, wrench=WRENCH)
    motion = FreeMotion(log=Run(recording=recording, robot=ROBOT))
    estimate = ExternalTorque(name="gmo", t=T, tau=np.zeros((300, 6)))
    never = np.zeros(300, bool)
    sensor, choice = VirtualSensor(frame="base"), ReferenceChoice(name="sensor")
    same = reference_wrench(recording, ROBOT, make_reference(motion, choice), sensor)
    wrenches = (replace(same, name="gmo"),)
    read = SensorReading(sensor=sensor, wrenches=wrenches, masked=never, free=never)
    found = judge(motion, [estimate], read, choice)[2]
    (lag,) = (remark for remark in found.remarks if remark.code == "lag-behind-sensor")
    assert lag.values["lag_ms"] == pytest.approx(0.0, abs=5.0)  # half a sample
    assert lag.values["correlation"] == pytest.approx(1.0)
    file = write(tmp_path / "truth.parquet", wrench=WRENCH)
    found = judge(motion, [estimate], read, file)[2]
    assert found.remarks == ()
