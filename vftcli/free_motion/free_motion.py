"""Contact-free motion beside a log: its own spans and cycles, other runs."""

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from vftcli.free_motion.choice import FreeChoice
from vftcli.robots.run import Run, RunSamples
from vftcli.signals.arrays import Mask
from vftcli.signals.errors import ParameterError, ReferenceTorqueError
from vftcli.signals.parsing import interval_text
from vftcli.signals.recording import Recording, refuse_repeated_runs
from vftcli.signals.remarks import Remark, Where, fact
from vftcli.signals.shown import Shown

# A plain estimate asks for no free motion: what finds it is loaded when it is asked for.
if TYPE_CHECKING:
    from vftcli.free_motion.alignment import Alignment
    from vftcli.free_motion.cycles import Cycles, FreeCycles, Period
    from vftcli.free_motion.paired_runs import Pairing

#: A cycle counts as inside a span if it sticks out by no more than this share of itself.
SLACK = 0.03


class FreePart(NamedTuple):
    """Everything that is free of contact, of the log and of free runs."""

    pieces: tuple[RunSamples, ...]  #: One a recording, the log's own first.
    own: Mask  #: RunSamples of the log itself that are free. (T,)
    remarks: tuple[Remark, ...]  #: What it is and how it was found.
    #: Whether it was found, not named, so that it may be touched after all.
    doubted: bool = False


@dataclass(frozen=True, kw_only=True, eq=False)
class FreeRun:
    """A motion in another recording that nobody touched, beside the log it serves.

    Everything that is asked of it, by references, zero and bands, is made once.
    """

    run: Run  #: The free run.
    log: Run  #: The log.

    @cached_property
    def _alignment(self) -> "Alignment | ReferenceTorqueError":
        from vftcli.free_motion.alignment import align

        try:
            return align(self.log.recording, self.recording)
        except ReferenceTorqueError as error:
            return error

    @property
    def recording(self) -> Recording:
        """The free run as it was read."""
        return self.run.recording

    @property
    def is_same_motion(self) -> bool:
        """Whether it follows the log's trajectory, or a part of it."""
        return not isinstance(self._alignment, ReferenceTorqueError)

    @property
    def alignment(self) -> "Alignment":
        """Its alignment with the log."""
        if isinstance(self._alignment, ReferenceTorqueError):
            raise self._alignment
        return self._alignment

    @cached_property
    def pairing(self) -> "Pairing":
        """Instant in the free run of each sample of the log."""
        from vftcli.free_motion.paired_runs import pair_with_run

        found = self.alignment
        pairing = pair_with_run(self.log.t, self.run, found.shift, found.rate)
        return pairing._replace(times=np.where(found.overlap, pairing.times, np.nan))


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class FreeMotion(Shown):
    """The free motion of one log; each part is found once, when first asked for."""

    log: Run  #: The log.
    choice: FreeChoice = field(default_factory=FreeChoice)  #: What the user says is free.
    runs: tuple[FreeRun, ...] = ()  #: Free runs in other recordings.

    def __post_init__(self) -> None:
        refuse_repeated_runs(self.log.recording, [run.recording for run in self.runs])

    @property
    def steadied(self) -> "FreeMotion":
        """The motion without samples that stand alone; itself where there are none."""
        log = self.log.steadied
        if log is self.log and all(run.run is run.run.steadied for run in self.runs):
            return self
        runs = tuple(FreeRun(run=run.run.steadied, log=log) for run in self.runs)
        return replace(self, log=log, runs=runs)

    @cached_property
    def period(self) -> "Period":
        """The period of the log's motion."""
        from vftcli.free_motion.cycles import find_period

        return find_period(self.log.recording, self.choice.period)

    @cached_property
    def cycles(self) -> "Cycles":
        """The cycles of the log."""
        from vftcli.free_motion.cycles import segment

        return segment(self.log.recording, self.period)

    @cached_property
    def cycles_given(self) -> tuple[int, ...]:
        """Cycles that you name free, from 0: named, or whole inside a free span."""
        cycles, whole = self.cycles, self.cycles.whole
        for number in self.choice.cycles:
            if not 1 <= number <= whole:
                raise ReferenceTorqueError(
                    f"{self.log.recording.name}: there is no cycle {number}; the log holds {whole} "
                    f"whole cycles of {cycles.period:.4g} s from {cycles.begin:.4g} s on"
                )
        slack, found = SLACK * cycles.period, {number - 1 for number in self.choice.cycles}
        for number in range(whole):
            begin, end = cycles.span(number)
            if any(begin >= a - slack and end <= b + slack for a, b in self.choice.spans):
                found.add(number)
        return tuple(sorted(found))

    @cached_property
    def free_cycles(self) -> "FreeCycles":
        """Free cycles of the log: the user's, else those found."""
        from vftcli.free_motion.cycles import FreeCycles, find_free_cycles

        if self.cycles_given:
            return FreeCycles(self.cycles_given, None)
        return find_free_cycles(self.log, self.cycles)

    @cached_property
    def known(self) -> FreePart:
        """The free part: the given spans and runs, else the free cycles of the log.

        Its remarks are on the log alone: where in a free run the log's motion lies is not asked.
        """
        log, choice = self.log, self.choice
        own, t = self.within_spans, log.t
        remarks = [
            fact("free-span", begin_s=max(a, float(t[0])), end_s=min(b, float(t[-1])))
            for a, b in choice.spans
        ]
        given = choice.is_given or bool(self.runs)
        if choice.cycles or not given:
            found = self.free_cycles
            own = own | np.isin(self.cycles.number(t), found.numbers)
            remarks += found.remarks(self.cycles.whole)[:1]
        pieces = [RunSamples(log, own)] if own.any() else []
        whole = (RunSamples(r.run, np.ones(r.recording.samples, dtype=bool)) for r in self.runs)
        return FreePart((*pieces, *whole), own, tuple(remarks), doubted=not given)

    @cached_property
    def part(self) -> FreePart:
        """The free part, with how each free run lies on the log among its remarks."""
        paired = []
        for run in self.runs:
            about = Where(about=run.recording.name)
            if run.is_same_motion:
                paired.append(fact("free-run", about, shift_s=run.alignment.shift))
            else:
                paired.append(fact("free-run-of-another-motion", about))
        return self.known._replace(remarks=(*self.known.remarks, *paired))

    def unloaded(self, spans: tuple[tuple[float, float], ...]) -> "FreeMotion":
        """The log with its unloaded spans as free motion, where none is given."""
        if self.choice.is_given or not spans:
            return self
        return replace(self, choice=replace(self.choice, spans=spans))

    @property
    def within_spans(self) -> Mask:
        """RunSamples of the log inside the spans that are given as free. (T,)"""
        recording, spans, t = self.log.recording, self.choice.spans, self.log.t
        inside = np.zeros(len(t), dtype=bool)
        for first, last in spans:
            inside |= (t >= first) & (t <= last)
        if spans and (np.count_nonzero(inside) < 2 or inside.all()):
            raise ParameterError(
                f"{recording.name}: the free part {', '.join(interval_text(*s) for s in spans)} "
                f"holds {np.count_nonzero(inside)} of its {recording.samples} samples; it must be "
                f"a part of the log, which runs from {t[0]:g} to {t[-1]:g} s"
            )
        return inside
