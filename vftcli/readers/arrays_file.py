"""Bundles of arrays: .npz files, and the dictionaries that panda-py and frankapy hand to users."""

import zipfile
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from io import BytesIO
from typing import Any

import numpy as np

from vftcli.readers.formats import FORMATS, LogFormat
from vftcli.readers.opening import check_unpacked
from vftcli.readers.reader import Episodes, LogFile, RawLog, ReadChoice
from vftcli.readers.table import Column
from vftcli.readers.tables import ArrayTable, check_npy_header, from_table, numpy_array, read_layout
from vftcli.signals.errors import LogError, NoLogError
from vftcli.signals.remarks import Remark

SKILL = "skill_state_dict"  #: What frankapy calls the states of a skill.


def npz_arrays(file: LogFile) -> dict[str, Column]:
    """The arrays of an .npz file by name, unpacked within bounds."""
    arrays = {}
    try:
        with zipfile.ZipFile(BytesIO(file.content)) as bundle:
            total = sum(member.file_size for member in bundle.infolist())
            check_unpacked(file.path, total, len(file.content))
            for member in bundle.infolist():
                if member.filename.endswith(".npy"):
                    with bundle.open(member) as stream:
                        content = stream.read(total + 1)
                    member_head = LogFile(path=file.path, head=content)
                    check_npy_header(member_head, len(content))  # before it is believed
                    arrays[member.filename.removesuffix(".npy")] = numpy_array(file.path, content)
    except (
        zipfile.BadZipFile, NotImplementedError, RuntimeError, EOFError, OSError, ValueError,
    ) as e:  # fmt: skip
        reason = str(e).split("\n")[0][:120]
        raise LogError(f"{file.path}: a damaged .npz file ({reason})") from None
    return arrays


def read_arrays(
    file: LogFile, arrays: Mapping[str, Column], request: ReadChoice, *remarks: Remark
) -> RawLog:
    """Read named arrays as panda-py's log, by --columns, or by alias."""
    shaped = {name: _shaped(array) for name, array in arrays.items() if array.ndim in {1, 2, 3}}
    table = ArrayTable(path=file.path, columns=shaped, remarks=remarks)
    if request.spec.named:
        return from_table(table, request)
    if request.columns is not None:
        raise LogError(
            f"{file.path}: its arrays have names ({', '.join(list(arrays)[:20])}); --columns must "
            "name them, as in t[ms]=time,q=q,tau=tau_J."
        )
    if {"q", "time"} <= set(shaped) and {"tau_J", "O_T_EE", "dq"} & set(shaped):
        return read_layout(table, FORMATS["npz"], request)
    return from_table(table, request)


def _shaped(array: Column) -> Column:
    """An array as a column: (T,) of (T, 1), rows of matrices laid out flat."""
    if array.ndim == 3:
        return array.reshape(len(array), -1)
    if array.ndim == 2 and array.shape[1] == 1:
        return array[:, 0]
    return array


def arrays_of_lists(file: LogFile, log: Mapping[Any, Any]) -> dict[str, Column]:
    """The arrays of a dictionary of arrays or of lists of equally long arrays."""
    arrays = {}
    for name, value in log.items():
        rows = value.shape[0] if isinstance(value, np.ndarray) and value.ndim else 0
        if not (rows or (isinstance(value, list) and value)):
            continue
        try:
            array = np.asarray(value)
        except ValueError:
            raise LogError(f"{file.path}: {name!s:.40} holds rows of different lengths.") from None
        if array.dtype.kind in "fiub":
            arrays[str(name)] = array
    if not arrays:
        raise NoLogError(f"{file.path}: holds no arrays of numbers, so no log.")
    return arrays


def dictionary_episodes(file: LogFile, log: Mapping[Any, Any]) -> Episodes:
    """The logs of a dictionary of arrays or lists: frankapy's skills, else the one.

    frankapy has one dictionary a skill, {0: {skill_state_dict: {…}}}; panda-py's get_log() is one.
    """
    held = [value.get(SKILL) for value in log.values() if isinstance(value, dict)]
    if skills := [states for states in held if isinstance(states, dict)]:
        return {k: partial(read_skill, file, states) for k, states in enumerate(skills)}
    if len(log) == 1 and isinstance(inner := next(iter(log.values())), dict):
        log = inner
    return {0: lambda request: read_arrays(file, arrays_of_lists(file, log), request)}


def read_skill(file: LogFile, log: Mapping[Any, Any], request: ReadChoice) -> RawLog:
    """Read the states of one of frankapy's skills."""
    if "time_since_skill_started" in log:
        arrays = arrays_of_lists(file, {**log, "time": log["time_since_skill_started"]})
        usual = {"time": "t[s]", "q": "q[rad]", "dq": "dq", "tau_J": "tau"}
        items = [f"{signal}={name}" for name, signal in usual.items() if name in arrays]
        request = replace(request, columns=request.columns or ",".join(items))
        log = {name: arrays[name] for name in usual if name in arrays}
    return read_arrays(file, arrays_of_lists(file, log), request)


def read(file: LogFile, request: ReadChoice, _: LogFormat) -> RawLog:
    """Read an .npz file."""
    return read_arrays(file, npz_arrays(file), request)
