"""Equations recorded once, on values, and replayed on arrays of samples.

Equations on `Value`s leave a list of operations on whole rows of samples, without
products by zero or one and without unused results: an arm's special angles and symmetries
need no case of their own.
"""

import math
from collections.abc import Callable, Sequence
from functools import reduce
from typing import Any, NamedTuple

import numpy as np

from vftcli.signals.arrays import Array


class Value(NamedTuple):
    """A number of the equations: a constant, or a row of samples with a sign."""

    factor: float  #: The constant; of a row its sign, 1 or −1.
    row: int | None = None  #: Number of the row; None for a constant.

    def __neg__(self) -> "Value":
        """This row with the other sign: no operation."""
        return Value(-self.factor, self.row)


ZERO = Value(0.0)

Vector = tuple[Value, Value, Value]
NOTHING: Vector = (ZERO, ZERO, ZERO)

Operand = int | np.float64  #: The number of a row, or a constant.


class Operation(NamedTuple):
    """One operation on whole rows: out ← work(a, b)."""

    work: Callable[..., Any]
    a: int
    b: Operand
    out: int

    @property
    def reads(self) -> set[int]:
        """The rows that it reads."""
        return {self.a, self.b} if isinstance(self.b, int) else {self.a}


class Tape:
    """The operations that equations need, in their order, behind the given rows."""

    def __init__(self, inputs: int) -> None:
        self.inputs = inputs
        self.operations: list[Operation] = []

    def record(self, work: Callable[..., Any], a: int, b: Operand) -> int:
        """Append an operation and return the row that it makes."""
        row = self.inputs + len(self.operations)
        self.operations.append(Operation(work, a, b, row))
        return row

    def times(self, a: Value, b: Value) -> Value:
        """The product a·b. A factor of 1 or −1 costs nothing."""
        factor = a.factor * b.factor
        if factor == 0.0:
            return ZERO
        if a.row is None or b.row is None:
            row = b.row if a.row is None else a.row
            if row is None or abs(factor) == 1.0:
                return Value(factor, row)
            size = np.float64(abs(factor))
            return Value(math.copysign(1.0, factor), self.record(np.multiply, row, size))
        return Value(factor, self.record(np.multiply, a.row, b.row))

    def plus(self, a: Value, b: Value) -> Value:
        """The sum a + b. Zero costs nothing."""
        if not (a.factor and b.factor):
            return a if a.factor else b
        if a.row is None:
            a, b = b, a
        if a.row is None:
            return Value(a.factor + b.factor)
        if b.row is None:
            return Value(a.factor, self.record(np.add, a.row, np.float64(a.factor * b.factor)))
        if a.factor == b.factor:
            return Value(a.factor, self.record(np.add, a.row, b.row))
        positive, negative = (a.row, b.row) if a.factor > 0.0 else (b.row, a.row)
        return Value(1.0, self.record(np.subtract, positive, negative))

    def dot(self, u: Sequence[Value], v: Sequence[Value]) -> Value:
        """The product u·v."""
        total = ZERO
        for a, b in zip(u, v, strict=True):
            if a.factor and b.factor:
                total = self.plus(total, self.times(a, b))
        return total

    def map(self, M: Array, v: Sequence[Value]) -> Vector:
        """The product M v with a constant matrix. (3, 3)"""
        x, y, z = (self.dot(constants(row), v) for row in M)
        return x, y, z

    def add(self, *vectors: Vector) -> Vector:
        """The sum of vectors."""
        x, y, z = (reduce(self.plus, each) for each in zip(*vectors, strict=True))
        return x, y, z

    def cross(self, u: Vector, v: Vector) -> Vector:
        """The product u × v."""
        x, y, z = (self.dot((u[i], -u[j]), (v[j], v[i])) for i, j in ((1, 2), (2, 0), (0, 1)))
        return x, y, z

    def turn(self, v: Vector, cosine: Value, sine: Value) -> Vector:
        """The vector turned about z by the angle with this cosine and sine."""
        x, y, z = v
        return self.dot((x, y), (cosine, -sine)), self.dot((x, y), (sine, cosine)), z


def constants(values: Array) -> Vector:
    """A vector of constants. (3,)"""
    x, y, z = map(Value, values.tolist())
    return x, y, z


class Program:
    """The part of a tape for some outputs, ready to run on rows of samples.

    It works in memory of its own, which the next run writes over: one caller at a time.
    """

    def __init__(self, tape: Tape, outputs: Sequence[Value]) -> None:
        rows = []
        for sign, row in outputs:
            if row is None or (sign > 0.0 and row >= tape.inputs and row not in rows):
                rows.append(row)
            else:
                rows.append(tape.record(np.multiply, row, np.float64(sign)))
        wanted, needed = set(rows), list[Operation]()
        for operation in reversed(tape.operations):
            if operation.out in wanted:
                wanted.update(operation.reads)
                needed.append(operation)
        self._inputs = slice(len(outputs), len(outputs) + tape.inputs)
        self._constants = {k: v.factor for k, v in enumerate(outputs) if v.row is None}
        self._operations, self._rows = in_few_rows(needed[::-1], tape.inputs, rows)
        self._memory = empty_rows(self._rows, 0)
        self._samples, self._calls = 0, []  # type: tuple[int, list[tuple[Any, ...]]]

    def bind(self, samples: int) -> tuple[Array, Array]:
        """Where `run` reads so many samples' inputs and writes outputs. (rows, samples)"""
        if samples > self._memory.shape[1]:
            self._memory = empty_rows(self._rows, samples)
        if samples != self._samples:
            rows = list(self._memory[:, :samples])
            self._calls = [
                (work, rows[a], rows[b] if isinstance(b, int) else b, rows[out])
                for work, a, b, out in self._operations
            ]
            self._samples = samples
            for k, value in self._constants.items():
                self._memory[k] = value
        return self._memory[self._inputs, :samples], self._memory[: self._inputs.start, :samples]

    def run(self) -> None:
        """Fill the outputs from the inputs."""
        for work, a, b, out in self._calls:
            work(a, b, out)


def empty_rows(rows: int, samples: int) -> Array:
    """Uninitialised rows, each from a cache line (64 B) on: a fifth of the time."""
    width = -(-samples // 8) * 8
    memory = np.empty(rows * width + 8)
    start = -memory.ctypes.data // 8 % 8
    return memory[start : start + rows * width].reshape(rows, width)[:, :samples]


def in_few_rows(
    operations: Sequence[Operation], inputs: int, outputs: Sequence[int | None]
) -> tuple[list[Operation], int]:
    """Operations on as few rows as possible, and the number of rows.

    A row is used anew once nothing needs it. Outputs come first, in order, then the inputs.
    """
    last = {row: k for k, op in enumerate(operations) for row in op.reads}
    place = {row: k for k, row in enumerate([*outputs, *range(inputs)])}
    planned, free, rows = [], list[int](), len(outputs) + inputs
    for k, operation in enumerate(operations):
        work, a, b, out = operation
        # An operation may write where it reads.
        free += [place[row] for row in operation.reads if last[row] == k and row not in outputs]
        if out not in place:
            place[out] = free.pop() if free else rows
            rows = max(rows, place[out] + 1)
        second = place[b] if isinstance(b, int) else b
        planned.append(Operation(work, place[a], second, place[out]))
    return planned, rows
