"""Tables without a header whose values say what their columns are, or what they may be."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from vftcli.readers.picking import tick_of
from vftcli.signals.arrays import Array, Mask
from vftcli.signals.series import median_step

ROWS = 20_000  #: Rows that are looked at; of more, the first.
FITTED = 2000  #: Rows, of these, by which a drive constant is told.
JOINTS = range(3, 13)  #: Numbers of joints that a table may be of.
#: Rows over which a velocity's integral is compared with the change of a position.
STEPS = (1, 4, 16, 64)
OPEN = 0.35  #: Share of a position's change that its own velocity may leave; another's leaves 1.
STILL = 0.02  #: Travel below which a joint need not show which velocity is its own. [rad]
EVEN = 20.0  #: How much longer than the median a twentieth of a clock's steps are at most.
#: Misfit of a current to a torque divided by its drive constant, friction left free.
#:
#: Of a UR10e's target current .02 to .09, of its measured current .06 to .6.
DRIVEN = 0.12
CLEAR = 1.3  #: How much better than another current it must fit.
CONSTANTS = (3.0, 400.0)  #: Drive constants of geared joints. [N·m/A]
#: Slope and cosine between a target and what was measured, of the joint where they are nearest.
ALIKE, NEAR = (0.5, 2.0), 0.9


class Guess(NamedTuple):
    """What the values of a table say."""

    columns: str  #: The text for --columns.
    why: str  #: What was found, in words.
    #: Further texts that fit as well; empty where the values settle it.
    others: tuple[str, ...] = ()


def guessed(columns: Sequence[Array]) -> Guess | None:
    """What the columns of a table without a header are by their values.

    A clock steps evenly, velocities are the derivative of positions, and a controller's target
    torque is its target current times a constant, but for friction.

    Args:
        columns: The columns in file order. (T,) each

    Returns:
        None where no clock, or no positions with their velocities behind them, are found.
    """
    table = np.stack([np.asarray(column[:ROWS], dtype=np.float64) for column in columns], axis=1)
    clock = np.asarray(columns[0][:ROWS])
    if len(table) < 2 * STEPS[-1] or not np.isfinite(table).all() or not is_clock(clock):
        return None
    t = (clock - clock[0]).astype(np.float64) * tick_of(clock, "")[0]
    joints = joints_of(t, table)
    if joints is None:
        return None
    blocks, left = divmod(len(columns) - 1 - 2 * joints, joints)
    start = 1 + 2 * joints
    parts = [table[:, start + k * joints : start + (k + 1) * joints] for k in range(blocks)]
    few = slice(None, None, len(table) // FITTED + 1)
    found, why = efforts([part[few] for part in parts], table[few, 1 + joints : start])
    known = f"t,q:{joints},dq:{joints}"
    even = "the first steps evenly, dq is the derivative of q"
    if not left and len(found) == 1:
        return Guess(f"{known}{worded(found[0], joints)}", even + why)
    if not found:
        skipped = f",_:{(blocks - 1) * joints + left}".removesuffix(",_:0")
        texts = [f"{known},{name}:{joints}{skipped}" for name in SINGLE]
        return Guess(texts[0], even, tuple(texts[1:]))
    rest = f",_:{left}" if left else ""
    texts = [f"{known}{worded(names, joints)}{rest}" for names in found]
    return Guess(texts[0], even + why, tuple(texts[1:]) or (texts[0],))


#: What the numbers behind the velocities may be, the likeliest first.
SINGLE = ("tau", "current", "tau+g")


def worded(names: Sequence[str], joints: int) -> str:
    """Signals as they stand in a --columns text, behind others."""
    return "".join(f",{name}:{joints}" for name in names)


def is_clock(stamps: Array) -> bool:
    """Whether a column steps forward, and evenly but for a few."""
    steps = np.diff(stamps)
    if not np.all(steps >= 0):
        return False
    usual = median_step(stamps)
    return bool(usual > 0 and np.quantile(steps, 0.95) < EVEN * usual)


def joints_of(t: Array, table: Array) -> int | None:
    """How many joints a table has, positions behind the clock and their velocities behind them.

    Args:
        t: The clock. (T,) [s]
        table: All columns. (T, k)
    """
    matches = derivatives(t, table)
    fitting = [n for n in JOINTS if 2 * n < table.shape[1] and is_layout(matches, table, n)]
    return fitting[0] if len(fitting) == 1 else None


def is_layout(matches: Mask, table: Array, joints: int) -> bool:
    """Whether all that moves in q:n has its derivative in dq:n, and no other column has one."""
    rows, columns = np.nonzero(matches)
    inside = (rows >= 1) & (rows <= joints) & (columns == rows + joints)
    if not rows.size or not inside.all():
        return False
    positions = table[:, 1 : 1 + joints]
    moves = np.ptp(positions, axis=0) > STILL
    places = np.arange(1, 1 + joints)[moves]
    return bool(matches[places, places + joints].all())


def derivatives(t: Array, table: Array) -> Mask:
    """Which column (the first index) has which as its derivative. (k, k)

    The change of a position over some rows is compared with the integral of the other column: what
    is left, relative to the change.
    """
    width = table.shape[1]
    steps = np.diff(t)[:, None]
    integral = np.vstack([np.zeros(width), np.cumsum((table[1:] + table[:-1]) / 2 * steps, axis=0)])
    best = np.full((width, width), np.inf)
    for step in STEPS:
        change, area = (np.diff(values[::step], axis=0) for values in (table, integral))
        own, other = np.sum(change**2, axis=0), np.sum(area**2, axis=0)
        left = own[:, None] + other[None, :] - 2 * change.T @ area
        share = np.full((width, width), np.inf)
        live = own > 0
        share[live] = left[live] / own[live, None]
        best = np.minimum(best, share)
    best[0] = best[:, 0] = np.inf
    np.fill_diagonal(best, np.inf)
    # A slow joint's change may look like the integral of several columns: the nearest is its own.
    alike: Mask = (best < OPEN**2) & (best == best.min(axis=1, keepdims=True))
    return alike


def efforts(parts: Sequence[Array], dq: Array) -> tuple[list[tuple[str, ...]], str]:
    """What the blocks of columns behind the velocities are, by name, and why.

    Returns:
        All readings that fit; none where nothing can be said.
    """
    if not parts:
        return [()], ""
    if len(parts) != 3:
        return [], ""
    pairs = sorted((fit for fit in driven(parts, dq) if fit[0] < DRIVEN), key=lambda fit: fit[0])
    readings = []
    for misfit, torque, current, constants in pairs:
        measured = 3 - torque - current
        if misfit > CLEAR * pairs[0][0] or not alike(parts[measured], parts[current]):
            continue
        names = {measured: "current", current: "target_current", torque: "target_torque"}
        told = " ".join(f"{constant:.3g}" for constant in constants)
        readings.append((tuple(names[k] for k in range(3)), told))
    if len(readings) != 1:
        return [names for names, _ in readings], ""
    why = f", target_torque is target_current times {readings[0][1]} N·m/A but for friction"
    return [readings[0][0]], why


def driven(
    parts: Sequence[Array], dq: Array
) -> Iterator[tuple[float, int, int, tuple[float, ...]]]:
    """How well each block is another's torque through a drive constant, friction beside it.

    Yields:
        The misfit, the torque's block, the current's, and the constants. [N·m/A]
    """
    for torque, current in ((a, b) for a in range(len(parts)) for b in range(len(parts)) if a != b):
        size = np.sqrt(np.mean(parts[current] ** 2, axis=0))
        if np.abs(parts[torque]).max() < CONSTANTS[0] * np.abs(parts[current]).max():
            continue
        live = np.flatnonzero(size > 2e-3 * size.max())
        fits = [fitted(parts[torque][:, j], parts[current][:, j], dq[:, j]) for j in live]
        constants = tuple(constant for constant, _ in fits)
        if fits and all(CONSTANTS[0] < k < CONSTANTS[1] for k in constants):
            yield float(np.median([misfit for _, misfit in fits])), torque, current, constants


def fitted(torque: Array, current: Array, dq: Array) -> tuple[float, float]:
    """The drive constant between a torque and a current, and what it leaves of the current."""
    friction = (np.tanh(dq / 0.002), dq, dq * np.abs(dq))
    terms = np.stack([torque, *friction], axis=1)
    values, *_ = np.linalg.lstsq(terms, current, rcond=None)
    left = np.sqrt(np.mean((current - terms @ values) ** 2) / np.mean(current**2))
    return (1 / float(values[0]) if values[0] else 0.0), float(left)


def alike(measured: Array, target: Array) -> bool:
    """Whether two blocks are one quantity, measured and as it should be."""
    product = np.sum(measured * target, axis=0)
    own, other = np.sum(measured**2, axis=0), np.sum(target**2, axis=0)
    live = (own > 0) & (other > 0)
    slope = product[live] / other[live]
    cosine = product[live] / np.sqrt(own[live] * other[live])
    # Where a joint stands its stiction is in what was measured alone.
    return bool(np.any((slope > ALIKE[0]) & (slope < ALIKE[1]) & (cosine > NEAR)))
