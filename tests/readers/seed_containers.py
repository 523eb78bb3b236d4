"""Small logs in containers, made in code: Arrow, JSON, MATLAB, HDF5 and the data sets' folders."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from seed_logs import ROWS, motion, panda_py_log

Layout = dict[str, Any]
"""Path of a dataset → its numbers."""


def arrow(path: Path, *, stream: bool = False, codec: str | None = "lz4") -> Path:
    """A table with a column of lists as an Arrow file or stream."""
    import pyarrow as pa

    log = motion()
    held = {name: pa.array(log[name].tolist()) for name in ("t", "q", "dq", "current")}
    return write_arrow(path, pa.table(held), stream=stream, codec=codec)


def write_arrow(
    path: Path, table: Any, *, stream: bool = False, codec: str | None = None, rows: int = 50
) -> Path:
    import pyarrow as pa

    options = pa.ipc.IpcWriteOptions(compression=codec)
    make = pa.ipc.new_stream if stream else pa.ipc.new_file
    with path.open("wb") as file, make(file, table.schema, options=options) as writer:
        writer.write_table(table, max_chunksize=rows)
    return path


def json_lines(path: Path) -> Path:
    """panda-py's log, an object a sample."""
    log = panda_py_log() | {"time": 1000 + np.arange(ROWS)}
    states = ({name: value[k].tolist() for name, value in log.items()} for k in range(ROWS))
    path.write_text("".join(f"{json.dumps(state)}\n" for state in states), encoding="utf-8")
    return path


def json_arrays(path: Path) -> Path:
    held = {name: value.tolist() for name, value in panda_py_log().items()}
    path.write_text(json.dumps({"robot": "panda", **held}), encoding="utf-8")
    return path


def json_skills(path: Path, skills: int = 1) -> Path:
    """frankapy's trajectory, as json.dump writes it."""
    log = motion(7, step=0.01)
    states = (
        {"q": (log["q"] + 0.1 * k).tolist(), "time_since_skill_started": log["t"].tolist()}
        for k in range(skills)
    )
    described = ({"skill_description": "GuideMode", "skill_state_dict": s} for s in states)
    held = {str(k): skill for k, skill in enumerate(described)}
    path.write_text(json.dumps(held), encoding="utf-8")
    return path


def matlab(path: Path, *, turned: bool = False, packed: bool = True) -> Path:
    """A file of version 5: variables, or one struct of joints × samples."""
    from scipy.io import savemat

    log = {name: motion()[name] for name in ("q", "dq", "current")}
    held: Layout = {"t": motion()["t"][:, None], **log, "note": "made in code"}
    if turned:
        held = {"log": {"time": motion()["t"][None], **{n: a.T for n, a in log.items()}}}
    with path.open("wb") as file:
        savemat(file, held, do_compression=packed)
    return path


def hdf5(path: Path, layout: Layout, **attributes: dict[str, Any]) -> Path:
    """An HDF5 file of datasets; attributes of groups by their path, `/` for the file."""
    import h5py

    with h5py.File(path, "w") as file:
        for name, numbers in layout.items():
            file.create_dataset(name, data=numbers)
        for group, reported in attributes.items():
            file[group].attrs.update(reported)
    return path


def matlab_73(path: Path) -> Path:
    """A file of version 7.3: HDF5 behind a block of 512 bytes, every matrix column by column.

    Each joint's positions are a vector of their own.
    """
    import h5py

    log = motion()
    apart = {f"q{j}": q for j, q in enumerate(log["q"].T, start=1)}
    log = {"t": log["t"], **apart, "dq": log["dq"], "current": log["current"]}
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, signal in log.items():
            dataset = file.create_dataset(name, data=np.atleast_2d(signal.T))
            dataset.attrs["MATLAB_class"] = np.bytes_("double")
    with path.open("r+b") as raw:
        raw.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(512))
    return path


def aloha(path: Path) -> Path:
    """ALOHA's two arms side by side, the right one's positions and efforts half as large."""
    log = motion()
    gripper = np.full((len(log["t"]), 1), 9.0)
    sides = {n: np.hstack([log[n], gripper, log[n] / 2, gripper]) for n in ("q", "dq", "current")}
    layout = {
        "observations/qpos": sides["q"],
        "observations/qvel": sides["dq"],
        "observations/effort": 1e3 * sides["current"],
        "action": sides["q"],
        "observations/images/cam_high": np.zeros((4, 2, 2, 3), dtype=np.uint8),
    }
    return hdf5(path, layout, **{"/": {"sim": False}})


def aloha_set(path: Path, episodes: tuple[int, ...] = (0, 2, 10)) -> Path:
    """Episodes in one file as ALOHA lays out one, each with its own positions."""
    q = motion()["q"]
    arms = {k: np.hstack([q, np.zeros((len(q), 8))]) + 0.01 * k for k in episodes}
    return hdf5(path, {f"data/demo_{k}/observations/qpos": arm for k, arm in arms.items()})


def droid(folder: Path, rows: int = 60, serial: str = "panda-295341") -> Path:
    """A DROID episode: trajectory.h5 and its metadata in a folder."""
    log = motion(7, rows=rows, step=1 / 15)
    nanos = 1_689_000_000_999_000_000 + np.round(1e9 * log["t"]).astype(np.int64)
    state, time = "observation/robot_state", "observation/timestamp/robot_state"
    layout = {
        f"{state}/joint_positions": log["q"],
        f"{state}/joint_velocities": log["dq"],
        f"{state}/motor_torques_measured": log["tau"],
        f"{state}/joint_torques_computed": np.zeros((rows, 7)),
        f"{time}/robot_timestamp_seconds": nanos // 10**9,
        f"{time}/robot_timestamp_nanos": nanos % 10**9,
    }
    folder.mkdir(parents=True)
    (folder / "metadata_LAB.json").write_text(json.dumps({"robot_serial": serial}))
    return hdf5(folder / "trajectory.h5", layout)


MOTION = {name: motion()[name] for name in ("t", "q", "dq", "current")}

SEEDS: dict[str, tuple[Callable[[Path], Path], str | None]] = {
    "arrow": (arrow, None),
    "arrow-stream": (lambda path: arrow(path, stream=True, codec="zstd"), None),
    "json": (json_arrays, None),
    "json-skills": (json_skills, None),
    "json-lines": (json_lines, None),
    "mat": (matlab, None),
    "mat-struct": (lambda path: matlab(path, turned=True), None),
    "mat-73": (matlab_73, None),
    "hdf5": (lambda path: hdf5(path, MOTION), None),
    "aloha": (aloha, None),
}
"""Name → how a log of that kind is made, and its --columns."""

NEED_H5PY = {"mat-73", "hdf5", "aloha"}
"""Those that h5py writes and reads."""
