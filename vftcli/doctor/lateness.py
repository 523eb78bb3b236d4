"""An effort later than the motion: the lag at which a model fits best.

In short windows with Hann's weights φ the torque of the robot's model is linear in four
numbers a joint: the model's own torque, dry and viscous friction, and rotor inertia,

    ∫φ τ(t + lag) = c₁ ∫(−φ' p − φ (Cᵀq̇ − g)) + c₂ ∫φ tanh(q̇/ε) + c₃ ∫φ q̇ − c₄ ∫φ' q̇.

Differences of neighbouring windows are fitted at every lag, joint by joint: slow changes,
such as a load's, drop out.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from vftcli.doctor.signals import effort_of
from vftcli.doctor.windows import spread, trapezoids
from vftcli.robots.kernels import momentum_terms
from vftcli.robots.robot import Robot
from vftcli.signals.arrays import Array, Indices, Mask, root_mean_squares
from vftcli.signals.recording import Recording
from vftcli.signals.remarks import Remark, on_joints, warning
from vftcli.signals.rest import MOVES

WINDOW = 0.15  #: Length of a window; the next begins in its middle. [s]
#: Most windows; neighbours in a block; a joint's least.
WINDOWS, BLOCK, LEAST = 320, 16, 60
INSIDE = 12  #: Instants of the model in a window.
EARLIEST, LATEST, STEP = -0.1, 0.25, 0.01  #: Lags to try, and their step. [s]
SLOW = 0.01  #: Speed from which dry friction has a direction. [rad/s]
KEPT = 0.8  #: Share of the differences that judge a fit: the rest may be contact.
#: Growths of a lag to try, over the part of the log. [s]
DRIFTS = (0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.35, 0.4)
COARSE = 3  #: One lag in so many shows whether a growth is worth a closer look.
LONG = 60.0  #: Used part of a long log: a clock .5 % off loses 300 ms in it. [s]
#: Ratio of rests by which a growing lag beats a steady one; 1.00 on sound logs.
STEADY = 1.1
LEAST_RATE = 30.0  #: Least sample rate that shows such a lag. [Hz]
#: Least lag of a finding: friction behind a turn looks like 20 ms, simulations 30. [s]
LATE = 0.035
BETTER = 1.45  #: Ratio of rests by which a lag beats none, mean over joints.
#: Share and number of joints that agree on a lag, to this share.
AGREE, ENOUGH, NEAR = 0.65, 3, 0.35
#: Findings on velocities of another motion.
MISTIMED = frozenset(
    {"time-unit", "clock-rate", "velocity-unit", "velocity-sign", "velocity-mismatch"}
    | {"velocity-of-another-kind", "velocity-order", "velocity-lag", "velocity-filtered"}
    | {"velocity-held", "stuck-velocity"}
)
#: Findings that exclude a late effort.
LAGLESS = MISTIMED | {"stuck-position", "stuck-effort"}


def effort_lag(recording: Recording, robot: Robot) -> Iterator[Remark]:
    """An effort later or earlier than the motion, or on its own clock."""
    late = lateness_of(recording, robot)
    if late is None:
        return
    lags, rest = late.lags, late.rest()
    known = np.flatnonzero(np.isfinite(rest[:, 0]) & (rest.min(axis=1) > 0))
    if known.size < max(ENOUGH, 0.5 * recording.joints):
        return
    part: Lateness | None = late
    if recording.duration > LONG:
        part = lateness_of(recording.between(recording.t[0], recording.t[0] + LONG), robot)
    if part is not None and (found := part.drift(known)) is not None:
        yield found
        return
    rest = rest[known]
    together = np.log(rest).mean(axis=0)
    lag = lags[together.argmin()]
    better = np.exp(together[abs(lags).argmin()] - together.min())
    alike = agreed(lags[rest.argmin(axis=1)], lag, STEP)
    if abs(lag) > LATE and better > BETTER and alike.any():
        values = {"lag_ms": 1e3 * abs(lag), "order": "later" if lag > 0 else "earlier"}
        yield warning("effort-lag", on_joints(known[alike]), **values, ratio=better)


def agreed(own: Array, best: float, step: float) -> Mask:
    """Joints with a lag near the best of all; none if they are few. (K,)"""
    near = abs(own - best) < max(NEAR * abs(best), 1.5 * step)
    return np.asarray(near & (near.sum() >= ENOUGH) & (near.mean() >= AGREE))


class Lateness(NamedTuple):
    """Pairs of neighbouring windows, with the terms of their difference."""

    lags: Array  #: Lags to try. (L,) [s]
    step: float  #: Sample time. [s]
    starts: Indices  #: First samples of the two windows of each pair. (2, W)
    when: Array  #: Time of each pair from the log's start. (W,) [s]
    model: Array  #: Parts of a joint's change of torque. (W, n, 4)
    moves: Mask  #: Pairs in which a joint moves. (W, n)
    effort: Array  #: Mean effort in the window from each sample. (T', n)

    def rest(self, rate: float = 0.0) -> Array:
        """Rest of each joint's effort by lag, growing by a rate [s/s]; NaN at rest. (n, L)"""
        tried = np.round(self.lags[:, None] / self.step + rate * self.when / self.step).astype(
            int
        )
        rows = np.clip(self.starts[:, None] + tried, 0, len(self.effort) - 1)
        change = self.effort[rows[1]] - self.effort[rows[0]]
        rest = np.full((self.effort.shape[1], len(self.lags)), np.nan)
        for j, moves in enumerate(self.moves.T):
            if moves.sum() >= LEAST:
                rest[j] = rest_of(self.model[moves, j], change[:, moves, j].T)
        return rest

    def drift(self, known: Indices) -> Remark | None:
        """The finding that the effort's lag grows, None if it does not."""
        span = self.when[-1]
        coarse = self._replace(lags=self.lags[::COARSE])
        tried = (0.0, -DRIFTS[1], DRIFTS[1])
        rough = [np.log(coarse.rest(g / span)[known]).mean(axis=0).min() for g in tried]
        if not np.isfinite(rough).all() or rough[0] == min(rough):
            return None
        each = np.array([g for size in (0.0, *DRIFTS) for g in dict.fromkeys((size, -size))])
        rests = np.stack([self.rest(g / span)[known] for g in each])
        left = np.log(rests).mean(axis=1)
        best = left.min(axis=1).argmin()
        grown, least = each[best], left[best].min()
        alike = agreed(each[rests.min(axis=2).argmin(axis=0)], grown, DRIFTS[0])
        better = np.exp(left[0, abs(self.lags).argmin()] - least)
        steadily = np.exp(left[0].min() - least)
        if min(steadily / STEADY, better / BETTER) < 1 or not alike.any():
            return None
        first = self.lags[left[best].argmin()]
        return warning(
            "effort-drift",
            on_joints(known[alike]),
            drift_percent=100 * abs(grown) / span,
            pace="slow" if grown > 0 else "fast",
            first_ms=1e3 * first,
            last_ms=1e3 * (first + grown),
            span_s=span,
            ratio=better,
        )


def lateness_of(recording: Recording, robot: Robot) -> Lateness | None:
    """Windows that show an effort's lag, None if none do."""
    effort = effort_of(recording)
    if effort is None or recording.dq is None or recording.samples < LEAST:
        return None
    t, step = recording.t, recording.median_step
    if robot.joints != recording.joints or step * LEAST_RATE > 1:
        return None
    length = max(8, round(WINDOW / step))
    lags = np.unique(np.round(np.arange(EARLIEST, LATEST + STEP / 2, STEP) / step).astype(int))
    # On an even clock at every lag; the first lag is negative.
    starts = np.arange(-lags[0], len(t) - length - lags[-1], max(1, length // 2))
    starts = starts[spread(len(starts), WINDOWS, BLOCK)]
    whole = t[starts + length + lags[-1]] - t[starts + lags[0]]
    usual = (length + lags[-1] - lags[0]) * step
    starts = starts[(whole > 0.8 * usual) & (whole < 1.2 * usual)]
    if len(starts) < LEAST:
        return None
    rows = starts[:, None] + np.linspace(0, length, min(length, INSIDE) + 1).round().astype(int)
    times, dq = t[rows], recording.dq[rows]
    since, span = times - times[:, :1], times[:, -1:] - times[:, :1]
    turn, shares = 2 * np.pi / span, trapezoids(times)
    weight, slope = (1 - np.cos(turn * since)) * shares, turn * np.sin(turn * since) * shares
    joints = recording.q[rows.ravel()], dq.reshape(-1, recording.joints)
    terms = momentum_terms(robot.loaded_chain, *joints)
    rate = (terms.coriolis_transpose_dq - terms.gravity).reshape(dq.shape)

    def mean(by: Array, of: Array) -> Array:
        return (by[:, None] @ of)[:, 0]

    rigid = -mean(slope, terms.p.reshape(dq.shape)) - mean(weight, rate)
    columns = (rigid, mean(weight, np.tanh(dq / SLOW)), mean(weight, dq), -mean(slope, dq))
    speed = np.sqrt(mean(weight, dq**2))
    pairs = np.diff(starts) <= length // 2
    hann = (1 - np.cos(2 * np.pi * np.arange(length + 1) / length)) / length
    return Lateness(
        lags=lags * step,
        step=step,
        starts=np.stack([starts[:-1], starts[1:]])[:, pairs],
        when=(t[starts[:-1]] - t[0])[pairs],
        model=np.diff(np.stack(columns, axis=2), axis=0)[pairs],
        moves=(np.maximum(speed[1:], speed[:-1]) > MOVES)[pairs],
        effort=np.stack([np.convolve(column, hann, "valid") for column in effort[1].T], axis=1),
    )


def rest_of(model: Array, effort: Array) -> Array:
    """Rest (L,) of an effort (W, L) at every lag by its parts (W, 4), better samples."""
    size = root_mean_squares(model)
    columns = model / np.where(size > 0, size, 1.0)
    keep = np.ones(len(columns), bool)
    for _ in range(2):
        solution = np.linalg.pinv(columns[keep], rcond=1e-8) @ effort[keep]
        rest = (effort - columns @ solution) ** 2
        # Contact fits no lag; a sample that fits one lag shows it.
        least = rest.min(axis=1)
        keep = least <= np.quantile(least, KEPT)
    return np.asarray(np.sqrt(rest[keep].mean(axis=0)))
