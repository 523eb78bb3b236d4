"""One log scored by one protocol: truth, answers, rows."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from time import thread_time
from typing import Any, NamedTuple

import numpy as np
import polars as pl
from polars import Boolean, Float64, Int64, String

from vftcli.batch.cluster import begin
from vftcli.doctor.examination import Examiner
from vftcli.evaluation.references import on_the_logs_clock, since_start, table_reference
from vftcli.evaluation.scores import (
    ListedRow,
    Score,
    TrueContact,
    episodes,
    lag_sums,
    parts_of,
    score_list,
    weights,
)
from vftcli.free_motion.free_motion import within
from vftcli.observers.table import BEST, OBSERVERS
from vftcli.outputs import Record
from vftcli.outputs.batch_folder import BatchFolder
from vftcli.pipeline import AnalysisChoice, analyse, prepared
from vftcli.readers.reader import RawLog
from vftcli.readers.reading import Library
from vftcli.readers.references import TORQUE, read_list, read_outside, read_reference
from vftcli.reproduction.manifest import BenchmarkLog, Rival
from vftcli.robots.robot import Robot
from vftcli.robots.run import Run
from vftcli.signals.arrays import Array, Mask, summed
from vftcli.signals.errors import LogError
from vftcli.signals.external_torque import ExternalTorque
from vftcli.signals.recording import Recording
from vftcli.wrench.solvers import NOTHING

#: A joint is touched from here on, until below this. [N·m]
TOUCHED, UNTOUCHED = 0.05, 0.025
SAME = 1e-6  #: Stamps nearer than this are the log's own. [s]
WORST = 10.0  #: Length of the span that is drawn. [s]
LISTS = ("list", "list with candidates")  #: Parts of rows of lists.
#: Columns of a log × protocol × method: sums of parts and joints;
#: lists; wrench and weight; shifts; the worst 10 s of `best`.
COLUMNS: tuple[tuple[Any, str], ...] = (
    (String, "log arm protocol method part"),
    (Int64, "joint axis"),
    (Boolean, "future exact_model marked"),
    (Float64, "truth_error_Nm rmse_Nm l1_Nm observer_us command_us"),
    (pl.List(Float64), " ".join(Score._fields)),
    (Int64, "true_contacts found found_as_load split false"),
    (Float64, "free_h"),
    (pl.List(Float64), "onset_s peak_error_N true_peak_N"),
    (Int64, "peaks_held"),
    (Float64, "hardest_false_N"),
    (Float64, "weight_N mean_N rms_error_N answered"),
    (pl.List(Float64), "lag_squares"),
    (Int64, "worst_joint"),
    (pl.List(Float64), "worst_t worst_truth worst_estimate"),
)
SCHEMA = {name: kind for kind, names in COLUMNS for name in names.split()}


class ScoreTask(NamedTuple):
    """One log by one protocol, with our estimates or another program's."""

    folder: Path
    key: str
    label: str
    log: BenchmarkLog
    choice: AnalysisChoice
    rival: Rival | None
    about: Mapping[str, Any]  #: What every row has.


class KnownTruth(NamedTuple):
    """True contact of an arm, on its log's clock; None where unknown."""

    tau: Array | None = None  #: External torque on the robot. (T, n)
    wrench: Array | None = None  #: On the flange, base axes. (T, 6)
    contacts: Sequence[TrueContact] | None = None


class Answer(NamedTuple):
    """One method's answer for a log."""

    torque: ExternalTorque
    wrench: Array | None = None
    #: Whether it uses later samples, and its time on a processor.
    about: Mapping[str, Any] = {"future": False}
    lists: Mapping[str, Sequence[ListedRow]] = {}  #: Its contacts by part, one of `LISTS`.


def score_log(task: ScoreTask) -> None:
    """Score a log by a protocol and write its rows, if missing."""
    folder, log, rival = BatchFolder(task.folder), task.log, task.rival
    if folder.row_file(task.key).exists():
        return
    begin("reading")
    (path,) = log.paths
    choice = replace(task.choice, library=Library([path]), examiner=Examiner(anyway=True))
    run = prepared(choice.library.open(path, choice.read), choice)
    begin("estimating")
    if rival is None:
        answers = [*own_answers(run, choice, log)]
    else:
        answers = [outside_answer(run.recording, log, rival)]
    begin("scoring")
    truth = truth_of(log, run.recording, run.robot)
    rows = [
        {**task.about, **answer.about, "method": answer.torque.name, **row}
        for answer in answers
        for row in rows_of(answer, truth, log)
    ]
    folder.put_rows(task.key, pl.DataFrame(rows, schema=SCHEMA))


def truth_of(log: BenchmarkLog, recording: Recording, robot: Robot) -> KnownTruth:
    """The truth of a log, from the manifest or a file."""
    t, path = recording.t, log.truth_path
    if log.truth == "free":
        return KnownTruth(np.zeros(recording.q.shape), contacts=[])
    listed: list[Any] | None = [(*c, np.nan)[:3] for c in log.contacts] or None
    if path is None:
        return KnownTruth(contacts=listed)
    table = read_reference(path, log.truth_columns or None)
    table = replace(table, stamps=since_start(table.stamps, recording))
    load = table_reference(table, path, recording, robot, NOTHING)
    tau, wrench = load.torque.tau, None if load.wrench is None else load.wrench.values
    if listed is None and wrench is not None:
        size = np.linalg.norm(wrench[:, :3], axis=1)
        listed = episodes(t, size, log.contact_N, 0.5 * log.contact_N)
    elif listed is None:
        found = episodes(t, abs(tau).max(axis=1), TOUCHED, UNTOUCHED)
        listed = [(start, stop, np.nan) for start, stop, _ in found]
    return KnownTruth(tau, wrench, listed)


def own_answers(run: Run, choice: AnalysisChoice, log: BenchmarkLog) -> Iterator[Answer]:
    """Answers of zero, vendor and our observers, `best` with contacts."""
    recording, t, begun = run.recording, run.t, thread_time()
    made = analyse(run, choice)
    us = 1e6 / len(t)
    whole = us * (thread_time() - begun)
    zero = ExternalTorque(name="zero", t=t, tau=np.zeros(recording.q.shape))
    yield Answer(zero, np.zeros((recording.samples, 6)))
    if log.vendor:
        (path,) = log.paths
        there = at_the_logs_times(read_reference(path, log.vendor), recording, path)
        yield Answer(ExternalTorque(name="vendor", t=t, tau=there[TORQUE]))
    lists: dict[str, list[ListedRow]] = {}
    if made.contacts is not None:
        listed, weak = (
            [
                ListedRow(c.start, c.stop, c.peak_force or 0.0, c.peak_band or 0.0, c.is_load)
                for c in each
            ]
            for each in (made.contacts.contacts, made.contacts.candidates)
        )
        lists = dict(zip(LISTS, (listed, sorted(listed + weak)), strict=True))
    wrenches = {wrench.name: wrench.known for wrench in made.wrenches}
    for observer, torque in zip(made.observers, made.estimates, strict=True):
        name, begun = torque.name, thread_time()
        choice.observers.run(observer, made.motion.log.terms)
        about = {
            "future": not OBSERVERS[name].online,
            "observer_us": us * (thread_time() - begun),
            "command_us": whole,
        }
        yield Answer(torque, wrenches.get(name), about, lists if name == BEST else {})


def outside_answer(recording: Recording, log: BenchmarkLog, rival: Rival) -> Answer:
    """Another program's answer for a log, at the log's stamps."""
    # Without estimates for a log it answers nothing there.
    there: Mapping[str, Array] = {TORQUE: np.full(recording.q.shape, np.nan)}
    if (path := rival.file(log)) is not None:
        there = at_the_logs_times(read_outside(path, rival.name), recording, path)
    tau = there[TORQUE]
    if tau.shape != recording.q.shape:
        joints = f"torques of {tau.shape[1]} joints for a log of {recording.joints}"
        raise LogError(f"{path}: {joints}")
    torque = ExternalTorque(name=rival.name, t=recording.t, tau=tau, error_sd=there.get("band"))
    path = rival.file(log, "contacts.csv")
    lists = {} if path is None else {LISTS[0]: [ListedRow(*row) for row in read_list(path)]}
    return Answer(torque, there.get("wrench"), {"future": not rival.causal}, lists)


def at_the_logs_times(read: RawLog, recording: Recording, path: Path) -> Mapping[str, Array]:
    """A file's signals at the log's stamps; NaN beyond its own."""
    t, signals = since_start(read.stamps, recording), read.signals
    if len(t) == recording.samples and abs(t - recording.t).max() < SAME:
        return signals
    return {name: on_the_logs_clock(t, x, recording, path) for name, x in signals.items()}


def rows_of(answer: Answer, truth: KnownTruth, log: BenchmarkLog) -> Iterator[Record]:
    """Every row of one method on one log."""
    t, wrench, touches = answer.torque.t, answer.wrench, truth.contacts
    w, scored = weights(t), within(t, log.score)
    known = scored if truth.tau is None else scored & np.isfinite(truth.tau).all(axis=1)
    parts = parts_of(t, known, touches or ())
    touch = parts["contact"]
    if truth.tau is not None and known.any():
        if not touches:
            del parts["all"]
        if log.pushes:
            del parts["free"]  # it is scored of the log without them
        yield from torque_rows(answer.torque, truth.tau, parts)
    if wrench is not None and truth.wrench is not None and touch.any():
        score = Score.of(t, wrench, truth.wrench, touch)
        for axis, sums in enumerate(score.by_joint(), 1):
            yield {"part": "wrench", "axis": axis, **sums}
    if wrench is not None and log.weight_N:
        yield {"part": "weight", **weighed(-wrench[scored, 2], log.weight_N, w[scored])}
    if touches is not None:
        for part, rows in answer.lists.items():
            yield {"part": part, **score_list(rows, touches, log.vouched, float(t[-1]))}


def torque_rows(
    torque: ExternalTorque, truth: Array, parts: Mapping[str, Mask]
) -> Iterator[Record]:
    """Rows of a torque: sums, shifts, the worst span."""
    for part, inside in parts.items():
        if inside.any():
            score = Score.of(torque.t, torque.tau, truth, inside, torque.error_sd)
            means = zip(score.rmse.tolist(), score.mean(score.sizes).tolist(), strict=True)
            for j, ((rmse, l1), sums) in enumerate(zip(means, score.by_joint(), strict=True), 1):
                yield {"part": part, "joint": j, "rmse_Nm": rmse, "l1_Nm": l1, **sums}
    if torque.name == BEST:
        yield {"part": "worst", **worst_of(torque, truth, np.any([*parts.values()], axis=0))}
    if "all" in parts and torque.name != "zero":
        yield {"part": "all", "lag_squares": lag_sums(torque, truth, parts["all"])}


def worst_of(torque: ExternalTorque, truth: Array, scored: Mask) -> Record:
    """The `WORST` seconds with the largest Σ w e², and their joint."""
    t, answer = torque.t, np.where(torque.known, torque.tau, 0.0)
    squares = np.where(scored[:, None], weights(t)[:, None] * (answer - truth) ** 2, 0.0)
    total = summed(squares.sum(axis=1))
    ends = np.searchsorted(t, t + WORST)
    first = int(np.argmax(total[ends] - total[:-1]))
    part = slice(first, int(ends[first]))
    joint = int(squares[part].sum(axis=0).argmax())
    true, seen = (np.where(scored, x[:, joint], np.nan)[part].tolist() for x in (truth, answer))
    return {
        "worst_joint": joint + 1,
        "worst_t": t[part].tolist(),
        "worst_truth": true,
        "worst_estimate": seen,
    }


def weighed(up: Array, weight: float, w: Array) -> Record:
    """Mean and rms error of a weight [N], share of answered time."""
    known = np.isfinite(up)
    total = float(w[known].sum()) or np.nan
    mean, square = (float((w * x)[known].sum()) / total for x in (up, (up - weight) ** 2))
    return {
        "weight_N": weight,
        "mean_N": mean,
        "rms_error_N": np.sqrt(square),
        "answered": total / w.sum(),
    }
