"""Pickles: opened only if they rebuild nothing but NumPy arrays. They are never executed."""

import codecs
import io
import pickle
import pickletools
import warnings
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from vftcli.readers.arrays_file import arrays_of_lists, read_arrays
from vftcli.readers.reader import LogFile, RawLog, ReadChoice, Reader
from vftcli.readers.table import Column
from vftcli.signals.errors import LogError

PICKLE_LIMIT = 512 * 1024 * 1024
"""Larger pickles are refused: they have to be held in memory twice."""


class Refused(pickle.UnpicklingError):
    """The pickle asks for something that is no array of numbers."""


class Marker:
    """Stands for the class ndarray, which a pickle names but may not call."""

    def __new__(cls, *_: object, **__: object) -> "Marker":
        """Refuse to be called.

        Raises:
            Refused: Always.
        """
        raise Refused("an array of its own making")


def _dtype(code: Any, *_: Any) -> Any:  # noqa: ANN401
    """A dtype of plain numbers, letters or booleans; object dtypes are refused."""
    dtype = np.dtype(code)
    if dtype.hasobject or dtype.itemsize > 1024:
        raise Refused("an array of objects")
    return dtype


def _empty(_kind: Any, _shape: Any, _code: Any) -> Any:  # noqa: ANN401
    """The empty array that a pickled array's state then fills."""
    return np.ndarray.__new__(np.ndarray, (0,), "b")


def _scalar(dtype: Any, content: Any = None) -> Any:  # noqa: ANN401
    """One number of its bytes."""
    if not isinstance(dtype, np.dtype) or dtype.hasobject or not isinstance(content, bytes):
        raise Refused("a scalar that is no number")
    return np.frombuffer(content, dtype=dtype, count=1)[0]


def _encode(text: Any, encoding: Any = "latin1") -> Any:  # noqa: ANN401
    """Text that old pickles hold the bytes of an array as."""
    if not isinstance(text, str) or encoding not in {"latin1", "latin-1"}:
        raise Refused("an odd encoding")
    return codecs.encode(text, "latin1")


def _from_buffer(buffer: Any, dtype: Any, shape: Any, order: Any = "C") -> Any:  # noqa: ANN401
    """An array of plain numbers over a buffer of the pickle."""
    if not isinstance(dtype, np.dtype) or dtype.hasobject:
        raise Refused("an array of objects")
    return np.frombuffer(buffer, dtype=dtype).reshape(shape, order=order).copy()


ALLOWED: dict[tuple[str, str], Callable[..., Any] | type] = {
    ("numpy", "ndarray"): Marker,
    ("numpy", "dtype"): _dtype,
    ("collections", "OrderedDict"): OrderedDict,
    ("_codecs", "encode"): _encode,
    **{
        (f"numpy.{package}.{module}", name): function
        for package in ("core", "_core")
        for module, name, function in (
            ("multiarray", "_reconstruct", _empty),
            ("multiarray", "scalar", _scalar),
            ("numeric", "_frombuffer", _from_buffer),
        )
    },
}
"""All that a pickle may call, by the names NumPy has pickled it under, each replaced by ours."""


class ArrayUnpickler(pickle.Unpickler):
    """An unpickler that rebuilds arrays and refuses everything else."""

    def find_class(self, module: str, name: str) -> Any:  # noqa: ANN401
        """Return what a name may stand for.

        Raises:
            Refused: If the name is not one of the few that arrays are made of.
        """
        try:
            return ALLOWED[module, name]
        except KeyError:
            raise Refused(f"{module}.{name}"[:80]) from None


def load_arrays_only(file: LogFile) -> Any:  # noqa: ANN401 - whatever the pickle holds
    """Load a pickle that holds only arrays, numbers, strings, lists and dictionaries.

    Raises:
        LogError: If it asks for anything else, is damaged, or is larger than its file can fill.
    """
    content = bytes(file.content)
    if len(content) > PICKLE_LIMIT:
        raise LogError(f"{file.path}: a pickle of {len(content) >> 20} MiB. Save it with np.savez.")
    remedy = "Pickles are opened only if they hold nothing but NumPy arrays; save with np.savez."
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # old opcodes' escapes: refused or read, never told
            # Looked over as a whole first: loading builds objects on the way to what it refuses.
            _check_opcodes(content)
            return ArrayUnpickler(io.BytesIO(content)).load()
    except Refused as refusal:
        raise LogError(f"{file.path}: refused, the pickle asks for {refusal}. {remedy}") from None
    except RecursionError:
        raise LogError(f"{file.path}: the pickle is nested too deeply. {remedy}") from None
    except (
        pickle.UnpicklingError, EOFError, ValueError, TypeError, KeyError, IndexError,
        AttributeError, OverflowError, MemoryError, UnicodeDecodeError, SyntaxError,
    ) as error:  # fmt: skip
        reason = str(error).split("\n")[0][:80]
        raise LogError(f"{file.path}: a damaged pickle ({reason}). {remedy}") from None


def _check_opcodes(content: bytes) -> None:
    """Raise Refused for opcodes that no array needs, before anything is built.

    Extension codes and persistent ids reach outside the file; a memo index or a claimed length far
    beyond the file's size would only fill memory.
    """
    for opcode, argument, _ in pickletools.genops(content):
        if opcode.name in {"EXT1", "EXT2", "EXT4", "PERSID", "BINPERSID", "INST", "OBJ"}:
            raise Refused(f"the opcode {opcode.name}")
        # A memo index allocates a list of its size.
        if isinstance(argument, int) and "PUT" in opcode.name and argument > len(content):
            raise Refused("a memo larger than the file")


def read_pickle(file: LogFile, request: ReadChoice) -> RawLog:
    """Read a pickled dictionary of arrays: panda-py's get_log() or frankapy's trajectory.

    Raises:
        LogError: If it holds anything but arrays, or no positions and times.
    """
    log = load_arrays_only(file)
    if (
        isinstance(log, dict)
        and len(log) == 1
        and isinstance(inner := next(iter(log.values())), dict)
    ):
        log = inner.get("skill_state_dict", inner)  # frankapy: {0: {skill_state_dict: {…}}}
        if isinstance(log, dict) and "time_since_skill_started" in log:
            log = {**log, "time": log["time_since_skill_started"]}
            return _read_frankapy(file, log, request)
    if not isinstance(log, dict):
        raise LogError(
            f"{file.path}: the pickle holds a {type(log).__name__}, not a dictionary of arrays. "
            "Save the log with np.savez."
        )
    return read_arrays(file, arrays_of_lists(file, log), request)


def _read_frankapy(file: LogFile, log: dict[Any, Any], request: ReadChoice) -> RawLog:
    """Read frankapy's trajectory: times in seconds, positions, no torque."""
    arrays = arrays_of_lists(file, log)
    kept: dict[str, Column] = {
        name: arrays[name] for name in ("time", "q", "dq", "tau_J") if name in arrays
    }
    columns = request.columns or ",".join(
        f"{signal}={name}"
        for signal, name in (("t[s]", "time"), ("q[rad]", "q"), ("dq", "dq"), ("tau", "tau_J"))
        if name in kept
    )
    return read_arrays(file, kept, replace(request, columns=columns))


PICKLE = Reader(
    name="pickle",
    recognises=lambda file: (
        file.head[:1] == b"\x80" and file.head[1:2] in {b"\2", b"\3", b"\4", b"\5"}
    ),
    read=read_pickle,
)
