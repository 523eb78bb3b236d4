"""Recorded equations: what they compute, and what is not in them."""

import numpy as np

from vftcli.robots.tape import ZERO, Program, Tape, Value


def test_zero_and_one_cost_nothing() -> None:
    tape = Tape(2)
    x, y = Value(1.0, 0), Value(1.0, 1)
    assert tape.times(x, ZERO) == ZERO
    assert tape.times(x, Value(-1.0)) == -x
    assert tape.plus(-x, ZERO) == -x
    assert tape.times(Value(2.0), Value(-3.0)) == Value(-6.0)
    assert tape.plus(Value(2.0), Value(-3.0)) == Value(-1.0)
    assert not tape.operations
    assert tape.times(-x, y).factor == -1.0
    assert len(tape.operations) == 1


def test_what_nothing_depends_on_is_left_out_and_rows_are_used_anew() -> None:
    tape = Tape(2)
    x, y = Value(1.0, 0), Value(1.0, 1)
    tape.times(tape.times(x, y), y)  # nobody asks for it
    total = x
    for _ in range(30):
        total = tape.plus(tape.times(total, Value(0.5)), y)
    program = Program(tape, [total])
    assert len(program._operations) == 60
    assert program._rows <= 4


def test_a_constant_that_equals_the_number_of_a_row_is_a_constant() -> None:
    """4.0 is no row 4, though the two are equal; outputs may be constants or inputs too."""
    tape = Tape(5)
    total = tape.plus(tape.times(Value(1.0, 0), Value(4.0)), Value(1.0, 4))
    program = Program(tape, [total, -total, Value(-2.5), Value(1.0, 4), ZERO])
    for samples in (3, 10, 2, 10):  # which share the memory
        inputs, results = program.bind(samples)
        # Each row begins with a cache line.
        assert not any(row.ctypes.data % 64 for row in (*inputs, *results))
        given = inputs[:] = np.arange(5.0 * samples).reshape(5, samples)
        program.run()
        expected = 4.0 * given[0] + given[4]
        for row, values in zip(results, (expected, -expected, -2.5, given[4], 0.0), strict=True):
            np.testing.assert_array_equal(row, np.broadcast_to(values, samples))
