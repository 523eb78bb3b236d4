"""Reference files: the clock that their times are on."""

from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from vftcli.evaluation import ReferenceChoice, references
from vftcli.evaluation.references import (
    evaluate_wrenches,
    judge,
    make_reference,
    on_the_logs_clock,
    reference_wrench,
    since_start,
    with_contacts,
)
from vftcli.free_motion.free_motion import FreeMotion
from vftcli.readers.references import read_reference
from vftcli.robots import load_robot
from vftcli.robots.chain import flange_jacobian
from vftcli.robots.run import Run
from vftcli.signals.errors import ReferenceTorqueError
from vftcli.signals.external_torque import ExternalTorque
from vftcli.signals.recording import Recording, Source
from vftcli.signals.wrench import AXES, Wrench
from vftcli.wrench.detection import Detection
from vftcli.wrench.sensor import SensorReading
from vftcli.wrench.solvers import VirtualSensor


@pytest.mark.parametrize("zero", [0.0, 0.02, 798.467])
@pytest.mark.parametrize("every", [1, 3])
def test_a_file_may_count_from_the_first_sample_or_be_on_the_logs_clock(zero, every) -> None:
    t = np.arange(0.0, 5.0, 0.0137)
    source = Source(format="x", clock="x", rows=len(t), duplicates=0, t0=zero)
    log = Recording(t=t, q=np.zeros((len(t), 6)), source=source)
    for stamps in (t[::every], t[::every] + zero):
        assert since_start(stamps, log) == pytest.approx(t[::every])
    # A sensor's clock of its own has none of the log's stamps: where it overlaps, it is the log's.
    for first, last in ((-0.01005, 4.0), (1.00005, 9.0)):  # it may go on after the log's end
        own = np.arange(zero + first, zero + last, 0.003)
        assert since_start(own, log) == pytest.approx(own - zero)


def test_a_file_of_another_time_is_refused_with_both_spans() -> None:
    t = np.arange(0.0, 5.0, 0.5)
    log = Recording(t=t, q=np.zeros((len(t), 6)))
    message = r"a\.csv: its clock \(50 to 54\.5 s\) does not overlap the log's \(0 to 4\.5 s\)"
    with pytest.raises(ReferenceTorqueError, match=message):
        on_the_logs_clock(t + 50.0, np.zeros((len(t), 6)), log, Path("a.csv"))
    # Half a sample beyond either end is the same clock, rounded; more is no answer.
    there = on_the_logs_clock(t[:-2] + 0.2, t[:-2, None], log, Path("a.csv"))[:, 0]
    assert np.isfinite(there).tolist() == [True] * 8 + [False] * 2


# References by name: what is checked before a log is read, and what each is made from


ROBOT = load_robot("ur5")
T = 0.01 * np.arange(300)
RNG = np.random.default_rng(3)
SWAY = 0.2 * np.sin(np.outer(T, RNG.uniform(0.3, 1, 6)))
Q = np.array([0.3, -1.2, 1.4, -1.7, -1.5, 0.2]) + SWAY
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


def test_zero_is_zero_and_vendor_is_the_log_s_own() -> None:
    zero = make_reference(MOTION, ReferenceChoice(name="zero")).torque
    assert not zero.tau.any()
    assert zero.floor is None  # nobody knows how free the motion was
    vendor = make_reference(MOTION, ReferenceChoice(name="vendor")).torque
    np.testing.assert_array_equal(vendor.tau, RECORDING.tau_ext)
    assert vendor.floor is None  # its error is not known


def test_a_file_is_read_once_and_its_torques_go_before_its_wrench(tmp_path, monkeypatch) -> None:
    reads = []
    counted = partial(lambda *a: reads.append(a) or read_reference(*a))
    monkeypatch.setattr(references, "read_reference", counted)
    tau = RNG.standard_normal((300, 6))
    choice = write(tmp_path / "truth.parquet", wrench=WRENCH, tau_ext=tau)
    reference = make_reference(MOTION, choice)
    wrench = reference_wrench(RECORDING, ROBOT, reference, VirtualSensor(frame="base"))
    assert len(reads) == 1
    np.testing.assert_allclose(reference.torque.tau, tau, atol=1e-12)
    covered = reference.torque.remarks[0].values
    assert covered["covered"] == covered["samples"] == 300
    # A file of base axes, asked for in base axes, comes back as it is.
    np.testing.assert_allclose(wrench.values, WRENCH, atol=1e-9)


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
    read = SensorReading(sensor=sensor, wrenches=wrenches, masked=never)
    found = judge(motion, [estimate], read, choice)[2]
    (lag,) = (remark for remark in found.remarks if remark.code == "lag-behind-sensor")
    assert lag.values["lag_ms"] == pytest.approx(0.0, abs=5.0)  # half a sample
    assert lag.values["correlation"] == pytest.approx(1.0)
    file = write(tmp_path / "truth.parquet", wrench=WRENCH)
    found = judge(motion, [estimate], read, file)[2]
    assert found.remarks == ()


# Rows of wrenches: axes, units, bands, and contacts below them


TIMES = 0.01 * np.arange(200)
WAVES = np.column_stack([np.sin((k + 1) * TIMES) for k in range(6)])


def wrench(values: np.ndarray, name: str = "gmo", **more: object) -> Wrench:
    return Wrench(name=name, t=TIMES, values=values, frame="base", **more)  # type: ignore[arg-type]


def wrench_rows(found: Wrench, reference: Wrench) -> dict[str, dict[str, object]]:
    table = evaluate_wrenches("log", [found], reference)
    return {row["axis"]: row for row in table.iter_rows(named=True)}


def test_an_axis_has_its_own_unit() -> None:
    """Errors 1 to 6: newtons for the first three, newton metres for the others."""
    found = wrench_rows(wrench(WAVES + np.arange(1.0, 7.0)), wrench(WAVES, "sensor"))
    assert list(found) == list(AXES)
    for k, axis in enumerate(AXES):
        here, there = ("N", "Nm") if axis.startswith("f") else ("Nm", "N")
        for size in ("rmse", "bias", "max"):
            assert found[axis][f"{size}_{here}"] == pytest.approx(k + 1.0)
        assert found[axis][f"rmse_{there}"] is None
        assert found[axis]["samples"] == len(TIMES)
        assert found[axis]["correlation"] == pytest.approx(1.0)


@pytest.mark.parametrize(("error", "share"), [(0.0, 1.0), (0.97, 1.0), (0.99, 0.0), (3.0, 0.0)])
def test_the_band_holds_1_96_deviations(error: float, share: float) -> None:
    found = wrench_rows(wrench(WAVES + error, sd=np.full((200, 6), 0.5)), wrench(WAVES, "sensor"))
    assert {row["band_share"] for row in found.values()} == {share}


def test_a_sample_without_an_answer_is_zero_and_in_no_band() -> None:
    """A quarter without an answer, three eighths outside: three eighths are left within."""
    values = WAVES.copy()
    values[:50] = np.nan
    values[50:125] += 9.0
    found = wrench_rows(wrench(values, sd=np.ones((200, 6))), wrench(WAVES, "sensor"))
    assert found["mz"]["band_share"] == pytest.approx(0.375)
    assert found["mz"]["missing"] == pytest.approx(0.25)
    assert found["mz"]["samples"] == 200
    wanted = np.sqrt((np.sum(WAVES[:50, 5] ** 2) + 75 * 81.0) / 200)
    assert found["mz"]["rmse_Nm"] == pytest.approx(wanted)


def test_without_a_deviation_or_a_known_sample_there_is_no_share() -> None:
    assert wrench_rows(wrench(WAVES), wrench(WAVES, "sensor"))["fx"]["band_share"] is None
    nothing = wrench(np.full((200, 6), np.nan), sd=np.ones((200, 6)))
    row = wrench_rows(wrench(WAVES, sd=np.ones((200, 6))), nothing)["fx"]
    assert [row[name] for name in ("band_share", "rmse_N", "samples")] == [None, None, 0]


def test_contacts_stand_below_the_errors() -> None:
    detection = Detection(
        contacts=3, listed=5, missed=1, false_alarms=2, false_alarms_per_h=7.5,
        delay=(0.1, 0.3, np.nan),
    )  # fmt: skip
    errors = pl.DataFrame({"recording": ["log"], "observer": ["gmo"]})
    row = with_contacts(errors, "log", "truth", detection).row(1, named=True)
    names = ("contacts", "listed_contacts", "found_contacts", "missed_contacts", "false_alarms")
    assert [row[name] for name in names] == [3, 5, 2, 1, 2]
    assert row["false_alarms_per_h"] == 7.5
    assert row["detection_delay_s"] == pytest.approx(0.2)  # the mean of those that were found
    assert row["longest_delay_s"] == pytest.approx(0.3)
