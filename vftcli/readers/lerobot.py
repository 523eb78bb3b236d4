"""LeRobot datasets, versions 2 and 3: a folder of Parquet files with meta/info.json."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from vftcli.readers.parquet import ParquetTable
from vftcli.readers.reader import LogFile, RawLog, ReadChoice, Reader, open_log
from vftcli.readers.tables import from_table
from vftcli.signals.errors import LogError
from vftcli.signals.remarks import caution

INFO_LIMIT = 16 * 1024 * 1024


def read_lerobot(file: LogFile, request: ReadChoice) -> RawLog:
    """Read the first episode of a dataset; which one, of how many, is said.

    Raises:
        LogError: If the folder has no Parquet data or its info cannot be read.
    """
    info = _info(file.path)
    files = sorted((file.path / "data").rglob("*.parquet"))
    if not files:
        raise LogError(f"{file.path}: a LeRobot dataset without data/**/*.parquet.")
    first_file = open_log(files[0])
    table = ParquetTable(first_file)
    rows, first = None, 0
    if (numbers := table.episodes()).size:
        first = int(numbers[0])
        rows = np.flatnonzero(numbers == numbers[0])
    table = ParquetTable(first_file, rows)
    remark = caution(
        "episode-taken",
        episode=first,
        episodes=str(info.get("total_episodes", "an unknown number"))[:20],
        rate_Hz=str(info.get("fps", "unknown"))[:20],
    )
    request = replace(request, columns=request.columns or default_columns(table, info))
    return from_table(table, request, remarks=(remark,))


def default_columns(table: ParquetTable, info: dict[str, Any]) -> str:
    """A --columns text for a dataset's usual names: the first numbers of observation.state.

    The state of an arm often ends with its gripper; the names in info.json tell.
    """
    names = list(table.names or ())
    if "observation.state" not in names:
        raise LogError(
            f"{table.path}: no observation.state among {', '.join(names[:20])}. Name the columns: "
            "--columns 't=timestamp,q[rad]=observation.state[0:7]'."
        )
    length = table.lists.get(names.index("observation.state"), 0)
    feature = info.get("features", {})
    feature = feature.get("observation.state", {}) if isinstance(feature, dict) else {}
    labels = feature.get("names") if isinstance(feature, dict) else None
    if isinstance(labels, dict):
        labels = next(iter(labels.values()), None)
    # A gripper ends the state, and is no joint of the arm.
    joints = length
    if isinstance(labels, list) and len(labels) == length:
        fingers = [k for k, label in enumerate(labels) if "grip" in str(label).lower()]
        joints = min(fingers) if fingers else length
    return f"t=timestamp,q=observation.state[0:{joints}]"


def _info(folder: Path) -> dict[str, Any]:
    """meta/info.json."""
    path = folder / "meta" / "info.json"
    try:
        if path.stat().st_size > INFO_LIMIT:
            raise LogError(f"{path}: larger than {INFO_LIMIT >> 20} MiB; no description is.")
        info = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        raise LogError(f"{path}: not a readable description of a dataset") from None
    return info if isinstance(info, dict) else {}


LEROBOT = Reader(
    name="lerobot",
    recognises=lambda file: "meta" in file.entries and (file.path / "meta" / "info.json").is_file(),
    read=read_lerobot,
)
