"""An effort that is logged later than the motion: the lag at which a model explains it best.

Over short windows weighed by Hann's weights φ the torque that the robot's model needs is linear in
a few numbers a joint: the model's own torque, dry and viscous friction, and rotor inertia,

    ∫φ τ(t + lag) = c₁ ∫(−φ' p − φ (Cᵀq̇ − g)) + c₂ ∫φ tanh(q̇/ε) + c₃ ∫φ q̇ − c₄ ∫φ' q̇.

The differences of neighbouring windows are fitted at every lag, joint by joint: they leave out what
changes slowly, an offset, a load and most of a contact. A turn of the motion, where dry friction
jumps and inertia is large, tells the lag; a wrong mass or drive constant shifts nothing.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from vftcli.doctor.findings import on_joints
from vftcli.robots import Robot
from vftcli.robots.kernels import momentum_terms
from vftcli.signals.arrays import Array
from vftcli.signals.recording import Recording
from vftcli.signals.remarks import Remark, warning
from vftcli.signals.series import median_step

WINDOW = 0.15
"""Length of a window; each begins in the middle of the one before. [s]"""
WINDOWS, BLOCK, LEAST = 320, 16, 40
"""Windows that are looked at, at most, in blocks of neighbours; and how many a joint needs."""
INSIDE = 12
"""Instants of a window at which the model is computed."""
EARLIEST, LATEST, STEP = -0.1, 0.25, 0.01
"""Lags that are tried, and how far apart they are. [s]"""
SLOW = 0.01
"""Speed at which dry friction has its direction. [rad/s]"""
MOVES = 0.02
"""Speed of a window from which it tells a lag. [rad/s]"""
KEPT = 0.8
"""Share of the differences that a fit is judged by: the rest may be contact."""
LEAST_RATE = 30.0
"""Sample rate below which no lag of that size can be told. [Hz]"""
LATE = 0.035
"""Lag that is told. Friction that builds up behind a turn looks like 20 ms on real logs, and a
simulation whose torque belongs to the step before like 30. [s]"""
BETTER = 1.45
"""How much better a lag explains the joints, in the mean."""
AGREE, ENOUGH, NEAR = 0.65, 3, 0.35
"""Share and number of the joints whose own best lag is nearer to it than this share of it."""
MISTIMED = frozenset(
    {"time-unit", "clock-rate", "velocity-unit", "velocity-sign", "velocity-mismatch"}
    | {"velocity-of-another-kind", "velocity-order", "velocity-lag", "velocity-filtered"}
    | {"velocity-held", "stuck-velocity"}
)
"""Findings that the logged velocity is another motion's."""
LAGLESS = MISTIMED | {"stuck-position", "stuck-effort"}
"""Findings with which no effort can be called late."""


def effort_lag(recording: Recording, robot: Robot) -> Iterator[Remark]:
    """An effort that is logged later than the motion, or earlier.

    Args:
        recording: The log; its velocities are sound.
        robot: An arm that explains its torques.
    """
    left = unexplained(recording, robot)
    if left is None:
        return
    lags, rest = left
    known = np.flatnonzero(np.isfinite(rest[:, 0]) & (rest.min(axis=1) > 0))
    if known.size < ENOUGH:
        return
    together = np.log(rest[known]).mean(axis=0)
    best, none = int(np.argmin(together)), int(np.argmin(np.abs(lags)))
    lag, better = float(lags[best]), float(np.exp(together[none] - together[best]))
    own = lags[np.argmin(rest[known], axis=1)]
    alike = np.abs(own - lag) < max(NEAR * abs(lag), 1.5 * STEP)
    agreed = alike.sum() >= ENOUGH and np.mean(alike) >= AGREE
    if abs(lag) > LATE and better > BETTER and agreed:
        order = "later" if lag > 0 else "earlier"
        joints = on_joints(known[alike])
        yield warning("effort-lag", joints, lag_ms=1e3 * abs(lag), order=order, ratio=better)


def unexplained(recording: Recording, robot: Robot) -> tuple[Array, Array] | None:
    """Lags [s] and what the model leaves of each joint's effort then; NaN at rest. (L,), (n, L)"""
    effort = recording.torque if recording.torque is not None else recording.current
    if effort is None or recording.dq is None or recording.samples < LEAST:
        return None
    t, step = recording.t, recording.median_step
    if robot.joints != recording.joints or step * LEAST_RATE > 1:
        return None
    length = max(8, round(WINDOW / step))
    lags = np.unique(np.round(np.arange(EARLIEST, LATEST + STEP / 2, STEP) / step).astype(int))
    starts = window_starts(t, length, int(lags[0]), int(lags[-1]))
    if len(starts) < LEAST:
        return None
    rows = starts[:, None] + np.linspace(0, length, min(length, INSIDE) + 1).round().astype(int)
    model, speed = model_columns(recording, robot, rows)
    late = by_hann(effort, length)[starts[:, None] + lags]
    neighbours = np.diff(starts) <= length // 2
    rest = np.full((recording.joints, len(lags)), np.nan)
    for j in range(recording.joints):
        moves = neighbours & (np.maximum(speed[1:, j], speed[:-1, j]) > MOVES)
        if moves.sum() >= LEAST:
            change = np.diff(late[:, :, j], axis=0)[moves]
            rest[j] = rest_of(np.diff(model[:, j], axis=0)[moves], change)
    return lags * step, rest


def by_hann(x: Array, length: int) -> Array:
    """Means of columns over every window of so many steps, by Hann's weights. (T - length, n)

    By Fourier transform: a window of a fast log has a hundred samples and more.
    """
    weight = (1 - np.cos(2 * np.pi * np.arange(length + 1) / length)) / length
    size = 1 << (len(x) + length).bit_length()
    product = np.fft.rfft(np.ascontiguousarray(x.T), size) * np.fft.rfft(weight, size)
    mean: Array = np.fft.irfft(product, size)[:, length : len(x)].T
    return mean


def window_starts(t: Array, length: int, earliest: int, latest: int) -> NDArray[np.intp]:
    """First samples of windows that lie on an even clock at every lag. (W,)

    Args:
        t: Clock. (T,) [s]
        length: Steps of a window.
        earliest: The first lag, negative. [samples]
        latest: The last lag. [samples]
    """
    starts = np.arange(-earliest, len(t) - length - latest, max(1, length // 2))
    if len(starts) > WINDOWS:
        blocks = np.linspace(0, len(starts) - BLOCK, WINDOWS // BLOCK).astype(int)
        starts = starts[np.unique(blocks[:, None] + np.arange(BLOCK))]
    whole = t[starts + length + latest] - t[starts + earliest]
    usual = (length + latest - earliest) * median_step(t)
    found: NDArray[np.intp] = starts[(whole > 0.8 * usual) & (whole < 1.2 * usual)]
    return found


def model_columns(
    recording: Recording, robot: Robot, rows: NDArray[np.intp]
) -> tuple[Array, Array]:
    """What a joint's torque is made of, window by window, and its rms speed. (W, n, 4), (W, n)

    Args:
        recording: The log.
        robot: The arm.
        rows: Samples of each window at which the model is computed. (W, I)
    """
    times = recording.t[rows]
    since, span = times - times[:, :1], times[:, -1:] - times[:, :1]
    steps = np.diff(times, axis=1) / span
    shares = np.zeros_like(times)
    shares[:, 1:] += steps / 2
    shares[:, :-1] += steps / 2
    turn = 2 * np.pi / span
    weight, slope = (1 - np.cos(turn * since)) * shares, turn * np.sin(turn * since) * shares
    dq = recording.require("dq")[rows]
    terms = momentum_terms(
        robot.loaded_chain, recording.q[rows.ravel()], dq.reshape(-1, recording.joints)
    )
    momentum = terms.p.reshape(dq.shape)
    rate = (terms.coriolis_transpose_dq - terms.gravity).reshape(dq.shape)

    def mean(by: Array, of: Array) -> Array:
        return np.asarray((by[:, None] @ of)[:, 0])

    rigid = -mean(slope, momentum) - mean(weight, rate)
    columns = (rigid, mean(weight, np.tanh(dq / SLOW)), mean(weight, dq), -mean(slope, dq))
    speed = np.sqrt(mean(weight, dq**2))
    return np.stack(columns, axis=2), speed


def rest_of(model: Array, effort: Array) -> Array:
    """What a model leaves of an effort at every lag, rms over the better of its samples. (L,)

    Args:
        model: What the effort is made of. (W, 4)
        effort: The effort at every lag. (W, L)
    """
    size = np.sqrt(np.mean(model**2, axis=0))
    columns = model / np.where(size > 0, size, 1.0)
    keep = np.ones(len(columns), dtype=bool)
    rest = np.zeros_like(effort)
    for _ in range(2):
        solution = np.linalg.lstsq(columns[keep], effort[keep], rcond=1e-8)[0]
        rest = (effort - columns @ solution) ** 2
        # A sample that no lag explains is contact; one that some lag explains is what tells it.
        least = rest.min(axis=1)
        keep = least <= np.quantile(least, KEPT)
    return np.asarray(np.sqrt(rest[keep].mean(axis=0)))
