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
    #: What every row has: protocol, and whether it is scored in spite of a complaint.
    about: Mapping[str, Any]


class KnownTruth(NamedTuple):
    """True contact of a log's arm, on the log's clock; None where unknown."""

    tau: Array | None  #: External torque on the robot. (T, n)
    wrench: Array | None  #: On the flange, base axes. (T, 6)
    contacts: Sequence[TrueContact] | None


def truth_of(log: BenchmarkLog, recording: Recording, robot: Robot) -> KnownTruth:
    """The truth of a log, from the manifest or a file."""
    t, path = recording.t, log.truth_path
    listed: list[Any] | None = [(*c, np.nan)[:3] for c in log.contacts] or None
    if path is None:
        if log.truth == "free":
            return KnownTruth(np.zeros(recording.q.shape), None, [])
        return KnownTruth(None, None, listed)
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


class Answer(NamedTuple):
    """One method's answer for a log."""

    torque: ExternalTorque
    wrench: Array | None = None
    future: bool = False  #: Whether it uses later samples.
    lists: Mapping[str, Sequence[ListedRow]] = {}  #: Its contacts by part, one of `LISTS`.
    #: Time on a processor a sample, of the observer alone and of the whole analysis. [µs]
    cost: Mapping[str, float] = {}


def score_log(task: ScoreTask) -> None:
    """Score a log by a protocol and write its rows, unless they are there."""
    folder, log = BatchFolder(task.folder), task.log
    if folder.row_file(task.key).exists():
        return
    begin("reading")
    (path,) = log.paths
    choice = replace(task.choice, library=Library([path]), examiner=Examiner(anyway=True))
    run = prepared(choice.library.open(path, choice.read), choice)
    begin("estimating")
    answers = [
        *(
            own_answers(run, choice, log)
            if task.rival is None
            else [outside_answer(run.recording, log, task.rival)]
        )
    ]
    begin("scoring")
    truth = truth_of(log, run.recording, run.robot)
    rows = [
        {**answer.cost, "method": answer.torque.name, "future": answer.future, **row}
        for answer in answers
        for row in rows_of(answer, truth, log)
    ]
    about = {"log": log.name, "arm": log.arm, "exact_model": log.exact_model}
    about |= {"truth_error_Nm": log.truth_error.tau_Nm, **task.about}
    same = [pl.lit(value, SCHEMA[name]).alias(name) for name, value in about.items()]
    folder.put_rows(task.key, pl.DataFrame(rows, schema=SCHEMA).with_columns(same))


def own_answers(run: Run, choice: AnalysisChoice, log: BenchmarkLog) -> Iterator[Answer]:
    """Answers of zero, the vendor and our observers, `best` with its contacts."""
    recording, t, begun = run.recording, run.t, thread_time()
    made = analyse(run, choice)
    us = 1e6 / len(t)
    whole = us * (thread_time() - begun)
    wrenches = {wrench.name: wrench.known for wrench in made.wrenches}
    nothing = np.zeros((recording.samples, 6))
    yield Answer(ExternalTorque(name="zero", t=t, tau=np.zeros(recording.q.shape)), nothing)
    if log.vendor:
        (path,) = log.paths
        there = at_the_logs_times(read_reference(path, log.vendor), recording, path)
        yield Answer(ExternalTorque(name="vendor", t=t, tau=there[TORQUE]))
    lists: dict[str, Sequence[ListedRow]] = {}
    if made.contacts is not None:
        counted, weak = (
            [
                ListedRow(c.start, c.stop, c.peak_force or 0.0, c.peak_band or 0.0, c.is_load)
                for c in each
            ]
            for each in (made.contacts.contacts, made.contacts.candidates)
        )
        lists = dict(zip(LISTS, (counted, sorted((*counted, *weak))), strict=True))
    for observer, torque in zip(made.observers, made.estimates, strict=True):
        name, terms, begun = torque.name, made.motion.log.terms, thread_time()
        choice.observers.run(observer, terms)
        cost = {"observer_us": us * (thread_time() - begun), "command_us": whole}
        own = lists if name == BEST else {}
        yield Answer(torque, wrenches.get(name), not OBSERVERS[name].online, own, cost)


def outside_answer(recording: Recording, log: BenchmarkLog, rival: Rival) -> Answer:
    """Another program's answer for a log, at the log's stamps."""
    path, listed = rival.file(log), rival.file(log, "contacts.csv")
    there: Mapping[str, Array] = {}
    if path is not None:
        read = read_outside(path, rival.name)
        if (joints := read.signals[TORQUE].shape[1]) != recording.joints:
            raise LogError(f"{path}: torques of {joints} joints for a log of {recording.joints}")
        there = at_the_logs_times(read, recording, path)
    # Without estimates for a log it answers nothing there.
    tau = there.get(TORQUE, np.full(recording.q.shape, np.nan))
    torque = ExternalTorque(name=rival.name, t=recording.t, tau=tau, error_sd=there.get("band"))
    lists = {} if listed is None else {LISTS[0]: [ListedRow(*row) for row in read_list(listed)]}
    return Answer(torque, there.get("wrench"), not rival.declared.causal, lists)


def at_the_logs_times(read: RawLog, recording: Recording, path: Path) -> Mapping[str, Array]:
    """Signals of a file beside a log, at the log's stamps; NaN beyond the file's."""
    t, signals = since_start(read.stamps, recording), read.signals
    if len(t) == recording.samples and abs(t - recording.t).max() < SAME:
        return signals
    return {name: on_the_logs_clock(t, x, recording, path) for name, x in signals.items()}


def rows_of(answer: Answer, truth: KnownTruth, log: BenchmarkLog) -> Iterator[dict[str, Any]]:
    """Every row of one method on one log."""
    t, wrench = answer.torque.t, answer.wrench
    w, scored = weights(t), within(t, log.score)
    known = scored if truth.tau is None else scored & np.isfinite(truth.tau).all(axis=1)
    parts = parts_of(t, known, truth.contacts or ())
    touch = parts["contact"]
    if truth.tau is not None and known.any():
        if not truth.contacts:
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
    if truth.contacts is not None:
        for part, rows in answer.lists.items():
            yield {"part": part, **score_list(rows, truth.contacts, log.vouched, float(t[-1]))}


def torque_rows(
    torque: ExternalTorque, truth: Array, parts: Mapping[str, Mask]
) -> Iterator[dict[str, Any]]:
    """Rows of a torque: sums by part and joint, shifts, the worst span."""
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


def worst_of(torque: ExternalTorque, truth: Array, scored: Mask) -> dict[str, Any]:
    """The `WORST` seconds with the largest Σ w e², and their joint."""
    t, answer = torque.t, np.where(torque.known, torque.tau, 0.0)
    squares = np.where(scored[:, None], weights(t)[:, None] * (answer - truth) ** 2, 0.0)
    total = summed(squares.sum(axis=1))
    ends = np.searchsorted(t, t + WORST)
    first = int(np.argmax(total[ends] - total[:-1]))
    part = slice(first, int(ends[first]))
    joint = int(squares[part].sum(axis=0).argmax())
    seen = [np.where(scored, x[:, joint], np.nan)[part].tolist() for x in (truth, answer)]
    names = ("worst_joint", "worst_t", "worst_truth", "worst_estimate")
    return dict(zip(names, (joint + 1, t[part].tolist(), *seen), strict=True))


def weighed(up: Array, weight: float, w: Array) -> dict[str, float]:
    """Mean and rms error of a carried weight [N], and the share of answered time."""
    known = np.isfinite(up)
    total = float(w[known].sum()) or np.nan
    mean = float((w * up)[known].sum()) / total
    square = float((w * (up - weight) ** 2)[known].sum()) / total
    found = {"weight_N": weight, "mean_N": mean, "rms_error_N": np.sqrt(square)}
    return {**found, "answered": total / w.sum()}
