"""Logs as one experiment: what is pooled is weighed by samples, and never over two arms."""

import numpy as np
import pytest

from vftcli.evaluation.errors import POOLED, PoolMember, evaluate, evaluate_pooled
from vftcli.signals.external_torque import ExternalTorque

T = 0.008 * np.arange(1500)
WAVE = np.sin(2.0 * np.pi * 0.7 * T)


def torque(name: str, tau: np.ndarray, **more: object) -> ExternalTorque:
    return ExternalTorque(name=name, t=T, tau=tau[:, None], **more)  # type: ignore[arg-type]


def member(error: float, until: float = 99.0, robot: str = "ur5", **more: object) -> PoolMember:
    """A log with a constant error, its reference known until a time."""
    reference = torque("x", np.where(until > T, WAVE, np.nan), floor=np.array([1.0]))
    return PoolMember(robot, [torque("fdo", WAVE + error, **more)], reference)


def row_of(*members: PoolMember) -> dict[str, object]:
    return evaluate_pooled(members).row(0, named=True)


def test_pooled_rows_weigh_samples() -> None:
    """Errors 1 over 1500 samples and 3 over 500: √((1500 + 9·500)/2000)."""
    whole, part = member(1.0), member(3.0, until=4.0)
    part = part._replace(reference=torque("x", part.reference.tau[:, 0], floor=np.array([2.0])))
    row = row_of(whole, part)
    assert row["recording"] == POOLED
    assert row["samples"] == 2000
    assert row["rmse_Nm"] == pytest.approx(np.sqrt((1500.0 + 9.0 * 500.0) / 2000.0))
    assert row["bias_Nm"] == pytest.approx(1.5)
    assert row["reference_floor_Nm"] == pytest.approx(np.sqrt((1500.0 + 4.0 * 500.0) / 2000.0))


def test_a_pool_of_one_log_twice_has_its_rmse_and_a_narrower_interval() -> None:
    rng = np.random.default_rng(0)
    noisy = [
        PoolMember("ur5", [torque("fdo", WAVE + rng.standard_normal(len(T)))], torque("x", WAVE))
        for _ in range(4)
    ]
    pooled = row_of(*noisy)
    alone = evaluate("log", noisy[0].estimates, noisy[0].reference).row(0, named=True)
    width = [row["rmse_high_Nm"] - row["rmse_low_Nm"] for row in (pooled, alone)]
    # Four logs: half the width, known to some 20 % by the bootstrap of each.
    assert width[0] / width[1] == pytest.approx(0.5, rel=0.3)


def test_logs_of_two_arms_are_not_pooled() -> None:
    """A UR5 and a UR10e have six joints each and the same observers; their errors are two arms'."""
    assert evaluate_pooled([member(1.0), member(1.0, robot="ur10e")]).is_empty()
    assert not evaluate_pooled([member(1.0), member(1.0)]).is_empty()


def test_one_log_or_other_observers_are_not_pooled() -> None:
    one = member(1.0)
    other = one._replace(estimates=[torque("gmo", WAVE)])
    assert evaluate_pooled([one]).is_empty()
    assert evaluate_pooled([one, other]).is_empty()


def test_coverage_is_pooled_over_the_samples_of_all() -> None:
    """1500 samples within the band and 500 outside it: three quarters."""
    sd = np.ones((len(T), 1))
    row = row_of(member(0.0, error_sd=sd), member(3.0, until=4.0, error_sd=sd))
    assert row["coverage_95"] == pytest.approx(0.75)


def test_a_log_without_a_lag_does_not_pull_the_others() -> None:
    late = np.interp(T - 0.08, T, WAVE)
    delayed = PoolMember("ur5", [torque("fdo", late)], torque("x", WAVE))
    still = PoolMember("ur5", [torque("fdo", np.zeros_like(T))], torque("x", WAVE))
    assert row_of(delayed, still)["lag_s"] == pytest.approx(0.08, abs=2e-3)  # a quarter of a step
    # One of a third of the samples that is not late takes a quarter of the weight.
    prompt = PoolMember(
        "ur5", [torque("fdo", WAVE)], torque("x", np.where(T < 4.0, WAVE, np.nan))
    )
    assert row_of(delayed, prompt)["lag_s"] == pytest.approx(0.06, abs=2e-3)


def test_a_log_without_a_known_sample_adds_none() -> None:
    empty = member(1.0, until=-1.0)
    assert row_of(empty, member(2.0))["rmse_Nm"] == pytest.approx(2.0)
    assert row_of(empty, member(2.0))["samples"] == len(T)
