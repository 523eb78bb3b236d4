"""Pickles: opened only if they rebuild nothing but NumPy arrays. They are never executed."""

import io
import pickle
import pickletools
import re
import warnings
from collections.abc import Callable
from typing import Any

import numpy as np

from vftcli.readers.reader import LogFile
from vftcli.signals.errors import LogError

#: Numbers that a pickle of any size may build; a larger one as many as it has bytes.
BUILT_LIMIT = 1 << 20

TOO_MUCH = "more numbers than a file of its size can hold"

DEPTH = 32  #: Lists inside lists: a log has four, an array of states four or five.


class Refused(pickle.UnpicklingError):
    """The pickle asks for something that is no array of numbers."""


class Marker:
    """Stands for the class ndarray, which a pickle names but may not call."""

    def __new__(cls, *_: object, **__: object) -> "Marker":
        """Refuse to be called."""
        raise Refused("an array of its own making")


class PickledType:
    """The type of an array's numbers as a pickle tells it; NumPy's own never meets a pickle.

    Attributes:
        dtype: The type of plain numbers, letters or booleans; None for any other.
    """

    def __init__(self, code: Any = None, *_: Any) -> None:  # noqa: ANN401 - whatever is pickled
        if isinstance(code, str) and re.search(r"O|object", code):
            raise Refused("an array of objects")
        plain = isinstance(code, str) and re.fullmatch(
            r"[<>=|]?([biufc?]\d{0,2}|[SU]\d{1,3})", code
        )
        self.dtype: np.dtype[Any] | None = np.dtype(code) if plain else None

    def __setstate__(self, state: Any) -> None:  # noqa: ANN401
        """Take up the byte order, the second of what NumPy pickles of a type."""
        _version, order, subarray, names = state[:4]
        if subarray is not None or names is not None or order not in {"<", ">", "=", "|"}:
            self.dtype = None
        elif self.dtype is not None and order in {"<", ">"}:
            self.dtype = self.dtype.newbyteorder(order)


class PickledArray:
    """An array as a pickle tells it, laid over the pickle's own bytes.

    Attributes:
        array: The array; empty where it holds no plain numbers.
    """

    __slots__ = ("array",)

    def __init__(self, kind: Any = Marker, *_: Any) -> None:  # noqa: ANN401
        if kind is not Marker:
            raise Refused("an array of a kind of its own")
        self.array = NOTHING

    def __setstate__(self, state: Any) -> None:  # noqa: ANN401
        """Take up shape, type, order and bytes, as NumPy pickles them."""
        shape, kind, fortran, content = state[-4:]
        self.fill(content, kind, shape, "F" if fortran else "C")

    def fill(self, content: Any, kind: Any, shape: Any, order: str) -> None:  # noqa: ANN401
        """Lay the array over some bytes."""
        if not isinstance(kind, PickledType) or not isinstance(content, bytes | bytearray):
            raise Refused("an array of objects")
        if kind.dtype is not None:
            numbers = np.frombuffer(content, dtype=kind.dtype)
            self.array = numbers.reshape(shape, order="F" if order == "F" else "C")


Built = tuple[Any, int]  #: What was built of a part of a pickle, and how many numbers it holds.
NOTHING = np.empty(0, dtype="V1")  #: What stands for an array that holds no numbers.


def _from_buffer(buffer: Any, kind: Any, shape: Any, order: Any = "C") -> PickledArray:  # noqa: ANN401
    """An array over a buffer of the pickle, as newer protocols hold it."""
    array = PickledArray()
    array.fill(buffer, kind, shape, order)
    return array


def _scalar(kind: Any, content: Any = None) -> Any:  # noqa: ANN401
    """One number of its bytes."""
    if not isinstance(kind, PickledType) or kind.dtype is None or not isinstance(content, bytes):
        raise Refused("a scalar that is no number")
    return np.frombuffer(content, dtype=kind.dtype, count=1)[0].item()


#: All that a pickle may call, by the names NumPy has pickled it under, each replaced by ours.
ALLOWED: dict[tuple[str, str], Callable[..., Any] | type] = {
    ("numpy", "ndarray"): Marker,
    ("numpy", "dtype"): PickledType,
    **{
        (f"numpy.{package}.{module}", name): function
        for package in ("core", "_core")
        for module, name, function in (
            ("multiarray", "_reconstruct", PickledArray),
            ("multiarray", "scalar", _scalar),
            ("numeric", "_frombuffer", _from_buffer),
        )
    },
}


class ArrayUnpickler(pickle.Unpickler):
    """An unpickler that rebuilds arrays and refuses everything else.

    What it builds is bounded by the size of the pickle: a part may be named again and again in two
    bytes each.
    """

    def __init__(self, content: bytes) -> None:
        super().__init__(io.BytesIO(content))
        self._left = max(BUILT_LIMIT, len(content))

    def find_class(self, module: str, name: str) -> Any:  # noqa: ANN401
        """Return what a name may stand for."""
        if (module, name) == ("_codecs", "encode"):
            return self._encoded
        if (module, name) == ("collections", "OrderedDict"):
            return self._ordered
        try:
            return ALLOWED[module, name]
        except KeyError:
            raise Refused(f"{module}.{name}"[:80]) from None

    def _encoded(self, text: Any, encoding: Any = "latin1") -> bytes:  # noqa: ANN401
        """Text that old pickles hold the bytes of an array as."""
        if not isinstance(text, str) or encoding not in {"latin1", "latin-1"}:
            raise Refused("an odd encoding")
        self._claim(len(text))
        return text.encode("latin1")

    def _ordered(self, items: Any = ()) -> dict[Any, Any]:  # noqa: ANN401
        """A dictionary that keeps its order, as every dictionary does today."""
        self._claim(len(items))
        return dict(items)

    def _claim(self, size: int) -> None:
        """Count what is about to be built."""
        self._left -= size
        if self._left < 0:
            raise Refused(TOO_MUCH)

    def built(self, value: Any) -> Any:  # noqa: ANN401 - whatever the pickle holds
        """What was loaded, with arrays for pickled arrays, once its size is known to be bounded."""
        built, size = self._settled(value, {}, 0)
        self._claim(size)
        return built

    def _settled(self, value: Any, known: dict[int, Built | None], depth: int) -> Built:  # noqa: ANN401
        """A value with arrays for pickled arrays, and how many numbers it takes laid out in full.

        A part that is named again is not walked again: a few lists that hold one another a few
        times over are more than any memory takes.
        """
        if isinstance(value, PickledArray):
            return value.array, value.array.size
        if not isinstance(value, list | tuple | dict):
            return value, 1
        if id(value) in known:
            if (before := known[id(value)]) is None:
                raise Refused("a list that holds itself")
            return before
        if depth > DEPTH:
            raise Refused(f"lists nested more than {DEPTH} deep")
        known[id(value)] = None
        parts = [
            self._settled(part, known, depth + 1)
            for part in (value.values() if isinstance(value, dict) else value)
        ]
        inner = [part for part, _ in parts]
        whole = dict(zip(value, inner, strict=True)) if isinstance(value, dict) else inner
        built = whole, 1 + sum(size for _, size in parts)
        known[id(value)] = built
        return built


#: Larger pickles are refused: they have to be held in memory twice.
PICKLE_LIMIT = 512 * 1024 * 1024


def load_arrays_only(file: LogFile) -> Any:  # noqa: ANN401 - whatever the pickle holds
    """Load a pickle that holds only arrays, numbers, strings, lists and dictionaries."""
    content = bytes(file.content)
    if len(content) > PICKLE_LIMIT:
        raise LogError(f"{file.path}: a pickle of {len(content) >> 20} MiB. Save it with np.savez.")
    remedy = "Pickles are opened only if they hold nothing but NumPy arrays; save with np.savez."
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # old opcodes' escapes: refused or read, never told
            # Looked over as a whole first: loading builds objects on the way to what it refuses.
            _check_opcodes(content)
            unpickler = ArrayUnpickler(content)
            return unpickler.built(unpickler.load())
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
