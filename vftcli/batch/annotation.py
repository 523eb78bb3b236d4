"""Forces of a dataset's episodes: request and columns."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from vftcli.analysis import Analysis
from vftcli.batch.cluster import begin
from vftcli.batch.datasets import DataFile, ForceColumn, Single, put_rows, stored_rows
from vftcli.doctor.examination import Examiner
from vftcli.doctor.signals import efforts_of
from vftcli.free_motion.free_motion import within
from vftcli.observers import ObserverChoice, settling_samples
from vftcli.observers.table import OBSERVERS
from vftcli.outputs.run_record import observer_record, robot_record, to_json
from vftcli.pipeline import AnalysisChoice, analyse, prepared
from vftcli.readers.reading import Library
from vftcli.signals.arrays import Array, Indices
from vftcli.signals.errors import LogError, MissingSignalError, ParameterError, VftError
from vftcli.signals.packages import VERSION
from vftcli.signals.recording import Recording
from vftcli.signals.wrench import AXES
from vftcli.wrench.solvers import FRAMES

USUAL = "kfo-zoh"  #: The observer if none is named: it needs no later sample.
Record = dict[str, Any]  #: Facts of episodes, by name.
SIGN = "what the environment exerts ON the robot"  #: Sign of all that is added.


@dataclass(frozen=True, kw_only=True)
class ForceChoice(AnalysisChoice):
    """Request for every episode, of one observer."""

    observers: ObserverChoice = field(default_factory=lambda: ObserverChoice(names=(USUAL,)))
    contacts: bool = False  #: Whether it is wanted which frames lie in a contact of the list.
    sd: bool = False  #: Whether the observer's own standard deviation is wanted.
    #: Whether to go on after a finding, and without results.
    anyway: bool = False

    def __post_init__(self) -> None:
        super().__post_init__()
        if len(self.observers.names) != 1:
            raise ParameterError(
                "annotate writes the torques of one observer; give --observer once"
            )
        if self.read.interval or self.read.episode is not None:
            raise ParameterError(
                "annotate writes every frame of every episode; leave --interval and --episode out"
            )
        read = replace(self.read, skips_unknown=True, derive=self.read.derive or "none")
        object.__setattr__(self, "read", read)
        object.__setattr__(self, "observers", replace(self.observers, from_rest=True))

    @property
    def observer(self) -> str:
        """The observer's name."""
        return self.observers.names[0]

    @property
    def is_online(self) -> bool:
        """Whether torques and wrench need no later samples, if dq is logged."""
        wrench = self.wrench
        back = wrench is not None and (
            wrench.smooths(self.observer) or bool(wrench.zero.spans) or wrench.zero.start
        )
        return OBSERVERS[self.observer].online and not self.observers.gains_of_log and not back

    @property
    def suffix(self) -> str:
        """Suffix of the columns' names: the arm, of a dataset of two."""
        return f"_{self.read.arm}" if self.read.arm else ""


class EpisodesTask(NamedTuple):
    """Some episodes of one data file."""

    file: DataFile  #: The data file, with these episodes only.
    rows: Path  #: Where their columns are put.


def estimate_episodes(choice: ForceChoice, task: EpisodesTask) -> Record:
    """Records of some episodes; writes their forces."""
    if task.rows.is_file():
        return dict(json.loads(str(stored_rows(task.rows)["record"])))
    library, examiner = Library([task.file.log]), Examiner(anyway=choice.anyway)
    asked = replace(choice, library=library, examiner=examiner)
    arrays: dict[str, Single] = {}
    records: list[Record] = []
    found: Record = {"episodes": records, "robot": None, "observer": None}
    for number in task.file.episodes:
        begin(f"episode {number}")
        record: Record = {"episode": number, "file": task.file.place.as_posix()}
        try:
            recording = library.open(task.file.log, replace(choice.read, episode=number))
            check_signals(recording, anyway=choice.anyway)
            analysis = analyse(prepared(recording, asked), asked)
            if choice.contacts and analysis.contacts is None:
                reason = next(str(r) for r in analysis.remarks if r.code == "contacts-not-listed")
                raise LogError(f"{recording.name}: {reason}")
            columns = columns_of(analysis, choice)
        except ParameterError:
            raise  # what is asked cannot be had of any episode
        except VftError as error:
            record |= {"status": "missing", "reason": " ".join(str(error).split())}
        else:
            arrays |= {f"{number}/{name}": values for name, values in columns.items()}
            record |= record_of(analysis, columns)
            if found["robot"] is None:
                observer = analysis.observers[0]
                found["robot"] = robot_record(analysis.robot)
                found["observer"] = observer_record(observer, analysis.tunings[observer.name])
        records.append(record)
    text = to_json(found)
    if arrays:
        put_rows(task.rows, record=np.array(text), **arrays)
    return dict(json.loads(text))


def check_signals(recording: Recording, *, anyway: bool) -> None:
    """Raise without velocities or efforts, or if efforts are constant."""
    if recording.dq is None:
        raise MissingSignalError(
            f"{recording.name}: no joint velocities. --set log.derive=dq makes them of positions "
            "over the complete episode, so that the forces are not causal, and that is recorded"
        )
    efforts = efforts_of(recording)
    if not efforts:
        raise MissingSignalError(
            f"{recording.name}: no joint torques or currents, so no forces can be estimated; "
            "ports of DROID and Open X-Embodiment leave them out, DROID's raw release has them"
        )
    for _, value in () if anyway else efforts:
        same = np.flatnonzero((value == value[0]).all(axis=0))
        if 2 * len(same) >= recording.joints:
            joints = ", ".join(f"J{j + 1}" for j in same)
            raise LogError(
                f"{recording.name}: the effort of {joints} is {value[0, same[0]]:g} in every "
                "frame, so it was not measured: gravity would be written as force. Name the column "
                "that was measured with --columns. --anyway continues despite this"
            )


def columns_of(analysis: Analysis, choice: ForceChoice) -> dict[str, Single]:
    """An episode's columns by name, a row a frame, NaN without an estimate."""
    estimate, t = analysis.estimates[0], analysis.t
    found: dict[str, Array] = {"external_torque": estimate.tau}
    if choice.sd:
        if estimate.sd is None:
            raise ParameterError(
                f"--add sd: {estimate.name} states no standard deviation; choose another "
                "--observer, as kfo-zoh"
            )
        found["external_torque_sd"] = estimate.sd
    if choice.wrench is not None:
        found["wrench"] = analysis.wrenches[0].known
    if choice.contacts:
        touched = within(t, [(contact.start, contact.stop) for contact in analysis.listed])
        found["contact"] = touched[:, None].astype(np.float64)
    samples = analysis.recording.source.row_samples
    return {name: by_row(values, samples) for name, values in found.items()}


def by_row(values: Array, samples: Indices | None) -> Single:
    """Sample values (T, k) by row of the file; else NaN."""
    if samples is None:
        return values.astype(np.float32)
    return np.where(samples[:, None] >= 0, values[samples], np.nan).astype(np.float32)


def record_of(analysis: Analysis, columns: Mapping[str, Single]) -> Record:
    """Record of a finished episode."""
    recording, observer = analysis.recording, analysis.observers[0]
    missing = {name: int(np.isnan(v).any(axis=1).sum()) for name, v in columns.items()}
    some = {name: count for name, count in missing.items() if count}
    warnings = {f.code: None for one in analysis.examinations for f in one.warnings}
    refusals = [f.code for one in analysis.examinations for f in one.refusals()]
    return {
        "status": "part" if some else "done",
        "frames": len(columns["external_torque"]),
        **({"missing_frames": some} if some else {}),
        "transient_frames": settling_samples(observer, recording.median_step, recording.joints),
        "clock": recording.source.clock,
        "joints": list(recording.joint_names) or None,
        "joint_count": recording.joints,
        "robot": analysis.robot.name,
        "derived": list(recording.source.derived),
        "warnings": list(warnings),
        **({"overridden": refusals} if refusals else {}),
        "notes": [str(r) for r in (*recording.source.remarks, *analysis.estimates[0].remarks)],
    }


def force_columns(
    choice: ForceChoice, names: Sequence[str], *, derived: bool, valid: bool
) -> list[ForceColumn]:
    """The written columns."""
    online, version = choice.is_online and not derived, f"vftcli {VERSION}"
    made = {"observer": choice.observer, "causal": online, "version": version}
    joint = {"units": "N·m", "frame": "joint axes", "sign": SIGN, **made}
    flag = {"units": "1", "frame": "none", "sign": "1 where known, 0 where filled with 0", **made}
    found = [("external_torque", tuple(names), joint)]
    if choice.sd:
        found.append(("external_torque_sd", tuple(names), {**joint, "sign": "not negative"}))
    if valid:
        found.append(("external_torque_valid", (), flag))
    if choice.wrench is not None:
        frame = FRAMES[choice.wrench.frame]
        found.append(("wrench", AXES, {**joint, "units": "N, N·m", "frame": frame}))
        if valid:
            found.append(("wrench_valid", (), flag))
    if choice.contacts:
        listed = {**flag, "sign": "1 in a contact of the list, else 0", "causal": False}
        found.append(("contact", (), listed))
    return [
        ForceColumn(
            name + choice.suffix,
            elements if elements == AXES else tuple(f"{each}.{name}" for each in elements),
            about,
        )
        for name, elements, about in found
    ]
