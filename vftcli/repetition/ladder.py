"""The alignment ladder: ways to pair a free run with a log, best last."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from vftcli.repetition.error_model import ErrorModel, error_model
from vftcli.repetition.laid_over import LaidOver
from vftcli.repetition.pairing import Pairing, by_phase
from vftcli.robots.run import Run
from vftcli.signals.arrays import Array, at
from vftcli.signals.errors import ReferenceTorqueError
from vftcli.signals.filters import low_pass
from vftcli.signals.remarks import Remark, fact

LOW_PASS = 12.0  #: Default cutoff of the zero-phase low-pass. [Hz]
#: A rung further up, or the low-pass, must bring the expected error down to this share.
WORTH = 0.97


class Rung(NamedTuple):
    """One way of alignment."""

    clock: str  #: The pairing it starts from: "commanded" or "found".
    phase: bool  #: Whether partners are moved to the nearest place on the joint-space path.
    corrected: bool  #: Whether the motion difference's model torque is subtracted.
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
    cutoff: float | None  #: Cutoff of the zero-phase low-pass, None without. [Hz]
    tau: Array  #: τ_ext, NaN where there is no partner. (T, n) [N·m]
    error: ErrorModel  #: What is known of its own error.

    def remark(self, code: str, **values: Any) -> Remark:  # noqa: ANN401 - any value
        """A remark on this rung, by another code, -filtered, where it is low-passed."""
        if self.cutoff is None:
            return fact(code, rung=self.rung, **values)
        return fact(f"{code}-filtered", rung=self.rung, cutoff_Hz=self.cutoff, **values)

    def floor_remark(self) -> Remark:
        """The floor on this rung."""
        return self.remark("alignment-floor", floor_Nm=self.error.floor.tolist())


def differences(
    motion: Run,
    clocks: Mapping[str, Sequence[Pairing]],
    rungs: Sequence[str],
    cutoffs: Sequence[float | None],
) -> Iterator[Difference]:
    """The difference on every rung, with and without the low-pass, one by one.

    Args:
        motion: The log.
        clocks: "found" and, where a period is stated, "commanded" → one pairing a free run.
        rungs: Names in `RUNGS`; those without their clock are left out.
        cutoffs: Cutoffs of the low-pass to try, None for none. [Hz]
    """
    laid: dict[tuple[str, bool], LaidOver] = {}
    for name in rungs:
        rung = RUNGS[name]
        if rung.clock not in clocks:
            continue
        way = (rung.clock, rung.phase)
        if way not in laid:
            # One way of pairing after the other: of a long log two have no room at once.
            laid.clear()
            pairings = clocks[rung.clock]
            if rung.phase:
                pairings = [by_phase(motion, pairing) for pairing in pairings]
            laid = {way: LaidOver(motion=motion, pairings=pairings)}
        for cutoff in cutoffs:
            yield difference(laid[way], name, cutoff)


def difference(laid: LaidOver, name: str, cutoff: float | None) -> Difference:
    """τ_ext = τ_free − τ (+ model − model_free) at pairs, low-passed if asked.

    With Mq̈ + Cq̇ + g + F_f = τ + τ_ext for both motions and τ_ext = 0 in the free one, the
    bracket is exact; without it the two motions are assumed equal.
    """
    motion, known = laid.motion, laid.known
    if np.count_nonzero(known) < 16:
        raise ReferenceTorqueError(
            f"{motion.name}: only {np.count_nonzero(known)} samples have a partner in the free "
            "run; record a longer one, or choose other cycles: --set two-cycle.free-cycles=…"
        )
    corrected = RUNGS[name].corrected
    signal = at(known, laid.torque)
    if corrected:
        signal += at(known, laid.change)
    smooth = signal if cutoff is None else low_pass(motion.t[known], signal, cutoff)
    error = error_model(laid, signal, smooth, corrected=corrected, cutoff=cutoff)
    tau = np.full_like(laid.torque, np.nan)
    for column, found in zip(tau.T, smooth.T, strict=True):
        column[known] = found
    return Difference(name, cutoff, tau, error)


class Climbed(NamedTuple):
    """Results of the rungs."""

    chosen: Difference  #: The difference that is most certain.
    floors: tuple[Remark, ...]  #: The floor of each rung.


def most_certain(made: Iterable[Difference]) -> Climbed:
    """The difference with the least expected error, the simpler of equals.

    Compared is the mean over trusted joints of expected error in motion, relative to the lowest
    rung's. Only the best so far is kept: of a long log not all have room at once.
    """
    steps = iter(made)
    chosen = next(steps)
    lowest, trusted, least = chosen.error.floor_moving, chosen.error.trusted_joints, 1.0
    floors = [chosen.floor_remark()]
    for candidate in steps:
        floors.append(candidate.floor_remark())
        share = float(np.mean((candidate.error.floor_moving / lowest)[trusted]))
        if share < WORTH * least:
            chosen, least = candidate, share
        del candidate  # it has no room beside the next
    return Climbed(chosen, tuple(floors))
