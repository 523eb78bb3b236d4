"""The tidy error table: analytic errors, what is known of the reference, pooled rows."""

import numpy as np
import polars as pl
import pytest

from vftcli.evaluation.errors import (
    POOLED,
    SCHEMA,
    PoolMember,
    evaluate,
    evaluate_pooled,
    joint_means,
    rmse,
)
from vftcli.signals.errors import ShapeError
from vftcli.signals.external_torque import ExternalTorque

T = 0.008 * np.arange(1500)


def torque(name: str, *columns: object, **more: object) -> ExternalTorque:
    tau = np.column_stack([np.broadcast_to(c, T.shape) for c in columns])  # type: ignore[arg-type]
    return ExternalTorque(name=name, t=T, tau=tau, **more)  # type: ignore[arg-type]


WAVE = np.sin(2.0 * np.pi * 0.7 * T)


def row_of(estimate: ExternalTorque, reference: ExternalTorque) -> dict[str, object]:
    """What is said of an estimate's first joint."""
    return evaluate("log", [estimate], reference).row(0, named=True)


def rows_of(table: pl.DataFrame) -> dict[tuple[str, int], dict[str, object]]:
    return {(row["observer"], row["joint"]): row for row in table.iter_rows(named=True)}


def test_constant_error_is_bias_maximum_and_rmse() -> None:
    row = row_of(torque("fdo", WAVE + 2.0), torque("file", WAVE))
    sizes = [row[name] for name in ("rmse_Nm", "bias_Nm", "max_Nm", "correlation")]
    assert sizes == pytest.approx([2.0, 2.0, 2.0, 1.0])
    assert row["reference_floor_Nm"] is None
    assert row["samples"] == len(T)


def test_the_floor_is_over_the_samples_that_are_compared() -> None:
    """The reference is off by 1 N·m in its first half and 3 in its second."""
    sd = np.where(T[750] > T, 1.0, 3.0)[:, None]
    file = torque("file", WAVE, sd=sd, floor=np.array([7.0]))
    whole = row_of(torque("fdo", WAVE), file)
    assert whole["reference_floor_Nm"] == pytest.approx(np.sqrt(5.0))  # (1 + 9)/2
    known = torque("file", np.where(T[750] > T, WAVE, np.nan), sd=sd, floor=np.array([7.0]))
    half = row_of(torque("fdo", WAVE), known)
    assert half["reference_floor_Nm"] == pytest.approx(1.0)
    # one number is all that a reference without sd knows
    plain = torque("file", WAVE, floor=np.array([7.0]))
    row = row_of(torque("fdo", WAVE), plain)
    assert row["reference_floor_Nm"] == 7.0


@pytest.mark.parametrize("delay", [0.0, 0.05, 0.1234, -0.06])
def test_lag_below_the_sample_time(delay: float) -> None:
    """A parabola through three samples of a 0.7 Hz correlation is good to microseconds."""
    late = np.sin(2.0 * np.pi * 0.7 * (T - delay))
    row = row_of(torque("gmo", late), torque("x", WAVE))
    # The ends, where the shifted signals do not overlap, pull by well under a millisecond.
    assert row["lag_s"] == pytest.approx(delay, abs=1e-3)


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


@pytest.mark.parametrize("share", [0.0, 0.3, 0.9, 1.0])
def test_a_sample_without_an_answer_counts_as_zero_and_spoils_no_other(share: float) -> None:
    """Perfect where it answers, it misses the whole reference where it does not."""
    missing = np.arange(len(T)) < share * len(T)
    broken = np.where(missing, np.nan, WAVE)
    estimates = [torque("gmo", broken), torque("fdo", WAVE + 0.5)]
    found = rows_of(evaluate("log", estimates, torque("x", WAVE)))
    assert found["gmo", 1]["rmse_Nm"] == pytest.approx(np.sqrt(np.mean((WAVE * missing) ** 2)))
    assert found["gmo", 1]["missing"] == pytest.approx(share)
    assert found["gmo", 1]["samples"] == found["fdo", 1]["samples"] == len(T)
    assert found["fdo", 1]["rmse_Nm"] == pytest.approx(0.5)
    assert found["fdo", 1]["missing"] == 0.0


def test_shapes_must_agree() -> None:
    with pytest.raises(ShapeError):
        evaluate("log", [torque("fdo", WAVE)], torque("x", WAVE, WAVE))
    with pytest.raises(ShapeError):
        rmse(np.zeros((3, 2)), np.zeros((3, 1)))


def test_coverage_is_the_share_within_1_96_deviations() -> None:
    errors = {0.0: 1.0, -1.95: 1.0, 1.97: 0.0, 3.0: 0.0}
    for error, share in errors.items():
        estimate = torque("gmo", error, error_sd=np.ones((len(T), 1)))
        assert row_of(estimate, torque("x", 0.0))["coverage_95"] == share
    # A sample without an answer is in no band, and without a band there is no coverage.
    half = np.where(np.arange(len(T)) < len(T) // 2, 0.1, np.nan)
    estimate = torque("gmo", half, error_sd=np.ones((len(T), 1)))
    assert row_of(estimate, torque("x", 0.0))["coverage_95"] == 0.5
    assert row_of(torque("gmo", 0.0), torque("x", 0.0))["coverage_95"] is None


@pytest.mark.parametrize(("count", "share"), [(9, None), (10, 1.0), (11, 1.0)])
def test_a_coverage_rests_on_ten_samples(count: int, share: float | None) -> None:
    moving = np.arange(len(T))[:, None] < count
    reference = torque("x", 0.0, moving=moving)
    estimate = torque("gmo", 0.5, error_sd=np.ones((len(T), 1)))
    assert row_of(estimate, reference)["coverage_95"] == share


def test_an_rmse_lies_within_its_interval() -> None:
    rng = np.random.default_rng(1)
    small, large = (s * rng.standard_normal(len(T)) for s in (1.0, 3.0))
    found = rows_of(evaluate("log", [torque("a", large), torque("b", small)], torque("x", 0.0)))
    assert found["b", 1]["rmse_low_Nm"] < found["b", 1]["rmse_Nm"] < found["b", 1]["rmse_high_Nm"]


def test_rmse_skips_unknown_samples_joint_by_joint() -> None:
    estimate = np.array([[3.0, 1.0], [np.nan, 1.0], [4.0, np.nan]])
    reference = np.array([[0.0, 0.0], [0.0, np.nan], [0.0, 0.0]])
    assert rmse(estimate, reference) == pytest.approx([np.sqrt(12.5), 1.0])
    assert np.isnan(rmse(np.full((3, 1), np.nan), np.zeros((3, 1))))[0]


# The one mean over joints: only of those with a reference to be trusted


def test_a_joint_whose_reference_rests_is_left_out_and_named() -> None:
    rows = (("a", 1, 1.0, True), ("a", 2, 9.0, False), ("a", 3, 3.0, None), ("b", 1, 0.5, True))
    names = ("observer", "joint", "rmse_Nm", "reference_trusted")
    lines = [dict(zip(names, row, strict=True)) | {"reference_floor_Nm": row[1]} for row in rows]
    means = joint_means(pl.DataFrame(lines, schema=SCHEMA))
    assert means.errors == {"a": 2.0, "b": 0.5}
    assert means.floor == 2.0  # of J1 and J3
    assert means.left_out == " without J2"
    assert means.least == ("b", 0.5)


# Logs as one experiment: what is pooled is weighed by samples, and never over two arms


def member(error: float, until: float = 99.0, robot: str = "ur5", **more: object) -> PoolMember:
    """A log with a constant error, its reference known until a time."""
    reference = torque("x", np.where(until > T, WAVE, np.nan), floor=np.array([1.0]))
    return PoolMember(robot, [torque("fdo", WAVE + error, **more)], reference)


def pooled_row(*members: PoolMember) -> dict[str, object]:
    return evaluate_pooled(members).row(0, named=True)


def test_pooled_rows_weigh_samples() -> None:
    """Errors 1 over 1500 samples and 3 over 500: √((1500 + 9·500)/2000)."""
    whole, part = member(1.0), member(3.0, until=4.0)
    part = part._replace(reference=torque("x", part.reference.tau[:, 0], floor=np.array([2.0])))
    row = pooled_row(whole, part)
    assert row["recording"] == POOLED
    assert row["samples"] == 2000
    assert row["rmse_Nm"] == pytest.approx(np.sqrt((1500.0 + 9.0 * 500.0) / 2000.0))
    assert row["bias_Nm"] == pytest.approx(1.5)
    assert row["reference_floor_Nm"] == pytest.approx(np.sqrt((1500.0 + 4.0 * 500.0) / 2000.0))


def test_one_log_another_arm_or_other_observers_are_not_pooled() -> None:
    """A UR5 and a UR10e have six joints each and the same observers; their errors are two arms'."""
    one = member(1.0)
    others = (member(1.0, robot="ur10e"), one._replace(estimates=[torque("gmo", WAVE)]))
    assert all(evaluate_pooled(some).is_empty() for some in ([one], *([one, x] for x in others)))
    assert not evaluate_pooled([one, one]).is_empty()


def test_coverage_is_pooled_over_the_samples_of_all() -> None:
    """1500 samples within the band and 500 outside it: three quarters."""
    sd = np.ones((len(T), 1))
    row = pooled_row(member(0.0, error_sd=sd), member(3.0, until=4.0, error_sd=sd))
    assert row["coverage_95"] == pytest.approx(0.75)


def test_a_log_without_a_lag_does_not_pull_the_others() -> None:
    late = np.interp(T - 0.08, T, WAVE)
    delayed = PoolMember("ur5", [torque("fdo", late)], torque("x", WAVE))
    still = PoolMember("ur5", [torque("fdo", np.zeros_like(T))], torque("x", WAVE))
    quarter = 2e-3  # of a step
    assert pooled_row(delayed, still)["lag_s"] == pytest.approx(0.08, abs=quarter)
    # One of a third of the samples that is not late takes a quarter of the weight.
    assert pooled_row(delayed, member(0.0, 4.0))["lag_s"] == pytest.approx(0.06, abs=quarter)


def test_a_log_without_a_known_sample_adds_none() -> None:
    empty = member(1.0, until=-1.0)
    alone, row = row_of(empty.estimates[0], empty.reference), pooled_row(empty, member(2.0))
    assert (alone["rmse_Nm"], alone["samples"]) == (None, 0)
    assert (row["rmse_Nm"], row["samples"]) == (pytest.approx(2.0), len(T))
