"""Which rows of a file are samples of the recording."""

from dataclasses import replace

import numpy as np

from vftcli.readers.reader import RawLog
from vftcli.signals.arrays import Indices, Mask
from vftcli.signals.remarks import Remark, caution


def kept(raw: RawLog, keep: Mask | slice, *remarks: Remark) -> RawLog:
    """The log with some of its rows only, and what is to be said of the others."""
    rows = np.arange(len(raw.stamps)) if raw.rows is None else raw.rows
    return replace(
        raw,
        rows=rows[keep],
        stamps=raw.stamps[keep],
        signals={name: value[keep] for name, value in raw.signals.items()},
        remarks=(*raw.remarks, *remarks),
    )


def without_unknown_rows(raw: RawLog) -> RawLog:
    """Leave out rows with a value that is no number, and say so; as it is if that is every row."""
    known = np.isfinite(raw.stamps)
    for value in raw.signals.values():
        known &= np.isfinite(value).all(axis=1)
    if known.all() or not known.any():
        return raw
    unknown = np.flatnonzero(~known)
    left = kept(raw, known, caution("rows-unknown", rows=unknown.size, first=int(unknown[0]) + 1))
    return replace(left, unknown=unknown)


def row_samples(raw: RawLog, rows: int) -> Indices | None:
    """The sample that each row of a file is or repeats, −1 for none; None where each is its own."""
    if raw.rows is None:
        return None
    sample: Indices = np.searchsorted(raw.rows, np.arange(rows), side="right") - 1
    if raw.segment is not None:
        sample[raw.rows[-1] + 1 :] = -1
    if raw.unknown is not None:
        sample[raw.unknown] = -1
    return sample
