"""The two-cycle difference: a log's samples less their partners in free runs.

Partners go by a clock, or by the nearest place on the joint-space path. The error of each
way follows from the logs themselves, by sample and joint.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, cached_property
from typing import Any, NamedTuple

import numpy as np

from vftcli.robots.friction import REPEATED_STOP, TWO_STOPS
from vftcli.robots.run import Run, signal_edge
from vftcli.robots.terms import GAP
from vftcli.signals.arrays import Array, Mask, around, empty_series, gaps_of, resample_columns
from vftcli.signals.errors import ReferenceTorqueError
from vftcli.signals.filters import band_pass, low_pass, noise_passed
from vftcli.signals.remarks import Remark, fact

FARTHEST = 0.1  #: How far phase may lie from the clock. [s]
#: Cutoff of the phase shift: a servo's compliance is slower. [Hz]
PHASE_CUTOFF = 8.0
#: A stop this long leaves all of the dry friction open. [s]
STUCK = 0.3
#: Share of the stiction that cancels between two equal stops at one place.
REPEATED = 0.5


class Pairing(NamedTuple):
    """A free run, and where in it each sample of the log belongs."""

    free: Run  #: The free run, or the log itself with its cycles.
    times: Array  #: Instant on the free run's clock, or NaN. (T,) [s]

    @property
    def known(self) -> Mask:
        """Whether a sample has a partner. (T,)"""
        return np.isfinite(self.times)

    def there(self, x: Array) -> Array:
        """Columns of a free run's signal at paired instants, NaN without."""
        return resample_columns(self.times, self.free.t, x)


def pair_with_run(t: Array, free: Run, shift: float, rate: float = 1.0) -> Pairing:
    """Samples at t (T,) paired with a free run at rate·t + shift of its clock."""
    times = rate * t + shift
    inside = (times >= free.t[0]) & (times <= free.t[-1]) & ~in_gap(free.t, times)
    return Pairing(free, np.where(inside, times, np.nan))


def in_gap(clock: Array, times: Array) -> Mask:
    """Whether an instant lies in a gap of a clock. (T,)"""
    before = np.clip(clock.searchsorted(times) - 1, 0, len(clock) - 2)
    return np.isin(before, gaps_of(clock, GAP))


def by_phase(motion: Run, pairing: Pairing) -> Pairing:
    """Move each sample's partner to the nearest place on the free run's path.

    Gauss–Newton minimises the joints' distance; the shift is smoothed along time.
    """
    known, free = pairing.known, pairing.free
    if np.count_nonzero(known) < 8:
        return pairing
    times, q, speed = pairing.times[known], motion.q[known], free.smooth_dq
    shift, ends = np.zeros(len(times)), (times.min(), times.max())
    damping = 0.01 * np.sum(speed**2, axis=1).mean() + 1e-6
    for _ in range(4):
        at = np.clip(times + shift, *ends)
        path = resample_columns(at, free.t, speed)
        distance = resample_columns(at, free.t, free.q) - q
        shift -= np.sum(distance * path, axis=1) / (np.sum(path**2, axis=1) + damping)
        shift = shift.clip(-FARTHEST, FARTHEST)
    cutoff = min(PHASE_CUTOFF, 0.2 / motion.step)
    smooth = low_pass(motion.t[known], shift[:, None], cutoff)[:, 0]
    moved = pairing.times.copy()
    moved[known] = np.clip(times + smooth, *ends)
    return Pairing(free, moved)


@dataclass(frozen=True, kw_only=True, eq=False)
class PairedRuns:
    """A log and its free runs, each sample of the log with its partners."""

    motion: Run  #: The log.
    pairings: Sequence[Pairing]  #: Its free runs.
    _found: dict[tuple[str, float], Array] = field(init=False, repr=False, default_factory=dict)

    def cached(self, what: str, cutoff: float, find: Callable[[], Array]) -> Array:
        """An earlier result for a cutoff [Hz], else a new one."""
        if (what, cutoff) not in self._found:
            self._found[what, cutoff] = find()
        return self._found[what, cutoff]

    def of_free(self, name: str) -> Array:
        """Mean of a `Run`'s series over the free runs' partners. (T, n)"""
        count, total = np.zeros(1), np.zeros(1)
        for p in self.pairings:
            there = p.there(getattr(p.free, name))
            known = np.isfinite(there)
            count = count + known
            total = total + np.where(known, there, 0.0)
        return np.where(count > 0, total / np.maximum(count, 1), np.nan)

    @cached_property
    def torque(self) -> Array:
        """Raw torque difference, NaN without partner. (T, n) [N·m]"""
        return self.of_free("drive_torque") - self.motion.drive_torque

    @cached_property
    def model_difference(self) -> Array:
        """The model's torque of the motion difference. (T, n) [N·m]"""
        return self.motion.model_torque - self.of_free("model_torque")

    @cached_property
    def known(self) -> Mask:
        """Samples that have a partner. (T,)"""
        return np.asarray(np.isfinite(self.torque).all(axis=1))

    @cached_property
    def standing(self) -> Mask:
        """Rest of a joint in the log or in any free run. (T, n)"""
        found = self.motion.standing.copy()
        for p in self.pairings:
            found |= p.there(p.free.standing.astype(float)) > 0.0
        return found

    @cached_property
    def stopped(self) -> Array:
        """Share of dry friction that a stop leaves open, 0–1. (T, n)"""
        longest = self.motion.standstill.copy()
        shortest = longest.copy()
        for p in self.pairings:
            there = np.nan_to_num(p.there(p.free.standstill))
            np.maximum(longest, there, out=longest)
            np.minimum(shortest, there, out=shortest)
        alike = shortest / np.maximum(longest, 1e-9)
        share = np.minimum(longest / STUCK, 1.0) * (1.0 - REPEATED * alike)
        return np.maximum(share, self.standing)

    @cached_property
    def misfit(self) -> Array:
        """Share of the free run's torque that the model misses, ≤ 1. (n,)"""
        missed = total = np.zeros(self.motion.drive_torque.shape[1])
        for p in self.pairings:
            free = p.free.coarse
            used = free.t.searchsorted(p.times[p.known])
            used = np.unique(used.clip(0, len(free.t) - 1))
            # Below the band of the noise.
            gap, edge = free.drive_torque - free.model_torque, signal_edge(free.step)
            missed = missed + low_pass(free.t, gap, edge)[used].var(axis=0)
            total = total + low_pass(free.t, free.model_torque, edge)[used].var(axis=0)
        return np.sqrt(np.minimum(missed / np.maximum(total, 1e-12), 1.0))


LOW_PASS = 12.0  #: Default cutoff of the zero-phase low-pass. [Hz]
#: A rung further up, or the low-pass, must leave this share of the error.
WORTH = 0.97
#: Least band of a noise estimate: contacts fill lower ones. [Hz]
LEAST_BAND = 12.0
#: Share of the correction that is wrong even with the best model.
LEAST_SHARE = 0.05
PIECE = 0.4  #: Length of pieces that separate noise from slow loads. [s]
#: Fewest pieces for a noise estimate.
LEAST_PIECES = 20
QUIET = 0.1  #: Share of the pieces without a fast contact.
SEED = 15  #: Of the white noise beside the quietest pieces.
TRUSTED_SHARE = 0.5  #: Least share of samples in motion of a joint to trust.


class ErrorModel(NamedTuple):
    """Expected error of a difference, from the logs themselves."""

    sd: Array  #: Deviation of each sample, or NaN. (T, n) [N·m]
    standing: Mask  #: Where the joint rests in either log. (T, n)

    @property
    def standing_share(self) -> Array:
        """Share of paired samples at rest. (n,)"""
        return np.asarray(np.mean(self.standing[self.known], axis=0))

    @property
    def known(self) -> Mask:
        """Samples with a reference. (T,)"""
        return np.asarray(np.isfinite(self.sd).all(axis=1))

    @property
    def floor(self) -> Array:
        """RMS of `sd` over samples with a reference. (n,) [N·m]"""
        return rms(self.sd, np.isfinite(self.sd))

    @property
    def floor_moving(self) -> Array:
        """RMS of `sd` in motion, of all if mostly at rest. (n,) [N·m]"""
        return self.rms_moving(self.sd)

    def rms_moving(self, x: Array) -> Array:
        """RMS of a signal over `floor_moving`'s samples. (n,)"""
        moving = ~self.standing[self.known]
        used = np.where(self.standing_share <= 1.0 - TRUSTED_SHARE, moving, True)
        return rms(x[self.known], used)


class Rung(NamedTuple):
    """One way of alignment."""

    clock: str  #: The pairing it starts from: "commanded" or "found".
    phase: bool  #: Whether partners are the nearest on the joint-space path.
    corrected: bool  #: Whether the model's torque is subtracted.
    title: str  #: What it does, in words.


#: Name at the command line → rung, from the lowest.
RUNGS: dict[str, Rung] = {
    "commanded": Rung("commanded", False, False, "the stated period as it is"),
    "period": Rung("found", False, False, "the period (or shift) found on the joint positions"),
    "phase": Rung("found", True, False, "joint-space phase"),
    "model": Rung(
        "found", True, True, "joint-space phase and the model's torque of the motion difference"
    ),
}


class Difference(NamedTuple):
    """A two-cycle difference made on one rung."""

    rung: str  #: Its name in `RUNGS`.
    cutoff: float | None  #: Cutoff of the zero-phase low-pass. [Hz]
    tau: Array  #: τ_ext, NaN where there is no partner. (T, n) [N·m]
    error: ErrorModel  #: What is known of its own error.

    def remark(self, code: str, **values: Any) -> Remark:  # noqa: ANN401 - any value
        """A remark on this rung, with its low-pass."""
        low_pass = "" if self.cutoff is None else f" + {self.cutoff:g} Hz low-pass"
        return fact(code, rung=f"{self.rung}{low_pass}", **values)


def differences(
    motion: Run,
    clocks: Mapping[str, Sequence[Pairing]],
    rungs: Sequence[str],
    cutoffs: Sequence[float | None],
) -> Iterator[Difference]:
    """The difference on each rung with a clock, at each low-pass [Hz], one by one.

    Clocks are "found" and, for a stated period, "commanded", with one pairing a free run.
    """
    way, pair = None, None
    for name in rungs:
        rung = RUNGS[name]
        if rung.clock not in clocks:
            continue
        if pair is None or way != (rung.clock, rung.phase):
            # One way after the other: of a long log two have no room.
            pair, way = None, (rung.clock, rung.phase)
            pairings = clocks[rung.clock]
            if rung.phase:
                pairings = [by_phase(motion, pairing) for pairing in pairings]
            pair = PairedRuns(motion=motion, pairings=pairings)
        for cutoff in cutoffs:
            yield difference(pair, name, cutoff)


def difference(pair: PairedRuns, name: str, cutoff: float | None) -> Difference:
    """τ_ext = τ_free − τ (+ model − model_free) at pairs, low-passed if asked.

    With Mq̈ + Cq̇ + g + F_f = τ + τ_ext for both motions and τ_ext = 0 in the free one,
    the bracket is exact; without it the two motions are assumed equal.
    """
    motion, known = pair.motion, pair.known
    if np.count_nonzero(known) < 16:
        raise ReferenceTorqueError(
            f"{motion.name}: only {np.count_nonzero(known)} samples have a partner in the free "
            "run; record a longer one, or choose other cycles: --set two-cycle.free-cycles=…"
        )
    corrected = RUNGS[name].corrected
    signal = at(known, pair.torque)
    if corrected:
        signal += at(known, pair.model_difference)
    smooth = signal if cutoff is None else low_pass(motion.t[known], signal, cutoff)
    error = error_model(pair, signal, smooth, corrected=corrected, cutoff=cutoff)
    tau = np.full_like(pair.torque, np.nan)
    for column, found in zip(tau.T, smooth.T, strict=True):
        column[known] = found
    return Difference(name, cutoff, tau, error)


def most_certain(made: Iterable[Difference]) -> tuple[Difference, list[Remark]]:
    """The difference of least expected error in motion; all floors."""
    steps = iter(made)
    chosen = next(steps)
    lowest, least = chosen.error.floor_moving, 1.0
    # Joints with motion enough to cancel friction; all if none has.
    trusted = chosen.error.standing_share <= 1.0 - TRUSTED_SHARE
    trusted |= not trusted.any()
    floors = [chosen.remark("alignment-floor", floor_Nm=chosen.error.floor)]
    for candidate in steps:
        floors.append(candidate.remark("alignment-floor", floor_Nm=candidate.error.floor))
        share = (candidate.error.floor_moving / lowest)[trusted].mean()
        if share < WORTH * least:
            chosen, least = candidate, share
        del candidate  # it has no room beside the next
    return chosen, floors


def error_model(
    pair: PairedRuns, signal: Array, smooth: Array, *, corrected: bool, cutoff: float | None
) -> ErrorModel:
    """The error of a difference.

    Its square is the sum of
    - noise: √2·K·σ_i without repetition, measured on the difference itself; the larger of
      the band about the cutoff, as if white, and the quietest seconds;
    - motion: the model's torque of the motion difference, all of it without the correction,
      else the model's relative error on the free run's own torque;
    - stiction where a joint stops: two torques anywhere within ±F_c differ by √(2/3)·F_c, after
      a stop shorter than `STUCK` by its share, by `REPEATED_STOP` where the whole arm rests.

    The signal is the difference where known, smooth its low-passed part. (S, n) [N·m]
    """
    motion, known = pair.motion, pair.known
    t, step = motion.t[known], motion.step
    moving = ~pair.standing[known]
    noise = np.maximum(
        noise_of(t, signal, moving, step, cutoff),
        noise_when_quiet(t, smooth, moving, step, cutoff),
    )
    low = signal_edge(step) if cutoff is None else signal_edge(step, cutoff)

    motion_error = pair.cached(
        "motion", low, lambda: local_rms(low_pass(t, at(known, pair.model_difference), low), step)
    )
    missed, own = np.maximum(LEAST_SHARE, pair.misfit), np.zeros(len(noise))
    if not corrected:
        # The model's torque differentiates momenta: their noise is no motion.
        missed, around = np.ones(len(noise)), (moving, step, (low, 2.0 * low), low)
        own = pair.cached(
            "slope",
            low,
            lambda: noise_below(
                t, at(known, motion.momentum - pair.of_free("momentum")), *around, slope=1
            ),
        )
    at_rest = pair.standing.all(axis=1)
    sd = np.full_like(pair.stopped, np.nan)
    for j, stopped in enumerate(pair.stopped.T):
        left = np.maximum((motion_error[:, j] * missed[j]) ** 2 - own[j] ** 2, 0.0)
        share = np.where(at_rest, REPEATED_STOP, TWO_STOPS * stopped)[known]
        sd[known, j] = np.sqrt(noise[j] ** 2 + left + (motion.dry_friction[j] * share) ** 2)
    return ErrorModel(sd, pair.standing)


def noise_of(t: Array, x: Array, moving: Mask, step: float, cutoff: float | None) -> Array:
    """Noise of a difference. (n,) [N·m]

    Without a low-pass from second differences, √6·σ of white noise σ. With one from the
    band about its cutoff, at least `LEAST_BAND`, as contacts fill lower ones.
    """
    if cutoff is None:
        return np.asarray(rms(np.diff(x, 2, axis=0), moving[1:-1]) / np.sqrt(6.0))
    middle = max(cutoff, min(LEAST_BAND, 0.2 / step))
    limits = (0.7 * middle, min(1.3 * middle, 0.45 / step))
    return noise_below(t, x, moving, step, limits, cutoff)


def noise_below(
    t: Array,
    x: Array,
    moving: Mask,
    step: float,
    limits: tuple[float, float],
    cutoff: float,
    slope: int = 0,
) -> Array:
    """Noise below a cutoff, dense as in a band [Hz]. (n,)"""
    dense = rms(band_pass(t, x, *limits), moving) / np.sqrt(noise_passed(step, limits))
    return np.asarray(dense * np.sqrt(noise_passed(step, cutoff, slope)))


def noise_when_quiet(
    t: Array, x: Array, moving: Mask, step: float, cutoff: float | None
) -> Array:
    """Coloured noise of a low-passed difference, from its quiet pieces. (n,) [N·m]

    Of each `PIECE` of x (S, n) the deviation from a line, a slow load's course; `QUIET` of
    them are assumed free. Slower wander does not count: this errs low.
    """
    size = round(PIECE / step)
    count = len(t) // size
    found = np.zeros(x.shape[1])
    if size < 8 or count < LEAST_PIECES:
        return found
    left = off_line(x, size)
    moves = moving[: count * size].reshape(count, size, *x.shape[1:]).mean(axis=1) > 0.5
    whole = t[size - 1 : count * size : size] - t[: count * size : size] < 1.5 * PIECE
    for j in range(x.shape[1]):
        pieces = left[whole & moves[:, j], j]
        if len(pieces) >= LEAST_PIECES:
            found[j] = np.sqrt(np.quantile(pieces, QUIET) / white_when_quiet(size, step, cutoff))
    return found


def off_line(x: Array, size: int) -> Array:
    """Mean square deviation from a line in pieces of a size. (pieces, n)"""
    count = len(x) // size
    pieces = x[: count * size].reshape(count, size, -1)
    along = np.linspace(-1.0, 1.0, size)
    line = np.column_stack([np.ones(size) / np.sqrt(size), along / np.linalg.norm(along)])
    share = np.einsum("sk,psn->pkn", line, pieces)
    square = np.sum(pieces**2, axis=1) - np.sum(share**2, axis=1)
    return np.asarray(np.maximum(square, 0.0) / size)


@cache
def white_when_quiet(size: int, step: float, cutoff: float | None) -> float:
    """Square of `noise_when_quiet` of white noise over its variance."""
    noise = np.random.default_rng(SEED).standard_normal((400 * size, 1))
    clock = step * np.arange(len(noise), dtype=float)
    smooth = noise if cutoff is None else low_pass(clock, noise, cutoff)
    return np.quantile(off_line(smooth, size), QUIET) / np.mean(smooth**2)


def at(chosen: Mask, x: Array) -> Array:
    """The chosen samples (T,) of a series, its columns contiguous. (S, n)"""
    return np.compress(chosen, x.T, axis=1).T


def rms(x: Array, where: Mask) -> Array:
    """RMS per column over chosen samples, over all if none. (n,)"""
    # Column by column: copies of a long log take longer.
    chosen = (c[w] if w.any() else c for c, w in zip(x.T, where.T, strict=True))
    return np.sqrt([np.dot(column, column) / len(column) for column in chosen])


def local_rms(x: Array, step: float) -> Array:
    """RMS over a tenth of a second around each sample. (T, n)"""
    out = empty_series(*x.shape)
    for column, mean in zip(x.T, out.T, strict=True):
        np.sqrt(np.divide(*around(column**2, max(1, round(0.05 / step)))), out=mean)
    return out
