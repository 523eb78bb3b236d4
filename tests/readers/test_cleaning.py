"""Cleaning: what is dropped, what is said of it, and what cannot be radians."""

from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from vftcli.readers.cleaning import cleaned
from vftcli.readers.reader import RawLog, ReadChoice
from vftcli.readers.reading import Library
from vftcli.signals.errors import ClockError, LogError
from vftcli.signals.recording import Recording

ROWS = 300
GARBAGE = 3e19
"""A misread double: far beyond any joint position."""


def made(stamps: Any, q: Any, **more: Any) -> Recording:
    signals = {"q": np.asarray(q)} | more.pop("signals", {})
    log = RawLog(stamps=np.asarray(stamps), clock="test", signals=signals, **more)
    return cleaned(log, Path("log"), "test", ReadChoice())


@pytest.mark.parametrize(
    ("jumps", "absurd", "dropped"),
    [
        # Steps are judged in seconds: in nanoseconds each of them would be an enormous jump.
        ({}, (0,), 1),
        ({4: 1000.0}, (0,), 4),
        ({4: 1000.0, 8: 1000.0}, (0,), 8),
        # A pause of up to a minute, and of a thousand steps of a slow log, is no jump.
        ({4: 30.0}, (0,), 1),
        # A jump without garbage is left to be reported; one bad value is no misaligned packet.
        ({4: 1000.0}, (), 0),
        ({200: 1000.0}, (0,), 1),
    ],
)
def test_what_lies_before_the_clocks_last_jump_goes_with_the_garbage(jumps, absurd, dropped):
    """500 Hz, stamped in nanoseconds; the clock jumps by so many seconds before some rows."""
    steps = np.full(ROWS, 2_000_000, dtype=np.int64)
    for row, seconds in jumps.items():
        steps[row] += round(seconds * 1e9)
    q = np.full((ROWS, 6), 0.5)
    q[list(absurd)] = GARBAGE
    stamps = 1_700_000_000_000_000_000 + np.cumsum(steps)
    recording = made(stamps, q, tick=1e-9)
    assert (recording.samples, recording.source.rows) == (ROWS - dropped, ROWS)
    assert recording.source.t0_ns == int(stamps[dropped])
    found = [r.values["rows"] for r in recording.source.remarks if "rows" in r.values]
    assert found == ([dropped] if dropped else [])


def test_a_clock_may_jump_back_behind_garbage_and_a_bad_value_later_is_none():
    q, t = np.full((ROWS, 6), 0.5), 5 + 0.002 * np.arange(ROWS)
    q[0] = GARBAGE
    assert made(np.r_[5.0 + t[:4], t[4:]], q).samples == ROWS - 4
    with pytest.raises(LogError, match="sample 8"):
        made(t, np.roll(q, 7, axis=0))


@pytest.mark.parametrize(
    ("joints", "least", "reach", "words"),
    [
        (6, 0.0, 12.9, None),
        (6, 0.0, 13.1, "looks like degrees"),
        (6, -6.8, 6.8, r"travel 13\.6"),
        (7, 0.0, 6.3, None),
        (7, 0.0, 6.5, "looks like degrees"),
    ],
)
def test_positions_that_no_joint_reaches_are_refused_as_degrees(joints, least, reach, words):
    """Two turns are 12.6 rad; joints of seven-joint arms stay within one, 6.28 rad."""
    q = np.zeros((10, joints))
    q[5, 2], q[6, 2] = reach, least
    with pytest.raises(LogError, match=words) if words else nullcontext():
        assert made(np.arange(10.0), q, degrees_possible=True).joints == joints


def test_a_named_joint_without_numbers_is_left_out_and_said():
    """A gripper's effort is NaN throughout; of a whole signal that is NaN no joint is left out."""
    t, q, effort = 0.01 * np.arange(ROWS), np.full((ROWS, 3), 0.5), np.full((ROWS, 3), 2.0)
    effort[:, 1] = np.nan
    named = {"joint_names": ("a", "finger", "b")}
    found = made(t, q, signals={"torque": effort}, **named)
    assert (found.joint_names, found.q.shape) == (("a", "b"), (ROWS, 2))
    (remark,) = found.source.remarks
    assert (remark.code, remark.values["joints"]) == ("joints-empty", ["finger"])
    with pytest.raises(LogError, match="torque of joint 2 holds no numbers"):
        made(t, q, signals={"torque": effort})
    with pytest.raises(LogError, match="log: wrench axis 2 holds no numbers at all"):
        made(t, q, signals={"wrench": effort}, **named)  # of as many axes as joints
    effort[:] = np.nan
    with pytest.raises(LogError, match="torque of joint 1 holds no numbers"):
        made(t, q, signals={"torque": effort}, **named)


def test_a_log_of_more_years_than_nanoseconds_count_is_refused():
    """From the farthest start on 64 bits count 2.2e8 s: a cast to whole ones overflowed."""
    with pytest.raises(ClockError, match="over 3e\\+08 s, which no robot's log is"):
        made(np.linspace(0.0, 3e8, 10), np.zeros((10, 6)))


@pytest.mark.parametrize(
    ("empty", "first", "samples"),
    [
        ([(12, 1), (14, 0)], 13, 18),  # a cell of q1, and a stamp
        ([(18, 3), (19, 1), (19, 3)], 19, 18),
        ([], None, 20),
    ],
)
def test_rows_with_an_unknown_value_are_left_out_and_counted(tmp_path, empty, first, samples):
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
