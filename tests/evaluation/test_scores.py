"""Scores of estimates against truth, beside NumPy that shares nothing with them."""

import numpy as np
import pytest

from vftcli.evaluation.errors import evaluate, joint_means
from vftcli.evaluation.scores import (
    LAGS,
    ListedRow,
    Score,
    episodes,
    lag_sums,
    parts_of,
    rate_interval,
    score_list,
    share_interval,
)
from vftcli.signals.arrays import Array
from vftcli.signals.external_torque import ExternalTorque

CLOSE = {"rel": 1e-9}


def oracle(
    t: Array, tau: Array, truth: Array, inside: Array, sd: Array | None
) -> dict[str, float]:
    """The definitions of docs/benchmark.md, sample by sample."""
    gaps = np.gradient(t)
    middle = float(np.median(gaps))
    w = [min(gap, 5 * middle) for gap in gaps]
    squares, sizes, level, cells = [], [], [], {}
    total = sum(w[k] for k in range(len(t)) if inside[k])
    held = asked = penalty = 0.0
    for j in range(truth.shape[1]):
        e2 = e1 = y2 = 0.0
        for k in range(len(t)):
            if not inside[k]:
                continue
            answer = tau[k, j] if tau[k, j] == tau[k, j] else 0.0
            error = abs(answer - truth[k, j])
            e2, e1, y2 = e2 + w[k] * error**2, e1 + w[k] * error, y2 + w[k] * truth[k, j] ** 2
            cell = cells.setdefault(int((t[k] - t[0]) // 2), [0.0, *[0.0] * truth.shape[1]])
            cell[0] += w[k] * (j == 0)
            cell[1 + j] += w[k] * error**2
            if sd is not None and sd[k, j] == sd[k, j]:
                band = 1.96 * sd[k, j]
                asked, held = asked + w[k], held + w[k] * (error <= band)
                penalty += w[k] * (2 * band + 40 * max(0.0, error - band))
        squares.append((e2 / total) ** 0.5)
        sizes.append(e1 / total)
        level.append((y2 / total) ** 0.5)
    rows = np.array([cells[k] for k in sorted(cells)])
    picked = rows[np.random.default_rng(0).integers(0, len(rows), (1000, len(rows)))].sum(axis=1)
    drawn = np.sqrt(picked[:, 1:] / picked[:, :1]).mean(axis=1)
    return {
        "rmse_Nm": sum(squares) / len(squares),
        "l1_Nm": sum(sizes) / len(sizes),
        "skill": 1 - sum(squares) / sum(level),
        "coverage_95": held / asked if asked else float("nan"),
        "interval_score_Nm": penalty / asked if asked else float("nan"),
        "rmse_low_Nm": float(np.percentile(drawn, 2.5)),
        "rmse_high_Nm": float(np.percentile(drawn, 97.5)),
    }


def score_of(estimate: ExternalTorque, truth: Array, inside: Array) -> Score:
    """The score of an estimate with its own band."""
    return Score.of(estimate.t, estimate.tau, truth, inside, estimate.error_sd)


def made(seed: int = 1, samples: int = 2400) -> tuple[ExternalTorque, Array]:
    """An estimate with gaps in clock, answers and bands, and the truth."""
    rng = np.random.default_rng(seed)
    t = np.cumsum(rng.choice([0.01, 0.012, 0.2], samples, p=[0.6, 0.39, 0.01]))
    truth = np.sin(t)[:, None] * [3.0, 1.0, 0.2]
    tau = truth + rng.normal(0.0, 0.4, truth.shape)
    tau[rng.random(truth.shape) < 0.05] = np.nan
    sd = rng.uniform(0.1, 0.6, truth.shape)
    sd[:200] = np.nan
    return ExternalTorque(name="made", t=t, tau=tau, error_sd=sd), truth


@pytest.mark.parametrize("banded", [True, False])
def test_scores_are_those_of_plain_loops(banded: bool) -> None:
    estimate, truth = made()
    if not banded:
        estimate = ExternalTorque(name="made", t=estimate.t, tau=estimate.tau)
    inside = estimate.t > 3.0
    expected = oracle(estimate.t, estimate.tau, truth, inside, estimate.error_sd)
    found = score_of(estimate, truth, inside).numbers()
    assert {key: found[key] for key in expected} == pytest.approx(expected, nan_ok=True, **CLOSE)


def test_the_truth_is_perfect_and_nothing_is_zero() -> None:
    estimate, truth = made()
    everywhere = np.ones(len(truth), bool)
    exact = ExternalTorque(name="exact", t=estimate.t, tau=truth)
    silent = ExternalTorque(name="silent", t=estimate.t, tau=np.full(truth.shape, np.nan))
    nothing = ExternalTorque(name="zero", t=estimate.t, tau=np.zeros(truth.shape))
    perfect, silence, zero = (
        score_of(each, truth, everywhere).numbers() for each in (exact, silent, nothing)
    )
    assert (perfect["skill"], perfect["l1_Nm"]) == (1.0, 0.0)
    assert (silence["skill"], silence.pop("missing"), zero.pop("missing")) == (0.0, 1.0, 0.0)
    assert silence == pytest.approx(zero, abs=0.0, nan_ok=True)


def test_errors_have_l1_and_skill_of_the_joints_that_count() -> None:
    estimate, truth = made()
    reference = ExternalTorque(name="truth", t=estimate.t, tau=truth)
    means = joint_means(evaluate("log", [estimate], reference))
    error = np.where(np.isfinite(estimate.tau), estimate.tau, 0.0) - truth
    rms = np.sqrt(np.mean([error**2, truth**2], axis=1))
    assert means.l1["made"] == pytest.approx(abs(error).mean())
    assert means.skill["made"] == pytest.approx(1.0 - rms[0].mean() / rms[1].mean())


def test_a_shift_is_read_as_lag() -> None:
    t = np.arange(0.0, 20.0, 0.01)
    truth, late = (np.sin(2.0 * (t - shift))[:, None] for shift in (0.0, 0.05))
    sums = lag_sums(ExternalTorque(name="late", t=t, tau=late), truth, (t > 1) & (t < 18))
    assert LAGS[np.argmin(sums)] == pytest.approx(0.05)
    assert LAGS[[0, -1]] == pytest.approx([-0.1, 0.5])  # what docs/benchmark.md states
    assert len(sums) == 61
    # Unknown is read as 0 whatever the lag: the truth's own squares, 10 ms each.
    silent = ExternalTorque(name="silent", t=t, tau=np.full((len(t), 1), np.nan))
    inside = (t > 1) & (t < 18)
    squares = 0.01 * float((truth[inside] ** 2).sum())
    assert lag_sums(silent, truth, inside) == pytest.approx([squares] * 61, **CLOSE)


def test_eight_cells_have_an_interval_and_seven_have_none() -> None:
    t = np.arange(0.0, 16.0, 0.01)
    noise = np.random.default_rng(2).normal(size=(len(t), 2))
    estimate = ExternalTorque(name="noise", t=t, tau=noise)
    for cells in (7, 8):
        found = score_of(estimate, np.zeros_like(noise), t < 2.0 * cells - 0.005).numbers()
        assert (found["rmse_low_Nm"] < found["rmse_Nm"] < found["rmse_high_Nm"]) == (cells == 8)
        assert np.isnan(found["rmse_low_Nm"]) == (cells == 7)


def test_two_logs_are_one_sum() -> None:
    (first, truth), (second, other) = made(1), made(2)
    everywhere = np.ones(len(truth), bool)
    one, two = score_of(first, truth, everywhere), score_of(second, other, everywhere)
    joints = zip(one.by_joint(), two.by_joint(), strict=True)
    both = Score.pooled([{name: a[name] + b[name] for name in a} for a, b in joints])
    seconds = [score.numbers()["seconds"] for score in (one, two)]
    square = (one.rmse**2 * seconds[0] + two.rmse**2 * seconds[1]) / sum(seconds)
    assert both.rmse == pytest.approx(np.sqrt(square))
    assert len(both.seconds) == len(one.seconds) + len(two.seconds)


def test_episodes_start_end_and_join() -> None:
    t = np.arange(0.0, 6.0, 0.01)
    size = np.zeros(len(t))
    size[90:100] = 0.5  # above where one ends, before it starts
    size[100:150] = 2.0  # a contact
    size[150:158] = 0.1  # a gap of .08 s is closed,
    size[158:200] = 3.0
    size[212:240] = 4.0  # one of .12 s parts two
    size[240:250] = 0.5  # not yet below where one ends
    size[300:302] = 9.0  # two samples and the one in which it ends: .02 s
    size[400:404] = 9.0  # .04 s
    size[500:520] = 1.0  # not above where one starts
    found = episodes(t, size, 1.0, 0.5)
    assert found == [
        pytest.approx(each) for each in ((1.0, 2.0, 3.0), (2.12, 2.5, 4.0), (4.0, 4.04, 9.0))
    ]


def test_what_is_near_a_contact_is_in_no_part_but_all() -> None:
    t = np.arange(0.0, 10.0, 0.01)
    scored_from_one = t >= 1.0
    parts = parts_of(t, scored_from_one, [(4.0, 5.0, 1.0)])
    assert t[parts["contact"]][[0, -1]] == pytest.approx([4.0, 5.0])
    np.testing.assert_array_equal(parts["free"], scored_from_one & ~((t > 3.495) & (t < 5.505)))
    assert parts["all"].sum() == scored_from_one.sum()
    assert parts["free"].sum() < parts["all"].sum() - parts["contact"].sum()


# Lists of contacts against the true ones, and the intervals of what is counted


NAN = float("nan")


def test_found_split_false_onset_and_peak() -> None:
    true = [(2.0, 3.0, 20.0), (5.0, 6.0, NAN), (8.0, 9.0, 10.0), (9.5, 9.8, 33.0)]
    rows = [
        ListedRow(2.1, 2.4, 15.0, 6.0),  # finds the first, its band holds the peak
        ListedRow(2.6, 3.05, 18.0, 1.0),  # a second row on it
        ListedRow(6.08, 6.5, 5.0, 1.0, is_load=True),  # within the slack of the second
        ListedRow(6.9, 7.1, 30.0, 1.0),  # nothing there
        ListedRow(7.5, 7.92, 11.0, 1.0),  # within the slack before the third
        ListedRow(10.0, 11.8, 20.0, 1.0),  # beyond the slack, most of it nearer than 11 s
        ListedRow(10.8, 11.4, 80.0, 1.0),  # where, by its middle, nobody vouches
        ListedRow(12.0, 13.0, 90.0, 1.0),
    ]
    found = score_list(rows, true, [(-5.0, 11.0)], duration=20.0)
    whole = ("true_contacts", "found", "found_as_load", "split", "false", "hardest_false_N")
    assert [found[name] for name in whole] == [4, 3, 1, 1, 2, 30.0]
    assert found["free_h"] == pytest.approx((11.0 - 3.3) / 3600.0)
    assert found["onset_s"] == pytest.approx([0.1, 1.08, -0.5])
    # Of the rows on a contact the hardest counts: 18 N of 20, with a band of 1 N; 11 of 10.
    assert found["peak_error_N"] == pytest.approx([-2.0, 1.0])
    assert found["true_peak_N"] == [20.0, 10.0]
    assert found["peaks_held"] == 1


def test_a_vouched_span_ends_with_the_log() -> None:
    assert score_list([], [], [(0.0, 1e9)], duration=36.0)["free_h"] == pytest.approx(0.01)
    # A true contact that is longer than what is vouched for leaves no time, not less than none.
    assert score_list([], [(0.0, 9.0, NAN)], [(1.0, 2.0)], duration=36.0)["free_h"] == 0.0


@pytest.mark.parametrize(
    ("count", "low", "high"),
    # Exact 95 % limits of a Poisson mean: Garwood (1936), table as in any handbook.
    [(0, 0.0, 3.6889), (1, 0.02532, 5.5716), (3, 0.6187, 8.7673), (10, 4.7954, 18.3904)],
)
def test_a_rate_has_its_exact_poisson_interval(count: int, low: float, high: float) -> None:
    assert rate_interval(count, 1.0) == pytest.approx((low, high), abs=1e-4)
    assert rate_interval(count, 2.0) == pytest.approx((low / 2, high / 2), abs=1e-4)
    assert rate_interval(count, 0.0) == pytest.approx((NAN, NAN), nan_ok=True)


@pytest.mark.parametrize(
    ("part", "whole", "low", "high"),
    # Roots of (p̂ − p)² = z² p (1 − p)/n, solved by hand: 7/14 is symmetric about a half.
    [(7, 14, 0.26799, 0.73201), (0, 6, 0.0, 0.39033), (6, 6, 0.60967, 1.0), (0, 0, NAN, NAN)],
)
def test_a_share_has_its_wilson_interval(part: int, whole: int, low: float, high: float) -> None:
    found = share_interval(part, whole)
    assert found == pytest.approx((low, high), abs=1e-5, nan_ok=True)
    assert not found[0] < 0.0
