"""Findings about the clock: each with a known amount of its fault, just inside and just outside."""

from dataclasses import replace

import numpy as np
import pytest
from swinging import STEP, log_of, said_of

from vftcli.signals.arrays import Array
from vftcli.signals.recording import Recording, Source


def log_with(steps: Array) -> Recording:
    """A log of two moving joints whose samples are so far apart. (T - 1,) [s]"""
    t = np.concatenate([[0.0], np.cumsum(steps)])
    q, dq = np.column_stack([np.sin(t), np.cos(t)]), np.column_stack([np.cos(t), -np.sin(t)])
    return log_of(t=t, q=q, dq=dq)


def steps_with(count: int, factor: float, of: int = 1000) -> Array:
    """So many steps, a few of them, spread over the log, longer by a factor. [s]"""
    steps = np.full(of, STEP)
    steps[np.linspace(10, of - 10, count).astype(int)] *= factor
    return steps


@pytest.mark.parametrize(
    ("samples", "code"), [(2, "too-short"), (8, "short"), (126, "short"), (129, ""), (131, "")]
)
def test_below_two_seconds_a_log_is_short(samples: int, code: str) -> None:
    """Steps of 1/64 s are exact, so 129 samples last 2 s to the bit and are long enough."""
    findings = said_of(log_with(np.full(samples - 1, 1 / 64)))
    assert set(findings) == ({code} if code else set())
    if code == "short":
        assert findings[code].values["duration_s"] == pytest.approx((samples - 1) / 64)
        assert findings[code].level == "fact"


@pytest.mark.parametrize(("rate", "reported"), [(49.0, True), (51.0, False)])
def test_below_fifty_samples_a_second_the_rate_is_slow(rate: float, reported: bool) -> None:
    findings = said_of(log_with(np.full(1000, 1 / rate)))
    assert set(findings) == ({"slow-rate"} if reported else set())
    if reported:
        assert findings["slow-rate"].values["rate_Hz"] == pytest.approx(rate)
        assert findings["slow-rate"].level == "warning"


@pytest.mark.parametrize(
    ("count", "factor", "reported"),
    [
        (1, 2.0, False),  # one in a thousand is nothing to tell
        (2, 2.0, True),
        (7, 1.5, False),  # half a sample time late is late, not missed
        (7, 1.7, True),
        (7, 3.3, True),
        (7, 3.5, False),
    ],
)
def test_steps_of_two_or_three_sample_times_are_missed_samples(
    count: int, factor: float, reported: bool
) -> None:
    findings = said_of(log_with(steps_with(count, factor)))
    assert set(findings) == ({"missing-samples"} if reported else set())
    if reported:
        assert dict(findings["missing-samples"].values) == {"missed": count, "steps": 1000}


@pytest.mark.parametrize(("half", "reported"), [(0.0, False), (0.02, False), (0.03, True)])
def test_steps_that_vary_by_a_twentieth_are_jitter(half: float, reported: bool) -> None:
    """A tenth of the steps is shorter, a tenth longer: the spread of nine in ten is twice that."""
    steps = np.full(1000, STEP)
    steps[5::10] *= 1 - half
    steps[::10] *= 1 + half
    findings = said_of(log_with(steps))
    assert set(findings) == ({"jitter"} if reported else set())
    if reported:
        values = findings["jitter"].values
        assert values["spread_percent"] == pytest.approx(200 * half)
        assert values["low_ms"] == pytest.approx(10 * (1 - half))
        assert values["high_ms"] == pytest.approx(10 * (1 + half))
        assert values["clock"] == "as given"


def test_rare_jitter_is_not_reported() -> None:
    """Four in a hundred steps at either end lie outside the nine in ten, seven do not."""
    steps = np.full(1000, STEP)
    steps[100:140] *= 0.5
    steps[200:240] *= 1.5
    assert "jitter" not in said_of(log_with(steps))
    steps[240:270] *= 1.5
    assert "jitter" in said_of(log_with(steps))


@pytest.mark.parametrize(("factor", "reported"), [(3.9, False), (4.1, True)])
def test_four_sample_times_are_a_gap_and_no_jitter(factor: float, reported: bool) -> None:
    """A tenth of the steps are that long: as jitter they would be reported at once."""
    findings = said_of(log_with(steps_with(100, factor)))
    assert set(findings) == ({"gaps"} if reported else {"jitter"})
    if reported:
        assert findings["gaps"].values["gaps"] == 100
        assert findings["gaps"].values["steps"] == 4.0


@pytest.mark.parametrize(("longest", "level"), [(0.09, "fact"), (0.11, "warning")])
def test_the_longest_gap_decides_how_bad_they_are(longest: float, level: str) -> None:
    """A tenth of a second can hide a whole contact."""
    steps = steps_with(0, 1.0)
    steps[300], steps[600] = 0.05, longest
    finding = said_of(log_with(steps))["gaps"]
    assert (finding.level, finding.values["gaps"]) == (level, 2)
    assert finding.values["longest_s"] == pytest.approx(longest)
    assert finding.values["at_s"] == pytest.approx(600 * STEP + 0.05 - STEP)


@pytest.mark.parametrize(("repeats", "level"), [(1, "fact"), (20, "fact"), (22, "warning")])
def test_repeated_stamps_of_more_than_a_tenth_are_a_warning(repeats: int, level: str) -> None:
    source = Source(duplicates=repeats, rows=200)
    finding = said_of(replace(log_with(steps_with(0, 1.0)), source=source))["repeated-stamps"]
    values = {"repeats": repeats, "rows": 200, "share_percent": pytest.approx(repeats / 2)}
    assert (finding.level, dict(finding.values)) == (level, values)


def with_stale(count: int, scale: float = 1.0) -> Recording:
    """A log of 1001 samples, so many of which repeat the row before them."""
    t = STEP * np.arange(1001)
    source = np.arange(1001)
    for k in np.linspace(2, 999, count).astype(int):
        source[k] = source[k - 1]
    q = np.column_stack([np.sin(t), np.cos(t)])[source]
    dq = scale * np.column_stack([1 + np.sin(t), 1 + np.cos(t)])[source]
    return Recording(t=t, q=q, dq=dq, torque=t[source][:, None] * [1.0, 2.0])


@pytest.mark.parametrize(
    ("count", "reported"),
    # An arm at rest repeats nearly all its rows.
    [(2, False), (3, True), (10, True), (880, True), (920, False)],
)
def test_three_rows_in_a_thousand_that_repeat_are_reported(count: int, reported: bool) -> None:
    findings = said_of(with_stale(count))
    assert ("stale-rows" in findings) == reported
    if reported:
        assert findings["stale-rows"].level == "fact"
        assert findings["stale-rows"].values["stale"] == count
        assert findings["stale-rows"].values["share_percent"] == pytest.approx(count / 10)


def test_a_row_is_stale_only_where_it_moves_and_every_signal_repeats() -> None:
    """Where no joint is faster than 1 mrad/s equal rows are what a resting arm gives."""
    assert "stale-rows" in said_of(with_stale(50, scale=0.6e-3))  # up to 1.2 mrad/s
    assert "stale-rows" not in said_of(with_stale(50, scale=0.4e-3))  # up to 0.8 mrad/s
    log = with_stale(50)
    fresh = np.column_stack([log.t, log.t])
    for other in (
        replace(log, temperature=fresh),
        replace(log, q=log.q + np.outer(log.t, [0.0, 1.0])),
        replace(log, dq=None),
    ):
        assert "stale-rows" not in said_of(other)
