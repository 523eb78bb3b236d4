"""The alignment ladder: ways to lay a free run under a log, each a rung better than the last."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from vftcli.repetition.drive_run import DriveRun
from vftcli.repetition.error_model import ErrorModel, error_model
from vftcli.repetition.pairing import Pairing, by_phase, mean_of
from vftcli.signals.arrays import Array
from vftcli.signals.errors import ReferenceTorqueError
from vftcli.signals.filters import low_pass
from vftcli.signals.remarks import Remark, fact

LOW_PASS = 12.0
"""Default cutoff of the zero-phase low-pass. [Hz]"""

WORTH = 0.97
"""A rung further up, or the low-pass, must bring the expected error down to this share."""


class Rung(NamedTuple):
    """One way of alignment.

    Attributes:
        clock: The pairing it starts from: "commanded" or "found".
        phase: Whether partners are moved to the nearest place on the joint-space path.
        corrected: Whether the model's torque of the remaining motion difference is taken off.
        title: What it does, in words.
    """

    clock: str
    phase: bool
    corrected: bool
    title: str


RUNGS: dict[str, Rung] = {
    "commanded": Rung("commanded", False, False, "the stated period as it is"),
    "period": Rung("found", False, False, "the period (or shift) found on the joint positions"),
    "phase": Rung("found", True, False, "joint-space phase"),
    "model": Rung(
        "found", True, True, "joint-space phase and the model's torque of the motion difference"
    ),
}
"""Name at the command line → rung, from the lowest."""


class Difference(NamedTuple):
    """A two-cycle difference made on one rung.

    Attributes:
        rung: Its name in `RUNGS`.
        cutoff: Cutoff of the zero-phase low-pass, None without. [Hz]
        tau: τ_ext, NaN where there is no partner. (T, n) [N·m]
        error: What is known of its own error.
    """

    rung: str
    cutoff: float | None
    tau: Array
    error: ErrorModel

    def remark(self, code: str, **values: Any) -> Remark:  # noqa: ANN401 - any value
        """A remark on this rung, by another code, -filtered, where it is low-passed."""
        if self.cutoff is None:
            return fact(code, rung=self.rung, **values)
        return fact(f"{code}-filtered", rung=self.rung, cutoff_Hz=self.cutoff, **values)


def differences(
    motion: DriveRun,
    clocks: Mapping[str, Sequence[Pairing]],
    rungs: Sequence[str],
    cutoffs: Sequence[float | None],
) -> list[Difference]:
    """Make the difference on every rung asked for, with and without the low-pass.

    Args:
        motion: The log.
        clocks: "found" and, where a period is stated, "commanded" → one pairing a free run.
        rungs: Names in `RUNGS`; those whose clock is not there are left out.
        cutoffs: Cutoffs of the low-pass to try, None for none. [Hz]
    """
    steps = []
    for name in rungs:
        rung = RUNGS[name]
        if rung.clock not in clocks:
            continue
        pairings = clocks[rung.clock]
        if rung.phase:
            pairings = [by_phase(motion, p) for p in pairings]
        steps += [difference(motion, pairings, name, cutoff) for cutoff in cutoffs]
    return steps


def difference(
    motion: DriveRun, pairings: Sequence[Pairing], name: str, cutoff: float | None
) -> Difference:
    """τ_ext = τ_free − τ (+ model − model_free) at paired instants, low-passed if asked.

    With Mq̈ + Cq̇ + g + F_f = τ + τ_ext for both motions and τ_ext = 0 in the free one, the
    bracket is exact; without it the two motions are taken to be the same.
    """
    raw = mean_of(pairings, [p.free.torque for p in pairings]) - motion.torque
    change = motion.model - mean_of(pairings, [p.free.model for p in pairings])
    known = np.isfinite(raw).all(axis=1)
    if np.count_nonzero(known) < 16:
        raise ReferenceTorqueError(
            f"{motion.name}: only {np.count_nonzero(known)} samples have a partner in the free "
            "run; record a longer one, or choose other free cycles with --free-cycles"
        )
    corrected = RUNGS[name].corrected
    tau = np.full(raw.shape, np.nan)
    wanted = raw[known] + change[known] if corrected else raw[known]
    tau[known] = wanted if cutoff is None else low_pass(motion.t[known], wanted, cutoff)
    error = error_model(motion, pairings, raw, change, corrected=corrected, cutoff=cutoff)
    return Difference(name, cutoff, tau, error)


def most_certain(made: Sequence[Difference]) -> Difference:
    """The difference with the smallest expected error, the simpler one where they are alike.

    Compared is the mean over trusted joints of expected error in motion, relative to the lowest
    rung's.
    """
    lowest = made[0].error.floor_moving
    trusted = made[0].error.trusted_joints
    chosen, least = made[0], 1.0
    for candidate in made[1:]:
        share = float(np.mean((candidate.error.floor_moving / lowest)[trusted]))
        if share < WORTH * least:
            chosen, least = candidate, share
    return chosen
