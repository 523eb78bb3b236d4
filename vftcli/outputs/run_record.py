"""run.json: command, inputs and versions, to reproduce every number."""

import json
import platform
import re
import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields, is_dataclass, replace
from typing import Any

import numpy as np

from vftcli.analysis import Analysis
from vftcli.observers.observer import Observer, Tuning
from vftcli.observers.table import BEST
from vftcli.outputs import Record
from vftcli.outputs.contacts import contacts_record
from vftcli.outputs.examination import health_record, recording_record
from vftcli.outputs.files import OutputFolder, digest
from vftcli.robots import PROFILES
from vftcli.robots.robot import Robot
from vftcli.signals.arrays import root_mean_squares
from vftcli.signals.packages import VERSION
from vftcli.signals.parsing import whole
from vftcli.signals.recording import Recording
from vftcli.signals.remarks import Remark, as_record
from vftcli.wrench.solvers import FRAMES

#: Meaning of every number in an output.
CONVENTIONS = {
    "sign": "tau_ext is the torque the environment exerts ON the robot: "
    "M ddq + C dq + g + friction = tau + tau_ext",
    "frame": "joint torques, positive along each joint axis; joints count from 1 at the base",
    "units": "s, rad, rad/s, A, N, N·m, kg",
    "time": "seconds from the log's first sample",
}
#: A list without words, written on one line.
NUMBERS = re.compile(r"\[\n[^\[\]{}\"]*\n\s*\]")
END = "\n}\n"  #: End of an object's text.
#: Package → its module; its version is recorded if loaded.
PACKAGES = {
    **{name: name for name in ("numpy", "scipy", "polars")},
    "pin": "pinocchio",
    "rerun-sdk": "rerun",
    "rosbags": "rosbags",
    "mcap": "mcap",
}
#: Key of an observer's record → field of its tuning.
MEANT = {
    "omega_n_rad_s": "omega_n", "zeta": "zeta", "delay_s": "delay", "bandwidth_hz": "bandwidth",
    "dc_gain": "dc_gain", "numbers_to_tune": "parameter_count",
}  # fmt: skip


def run_record(analysis: Analysis, command: str) -> Record:
    """Content of `run.json`; `command` is the line as typed."""
    reference, sensed = analysis.reference, analysis.virtual_sensor
    found = {
        # Findings that may make all numbers wrong come first.
        "examination": health_record(analysis.examinations),
        "input": input_record(analysis.recording),
        "robot": robot_record(analysis.robot),
        "observers": [
            observer_record(observer, analysis.tunings.get(observer.name))
            for observer in analysis.observers
        ],
        "reference": reference
        and {"name": reference.name, "floor_Nm": reference.floor, "notes": reference.remarks},
        "wrench": sensed
        and {
            "frame": sensed.sensor.frame,
            "meaning": f"force and moment ON the robot; {FRAMES[sensed.sensor.frame]}",
            "solver": sensed.solver,
            "smoothed": {name: found.record for name, found in sensed.smoothed.items()},
            "least_sigma_m": sensed.sensor.least_sigma,
            "masked_share": sensed.masked_share,
            "tool": sensed.sensor.mounting.tool,
            "sensor": sensed.sensor.mounting.sensor,
            "zero_drift": [drift._asdict() for drift in sensed.drifts],
            "warnings": [r for r in sensed.remarks if r.level == "warning"],
        },
        "contacts": analysis.contacts and contacts_record(analysis.contacts),
        "complete_log": refinement_record(analysis),
        "conventions": CONVENTIONS,
        **log_remarks([analysis.recording]),
    }
    return envelope(command, [log_entry(analysis.recording)], all_remarks(analysis), found)


def envelope(
    command: str,
    logs: Sequence[Record] = (),
    remarks: Iterable[Remark] = (),
    found: Record | None = None,
) -> Record:
    """The answer of any command, as `--json` prints it and `run.json` holds it.

    Args:
        command: The command line.
        logs: An entry a log (`log_entry`); a single one's keys are at the top, too.
        remarks: What a reader of the numbers should know.
        found: The result; a table is its `rows`.
    """
    about = {"command": command, "versions": versions(), "logs": list(logs)}
    return {
        **about,
        "remarks": list(remarks),
        **(logs[0] if len(logs) == 1 else {}),
        **(found or {}),
    }


def log_entry(recording: Recording, found: Record | None = None) -> Record:
    """A log by name, path and digest, and the results on it."""
    source = recording.source
    about = {"path": source.path and str(source.path), "sha256": source.sha256 or None}
    return {"recording": recording.name, **about, **(found or {})}


def seal(
    folder: OutputFolder, name: str, record: Record, files: Mapping[str, str] | None = None
) -> str:
    """Write a run's record last, with every file's digest; its text without digests.

    Digests of recordings differ, since Rerun numbers rows by the clock.
    """
    files = folder.digests(name.rpartition("/")[0]) if files is None else files
    text, digests = to_json(record), to_json({"files": files})
    # Joined as texts: to encode all anew would double the time.
    folder.write(name, f"{text.removesuffix(END)},{digests.removeprefix('{')}")
    return text


def to_json(record: Record | Sequence[Any]) -> str:
    """A record, or rows, as JSON; null if not finite."""
    text = json.dumps(jsonable(record), indent=2, ensure_ascii=False, allow_nan=False)
    return NUMBERS.sub(lambda found: " ".join(found.group().split()), text) + "\n"


def jsonable(value: Any) -> Any:  # noqa: ANN401 - whatever JSON can hold
    """A value in JSON types: arrays as lists, NaN as None, dataclasses as objects.

    A remark becomes its code, level, values, place and words.
    """
    match value:
        case Remark():
            return jsonable(as_record(value))
        case None | bool() | int():
            return value
        case float() | np.floating():
            return float(value) if np.isfinite(value) else None
        case np.ndarray() | np.generic():
            return jsonable(value.tolist())
        case Mapping():
            return {whole(str(key)): jsonable(item) for key, item in value.items()}
        case list() | tuple() | set() | frozenset():
            return [jsonable(item) for item in value]
        case _ if is_dataclass(value) and not isinstance(value, type):
            return {field.name: jsonable(getattr(value, field.name)) for field in fields(value)}
    return whole(str(value))


def versions() -> dict[str, str]:
    """Versions of the program and of the packages loaded in this run, by name.

    A package that is not loaded has no part in the numbers; to look it up is slow.
    """
    loaded = {package: sys.modules.get(module) for package, module in PACKAGES.items()}
    found = {k: str(getattr(v, "__version__", "unknown")) for k, v in loaded.items() if v}
    return {"vftcli": VERSION, "python": platform.python_version(), **found}


def input_record(recording: Recording) -> Record:
    """The log by path and digest, its signals, and the part in use."""
    path = recording.source.path
    ends = {"start_s": float(recording.t[0]), "end_s": float(recording.t[-1])}
    return {"path": path and str(path), **recording_record(recording), **ends}


def log_remarks(logs: Iterable[Recording]) -> dict[str, list[Remark]]:
    """Repairs in reading the logs, and suspicions."""
    found = [remark for log in logs for remark in log.source.remarks]
    return {
        "repairs": [remark for remark in found if remark.level == "fact"],
        "warnings": [remark for remark in found if remark.level != "fact"],
    }


def robot_record(robot: Robot) -> Record:
    """The robot in use: a built-in profile by its name."""
    # Its path differs between machines; name and digest are enough.
    path, built_in = robot.path, robot.path in PROFILES.values()
    return {
        "name": robot.name,
        "title": robot.title,
        "file": None if built_in else path and str(path),
        "sha256": digest(path) if path is not None and path.is_file() else None,
        "torque_source": robot.torque_source,
        "friction": [joint.model for joint in robot.friction] or "none",
        "payload_kg": robot.payload and robot.payload.mass,
        "gravity_m_s2": robot.chain.gravity,
        "notes": robot.remarks,
    }


def observer_record(observer: Observer, tuning: Tuning | None) -> Record:
    """An observer's parameters, and their meaning for the log."""
    # The observer that ran is inside, with the log's gains.
    inner: Any = getattr(observer, "observer", observer)
    own = [field.name for field in fields(inner) if field.init] if is_dataclass(inner) else []
    parameters = {name: jsonable(getattr(inner, name)) for name in own}
    meant = {} if tuning is None else {key: getattr(tuning, of) for key, of in MEANT.items()}
    return {"name": observer.name, "parameters": parameters, **meant}


def refinement_record(analysis: Analysis) -> Record | None:
    """Free part, gains, bias, error budget of the complete log."""
    found = analysis.refinement
    if found is None:
        return None
    spectra, best = found.baselines.plain.spectra, None
    if any(observer.name == BEST for observer in analysis.observers):
        under, tuned = found.baselines.best, BEST in found.curves
        bias = under.correction
        best = {
            "observer": "rts-auto" if tuned else "kfo-rts",
            "gains": "log" if tuned else "robot",
            "omega_n_rad_s": analysis.tunings[BEST].omega_n,
            "free_part": under.part and under.part.remarks,
            "whole_log_bias": {
                "joints": np.flatnonzero(bias.applied) + 1,
                "rms_Nm": root_mean_squares(bias.bias),
                "sd_Nm": root_mean_squares(bias.sd),
            }
            if bias is not None and bias.applied.any()
            else None,
        }
    return {
        "bias_removed": found.removed,
        "segments_free_loaded": spectra and spectra.segments,
        "best": best,
        "tuned": {
            name: {"omega_n_rad_s": curve.best, "expected_rmse_Nm": curve.least}
            for name, curve in found.curves.items()
        },
        "error_budget_Nm": found.budget,
        "band_sd_Nm": {
            e.name: root_mean_squares(e.error_sd)
            for e in analysis.estimates
            if e.error_sd is not None
        },
        "notes": found.remarks,
    }


def all_remarks(analysis: Analysis) -> list[Remark]:
    """Remarks of run, estimates and reference, each once."""
    found: list[Remark] = [*analysis.remarks]
    # Compared by their words: values may be arrays.
    of_run = set(map(str, found))
    for torque in analysis.torques:
        for remark in torque.remarks:
            if str(remark) not in of_run:
                where = remark.where._replace(about=remark.where.about or torque.name)
                found.append(replace(remark, where=where))
    if analysis.virtual_sensor is not None:
        found += analysis.virtual_sensor.remarks
    return list({str(note): note for note in found}.values())
