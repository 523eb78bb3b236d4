"""Contact-free cycles of a repeated motion: given, or found by their residuals."""

from typing import NamedTuple

import numpy as np

from vftcli.repetition.cycles import Cycles
from vftcli.repetition.ladder import difference
from vftcli.repetition.laid_over import LaidOver
from vftcli.repetition.pairing import Pairing, pair_with_cycle
from vftcli.robots.run import Run, band
from vftcli.signals.arrays import Array
from vftcli.signals.errors import ReferenceTorqueError
from vftcli.signals.filters import low_pass
from vftcli.signals.remarks import Remark, fact

#: A cycle is free too if its difference from the freest is within this many expected errors.
ALIKE = 1.5
MOST_LAID = 8  #: Free cycles that are laid under the others, at most.
SETTLES = 2.0  #: Time around a cycle in which filters settle. [s]


class FreeCycles(NamedTuple):
    """Cycles assumed free."""

    numbers: tuple[int, ...]  #: Counted from 0.
    #: Of every whole cycle, relative to the smallest, by which these were chosen, ∞ of one that
    #: lies in a gap; None where they were given. (cycles,)
    residuals: Array | None

    @property
    def drawn(self) -> tuple[int, ...]:
        """Those that are laid under the others: all, or `MOST_LAID` from the first to the last.

        Every cycle more costs a pass over the whole log, and takes little off the error.
        """
        if len(self.numbers) <= MOST_LAID:
            return self.numbers
        at = np.linspace(0, len(self.numbers) - 1, MOST_LAID).round().astype(int)
        return tuple(self.numbers[k] for k in at)

    def remark(self, whole: int) -> Remark:
        """Their numbers among so many whole cycles, and their origin."""
        code = "free-cycle" if len(self.numbers) == 1 else "free-cycles"
        named = [number + 1 for number in self.numbers]
        if self.residuals is None:
            return fact(f"{code}-given", cycles=named, whole=whole)
        residuals = self.residuals[np.isfinite(self.residuals)].tolist()
        return fact(f"{code}-found", cycles=named, whole=whole, residuals=residuals)

    def remarks(self, whole: int) -> list[Remark]:
        """The same, and which of them are laid under the others where not all are."""
        count = len(self.numbers)
        if count <= MOST_LAID:
            return [self.remark(whole)]
        # The mean of k cycles with independent noise adds 1/k of one cycle's to the square.
        wider = float(np.sqrt((1.0 + 1.0 / MOST_LAID) / (1.0 + 1.0 / count)) - 1.0)
        drawn = [number + 1 for number in self.drawn]
        return [
            self.remark(whole),
            fact("free-cycles-drawn", cycles=drawn, free=count, wider=wider),
        ]


def find_free_cycles(motion: Run, cycles: Cycles) -> FreeCycles:
    """The cycle of smallest residual, and those that differ by noise alone.

    The residual of a cycle is the root mean square of torque minus the model's, low-passed, of
    each joint relative to that joint's smallest, averaged over the joints.
    """
    number = cycles.number(motion.t)
    if cycles.whole < 1:
        raise ReferenceTorqueError(
            f"{motion.name}: no whole cycle of {cycles.period:.4g} s is in the log; give a free "
            "run with --free"
        )
    residual = residuals(motion, cycles)
    freest = int(np.argmin(residual))
    pairing = pair_with_cycle(motion, cycles, freest, cycles.period)
    first, last = np.searchsorted(motion.t, np.add(cycles.span(freest), (-SETTLES, SETTLES)))
    free = motion.part(slice(int(first), int(last)))
    also = []
    for cycle in np.flatnonzero(np.isfinite(residual)).tolist():
        inside = np.flatnonzero(number == cycle)
        span = slice(int(inside[0]), int(inside[-1]) + 1)
        there = Pairing(free, pairing.times[span])
        if cycle == freest or differs_by_noise(motion.part(span), there):
            also.append(cycle)
    if len(also) == cycles.whole > 1:
        # Something must be left that the free cycles can be laid under.
        also.pop()
    return FreeCycles(tuple(also), residual)


def residuals(motion: Run, cycles: Cycles) -> Array:
    """Mean over joints of each cycle's residual relative to the smallest. (cycles,)

    A cycle of which a gap takes more than half has none: ∞.
    """
    # Below 5 Hz a push exceeds the drives' ripple.
    cutoff = min(5.0, band(motion.step, None)[0])
    gap = low_pass(motion.t, motion.drive_torque - motion.model_torque, cutoff)
    number = cycles.number(motion.t)
    held = np.bincount(number[(number >= 0) & (number < cycles.whole)], minlength=cycles.whole)
    square = np.full((cycles.whole, gap.shape[1]), np.inf)
    for cycle in np.flatnonzero(2 * held >= held.max()).tolist():
        square[cycle] = np.mean(gap[number == cycle] ** 2, axis=0)
    relative = np.sqrt(square / np.maximum(square.min(axis=0), 1e-12))
    return np.asarray(relative.mean(axis=1))


def differs_by_noise(motion: Run, pairing: Pairing) -> bool:
    """Whether a cycle is within the difference's error of its partner."""
    laid = LaidOver(motion=motion, pairings=[pairing])
    found = difference(laid, "model", band(motion.step, None)[0])
    shown = found.error.rms_moving(found.tau)
    return bool(np.all(shown <= ALIKE * found.error.floor_moving))
