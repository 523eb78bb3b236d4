"""Cleaning: what is dropped at the start, where a clock jumps, and what cannot be radians."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from vftcli.readers.cleaning import cleaned, without_leading_garbage
from vftcli.readers.library import Library
from vftcli.readers.reader import RawLog, ReadChoice
from vftcli.signals.errors import ClockError, LogError

STEP_NS = 2_000_000
ROWS = 300
GARBAGE = 3e19
"""A misread double: far beyond any joint position."""


def raw(jumps: dict[int, float] | None = None, *, absurd: tuple[int, ...] = (0,)) -> RawLog:
    """500 Hz, stamped in nanoseconds; the clock jumps by so many seconds before some rows."""
    steps = np.full(ROWS, STEP_NS, dtype=np.int64)
    for row, seconds in (jumps or {}).items():
        steps[row] += round(seconds * 1e9)
    q = np.full((ROWS, 6), 0.5)
    q[list(absurd)] = GARBAGE
    stamps = 1_700_000_000_000_000_000 + np.cumsum(steps)
    return RawLog(stamps=stamps, tick=1e-9, clock="test", signals={"q": q})


def dropped(log: RawLog) -> int:
    return ROWS - len(without_leading_garbage(log).stamps)


def test_a_lone_absurd_row_at_the_start_goes_alone_whatever_the_stamps_count_in():
    """Steps are judged in seconds: in nanoseconds each of them would be an enormous jump."""
    assert dropped(raw()) == 1


def test_what_lies_before_the_clocks_last_jump_goes_with_the_garbage():
    assert dropped(raw({4: 1000.0})) == 4
    assert dropped(raw({4: -5.0})) == 4
    assert dropped(raw({4: 1000.0, 8: 1000.0})) == 8


def test_a_pause_is_no_jump():
    """Up to a minute, and to a thousand steps of a slow log: 30 s here."""
    assert dropped(raw({4: 30.0})) == 1


def test_a_jump_without_garbage_is_left_to_be_reported():
    assert dropped(raw({4: 1000.0}, absurd=())) == 0


def test_one_bad_value_among_good_rows_is_not_a_misaligned_packet():
    assert dropped(raw(absurd=(7,))) == 0


def test_rows_after_the_head_are_never_taken_for_garbage():
    assert dropped(raw({200: 1000.0})) == 1


def test_the_source_counts_from_the_first_row_that_is_kept():
    recording = cleaned(raw({4: 1000.0}), Path("x"), "test")
    assert recording.samples == ROWS - 4
    assert recording.source.rows == ROWS
    assert recording.source.t0_ns == int(raw({4: 1000.0}).stamps[4])
    assert [r.values["rows"] for r in recording.source.remarks] == [4]


@pytest.mark.parametrize(
    ("joints", "reach", "refused"),
    [(6, 12.9, False), (6, 13.1, True), (7, 6.3, False), (7, 6.5, True)],
)
def test_positions_that_no_joint_reaches_are_refused_as_degrees(joints, reach, refused):
    """Two turns are 12.6 rad; joints of seven-joint arms stay within one, 6.28 rad."""
    q = np.zeros((10, joints))
    q[5, 2] = reach
    log = RawLog(stamps=np.arange(10.0), clock="test", signals={"q": q}, degrees_possible=True)
    if refused:
        with pytest.raises(LogError, match="looks like degrees"):
            cleaned(log, Path("x"), "test")
    else:
        assert cleaned(log, Path("x"), "test").joints == joints


def test_a_span_wider_than_two_turns_is_refused_too():
    q = np.zeros((10, 6))
    q[3], q[6] = -6.8, 6.8
    log = RawLog(stamps=np.arange(10.0), clock="test", signals={"q": q}, degrees_possible=True)
    with pytest.raises(LogError, match=r"travel 13\.6"):
        cleaned(log, Path("x"), "test")


def test_a_named_joint_without_numbers_is_left_out_and_said():
    """A gripper's effort is NaN throughout; of a whole signal that is NaN no joint is left out."""
    q, effort = np.full((ROWS, 3), 0.5), np.full((ROWS, 3), 2.0)
    effort[:, 1] = np.nan
    log = RawLog(
        stamps=np.arange(ROWS) * 0.01,
        clock="test",
        signals={"q": q, "torque": effort},
        joint_names=("a", "finger", "b"),
    )
    found = cleaned(log, Path("log"), "test")
    assert found.joint_names == ("a", "b")
    assert found.q.shape == (ROWS, 2)
    assert [(r.code, r.values["joints"]) for r in found.source.remarks] == [
        ("joints-empty", ["finger"])
    ]
    with pytest.raises(LogError, match="torque of joint 2 holds no numbers"):
        cleaned(replace(log, joint_names=()), Path("log"), "test")
    wrench = replace(log, signals={"q": q, "wrench": effort})  # of as many axes as joints
    with pytest.raises(LogError, match="log: wrench axis 2 holds no numbers at all"):
        cleaned(wrench, Path("log"), "test")
    effort[:] = np.nan
    with pytest.raises(LogError, match="torque of joint 1 holds no numbers"):
        cleaned(log, Path("log"), "test")


def test_a_log_of_more_years_than_nanoseconds_count_is_refused() -> None:
    """From the farthest start on 64 bits count 2.2e8 s: a cast to whole ones overflowed."""
    stamps = np.linspace(0.0, 3e8, 10)
    log = RawLog(stamps=stamps, clock="test", signals={"q": np.zeros((10, 6))})
    with pytest.raises(ClockError, match="over 3e\\+08 s, which no robot's log is"):
        cleaned(log, Path("log"), "test")


@pytest.mark.parametrize(
    ("empty", "first", "samples"),
    [
        ([(12, 1), (14, 0)], 13, 18),  # a cell of q1, and a stamp
        ([(18, 3), (19, 1), (19, 3)], 19, 18),
        ([], None, 20),
    ],
)
def test_rows_with_an_unknown_value_are_left_out_and_counted(
    tmp_path: Path, empty: list[tuple[int, int]], first: int | None, samples: int
) -> None:
    cells = [[f"{0.01 * k:.2f}", f"{0.1 * k:.1f}", "0.2", f"{k}"] for k in range(20)]
    for row, column in empty:
        cells[row][column] = "nan"
    path = tmp_path / "log.csv"
    path.write_text("\n".join(["t,q1,q2,tau1", *map(",".join, cells)]) + "\n")
    choice = ReadChoice.parsed(columns="t=t,q=q1,tau=tau1")
    (log,) = Library().open_each([path], replace(choice, skips_unknown=True))
    kept = [k for k in range(20) if k not in {row for row, _ in empty}]
    np.testing.assert_allclose(log.torque[:, 0], kept)
    assert log.samples == samples == len(kept)
    said = [r.values for r in log.source.remarks if r.code == "rows-unknown"]
    assert said == ([] if first is None else [{"rows": 20 - samples, "first": first}])
    rows = log.source.row_samples
    expected = [kept.index(k) if k in kept else -1 for k in range(20)]
    assert (list(range(20)) if rows is None else rows.tolist()) == expected
