"""Friction along a log: its memory of the motion, and its joints' temperature.

The teeth of a gear give before they slide: the angle alone shows it.

The play (backlash) operator follows the joint angle q at a distance of at most the
presliding length s₀,

    cᵗ = clip(cᵗ⁻¹, qᵗ − s₀, qᵗ + s₀),   sᵗ = (qᵗ − cᵗ)/s₀ ∈ [−1, 1],

so that s is the sign of the motion once the joint has moved 2 s₀, and is held at rest. It
is causal and needs no velocity or clock: across a gap only the net displacement counts.

References:
    A. Visintin, "Differential Models of Hysteresis", Springer, 1994, Ch. III, for play and stop;
    F. Al-Bender, J. Swevers, "Characterization of friction force dynamics", IEEE Control Systems
    Magazine 28(6), 2008, for presliding friction in drives.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from vftcli.robots.friction import COLDEST, WARMEST, friction_torque
from vftcli.robots.robot import JointFriction
from vftcli.signals.arrays import Array
from vftcli.signals.recording import Recording

BLOCK = 32  #: Samples in a block: the Python loop has this length, once a level.


class Play(NamedTuple):
    """The play operator along a stretch of a log."""

    state: Array  #: s, the share of full deflection. (T, n)
    centre: Array  #: c after the last sample, from which the next stretch goes on. (n,) [rad]


def play(q: Array, length: Array | float, centre: Array | None = None) -> Play:
    """Deflection s of the play operator, alike in one piece and in stretches.

    A sample is the map x → clip(x, q − s₀, q + s₀). Two such maps make one of the same
    kind, clip(clip(x, a, b), a′, b′) = clip(x, clip(a, a′, b′), clip(b, a′, b′)), so
    blocks of samples run side by side and their maps one after another, equal to a loop
    to the last bit. Without the centre c before the first sample it starts undeflected,
    c = q⁰, wrong by at most the whole deflection until the joint has moved 2 s₀.
    """
    reach = np.asarray(length, float)
    if not len(q):
        return Play(np.zeros_like(q), np.zeros(q.shape[1:]) if centre is None else centre)
    start = q[0] if centre is None else centre
    centres = follow(q - reach, q + reach, start)
    state = (q - centres) / reach
    return Play(state.clip(-1.0, 1.0, out=state), centres[-1])


def follow(low: Array, high: Array, start: Array) -> Array:
    """`start` (n,) clipped to [low, high], sample after sample. (T, n)"""
    samples = len(low)
    if samples <= BLOCK:
        out, value = np.empty_like(low), start
        for k in range(samples):
            out[k] = value = clipped(value, low[k], high[k])
        return out
    blocks = -(-samples // BLOCK)
    low, high = in_blocks(low, blocks), in_blocks(high, blocks)
    for i in range(1, BLOCK):
        # Both ends of the map so far go through this sample's clip.
        low[i], high[i] = (clipped(end[i - 1], low[i], high[i]) for end in (low, high))
    ends = follow(low[-1], high[-1], start)
    entering = np.concatenate([start[None], ends[:-1]])
    inside = clipped(entering, low, high)
    return inside.swapaxes(0, 1).reshape(blocks * BLOCK, -1)[:samples]


def clipped(value: Array, low: Array, high: Array) -> Array:
    """`numpy.clip` without its checks, which cost more than a row of a block."""
    return np.minimum(np.maximum(value, low), high)


def in_blocks(limits: Array, blocks: int) -> Array:
    """Samples as position in block × block × joint, the last one filled up."""
    padded = np.concatenate([limits, limits[-1:].repeat(blocks * BLOCK - len(limits), axis=0)])
    shaped = padded.reshape(blocks, BLOCK, -1)
    return np.ascontiguousarray(shaped.swapaxes(0, 1))


class RunningFriction:
    """The friction of an arm's joints, stretch after stretch of a motion.

    Presliding friction depends on where a joint came from: `centre` is c after the last
    sample of the joints that have it, None before the first (m,) [rad].
    """

    def __init__(self, friction: Sequence[JointFriction]) -> None:
        self.friction = friction
        self.centre: Array | None = None
        presliding = [joint.parameters.get("presliding", 0.0) for joint in friction]
        self._joints = [j for j, torque in enumerate(presliding) if torque > 0.0]
        lengths = [friction[j].parameters["presliding_length"] for j in self._joints]
        self._length = np.array(lengths)

    def torque(
        self,
        q: Array,
        dq: Array,
        load: Array | None = None,
        temperature: Array | None = None,
    ) -> Array:
        """Friction torque of the next samples, as `friction_torque` has it. (T, n) [N·m]"""
        return friction_torque(
            self.friction, dq, load, deflection=self.deflection(q), temperature=temperature
        )

    def deflection(self, q: Array) -> Array | None:
        """State s of the play operator along the next angles; None without one."""
        if not self._joints:
            return None
        found = play(q[:, self._joints], self._length, self.centre)
        self.centre = found.centre
        state = np.zeros(q.shape, order="F")
        state[:, self._joints] = found.state
        return state


def measured_temperature(recording: Recording) -> Array | None:
    """A log's joint temperatures, NaN where missing. (T, n) [°C]

    Controllers that do not measure them write zeros.
    """
    if recording.temperature is None:
        return None
    T = recording.temperature
    plausible = (T >= COLDEST) & (T <= WARMEST)
    if not plausible.any():
        return None
    return T if plausible.all() else np.where(plausible, T, np.nan)
