"""The contacts of a log: found by evidence, measured by the smoother.

Two things look like a contact and are none: a load, wrong payload or wrong model lasts
for most of a log and has a mean; the jerk of a brake looks like a knock.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from vftcli.bias.whole_log import WholeLogBias, whole_log_bias
from vftcli.contacts.contact_list import (
    CarriedLoad,
    Contact,
    ContactList,
    ContactModel,
    Unexplained,
    numbered,
)
from vftcli.contacts.free_statistics import (
    SETTLED,
    FreeStatistics,
    free_part,
    free_statistics,
    inferred_statistics,
    listed_force,
    observed,
)
from vftcli.contacts.rows import (
    BENT_SHORT,
    SHORT,
    TAIL,
    ContactMeasurement,
    force_course,
    shows_force,
)
from vftcli.contacts.search import Candidates, search
from vftcli.contacts.windows import LEAST_EVIDENCE, LEAST_IN_MOTION, places
from vftcli.free_motion.free_motion import FreeMotion
from vftcli.robots.run import Run
from vftcli.signals.arrays import Array, Mask, covered
from vftcli.signals.errors import ParameterError
from vftcli.signals.progress import passed
from vftcli.signals.recording import Recording
from vftcli.signals.remarks import Where, caution, on_joints
from vftcli.signals.rest import MOVES, REST, faster
from vftcli.wrench.model_error import error_process
from vftcli.wrench.smoother import DRIVES, BlockLog, BlockSpan, hidden_by_blocks, smooth_wrench

SHORTEST = 0.5  #: Shortest log with contacts. [s]
SLOWEST = 10.0  #: Rate below which a push may go unseen. [Hz]
#: Evidence over that of any row in the log's own free part.
FALSE_MARGIN = 1.5
#: No contacts so near to either end: filters begin there. [s]
AT_ENDS = 0.3
#: The arm rests around a contact if so long about it 95 % of samples are slow. [s]
AROUND = 1.0


def list_contacts(
    motion: FreeMotion, bias: WholeLogBias | None = None, *, referenced: bool = False
) -> ContactList:
    """The contacts along a log."""
    log = motion.log
    check_log(log)
    bias = bias or whole_log_bias(log)
    passed(0.25)
    free = free_statistics(motion, bias) or inferred_statistics(log, bias)
    if free is None:
        return without_list(log)
    passed(0.5)
    # A rest that nobody named may be a steady push.
    known = free.basis == "free motion" and (motion.choice.is_given or free.noise.seen.any())
    found = by_smoother(free, proven=bool(referenced or known))
    if log.robot.joints < 6:
        return found.without_forces()
    if is_load(log.recording, found.contacts) and (row := load_row(motion, found.contacts)):
        remarks = (*found.remarks, caution("contact-is-load"))
        return replace(found, contacts=(row,), remarks=remarks)
    return found


def check_log(run: Run) -> None:
    """Raise unless a log is known throughout, long and fast enough."""
    recording, known = run.recording, np.all(np.isfinite(run.terms.p + run.terms.mu), axis=1)
    if not known.all():
        raise ParameterError(
            f"{run.name}: {np.count_nonzero(~known)} of its {len(known)} samples are not "
            "finite; leave them out with --interval"
        )
    if recording.median_step * SLOWEST > 1:
        raise ParameterError(
            f"{recording.name} has {1 / recording.median_step:.2g} samples a second; below "
            f"{SLOWEST:g} a contact can come and go between two samples unseen: record "
            "faster"
        )
    if recording.duration < SHORTEST:
        raise ParameterError(
            f"{recording.name} lasts {recording.duration:.2g} s; of less than {SHORTEST:g} s "
            f"no contact is listed: the observer needs the first {SETTLED:g} s to settle. Give a "
            "longer log"
        )


def by_smoother(free: FreeStatistics, *, proven: bool) -> ContactList:
    """The list by the two-state filter, evidence, and the gated smoother."""
    run, named, seconds = free.log, free.basis == "free motion", free.seconds
    found = search(run, free.noise, free.level, seconds)
    t = found.log.blocks.t
    own = found.best[free.own[run.t.searchsorted([span.mean() for span in found.spans])]]
    least = max(LEAST_EVIDENCE, FALSE_MARGIN * own.max(initial=-np.inf))
    inner = (t >= t[0] + AT_ENDS) & (t <= t[-1] - AT_ENDS)
    found = found.kept([k for k, (a, b) in enumerate(found.runs) if inner[a:b].any()])
    spans = found.spans
    # Free motion tells friction of the joints that it moves.
    untold = ~free.noise.seen if named else np.ones_like(free.noise.seen)
    at_rest = np.array([rests_around(run, found, span, untold) for span in found.runs], bool)
    listed = found.best > np.where(at_rest, least, LEAST_IN_MOTION)
    if not named:
        listed |= at_rest & np.array(found.beyond, bool)
    seen = np.flatnonzero(listed | (found.best > LEAST_EVIDENCE)).tolist()
    halted = [k for k in seen if follows_stop(run.recording, spans[k], seconds)]
    stops = tuple(t[found.runs[k][0]] for k in halted if listed[k])
    going = [k for k in seen if k not in halted]
    kept, others = ([k for k in going if listed[k] == wanted] for wanted in (True, False))
    passed(0.75)
    measurement = ContactMeasurement.of(found.kept(kept), free)
    rows = measured_rows(free, measurement)
    groups = adjoining(measurement.found.runs, rows)
    if len(groups) < len(rows):
        measurement = ContactMeasurement.of(measurement.found.joined(groups), free)
        rows = measured_rows(free, measurement)
    smallest = listed_force(free, found.log, least, untold)
    shown = np.array([shows_force(row, smallest) for row in rows], bool)
    if not named and shown.any():
        rows = measured_rows(free, replace(measurement, tail=TAIL))
        shown &= [shows_force(row, smallest) for row in rows]
    contacts, weak = ([rows[k] for k in np.flatnonzero(some)] for some in (shown, ~shown))
    if others:
        beside = ContactMeasurement.of(found.kept(others), free, measurement)
        weak += measured_rows(free, beside)
    remarks = [caution("arm-stopped-abruptly", Where(span=(at, at)), at_s=at) for at in stops]
    if not free.noise.seen.all():
        remarks.append(caution("free-part-misses-joints", on_joints(~free.noise.seen)))
    return ContactList(
        recording=run.name,
        duration=run.recording.duration,
        contacts=numbered(contacts, inferred=not proven),
        candidates=numbered(weak, inferred=True),
        basis=free.basis,
        free=free.remarks,
        free_seconds=free.noise.free_seconds,
        false_on_free=int((own > LEAST_EVIDENCE).sum()) + false_rows(free) if named else None,
        threshold=least if named else LEAST_IN_MOTION,
        smallest_force=smallest,
        load=None if free.load is None else CarriedLoad.of(free.load, run),
        stops=stops,
        model=ContactModel(
            prior=measurement.prior,
            noise_sd=np.sqrt(free.noise.white),
            error_sd=np.sqrt(free.noise.variance),
            error_time=free.noise.time,
            block=seconds,
        ),
        remarks=tuple(remarks),
    )


def adjoining(runs: Sequence[BlockSpan], rows: Sequence[Contact]) -> list[list[int]]:
    """Numbers of the rows in groups: joined where one has no size."""
    groups: list[list[int]] = []
    sized = [(row.peak_force or 0.0) > (row.place_band or 0.0) for row in rows]
    for i, (start, _) in enumerate(runs):
        if not i or start - runs[i - 1][1] > 1 or (sized[i] and sized[i - 1]):
            groups.append([])
        groups[-1].append(i)
    return groups


def measured_rows(free: FreeStatistics, measurement: ContactMeasurement) -> list[Contact]:
    """The rows of a measurement; of short contacts from finer blocks."""
    found, rows = measurement.found, measurement.rows()
    brief = [k for k, seconds in enumerate(found.lasts) if seconds < SHORT]
    if not brief or free.fine is None:
        return rows
    fine, blocks = free.fine
    spans = [(a, b) for a, b in blocks.t.searchsorted(found.spans).tolist()]
    others = [span for k, span in enumerate(spans) if k not in brief]
    process = error_process(fine.noise, blocks).hiding(covered(others, len(blocks.t), 1))
    some = found.kept(brief)._replace(
        log=BlockLog(blocks, process),
        places=places(free.log.robot.loaded_chain, blocks.q),
        runs=[spans[k] for k in brief],
    )
    # The place needs no peak: longer blocks show it best.
    locations = [measurement.locations[k] for k in brief]
    measured = ContactMeasurement.of(some, fine, measurement, BENT_SHORT).rows(locations)
    for k, row in zip(brief, measured, strict=True):
        rows[k] = row
    return rows


def rests_around(run: Run, found: Candidates, span: BlockSpan, joints: Mask) -> bool:
    """Whether joints (n,) rest during a candidate and `AROUND` it."""
    t = found.log.blocks.t
    first, last = run.t.searchsorted([t[span[0]] - AROUND, t[span[1] - 1] + AROUND])
    speed = abs(run.dq[first:last, joints])
    return bool(len(speed) and np.quantile(speed, 0.95, axis=0).max(initial=0.0) < MOVES)


def false_rows(free: FreeStatistics) -> int:
    """Rows that the same search lists in free runs of other logs."""
    each = (
        (run, search(run, free.noise, free.level, free.seconds))
        for run, _ in free.free
        if run.recording is not free.log.recording
    )
    return sum(
        nats > LEAST_EVIDENCE and not follows_stop(run.recording, span, free.seconds)
        for run, found in each
        for span, nats in zip(found.spans, found.best, strict=True)
    )


def without_list(run: Run) -> ContactList:
    """A list without rows: nothing tells contact from model error."""
    unknown = np.full(run.robot.joints, np.nan)
    torque = abs(observed(run))
    torque[run.t < run.t[0] + SETTLED] = 0.0
    k, j = np.unravel_index(torque.argmax(), torque.shape)
    return ContactList(
        recording=run.name,
        duration=run.recording.duration,
        contacts=(),
        basis="none",
        unexplained=Unexplained(float(torque[k, j]), int(j) + 1, float(run.t[k])),
        model=ContactModel(
            prior=None, noise_sd=unknown, error_sd=unknown, error_time=unknown, block=np.nan
        ),
    )


#: No joint moves for so long about a contact's start: rest. [s]
EDGE = 1.0
#: Share of the time since the first motion that makes a load.
SHARE = 0.5
#: Contacts are one load if their forces add up to this share of their sizes.
ONE_SIDE = 0.95
PIECE = 5.0  #: Length of the pieces that show the mean's spread. [s]
BRIEF = 0.3  #: Longest row that a stop explains. [s]
#: Moving, then stopped, then at rest, about a row's start. [s]
BEFORE, AT_STOP, AFTER = (-0.25, -0.05), (-0.25, 0.1), (0.12, 0.35)
RINGING = 0.05  #: Share of the speed before that ringing may leave at rest.


def is_load(recording: Recording, contacts: Sequence[Contact]) -> bool:
    """Whether contacts of one force fill half of the time in motion."""
    moving = np.any(faster(recording.require("dq"), REST), axis=1)
    t = recording.t
    first = t[np.argmax(moving)]
    lasts = np.array([contact.stop - contact.start for contact in contacts])
    if lasts.sum() <= SHARE * (t[-1] - first):
        return False
    # A load neither begins nor ends while the arm rests; a push may.
    for edge in (contacts[0].start, contacts[-1].stop):
        if t[0] + EDGE < edge < t[-1] - EDGE and not moving[abs(t - edge) < EDGE].any():
            return False
    forces = np.array([contact.mean_force for contact in contacts]) * lasts[:, None]
    sizes = np.linalg.norm(forces, axis=1).sum()
    return bool(np.linalg.norm(forces.sum(axis=0)) > ONE_SIDE * sizes)


def load_row(motion: FreeMotion, contacts: Sequence[Contact]) -> Contact | None:
    """One row for contacts that are a load: the ungated wrench's mean.

    None if less than half acts between them. SD √(s²/m + (3 % of it)²), of m means over 5 s.
    """
    part = free_part(motion)
    wrench = smooth_wrench(motion.log, () if part is None else part.pieces)
    start, stop = contacts[0].start, contacts[-1].stop
    inside = (wrench.t >= start) & (wrench.t <= stop)
    values, t = wrench.values[inside], wrench.t[inside]
    on = np.any([(t >= c.start) & (t <= c.stop) for c in contacts], axis=0)
    felt = values[on, :3].mean(axis=0)
    if not on.all() and values[~on, :3].mean(axis=0) @ felt < SHARE * felt @ felt:
        return None
    mean, number = values.mean(axis=0), ((t - t[0]) / PIECE).astype(int)
    pieces = np.array([values[number == k].mean(axis=0) for k in np.unique(number)])
    error = wrench.sd[inside].mean(axis=0)
    if len(pieces) > 1:
        error = pieces.std(axis=0, ddof=1) / np.sqrt(len(pieces))
    sd = np.hypot(error, DRIVES * mean)
    _, (size,), (band,) = force_course(t[:1], mean[None, :3], np.diag(sd[:3] ** 2)[None])
    forces = values[:, :3]
    covariance = wrench.covariance[inside, :3, :3] + hidden_by_blocks(forces, bent=0.0)
    return replace(
        max(contacts, key=lambda contact: contact.evidence or 0.0),
        number=1,
        start=start,
        stop=stop,
        is_load=True,
        peak_force=size,
        peak_band=band,
        place_band=band,
        wrench=mean,
        wrench_sd=sd,
        mean_force=mean[:3],
        impulse=mean[:3] * (stop - start),
        anywhere=(max(size - band, 0.0), size + band),
        course=force_course(t, forces, covariance),
        where="wrist" if "wrist" in {contact.where for contact in contacts} else "cannot tell",
    )


def follows_stop(recording: Recording, span: Sequence[float] | Array, block: float) -> bool:
    """Whether a row [s] is brief and begins where all joints stop at once."""
    start, stop = span
    if stop - start > BRIEF + block:
        return False
    t, speed = recording.t - start, abs(recording.require("dq"))
    before, around, after = (
        speed[(t >= first) & (t <= last)]
        for first, last in (BEFORE, AT_STOP, (AFTER[0] + block, AFTER[1]))
    )
    if not len(before) or not len(after):
        return False
    rests = after.max(axis=0) < np.maximum(MOVES, RINGING * around.max(axis=0))
    # A median: noise is no motion.
    return bool(np.median(before, axis=0).max() > MOVES and rests.all())
