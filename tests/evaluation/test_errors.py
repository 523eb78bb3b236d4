"""The tidy error table: analytic errors, what is known of the reference, pooled rows."""

import numpy as np
import polars as pl
import pytest

from vftcli.evaluation import SCHEMA, evaluate, evaluate_pooled, rmse
from vftcli.evaluation.pooling import ScoredLog
from vftcli.signals.errors import ShapeError
from vftcli.signals.external_torque import ExternalTorque

T = 0.008 * np.arange(1500)


def torque(name: str, *columns: object, **more: object) -> ExternalTorque:
    tau = np.column_stack([np.broadcast_to(c, T.shape) for c in columns])  # type: ignore[arg-type]
    return ExternalTorque(name=name, t=T, tau=tau, **more)  # type: ignore[arg-type]


WAVE = np.sin(2.0 * np.pi * 0.7 * T)


def rows_of(table: pl.DataFrame) -> dict[tuple[str, int], dict[str, object]]:
    return {(row["observer"], row["joint"]): row for row in table.iter_rows(named=True)}


def test_constant_error_is_bias_maximum_and_rmse() -> None:
    row = rows_of(evaluate("log", [torque("fdo", WAVE + 2.0)], torque("file", WAVE)))["fdo", 1]
    assert row["rmse_Nm"] == pytest.approx(2.0)
    assert row["bias_Nm"] == pytest.approx(2.0)
    assert row["max_Nm"] == pytest.approx(2.0)
    assert row["correlation"] == pytest.approx(1.0)
    assert row["reference_floor_Nm"] is None
    assert row["samples"] == len(T)


def test_columns_and_order() -> None:
    table = evaluate(
        "log", [torque("fdo", WAVE, WAVE), torque("gmo", WAVE, 0.0)], torque("x", 0, 0)
    )
    assert table.schema == pl.Schema(SCHEMA)
    order = list(zip(table["observer"], table["joint"], strict=True))
    assert order == [("fdo", 1), ("fdo", 2), ("gmo", 1), ("gmo", 2)]


@pytest.mark.parametrize("delay", [0.0, 0.05, 0.1234, -0.06])
def test_lag_below_the_sample_time(delay: float) -> None:
    """A parabola through three samples of a 0.7 Hz correlation is good to microseconds."""
    late = np.sin(2.0 * np.pi * 0.7 * (T - delay))
    row = rows_of(evaluate("log", [torque("gmo", late)], torque("x", WAVE)))["gmo", 1]
    # The ends, where the shifted signals do not overlap, pull by well under a millisecond.
    assert row["lag_s"] == pytest.approx(delay, abs=1e-3)


def test_nothing_to_tell_a_lag_by() -> None:
    noise = np.random.default_rng(0).standard_normal(len(T))
    table = rows_of(evaluate("log", [torque("gmo", noise)], torque("zero", np.zeros_like(T))))
    assert table["gmo", 1]["lag_s"] is None
    assert table["gmo", 1]["correlation"] is None


def test_joints_at_rest_are_marked() -> None:
    """J1 moves in 80 % of the samples, J2 in 20 %; the error is 1 in motion, 3 at rest."""
    share = np.array([0.8, 0.2])
    moving = (np.arange(len(T))[:, None] < share * len(T)).astype(float)
    reference = torque("two-cycle", WAVE, WAVE, moving=moving, floor=np.array([0.5, 0.6]))
    error = np.where(moving > 0, 1.0, 3.0)
    table = rows_of(evaluate("log", [torque("fdo", *(WAVE[:, None] + error).T)], reference))
    assert [table["fdo", j]["reference_trusted"] for j in (1, 2)] == [True, False]
    assert [table["fdo", j]["at_rest"] for j in (1, 2)] == pytest.approx([0.2, 0.8])
    assert [table["fdo", j]["rmse_moving_Nm"] for j in (1, 2)] == pytest.approx([1.0, 1.0])
    wanted = np.sqrt(share + 9.0 * (1.0 - share))
    assert [table["fdo", j]["rmse_Nm"] for j in (1, 2)] == pytest.approx(wanted)


def test_an_unstable_observer_spoils_no_other() -> None:
    broken = np.where(T < 1.0, WAVE, np.nan)
    found = rows_of(evaluate("log", [torque("gmo", broken), torque("fdo", WAVE)], torque("x", 0.0)))
    assert found["gmo", 1]["rmse_Nm"] is None
    assert found["gmo", 1]["samples"] == 0
    assert found["fdo", 1]["samples"] == len(T)


def test_no_sample_in_common() -> None:
    row = rows_of(evaluate("log", [torque("fdo", WAVE)], torque("x", np.nan)))["fdo", 1]
    assert row["rmse_Nm"] is None
    assert row["samples"] == 0


def test_shapes_must_agree() -> None:
    with pytest.raises(ShapeError):
        evaluate("log", [torque("fdo", WAVE)], torque("x", WAVE, WAVE))
    with pytest.raises(ShapeError):
        rmse(np.zeros((3, 2)), np.zeros((3, 1)))


def test_pooled_rows_weigh_samples() -> None:
    """Errors 1 over 1500 samples and 3 over 500: √((1500 + 9·500)/2000)."""
    whole = ScoredLog([torque("fdo", WAVE + 1.0)], torque("x", WAVE, floor=np.array([1.0])))
    part = np.where(T < 4.0, WAVE, np.nan)
    short = ScoredLog([torque("fdo", WAVE + 3.0)], torque("x", part, floor=np.array([2.0])))
    row = rows_of(evaluate_pooled([whole, short]))["fdo", 1]
    assert row["recording"] == "pooled"
    assert row["samples"] == 2000
    assert row["rmse_Nm"] == pytest.approx(np.sqrt((1500.0 + 9.0 * 500.0) / 2000.0))
    assert row["bias_Nm"] == pytest.approx(1.5)
    assert row["reference_floor_Nm"] == pytest.approx(np.sqrt((1500.0 + 4.0 * 500.0) / 2000.0))


def test_one_log_or_unlike_logs_are_not_pooled() -> None:
    one = ScoredLog([torque("fdo", WAVE)], torque("x", WAVE))
    other = ScoredLog([torque("gmo", WAVE)], torque("x", WAVE))
    assert evaluate_pooled([one]).is_empty()
    assert evaluate_pooled([one, other]).is_empty()
