"""One log scored by one protocol: truth, answers, rows."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import count, takewhile
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
from vftcli.pipeline import AnalysisChoice, analyse, prepared, run_of
from vftcli.readers.columns import Cell, Item
from vftcli.readers.reader import ReadChoice
from vftcli.readers.reading import Library
from vftcli.readers.references import TORQUE, program_clock, read_reference, table_at
from vftcli.readers.table import listed
from vftcli.readers.tables import load_signals
from vftcli.reproduction.manifest import BenchmarkLog, Rival, read_list
from vftcli.robots.chain import flange_jacobian
from vftcli.robots.robot import Robot
from vftcli.robots.run import Run
from vftcli.robots.terms import effort_name
from vftcli.signals.arrays import Array, Mask, summed
from vftcli.signals.errors import LogError
from vftcli.signals.external_torque import ExternalTorque
from vftcli.signals.recording import Recording
from vftcli.signals.wrench import AXES
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
    (Int64, "joint"),
    (Boolean, "future exact_model marked"),
    (Float64, "truth_error_Nm rmse_Nm l1_Nm observer_us command_us"),
    (pl.List(Float64), " ".join(Score._fields)),
    (Int64, "true_contacts found found_as_load split false"),
    (Float64, "free_h"),
    (pl.List(Float64), "onset_s peak_error_N true_peak_N"),
    (Int64, "peaks_held"),
    (Float64, "hardest_false_N"),
    (Float64, "force_squares moment_squares true_force_squares true_moment_squares"),
    (Float64, "wrench_missing_s wrench_s weight_N mean_N rms_error_N answered"),
    (pl.List(Float64), "lag_squares"),
    (Int64, "worst_joint"),
    (pl.List(Float64), "worst_t worst_truth worst_estimate"),
)
SCHEMA = {name: kind for kind, names in COLUMNS for name in names.split()}


class ScoreTask(NamedTuple):
    """One log by one protocol, with our estimates or another program's."""

    folder: Path
    key: str
    log: BenchmarkLog
    protocol: str
    choice: AnalysisChoice
    file: Path
    truth: Path | None  #: The file of the truth.
    rival: Rival | None
    marked: bool  #: Whether scored in spite of a complaint.

    @property
    def label(self) -> str:
        """Name of the task."""
        rival = f", {self.rival.name}" if self.rival else ""
        return f"{self.log.name}, {self.protocol}{rival}"


def planted(run: Run, log: BenchmarkLog) -> tuple[Recording, Array, Array]:
    """A free log with pushes in its drive torque (τ − Jᵀ w), their w and Jᵀ w.

    Half sines at the flange in base axes, without moments. The motion does not yield.
    """
    t, recording, robot = run.t, run.recording, run.robot
    wrench = np.zeros((recording.samples, 6))
    for start, length, force in log.pushes:
        share = (t - start) / length
        course = np.where(abs(share - 0.5) < 0.5, np.sin(np.pi * share), 0.0)
        wrench[:, :3] += course[:, None] * force
    tau = np.einsum("tij,ti->tj", flange_jacobian(robot.chain, recording.q), wrench)
    name = effort_name(recording, robot)
    constant = robot.torque_constant if name == "current" else None
    effort = recording.require(name) - (tau if constant is None else tau / constant)
    return replace(recording, **{name: effort}), wrench, tau


class KnownTruth(NamedTuple):
    """True contact of a log's arm, on the log's clock; None where unknown."""

    tau: Array | None  #: External torque on the robot. (T, n)
    wrench: Array | None  #: On the flange, base axes. (T, 6)
    contacts: Sequence[TrueContact] | None


def truth_of(task: ScoreTask, recording: Recording, robot: Robot) -> KnownTruth:
    """The truth of a log, from the manifest or a file."""
    log, t = task.log, recording.t
    listed: list[Any] | None = [(*c, np.nan)[:3] for c in log.contacts] or None
    if task.truth is None:
        if log.truth == "free":
            return KnownTruth(np.zeros(recording.q.shape), None, [])
        return KnownTruth(None, None, listed)
    table = read_reference(task.truth, log.truth_columns or None)
    table = replace(table, stamps=since_start(table.stamps, recording))
    load = table_reference(table, task.truth, recording, robot, NOTHING)
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
    choice = replace(task.choice, library=Library([task.file]), examiner=Examiner(anyway=True))
    task = task._replace(choice=choice)
    run = prepared(choice.library.open(task.file, choice.read), choice)
    recording, robot = run.recording, run.robot
    begin("estimating")
    answers = [*(own_answers if task.rival is None else outside_answer)(task, recording, robot)]
    begin("scoring")
    truth = truth_of(task, recording, robot)
    shared = {
        "key": task.key,
        "log": log.name,
        "arm": log.arm,
        "protocol": task.protocol,
        "exact_model": log.exact_model,
        "marked": task.marked,
        "truth_error_Nm": log.truth_error.tau_Nm,
    }
    rows = [
        {**shared, **answer.cost, "method": answer.torque.name, "future": answer.future, **row}
        for answer in answers
        for row in rows_of(answer, truth, log)
    ]
    folder.put_rows(task.key, pl.DataFrame(rows, schema={"key": String, **SCHEMA}))


def own_answers(task: ScoreTask, recording: Recording, robot: Robot) -> Iterator[Answer]:
    """Answers of zero, the vendor and our observers, `best` with its contacts."""
    t, begun, choice = recording.t, thread_time(), task.choice
    made = analyse(run_of(recording, robot, choice), choice)
    us = 1e6 / len(t)
    whole = us * (thread_time() - begun)
    wrenches = {wrench.name: wrench.known for wrench in made.wrenches}
    nothing = np.zeros((recording.samples, 6))
    yield Answer(ExternalTorque(name="zero", t=t, tau=np.zeros(recording.q.shape)), nothing)
    if task.log.vendor:
        table = read_reference(task.file, task.log.vendor)
        t_file, tau = since_start(table.stamps, recording), table.signals["tau_ext"]
        tau = on_the_logs_clock(t_file, tau, recording, task.file)
        yield Answer(ExternalTorque(name="vendor", t=t, tau=tau))
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


def outside_answer(task: ScoreTask, recording: Recording, _: Robot) -> Iterator[Answer]:
    """Another program's answer for a log, at the log's stamps."""
    rival = task.rival
    assert rival is not None, "it has a folder"
    path, listed = rival.file(task.log), rival.file(task.log, "contacts.csv")
    lists = {} if listed is None else {LISTS[0]: read_list(listed)}
    # Without estimates for a log it answers nothing there.
    t = recording.t
    columns: list[Any] = [np.full(recording.q.shape, np.nan), None, None]
    if path is not None:
        read, wrench = read_outside(path, rival.name)
        if read.joints != recording.joints:
            joints = f"{read.joints} joints for a log of {recording.joints}"
            raise LogError(f"{path}: torques of {joints}")
        own, columns = since_start(read.t, recording), [read.tau, read.error_sd, wrench]
        if len(own) != len(t) or abs(own - t).max() >= SAME:
            there = (
                x if x is None else on_the_logs_clock(own, x, recording, path) for x in columns
            )
            columns = [*there]
    tau, sd, wrench = columns
    torque = ExternalTorque(name=rival.name, t=t, tau=tau, error_sd=sd)
    yield Answer(torque, wrench, not rival.declared.causal, lists)


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
        yield {"part": "wrench", **wrench_sums(wrench[touch], truth.wrench[touch], w[touch])}
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
            score = Score.of(torque, truth, inside)
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


def wrench_sums(values: Array, truth: Array, w: Array) -> dict[str, float]:
    """Σ w |f̂ − f|² and its like; a missing wrench counts as 0."""
    error, sums = np.where(np.isfinite(values), values, 0.0) - truth, {}
    for head, wrench in (("", error), ("true_", truth)):
        for kind, part in (("force", wrench[:, :3]), ("moment", wrench[:, 3:])):
            sums[f"{head}{kind}_squares"] = float((w * (part**2).sum(axis=1)).sum())
    missing = float((w * ~np.isfinite(values[:, 0])).sum())
    return {**sums, "wrench_missing_s": missing, "wrench_s": float(w.sum())}


def weighed(up: Array, weight: float, w: Array) -> dict[str, float]:
    """Mean and rms error of a carried weight [N], and the share of answered time."""
    known = np.isfinite(up)
    total = float(w[known].sum()) or np.nan
    mean = float((w * up)[known].sum()) / total
    square = float((w * (up - weight) ** 2)[known].sum()) / total
    found = {"weight_N": weight, "mean_N": mean, "rms_error_N": np.sqrt(square)}
    return {**found, "answered": total / w.sum()}


def read_outside(path: Path, name: str) -> tuple[ExternalTorque, Array | None]:
    """Torque and wrench (T, 6) or None of another program's file, at its own stamps.

    Its columns are t, tau_ext/1…, band/1… (one standard deviation), wrench/fx… (force and
    moment on the robot, base axes); a file of `vftcli estimate` has them as
    tau_ext/NAME/1…. NaN is no answer.
    """
    table = table_at(path)
    inner = f"/{name}/" if f"{TORQUE}/{name}/1" in table.names else "/"
    columns = {column: Cell(k) for k, column in enumerate(table.names)}
    picks = {}
    for kind, ends in {TORQUE: count(1), "band": count(1), "wrench": AXES}.items():
        wanted = (f"{kind}{inner}{end}" for end in ends)
        cells = tuple(columns[each] for each in takewhile(columns.__contains__, wanted))
        if cells and (kind != "wrench" or len(cells) == len(AXES)):
            picks[kind] = Item(kind, cells=cells)
    if "t" not in columns or TORQUE not in picks:
        raise LogError(
            f"{path}: estimates have columns t, {TORQUE}/1, {TORQUE}/2 …; it has "
            f"{listed(table.names)}"
        )
    picks["t"] = Item("t", unit="s", cells=(columns["t"],))
    raw = load_signals(table, picks, ReadChoice())
    torque = ExternalTorque(
        name=name,
        t=program_clock(raw, path),
        tau=raw.signals[TORQUE],
        error_sd=raw.signals.get("band"),
    )
    return torque, raw.signals.get("wrench")
