"""Recorded equations: what they compute, and what is not in them."""

import numpy as np

from vftcli.robots.tape import ZERO, Program, Tape, Value, constants

RNG = np.random.default_rng(8)


def play(tape: Tape, outputs: list[Value], inputs: np.ndarray) -> np.ndarray:
    program = Program(tape, outputs)
    given, results = program.bind(inputs.shape[1])
    given[:] = inputs
    program.run()
    return results


def test_vectors_are_added_mapped_crossed_and_turned_as_numpy_does() -> None:
    tape, inputs = Tape(8), RNG.normal(size=(8, 50))
    u, v = (tuple(Value(1.0, 3 * k + i) for i in range(3)) for k in range(2))
    cosine, sine = Value(1.0, 6), Value(1.0, 7)
    M = RNG.normal(size=(3, 3))
    asked = [*tape.cross(u, v), *tape.map(M, u), *tape.turn(u, cosine, sine), *tape.add(u, v, u)]
    asked += [tape.cross_z(u, v), -tape.dot(u, v), *tape.add(u, constants(M[0]))]
    a, b, (c, s) = inputs[:3], inputs[3:6], inputs[6:]
    expected = [
        *np.cross(a.T, b.T).T,
        *(M @ a),
        *(c * a[0] - s * a[1], s * a[0] + c * a[1], a[2]),
        *(2 * a + b),
        np.cross(a.T, b.T).T[2],
        -np.sum(a * b, axis=0),
        *(a + M[0][:, None]),
    ]
    # the same few products, at most in another order of sums
    np.testing.assert_allclose(play(tape, asked, inputs), expected, atol=1e-14)


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


def test_outputs_may_be_constants_inputs_or_each_other() -> None:
    tape, inputs = Tape(2), RNG.normal(size=(2, 5))
    x, y = Value(1.0, 0), Value(1.0, 1)
    product = tape.times(x, y)
    found = play(tape, [Value(-2.5), x, -y, product, product, -product, ZERO], inputs)
    both = inputs[0] * inputs[1]
    expected = [np.full(5, -2.5), inputs[0], -inputs[1], both, both, -both, np.zeros(5)]
    np.testing.assert_array_equal(found, expected)


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
    """4.0 is no row 4, though the two are equal."""
    tape, inputs = Tape(5), RNG.normal(size=(5, 3))
    scaled = tape.times(Value(1.0, 0), Value(4.0))
    total = tape.plus(scaled, Value(1.0, 4))
    np.testing.assert_array_equal(play(tape, [total], inputs), [4.0 * inputs[0] + inputs[4]])


def test_runs_of_several_lengths_share_the_memory() -> None:
    tape = Tape(1)
    program = Program(tape, [tape.times(Value(1.0, 0), Value(1.0, 0)), Value(3.0)])
    for samples in (3, 10, 2, 10):
        given, results = program.bind(samples)
        # Each row begins with a cache line.
        assert not any(row.ctypes.data % 64 for row in (*given, *results))
        given[:] = np.arange(samples)
        program.run()
        np.testing.assert_array_equal(results, [np.arange(samples) ** 2, np.full(samples, 3.0)])
