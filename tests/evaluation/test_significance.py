"""Pairs of observers: every pair once, its sign, and p between its bounds."""

import numpy as np
import pytest

from vftcli.evaluation.intervals import p_value, paired_significance
from vftcli.signals.external_torque import ExternalTorque

T = 0.01 * np.arange(500)


def estimate(name: str, *errors: np.ndarray) -> ExternalTorque:
    return ExternalTorque(name=name, t=T, tau=np.column_stack(errors))


def test_every_pair_of_observers_on_every_joint() -> None:
    rng = np.random.default_rng(0)
    three = [estimate(n, *rng.standard_normal((2, 500))) for n in ("a", "b", "c")]
    table = paired_significance("log", three, estimate("zero", *np.zeros((2, 500))))
    pairs = list(zip(table["joint"], table["observer"], table["other"], strict=True))
    assert pairs == [(j, *pair) for j in (1, 2) for pair in (("a", "b"), ("a", "c"), ("b", "c"))]
    for row in table.iter_rows(named=True):
        assert row["low_Nm"] < row["high_Nm"]
        assert 1e-3 <= row["p"] <= 1.0


def test_the_difference_is_the_first_less_the_second() -> None:
    two = [estimate("a", np.full(500, 3.0)), estimate("b", np.full(500, -2.0))]
    row = paired_significance("log", two, estimate("zero", np.zeros(500))).row(0, named=True)
    assert row["difference_Nm"] == pytest.approx(1.0)
    assert row["p"] == 1e-3  # certain: one over the number of draws


def test_a_joint_without_two_known_samples_has_no_row() -> None:
    unknown = np.full(500, np.nan)
    unknown[3] = 1.0
    two = [estimate(n, *np.ones((2, 500))) for n in ("a", "b")]
    assert paired_significance("log", two, estimate("z", unknown, np.zeros(500)))[
        "joint"
    ].to_list() == [2]


def test_p_is_two_sided_and_draws_within_a_billionth_are_one_number() -> None:
    """Above in 3 of 100 paired draws: p = .06 either way round."""
    first, second = np.ones(100), np.full(100, 2.0)
    first[:3] = 3.0
    assert [p_value(first, second), p_value(second, first)] == pytest.approx([0.06, 0.06])
    first = np.linspace(1.0, 3.0, 500)  # of mean 2
    for apart, p in ((0.0, 1.0), (0.9e-9, 1.0), (1.1e-9, 1.0 / 500)):
        assert p_value(first, first + 2.0 * apart) == p
        assert p_value(first + 2.0 * apart, first) == p
