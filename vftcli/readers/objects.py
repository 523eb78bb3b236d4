"""Objects of JSON, parsed within bounds, and of pickles, which are never executed."""

import io
import json
import pickle
import pickletools
import re
import warnings
from collections.abc import Iterable, Iterator
from itertools import islice
from mmap import mmap
from typing import Any, Literal

import numpy as np

from vftcli.readers.opening import DAMAGE, LogFile, reason_of
from vftcli.readers.table import Columns, Notes
from vftcli.signals.errors import LogError
from vftcli.signals.parsing import printable
from vftcli.signals.remarks import fact

#: Bytes of objects that a document may be _parsed into; one a line may be of any length.
MEMORY_LIMIT = 768 * 1024 * 1024
#: Letter → bytes of the object that it begins, at most.
COSTS = {b"[": 64, b"{": 72, b",": 40, b":": 110}
LONGEST_LINE = 1 << 20  #: Letters of one sample.
CHUNK_LINES = 8192  #: Lines with objects in memory at a time.
#: Numbers that are none as C++ streams print them, libfranka's among them.
NOT_JSON = re.compile(rb"(?<=[\[,:\s])(-?)(nan|inf)(?=[\],}\s])")

Data = Any  #: Whatever a document or a pickle holds.
Object = dict[str, Data]  #: An object of a document.


def lines_of(content: memoryview) -> Iterator[tuple[int, bytes]]:
    """The lines that are not empty, with their numbers from 1."""
    data: Any = content.obj
    stream = data if isinstance(data, mmap) else io.BytesIO(data)
    stream.seek(0)
    for number, line in enumerate(iter(stream.readline, b""), start=1):
        if bare := line.strip():
            yield number, bare


def columns_of_lines(file: LogFile, lines: Iterable[tuple[int, bytes]]) -> tuple[Columns, Notes]:
    """The numbers of objects, one a line; a cut last one is left out and said."""
    blocks: list[Columns] = []
    odd: list[int] = []  # numbers of lines without an object
    left = iter(lines)
    while part := list(islice(left, CHUNK_LINES)):
        each = {number: _object_in(line) for number, line in part}
        odd += [number for number, found in each.items() if found is None]
        if odd and odd[0] != part[-1][0]:
            raise LogError(f"{file.path}: line {odd[0]} is not one JSON object.")
        if objects := [found for found in each.values() if found is not None]:
            blocks.append(columns_of(file, objects))
    if not blocks:
        raise LogError(f"{file.path}: no line holds a JSON object.")
    if any(block.keys() != blocks[0].keys() for block in blocks):
        raise LogError(f"{file.path}: its lines hold different fields.")
    try:
        columns = {name: np.concatenate([b[name] for b in blocks]) for name in blocks[0]}
    except ValueError:
        raise LogError(f"{file.path}: a field differs in length from line to line.") from None
    return columns, (fact("line-cut"),) if odd else ()


def _object_in(line: bytes) -> Object | None:
    if len(line) > LONGEST_LINE:
        return None
    words = {b"nan": b"NaN", b"inf": b"Infinity"}
    try:
        found = json.loads(NOT_JSON.sub(lambda m: m[1] + words[m[2]], line))
    except (ValueError, RecursionError):
        return None
    return dict(flat(found, 1)) if isinstance(found, dict) else None


def flat(values: Object, levels: int, prefix: str = "") -> Iterator[tuple[str, Data]]:
    """Values by dotted path down to some level; objects below it as they are."""
    for name, value in values.items():
        if isinstance(value, dict) and value and levels:
            yield from flat(value, levels - 1, f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}", value


def columns_of(file: LogFile, objects: list[Object]) -> Columns:
    """The numeric fields of some objects, a row an object."""
    columns: Columns = {}
    for name, value in objects[0].items():
        held = value if isinstance(value, list) and value else [value]
        if not all(isinstance(v, int | float) for v in held):
            continue
        try:
            columns[name] = np.array([entry[name] for entry in objects], dtype=np.float64)
        except (KeyError, ValueError, TypeError, OverflowError):
            shown = printable(name[:40])
            raise LogError(
                f"{file.path}: {shown} differs in kind or length between the objects."
            ) from None
    return columns


def parsed(file: LogFile) -> Data:
    """The one value of a file: an object or a list."""
    content = bytes(file.content)
    if sum(cost * content.count(letter) for letter, cost in COSTS.items()) > MEMORY_LIMIT:
        raise LogError(
            f"{file.path}: a JSON document of {len(file.content) >> 20} MiB, too many values to "
            "hold. Save the log with np.savez, or an object a line."
        )
    try:
        return json.loads(content)
    except RecursionError:
        raise LogError(f"{file.path}: JSON nested too deeply to be a log.") from None
    except ValueError as error:
        reason = printable(reason_of(error))
        raise LogError(f"{file.path}: looks like JSON and is not ({reason}).") from None


#: Numbers that a pickle of any size may build; a larger one as many as it has bytes.
BUILT_LIMIT = 1 << 20

TOO_MUCH = "more numbers than a file of its size can hold"

DEPTH = 32  #: Lists inside lists: a log has four or five.


class Refused(pickle.UnpicklingError):
    """The pickle asks for something that is no array of numbers."""


class Stub:
    """A NumPy name in a pickle, kept as it was asked for and never executed."""

    def __init__(self, name: str, *arguments: Data) -> None:
        self.name, self.arguments = name, arguments
        self.state: tuple[Data, ...] = ()

    def __setstate__(self, state: Data) -> None:
        self.state = state


#: What was built of a part of a pickle, and how many numbers it holds.
Built = tuple[Any, int]
#: All that a pickle may call, by the names of NumPy before 2.
ALLOWED = {
    "numpy.ndarray", "numpy.dtype", "numpy.core.multiarray._reconstruct",
    "numpy.core.multiarray.scalar", "numpy.core.numeric._frombuffer", "_codecs.encode",
}  # fmt: skip


def dtype_of(kind: Data) -> np.dtype[Any] | None:
    """The type of an array's numbers, letters or booleans, or None."""
    code = kind.arguments[0] if isinstance(kind, Stub) and kind.name == "dtype" else "O"
    if not isinstance(code, str) or re.search(r"O|object", code):
        raise Refused("an array of objects")
    # The second to fourth of what NumPy pickles of a type.
    order, subarray, names = kind.state[1:4] or ("=", None, None)
    plain = re.fullmatch(r"[<>=|]?([biufc?]\d{0,2}|[SU]\d{1,3})", code)
    if not plain or subarray is not None or names is not None or order not in set("<>=|"):
        return None
    return np.dtype(f"{order}{plain[1]}" if order in {"<", ">"} else code)


class ArrayUnpickler(pickle.Unpickler):
    """An unpickler that rebuilds arrays and refuses everything else.

    The pickle's size bounds what it builds: two bytes name a part again.
    """

    def __init__(self, content: bytes) -> None:
        # A memo index allocates a list of its size: look before building.
        for opcode, argument, _ in pickletools.genops(content):
            if isinstance(argument, int) and "PUT" in opcode.name and argument > len(content):
                raise Refused("a memo larger than the file")
        super().__init__(io.BytesIO(content))
        self._left = max(BUILT_LIMIT, len(content))
        self._known: dict[int, Built | None] = {}

    def find_class(self, module: str, name: str) -> Data:
        """The stand-in for a name."""
        if (module, name) == ("collections", "OrderedDict"):
            return self._ordered
        if f"{module.replace('._core.', '.core.')}.{name}" not in ALLOWED:
            raise Refused(f"{module}.{name}"[:80])
        return lambda *arguments: Stub(name, *arguments)

    def _ordered(self, items: Data = ()) -> dict[Data, Data]:
        self.claim(len(items))
        return dict(items)

    def claim(self, size: int) -> None:
        """Count what is built, which a pickle of this size has to hold."""
        self._left -= size
        if self._left < 0:
            raise Refused(TOO_MUCH)

    def settled(self, value: Data, depth: int = 0) -> Built:
        """A value with arrays for pickled arrays, and how many numbers it has in full.

        A repeated part is not walked again: a few nested lists can outgrow any memory.
        """
        if not isinstance(value, Stub | list | tuple | dict):
            return value, 1
        if id(value) in self._known:
            if (before := self._known[id(value)]) is None:
                raise Refused("a list that holds itself")
            return before
        if depth > DEPTH:
            raise Refused(f"lists nested more than {DEPTH} deep")
        self._known[id(value)] = None
        if isinstance(value, Stub):
            built = self._array(value)
        else:
            inner = value.values() if isinstance(value, dict) else value
            parts = [self.settled(part, depth + 1) for part in inner]
            whole = [part for part, _ in parts]
            keyed = dict(zip(value, whole, strict=True)) if isinstance(value, dict) else whole
            built = keyed, 1 + sum(size for _, size in parts)
        self._known[id(value)] = built
        return built

    def _array(self, stub: Stub) -> Built:
        """An array, a view of the pickle's bytes if possible; a number; or bytes."""
        shape: Data = ()
        order: Literal["C", "F"] = "C"
        if stub.name == "encode":  # how protocol 2 holds bytes
            text, encoding = (*stub.arguments, "latin1")[:2]
            if not isinstance(text, str) or encoding not in {"latin1", "latin-1"}:
                raise Refused("an odd encoding")
            self.claim(len(text))
            return text.encode("latin1"), 1
        if stub.name == "_reconstruct":
            shape, kind, fortran, content = stub.state[-4:]
            order = "F" if fortran else "C"
        elif stub.name == "_frombuffer":
            content, kind, shape, order = stub.arguments[:4]
        elif stub.name == "scalar":
            kind, content = stub.arguments
        else:
            raise Refused("an array of its own making")
        dtype, content = dtype_of(kind), self.settled(content, DEPTH)[0]
        if not isinstance(content, bytes | bytearray):
            raise Refused("an array of objects")
        if dtype is None:  # of no plain numbers
            return np.empty(0, dtype="V1"), 0
        array = np.frombuffer(content, dtype=dtype).reshape(shape, order=order)
        return (array, array.size) if shape != () else (array.item(), 1)


#: Larger pickles are refused: they have to be held in memory twice.
PICKLE_LIMIT = 512 * 1024 * 1024


def load_arrays_only(file: LogFile) -> Data:
    """Load a pickle that holds only arrays, numbers, texts, lists, dicts."""
    content = bytes(file.content)
    if len(content) > PICKLE_LIMIT:
        raise LogError(
            f"{file.path}: a pickle of {len(content) >> 20} MiB. Save it with np.savez."
        )
    remedy = "Pickles are opened only if they hold nothing but NumPy arrays; save with np.savez."
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # old opcodes' escapes
            unpickler = ArrayUnpickler(content)
            log, size = unpickler.settled(unpickler.load())
            unpickler.claim(size)
            return log
    except Refused as refusal:
        raise LogError(f"{file.path}: refused, the pickle asks for {refusal}. {remedy}") from None
    except RecursionError:
        raise LogError(f"{file.path}: the pickle is nested too deeply. {remedy}") from None
    except (pickle.UnpicklingError, *DAMAGE) as error:
        raise LogError(
            f"{file.path}: a damaged pickle ({reason_of(error)[:80]}). {remedy}"
        ) from None
