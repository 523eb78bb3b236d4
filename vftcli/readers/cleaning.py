"""Cleaning: every log's way to a Recording. Nothing is repaired silently."""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vftcli.readers.reader import RawLog, ReadChoice
from vftcli.readers.table import joined
from vftcli.signals.arrays import Array, Indices, Mask, gaps_of, handed_over, median, median_step
from vftcli.signals.errors import ClockError, LogError
from vftcli.signals.recording import Recording, Source, pieces
from vftcli.signals.remarks import Remark, caution, fact, warning


def in_parts(signals: Mapping[str, NDArray[Any]]) -> Iterator[dict[str, NDArray[Any]]]:
    """Signals, some rows of all at a time."""
    for values in zip(*map(pieces, signals.values()), strict=True):
        yield dict(zip(signals, values, strict=True))


def kept(raw: RawLog, keep: Mask | slice, *remarks: Remark) -> RawLog:
    """The log with some of its rows, and remarks on the others."""
    rows = np.arange(len(raw.stamps)) if raw.rows is None else raw.rows
    if isinstance(keep, slice):
        signals = {name: value[keep] for name, value in raw.signals.items()}
    else:
        parts = in_parts({**raw.signals, "": keep})
        signals = joined({name: part[name][part[""]] for name in raw.signals} for part in parts)
    remarks, stamps = (*raw.remarks, *remarks), raw.stamps[keep]
    return replace(raw, rows=rows[keep], stamps=stamps, signals=signals, remarks=remarks)


def number_of(raw: RawLog, row: int) -> int:
    """The number of a sample in the file, counted from 1."""
    return 1 + (row if raw.rows is None else int(raw.rows[row]))


def without_unknown_rows(raw: RawLog) -> RawLog:
    """The log without rows of NaN or infinity; as it is if all are."""
    known = np.isfinite(raw.stamps)
    for value in raw.signals.values():
        known &= np.concatenate([np.isfinite(rows).all(axis=1) for rows in pieces(value)])
    if known.all() or not known.any():
        return raw
    unknown = np.flatnonzero(~known)
    left = kept(raw, known, caution("rows-unknown", rows=unknown.size, first=int(unknown[0]) + 1))
    return replace(left, unknown=unknown)


def row_samples(raw: RawLog, rows: int) -> Indices | None:
    """The sample of each row of a file, −1 for none; None if all give one."""
    if raw.rows is None:
        return None
    sample: Indices = np.searchsorted(raw.rows, np.arange(rows), side="right") - 1
    if raw.segment is not None:
        sample[raw.rows[-1] + 1 :] = -1
    if raw.unknown is not None:
        sample[raw.unknown] = -1
    return sample


#: No measurement is as large, in any unit: it is refused.
ABSURD = 1e9
#: How a log is read without one of its signals.
LEAVING_OUT = (
    "leave the signal out: with --columns name the others, as in t=t,q=q_{i},dq=dq_{i}, or skip it "
    "with _:6 in a table without a header"
)
#: No robot is sampled faster, or longer: 64 bits of nanoseconds count no farther. [s]
SHORTEST_STEP, LONGEST_LOG = 1e-7, 2e8
#: A clock starts within 285 years of 1970: nanoseconds in 64 bits count no farther. [s]
FARTHEST_START = 9e9
#: Reach of a joint: of seven-joint arms, of any. [rad]
ONE_TURN, TWO_TURNS = 2 * np.pi + 0.1, 13.0
GAP_STEPS = 4.0  #: A step this many times the median is reported as a gap.


@np.errstate(all="ignore")  # a damaged file is judged, not computed with
def cleaned(
    raw: RawLog,
    path: Path,
    format_name: str,
    choice: ReadChoice,
    sha256: str = "",
    label: str = "",
) -> Recording:
    """Make a Recording of what a reader found.

    In order: joints without a signal and garbage at the start go, values that are no numbers
    are refused, repeated stamps go, a clock that runs back is refused, gaps are counted,
    degrees refused.
    """
    rows = len(raw.stamps) + (0 if raw.unknown is None else len(raw.unknown))
    columns = choice.columns or ""
    before, raw = raw, measured(raw, path, examining=choice.examining)
    if raw.segment != before.segment:
        columns = f"{columns},segment=1".lstrip(",")
    fresh = without_repeats(raw, path)
    if raw.degrees_possible:
        _refuse_degrees(fresh, path)
    t, counts = seconds(fresh), raw.stamps.dtype.kind in "iu" and not raw.origin
    gaps = list[Remark]()
    if len(places := gaps_of(t, GAP_STEPS)):
        lengths = t[places + 1] - t[places]
        at, longest = t[places[lengths.argmax()]], lengths.max()
        values = {"gaps": len(places), "steps": GAP_STEPS, "longest_s": longest, "at_s": at}
        gaps = [caution("clock-gaps", **values)]
    # In whole nanoseconds, where the log counts its stamps in them.
    per_tick = round(raw.tick * 1e9) if counts else 0
    source = Source(
        path=path,
        label=f"{label or path.name} {raw.part}" if raw.part else label,
        part=raw.part,
        format=format_name,
        columns=columns,
        sha256=sha256,
        clock=raw.clock,
        t0=float(raw.stamps[0]) * raw.tick + raw.origin,
        t0_ns=int(raw.stamps[0]) * per_tick if per_tick >= 1 else None,
        rows=rows,
        duplicates=len(raw.stamps) - len(fresh.stamps),
        row_samples=row_samples(fresh, rows),
        remarks=(*fresh.remarks, *gaps),
    )
    arrays: dict[str, Any] = {
        name: handed_over(np.ascontiguousarray(v)) for name, v in fresh.signals.items()
    }
    return Recording(
        t=handed_over(t),
        **arrays,
        wrench_frame=raw.wrench_frame if "wrench" in arrays else None,
        joint_names=raw.joint_names,
        robot_hint=raw.robot_hint,
        payload_mass=raw.payload_mass,
        payload_com=raw.payload_com,
        source=source,
    )


def measured(raw: RawLog, path: Path, *, examining: bool = False) -> RawLog:
    """Samples of the segment asked for, without empty joints and leading garbage.

    A file of several recordings, if only examined, gives its first, with a remark.
    """
    if len(raw.stamps) == 0:
        raise ClockError(f"{path}: no samples; the log holds a header only.")
    part = raw
    if (number := raw.segment) is not None:
        # The clock's restarts part the recordings of a file.
        restarts = np.flatnonzero(np.diff(raw.stamps) < 0) + 1
        edges, count = [0, *restarts.tolist(), len(raw.stamps)], restarts.size + 1
        if not 1 <= number <= count:
            raise ClockError(f"{path}: there is no segment {number}; the file holds {count}.")
        first, last = edges[number - 1 : number + 1]
        places = {"first_row": first + 1, "last_row": last}
        said = fact("segment-chosen", number=number, recordings=count, **places)
        part = kept(raw, slice(first, last), said)
    part = without_leading_garbage(_without_empty_joints(part))
    _refuse_unknown_numbers(part, path)
    if rows := _restarts(part, path, examining=examining):
        said = warning("time-reset", restarts=len(rows), rows=rows)
        return measured(replace(raw, segment=1, remarks=(said, *raw.remarks)), path)
    _refuse_standing_clock(part, path)
    return part


def seconds(raw: RawLog) -> Array:
    """Time since the first sample; whole ticks are subtracted unscaled. (T,) [s]"""
    elapsed: Array = (raw.stamps - raw.stamps[0]).astype(np.float64)
    return elapsed if raw.tick == 1.0 else elapsed * raw.tick


def _without_empty_joints(raw: RawLog) -> RawLog:
    """The log without named joints with a signal of NaN, as a gripper's effort."""
    names, empty = np.array(raw.joint_names), np.zeros(len(raw.joint_names), dtype=bool)
    joints = {n: v for n, v in raw.signals.items() if n != "wrench" and v.shape[1] == names.size}
    for value in joints.values():
        if np.isnan(value[0]).any():
            missing = np.isnan(value).all(axis=0)
            empty |= missing & ~missing.all()
    if "q" not in joints or not empty.any() or empty.all():
        return raw
    return replace(
        raw,
        signals=joined(
            {n: v[:, ~empty] if n in joints else v for n, v in part.items()}
            for part in in_parts(raw.signals)
        ),
        joint_names=tuple(names[~empty].tolist()),
        remarks=(*raw.remarks, fact("joints-empty", joints=names[empty].tolist())),
    )


#: Rows at the start of a log among which a misaligned packet may have left garbage.
GARBAGE_ROWS = 100
#: No joint has so large a value in SI units; misread doubles have.
GARBAGE_VALUE = 1e6

DENORMAL = 1e-300
ABSURD_STAMP = 1e19  #: Beyond nanoseconds since 1970.


def without_leading_garbage(raw: RawLog) -> RawLog:
    """The log without a misaligned packet's first rows: absurd values, a time jump.

    Without an absurd value all stay, so that a jump of the clock alone shows.
    """
    head = slice(0, min(GARBAGE_ROWS, len(raw.stamps)))
    absurd, tiny = np.zeros((2, head.stop), dtype=bool)
    for value in raw.signals.values():
        size = np.abs(value[head])
        absurd |= (~(size < GARBAGE_VALUE)).any(axis=1)
        tiny |= ((size > 0) & (size < DENORMAL)).any(axis=1)
    absurd |= ~(np.abs(raw.stamps[head].astype(np.float64)) < ABSURD_STAMP)
    if not absurd.any() or absurd.all():
        return raw
    absurd |= tiny  # tiny values alone are a simulation at rest
    steps = np.diff(raw.stamps[head].astype(np.float64) * raw.tick)
    usual = np.median(np.diff(raw.stamps.astype(np.float64))) * raw.tick
    # The row after the last backward or enormous step, or 0.
    jumps = np.flatnonzero(~((steps >= 0) & (steps <= max(60.0, 1000 * usual)))) + 1
    jump = int(jumps[-1]) if jumps.size else 0
    if not absurd[0] and jump == 0:
        return raw  # a lone bad value is no misaligned packet
    count = max(int(np.flatnonzero(absurd)[-1]) + 1, jump)
    if count >= len(raw.stamps) - 1 or absurd[:count].mean() < 0.1:
        return raw
    return kept(raw, slice(count, None), fact("leading-garbage", rows=count))


#: What a column of a signal is that is none of a joint.
COLUMN = {"wrench": "axis", "jacobian": "cell"}


def _refuse_unknown_numbers(raw: RawLog, path: Path) -> None:
    if not np.isfinite(raw.stamps).all():
        row = number_of(raw, int(np.argmin(np.isfinite(raw.stamps))))
        raise LogError(f"{path}: the clock is not a number in sample {row}. Cut the row out.")
    for name, value in raw.signals.items():
        # the largest tells whether all are finite; the slow look is for the message
        if all(max(np.max(x), -np.min(x)) < ABSURD for x in pieces(value)):
            continue
        unknown = ~(np.abs(value) < ABSURD)
        row, column = np.argwhere(unknown)[0].tolist()
        lost = unknown[:, column].sum()
        where = f"{path}: {name} {COLUMN.get(name, 'of joint')} {column + 1}"
        if np.isnan(value[:, column]).all():
            raise LogError(f"{where} holds no numbers at all. Record it, or {LEAVING_OUT}.")
        at = f"in sample {number_of(raw, row)} (t = {seconds(raw)[row]:.6g} s)"
        raise LogError(
            f"{where} is {value[row, column]:.6g} {at}, {lost} such in all. Nothing is filled in: "
            f"cut the rows out, or {LEAVING_OUT}."
        )


#: Shortest recording between two restarts of the clock.
SEGMENT_ROWS = 20


def _restarts(raw: RawLog, path: Path, *, examining: bool) -> list[int]:
    """Rows before restarts of the clock, an error unless examining."""
    restarts = np.flatnonzero(np.diff(raw.stamps) < 0) + 1
    if not restarts.size:
        return []
    k, t = restarts[0], seconds(raw)
    where = f"at sample {number_of(raw, k)} (from {t[k - 1]:.6f} to {t[k]:.6f} s)"
    lengths = np.diff([0, *restarts, len(t)])
    # A clock that restarts begins near zero; any other step back is disorder.
    if np.any(np.abs(t[restarts]) > 3 * median_step(t)) or lengths.min() < SEGMENT_ROWS:
        raise ClockError(
            f"{path}: time runs backwards {restarts.size}×, first {where}. Split or sort it first."
        )
    if not examining:
        raise ClockError(
            f"{path}: the clock restarts {restarts.size}×, first {where}: the file holds "
            f"{len(lengths)} recordings one after another. Split it, or read one: --columns "
            "segment=1 (with the other columns, if they need describing)."
        )
    return [*restarts.tolist()]


def _refuse_standing_clock(raw: RawLog, path: Path) -> None:
    t, start = seconds(raw), float(raw.stamps[0]) * raw.tick + raw.origin
    rows, span, steps = len(t), float(t[-1]), np.diff(t)
    if not abs(start) <= FARTHEST_START:
        raise ClockError(
            f"{path}: the clock starts at {start:.3g} s, which no clock shows. Say its unit "
            "with --columns, as in t[ns]=…"
        )
    if rows < 2:
        return
    if span == 0:
        raise ClockError(
            f"{path}: the clock never moves: all {rows} samples are at {raw.stamps[0]:.10g}. "
            "Name another column as t with --columns, or state the rate, as in t@125Hz."
        )
    usual = median(steps[steps > 0])
    if not (usual >= SHORTEST_STEP and span <= LONGEST_LOG):
        raise ClockError(
            f"{path}: steps of {usual:.3g} s over {span:.3g} s, which no robot's log is. Say "
            "the unit of the clock with --columns, as in t[ms]=…"
        )


def without_repeats(raw: RawLog, path: Path) -> RawLog:
    """Drop rows that repeat the stamp before, and say so."""
    fresh = np.concatenate([[True], np.diff(raw.stamps) > 0])
    again = np.flatnonzero(~fresh)
    if again.size == 0:
        return raw
    changed = np.zeros(again.size, dtype=bool)
    for value in raw.signals.values():
        changed |= (value[again] != value[again - 1]).any(axis=1)
    repeats, different = again.size, int(changed.sum())
    if 2 * different > len(raw.stamps):
        raise ClockError(
            f"{path}: the clock is coarser than the samples: {different} of {len(fresh)} rows have "
            "the stamp of the row before. Name a finer column as t with --columns, or state the "
            "rate, as in t@125Hz."
        )
    remarks = [fact("repeats-dropped", rows=repeats)]
    if different:
        remarks.append(caution("repeats-differ", changed=different, repeats=repeats))
    return kept(raw, fresh, *remarks)


#: Fewer samples of another size are errors, not another unit.
BAD_SHARE = 0.05


def _refuse_degrees(raw: RawLog, path: Path) -> None:
    """Raise a LogError if positions of unstated unit can hardly be radians."""
    q = raw.signals["q"]
    limit = ONE_TURN if q.shape[1] == 7 else TWO_TURNS
    beyond = np.concatenate([np.any(np.abs(rows) > limit, axis=1) for rows in pieces(q)])
    # A few bad samples are no unit; the doctor cuts them out.
    own = ~beyond | (np.mean(beyond) >= BAD_SHARE)
    good = (rows[keep] for rows, keep in zip(pieces(q), pieces(own), strict=True))
    # Of each joint how far it goes below zero, then how far above.
    ends = np.max([np.hstack([-x, x]).max(axis=0, initial=-np.inf) for x in good], axis=0)
    largest, travel = ends.max(), ends.reshape(2, -1).sum(axis=0).max()
    if largest > limit or travel > TWO_TURNS:
        raise LogError(
            f"{path}: positions reach {largest:.4g} and travel {travel:.4g}, which looks like "
            "degrees. Say the unit with --columns: q[deg]=… or q[rad]=… (q[deg]:"
            f"{q.shape[1]} for a headerless table)."
        )
