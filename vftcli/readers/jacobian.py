"""A vendor's external torques beside its Jacobian: no positions, and yet a wrench."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from vftcli.readers.cleaning import measured, seconds, without_repeats
from vftcli.readers.opening import Digest
from vftcli.readers.picking import picked
from vftcli.readers.reader import ReadChoice
from vftcli.readers.table import JACOBIAN, Cell, JacobianError, Pick, Picks
from vftcli.signals.arrays import Array
from vftcli.signals.errors import ClockError, LogError
from vftcli.signals.parsing import interval_text
from vftcli.signals.remarks import Remark

UNIT = 1e-3  #: How far from 1 the axis of a joint may be in the Jacobian.


@dataclass(frozen=True, kw_only=True)
class JacobianLog:
    """What such a log holds; the Jacobian's axes and point are the log's own."""

    name: str  #: What it is called in tables.
    path: Path  #: The file.
    sha256: str  #: Digest of its bytes.
    t: Array  #: Time since its first sample. (T,) [s]
    tau_ext: Array  #: The vendor's estimate of the torque on the robot. (T, n) [N·m]
    jacobian: Array  #: Rows of velocity, then of angular velocity. (T, 6, n)
    wrench: Array | None  #: What a sensor reads, in axes of its own, or None. (T, 6) [N, N·m]
    remarks: tuple[Remark, ...] = ()  #: What reading dropped or turned.


@np.errstate(all="ignore")  # whatever a damaged file holds is judged, not computed with
def jacobian_log(path: Path, found: JacobianError, choice: ReadChoice, name: str) -> JacobianLog:
    """Read the log in which positions were looked for in vain."""
    table, digest = found.table, Digest((path,))
    digest.start()
    signals = {p.signal: p for p in found.picks.signals if p.signal in {"tau_ext", "wrench"}}
    cells, n = jacobian_cells(found)
    if "tau_ext" not in signals or len(signals["tau_ext"].cells) != n:
        raise LogError(
            f"{path}: a Jacobian of {n} joints and no external torques of {n} joints beside it. "
            "Name their columns with --columns, as in tau_ext=tau_ext_{i}."
        )
    signals["jacobian"] = Pick(signal="jacobian", cells=cells)
    picks = Picks(signals=tuple(signals.values()), clock=found.picks.clock, rate=found.picks.rate)
    raw = without_repeats(measured(picked(table, picks, ReadChoice()), path), path)
    t = seconds(raw)
    start, stop = choice.interval or (-np.inf, np.inf)
    inside = (t >= start) & (t <= stop)
    if np.count_nonzero(inside) < 2:
        raise ClockError(f"{path}: fewer than two samples in {interval_text(start, stop)} [s]")
    jacobian = velocity_first(raw.signals["jacobian"].reshape(-1, 6, n), path)
    wrench = raw.signals.get("wrench")
    return JacobianLog(
        name=name,
        path=path,
        sha256=digest.hexdigest(),
        t=t[inside],
        tau_ext=raw.signals["tau_ext"][inside],
        jacobian=jacobian[inside],
        wrench=None if wrench is None else wrench[inside],
        remarks=raw.remarks,
    )


def jacobian_cells(found: JacobianError) -> tuple[tuple[Cell, ...], int]:
    """The cells of jacobian_R_C row by row, and the number of joints."""
    names = found.table.names
    places = {
        (int(match[2]), int(match[3])): Cell(column)
        for column, name in enumerate(names)
        if (match := JACOBIAN.fullmatch(name))
    }
    rows, columns = (sorted({place[k] for place in places}) for k in (0, 1))
    if len(rows) != 6 or len(columns) < 6 or len(places) != 6 * len(columns):
        raise LogError(
            f"{found.table.path}: the Jacobian has {len(rows)} rows, {len(columns)} columns and "
            f"{len(places)} cells; a wrench needs 6 rows and a column for each of 6 joints or more."
        )
    return tuple(places[r, c] for r in rows for c in columns), len(columns)


def velocity_first(jacobian: Array, path: Path) -> Array:
    """The Jacobian with its rows of velocity first: the axes of revolute joints have length 1."""
    for J in (jacobian, np.roll(jacobian, 3, axis=1)):
        if np.all(np.abs(np.linalg.norm(J[:, 3:], axis=1) - 1) < UNIT):
            return J
    raise LogError(
        f"{path}: neither the first nor the last three rows of the Jacobian are axes of revolute "
        "joints, of length 1."
    )
