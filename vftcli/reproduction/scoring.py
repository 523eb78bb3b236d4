"""One log scored by one protocol: its truth, what each method answers, and the rows of that."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple, get_type_hints

import numpy as np
import polars as pl
from polars import Boolean, Float64, Int64, String

from vftcli.batch.cluster import begin
from vftcli.doctor.examination import Examiner
from vftcli.evaluation.detection import ListedRow, ListScore, TrueContact, score_list, wrench_sums
from vftcli.evaluation.references import on_the_logs_clock, since_start, table_reference
from vftcli.evaluation.scores import Score, episodes, lag_sums, parts_of, weights
from vftcli.free_motion.free_motion import within
from vftcli.observers.table import BEST, OBSERVERS
from vftcli.outputs.batch_folder import BatchFolder
from vftcli.pipeline import AnalysisChoice, analyse, prepared
from vftcli.readers.library import Library
from vftcli.readers.outside import read_list, read_outside
from vftcli.readers.references import read_reference
from vftcli.reproduction.manifest import BenchmarkLog, Rival
from vftcli.robots.chain import flange_jacobian
from vftcli.robots.robot import Robot
from vftcli.robots.run import Runs
from vftcli.robots.terms import effort_name
from vftcli.signals.arrays import Array, Mask
from vftcli.signals.errors import LogError
from vftcli.signals.external_torque import ExternalTorque
from vftcli.signals.recording import Recording
from vftcli.wrench.frames import NOTHING

#: Torque from which a joint's truth is a contact where no force is known, and its end. [N·m]
TOUCHED, UNTOUCHED = 0.05, 0.025
WORST = 10.0  #: Length of the span that is drawn. [s]
NO_WRENCH = np.zeros((0, 6))
KINDS = {int: Int64, float: Float64, list[float]: pl.List(Float64)}
#: Rows of a log × protocol × method: of a part and joint; of lists; of wrench, weight and lag.
SCHEMA: dict[str, Any] = {
    **dict.fromkeys(("log", "arm", "protocol", "method", "part"), String),
    "joint": Int64,
    **dict.fromkeys(("future", "exact_model", "marked"), Boolean),
    **dict.fromkeys(("truth_error_Nm", "rmse_Nm", "l1_Nm"), Float64),
    # Sums over each cell of 2 s, as `Score` has them.
    **dict.fromkeys(Score.__annotations__, pl.List(Float64)),
    **{name: KINDS[kind] for name, kind in get_type_hints(ListScore).items()},
    **dict.fromkeys(wrench_sums(NO_WRENCH, NO_WRENCH, np.zeros(0)), Float64),
    **dict.fromkeys(("weight_N", "mean_N", "rms_error_N", "answered"), Float64),
    "lag_squares": pl.List(Float64),
    # The worst 10 s of `best`, on the joint that errs most in them.
    "worst_joint": Int64,
    **dict.fromkeys(("worst_t", "worst_truth", "worst_estimate"), pl.List(Float64)),
}
LIST, WITH_CANDIDATES = "list", "list with candidates"  #: Parts of rows of lists.


class ScoreTask(NamedTuple):
    """One log by one protocol: ours, or what another program made of it."""

    folder: Path
    key: str
    log: BenchmarkLog
    protocol: str
    choice: AnalysisChoice
    file: Path
    truth: Path | None  #: The file of the truth.
    rival: Rival | None
    marked: bool  #: Whether it is scored in spite of a complaint.

    @property
    def label(self) -> str:
        """What it is called."""
        rival = f", {self.rival.name}" if self.rival else ""
        return f"{self.log.name}, {self.protocol}{rival}"


def planted(
    recording: Recording, robot: Robot, log: BenchmarkLog
) -> tuple[Recording, Array, Array]:
    """A free log with pushes in its drive torque: τ − Jᵀ w; their wrench and joint torque.

    Half sines at the flange in base axes, without moments. The motion does not yield.
    """
    t, wrench = recording.t, np.zeros((recording.samples, 6))
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
    """What really touched a log's arm, on the log's clock."""

    tau: Array | None = None  #: External torque on the robot; None where it is not known. (T, n)
    wrench: Array | None = None  #: On the flange, base axes; None where not known. (T, 6)
    contacts: Sequence[TrueContact] | None = None  #: None where they are not known.


def truth_of(
    log: BenchmarkLog, recording: Recording, robot: Robot, file: Path | None
) -> KnownTruth:
    """The truth that a manifest states of a log, or that a file holds."""
    listed: list[TrueContact] | None = None
    if log.contacts:
        listed = [(c[0], c[1], c[2] if len(c) > 2 else np.nan) for c in log.contacts]
    if file is None:
        zero = np.zeros(recording.q.shape) if log.truth == "free" else None
        return KnownTruth(zero, None, [] if log.truth == "free" else listed)
    table = read_reference(file, log.truth_columns or None)
    table = table._replace(t=since_start(table.t, recording))
    load = table_reference(table, file, recording, robot, NOTHING)
    tau, wrench = load.torque.tau, None if load.wrench is None else load.wrench.values
    if listed is None and wrench is not None:
        size = np.linalg.norm(wrench[:, :3], axis=1)
        listed = episodes(recording.t, size, log.contact_N, 0.5 * log.contact_N)
    elif listed is None:
        found = episodes(recording.t, abs(tau).max(axis=1), TOUCHED, UNTOUCHED)
        listed = [(start, stop, np.nan) for start, stop, _ in found]
    return KnownTruth(tau, wrench, listed)


class Answer(NamedTuple):
    """What one method says of a log."""

    torque: ExternalTorque
    wrench: Array | None = None
    future: bool = False  #: Whether it uses what comes later.
    rows: Mapping[str, Sequence[ListedRow]] = {}  #: Part → its list of contacts.


def score_log(task: ScoreTask) -> None:
    """Score a log by a protocol and write its rows, unless they are there."""
    folder = BatchFolder(task.folder)
    if folder.row_file(task.key).exists():
        return
    begin("reading")
    choice = replace(task.choice, library=Library([task.file]), examiner=Examiner(anyway=True))
    recording, robot = prepared(choice.library.open(task.file, choice.read), choice)
    begin("estimating")
    answers: dict[str, Answer]
    if task.rival is not None:
        answers = {task.rival.name: outside_answer(task, recording)}
    else:
        answers = own_answers(task, recording, robot, choice)
    begin("scoring")
    truth = truth_of(task.log, recording, robot, task.truth)
    scored = within(recording.t, task.log.spans)
    rows = [
        {
            "key": task.key,
            "log": task.log.name,
            "arm": task.log.arm,
            "protocol": task.protocol,
            "method": name,
            "exact_model": task.log.exact_model,
            "future": answer.future,
            "marked": task.marked,
            "truth_error_Nm": task.log.truth_error.tau_Nm,
            **row,
        }
        for name, answer in answers.items()
        for row in rows_of(answer, truth, task.log, recording.t, scored)
    ]
    folder.put_rows(task.key, pl.DataFrame(rows, schema={"key": String, **SCHEMA}))


def own_answers(
    task: ScoreTask, recording: Recording, robot: Robot, choice: AnalysisChoice
) -> dict[str, Answer]:
    """Our observers' estimates, with the list of contacts, and those of zero and the vendor."""
    made = analyse(recording, robot, choice, Runs())
    wrenches = {wrench.name: wrench.known for wrench in made.wrenches}
    rows: dict[str, Sequence[ListedRow]] = {}
    if made.contacts is not None:
        listed, weak = (
            [
                ListedRow(c.start, c.stop, c.peak_force or 0.0, c.peak_band or 0.0, c.is_load)
                for c in each
            ]
            for each in (made.contacts.contacts, made.contacts.candidates)
        )
        rows = {LIST: listed, WITH_CANDIDATES: sorted((*listed, *weak))}
    zero = ExternalTorque(name="zero", t=recording.t, tau=np.zeros(recording.q.shape))
    answers = {"zero": Answer(zero, np.zeros((recording.samples, 6)))}
    if task.log.vendor:
        table = read_reference(task.file, task.log.vendor)
        t = since_start(table.t, recording)
        assert table.tau is not None, "the vendor's columns are torques"
        tau = on_the_logs_clock(t, table.tau, recording, task.file)
        answers["vendor"] = Answer(ExternalTorque(name="vendor", t=recording.t, tau=tau))
    for estimate in made.estimates:
        name = estimate.name
        own = rows if name == BEST else {}
        answers[name] = Answer(estimate, wrenches.get(name), not OBSERVERS[name].online, own)
    return answers


def outside_answer(task: ScoreTask, recording: Recording) -> Answer:
    """What another program says of a log, at the log's stamps."""
    assert task.rival is not None, "it has a folder"
    name, _, declared = task.rival
    path, listed = task.rival.file(task.log), task.rival.list(task.log)
    rows = {} if listed is None else {LIST: [ListedRow(*row) for row in read_list(listed)]}
    # Without estimates of a log of an arm that it has it answers nothing there.
    tau = np.full(recording.q.shape, np.nan)
    sd: Array | None = None
    wrench: Array | None = None
    if path is not None:
        table = read_outside(path, name)
        if table.tau.shape[1] != recording.joints:
            raise LogError(
                f"{path}: torques of {table.tau.shape[1]} joints for a log of {recording.joints}"
            )
        t = since_start(table.t, recording)
        same = len(t) == recording.samples and abs(t - recording.t).max() < 1e-6

        def at_stamps(values: Array) -> Array:
            return values if same else on_the_logs_clock(t, values, recording, path)

        tau = at_stamps(table.tau)
        sd, wrench = (None if x is None else at_stamps(x) for x in (table.sd, table.wrench))
    torque = ExternalTorque(name=name, t=recording.t, tau=tau, error_sd=sd)
    return Answer(torque, wrench, not declared.causal, rows)


def rows_of(
    answer: Answer, truth: KnownTruth, log: BenchmarkLog, t: Array, scored: Mask
) -> Iterator[dict[str, Any]]:
    """Every row of one method on one log."""
    w, known = weights(t), scored
    if truth.tau is not None:
        known = scored & np.isfinite(truth.tau).all(axis=1)
    parts = parts_of(t, known, truth.contacts or ())
    touch = parts["contact"]
    if truth.tau is not None and known.any():
        if not truth.contacts:
            del parts["all"]
        if log.pushes:
            del parts["free"]  # it is scored of the log without them
        yield from torque_rows(answer.torque, truth.tau, parts)
    if answer.wrench is not None and truth.wrench is not None and touch.any():
        samples = answer.wrench[touch], truth.wrench[touch], w[touch]
        yield {"part": "wrench", **wrench_sums(*samples)}
    if answer.wrench is not None and log.weight_N:
        yield {"part": "weight", **weighed(-answer.wrench[scored, 2], log.weight_N, w[scored])}
    if truth.contacts is not None:
        for part, rows in answer.rows.items():
            counts = score_list(rows, truth.contacts, log.trusted, float(t[-1]))
            yield {"part": part, **counts._asdict()}


def torque_rows(
    torque: ExternalTorque, truth: Array, parts: Mapping[str, Mask]
) -> Iterator[dict[str, Any]]:
    """The rows of a torque: sums of each part and joint, of shifts, and where `best` is worst."""
    for part, inside in parts.items():
        if not inside.any():
            continue
        score = Score.of(torque, truth, inside)
        for j, sums in enumerate(score.by_joint()):
            means = {"rmse_Nm": float(score.rmse[j]), "l1_Nm": float(score.l1[j])}
            yield {"part": part, "joint": j + 1, **means, **sums}
    if torque.name == BEST:
        yield {"part": "worst", **worst_of(torque, truth, np.any([*parts.values()], axis=0))}
    if "all" in parts and torque.name != "zero":
        yield {"part": "all", "lag_squares": lag_sums(torque, truth, parts["all"]).tolist()}


def worst_of(torque: ExternalTorque, truth: Array, scored: Mask) -> dict[str, Any]:
    """The `WORST` seconds with the largest Σ w e², and the joint that has most of it."""
    t, answer = torque.t, np.where(torque.known, torque.tau, 0.0)
    squares = np.where(scored[:, None], weights(t)[:, None] * (answer - truth) ** 2, 0.0)
    total = np.concatenate([[0.0], squares.sum(axis=1).cumsum()])
    ends = np.searchsorted(t, t + WORST)
    first = int(np.argmax(total[ends] - total[:-1]))
    part = slice(first, int(ends[first]))
    joint = int(squares[part].sum(axis=0).argmax())
    seen = [np.where(scored, x[:, joint], np.nan) for x in (truth, answer)]
    lists = dict(zip(("t", "truth", "estimate"), (t, *seen), strict=True))
    return {"worst_joint": joint + 1, **{f"worst_{k}": v[part].tolist() for k, v in lists.items()}}


def weighed(up: Array, weight: float, w: Array) -> dict[str, float]:
    """The mean of a carried weight [N], its rms error, and the share of time with an answer."""
    known = np.isfinite(up)
    total = float(w[known].sum()) or np.nan
    mean = float((w * up)[known].sum()) / total
    square = float((w * (up - weight) ** 2)[known].sum()) / total
    shares = {"mean_N": mean, "rms_error_N": np.sqrt(square), "answered": total / w.sum()}
    return {"weight_N": weight, **shares}
