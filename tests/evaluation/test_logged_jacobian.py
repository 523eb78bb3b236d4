"""A vendor's torques through a logged Jacobian: a made log with known axes, and two real ones."""

from pathlib import Path

import numpy as np
import polars as pl
import pytest

from vftcli.evaluation.references import JacobianJudgement, judge_jacobian
from vftcli.readers.reader import ReadChoice
from vftcli.readers.reading import read
from vftcli.readers.references import JacobianLog, jacobian_log
from vftcli.readers.table import JacobianError
from vftcli.robots import load_robot
from vftcli.robots.chain import flange_jacobian
from vftcli.signals.errors import (
    ClockError,
    LogError,
    MissingSignalError,
    ParameterError,
    ReferenceTorqueError,
)
from vftcli.wrench import WrenchChoice, ZeroChoice

TURNED = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
"""The sensor's axes in those of the Jacobian."""


def made_log(tmp_path: Path, *, angular_first: bool = False, lost: str = "") -> Path:
    """A Panda at 80 Hz whose sensor reads a known wrench in turned axes; the bias is 0.2 N."""
    rng = np.random.default_rng(17)
    T = 400
    t = 1.7e9 + np.arange(T) / 80
    q = np.array([0.1, -0.6, 0.2, -2.0, 0.3, 1.6, 0.7]) + 0.1 * np.sin(np.arange(T) / 40)[:, None]
    J = flange_jacobian(load_robot("panda").chain, q)
    w = 8 * np.cumsum(rng.standard_normal((T, 6)), axis=0) / np.sqrt(T)
    w[:80] = 0  # unloaded for a second
    tau = np.einsum("tij,ti->tj", J, w)
    sensor = (w.reshape(-1, 2, 3) @ TURNED.T).reshape(-1, 6) + 0.2
    stored = np.roll(J, 3, axis=1) if angular_first else J
    columns = {"timestamp": t} | {f"tau_ext_{j}": tau[:, j] for j in range(7)}
    columns |= {f"jacobian_{r}_{c}": stored[:, r, c] for r in range(6) for c in range(7)}
    columns |= {name: sensor[:, k] for k, name in enumerate(["fx", "fy", "fz", "mx", "my", "mz"])}
    path = tmp_path / "jacobian.csv"
    pl.DataFrame({k: v for k, v in columns.items() if not lost or lost not in k}).write_csv(path)
    return path


def opened(path: Path, **how: object) -> JacobianLog:
    with pytest.raises(JacobianError, match="no joint positions") as found:
        read(path)
    return jacobian_log(path, found.value, ReadChoice(**how), path.name)  # type: ignore[arg-type]


def judged(log: JacobianLog, *spans: tuple[float, float]) -> JacobianJudgement:
    return judge_jacobian(log, WrenchChoice(zero=ZeroChoice(spans=spans)), "sensor")


def axis_errors(made: JacobianJudgement, name: str = "rmse") -> np.ndarray:
    rows = made.errors.filter(pl.col("axis").is_not_null())
    assert rows["axis"].to_list() == ["fx", "fy", "fz", "mx", "my", "mz"]
    return np.array([*rows[f"{name}_N"].to_list()[:3], *rows[f"{name}_Nm"].to_list()[3:]])


@pytest.mark.parametrize("angular_first", [False, True])
def test_the_sensor_s_axes_are_found_and_its_offset_stays(tmp_path, angular_first) -> None:
    made = judged(opened(made_log(tmp_path, angular_first=angular_first)))
    # Exactly the offset that was put in; sixteen digits were written.
    np.testing.assert_allclose(axis_errors(made), 0.2, atol=1e-9)
    assert [remark.code for remark in made.remarks] == ["logged-jacobian", "sensor-axes-fitted"]
    assert made.remarks[1].values["axes"] == "+x +z −y"
    assert made.log.t[0] == 0.0


def test_an_unloaded_span_takes_the_offset_off(tmp_path: Path) -> None:
    made = judged(opened(made_log(tmp_path)), (0.0, 0.9))
    np.testing.assert_allclose(axis_errors(made), 0.0, atol=1e-9)


def test_what_takes_positions_or_a_sensor_is_refused(tmp_path: Path) -> None:
    log = opened(made_log(tmp_path))
    with pytest.raises(ParameterError, match="takes only --zero A:B"):
        judge_jacobian(log, WrenchChoice(frame="base"), "sensor")
    with pytest.raises(ReferenceTorqueError, match="--reference sensor"):
        judge_jacobian(log, WrenchChoice(), "zero")
    with pytest.raises(ParameterError, match="holds no sample"):
        judged(log, (90.0, 91.0))
    with pytest.raises(ParameterError, match="--zero 90: holds no sample"):
        judged(log, (90.0, np.inf))
    with pytest.raises(MissingSignalError, match="no wrench of a sensor"):
        judged(opened(made_log(tmp_path, lost="fx")))


@pytest.mark.parametrize("lost", ["tau_ext", "jacobian_3", "jacobian_2_4"])
def test_a_log_that_lacks_a_part_is_refused(tmp_path: Path, lost: str) -> None:
    with pytest.raises(LogError, match="Jacobian"):
        opened(made_log(tmp_path, lost=lost))


@pytest.mark.parametrize(("column", "value", "reported"), [
    # Its square is infinite.
    ("jacobian_4_2", 1e200, "jacobian cell 31 is 1e[+]200 in sample 201"),
    ("tau_ext_3", -1e200, "tau_ext of joint 4 is -1e[+]200 in sample 201"),
    ("fy", float("nan"), "wrench axis 2 is nan in sample 201"),
    ("timestamp", 1e300, "time runs backwards"),
])  # fmt: skip
def test_a_value_that_nobody_measured_is_refused_in_one_line(tmp_path, column, value, reported):
    path = made_log(tmp_path)
    table = pl.read_csv(path).with_row_index()
    put = pl.when(pl.col("index") == 200).then(value).otherwise(pl.col(column))
    table.with_columns(put.alias(column)).drop("index").write_csv(path)
    with pytest.raises((ClockError, LogError), match=reported):
        opened(path)


def test_a_header_alone_is_refused(tmp_path: Path) -> None:
    path = made_log(tmp_path)
    path.write_text(path.read_text().split("\n")[0] + "\n")
    with pytest.raises(ClockError, match="no samples"):
        opened(path)


@pytest.mark.parametrize(("name", "forces"), [
    # rms and zero-mean rms as measured outside of this code with the pseudo-inverse of J;
    # in the Jacobian's axes, so that the sensor's y stands under z.
    ("traj_raw.csv", ((0.340, 0.294, 0.556), (0.227, 0.264, 0.370))),
    ("press_1.csv", ((0.242, 0.196, 0.315), (0.174, 0.196, 0.228))),
])  # fmt: skip
def test_a_vendor_s_wrench_beside_an_ati_sensor(logs: Path, name: str, forces) -> None:
    made = judged(opened(logs / "panda_ati" / name))
    rms, bias = axis_errors(made)[:3], axis_errors(made, "bias")[:3]
    np.testing.assert_allclose(rms, forces[0], atol=1e-3)  # three digits were noted
    np.testing.assert_allclose(np.sqrt(rms**2 - bias**2), forces[1], atol=1e-3)
    assert made.remarks[-1].values["axes"] == "+x +z −y"
