"""A log's free part and spectra, and its observers' input less the bias.

The whole log's bias comes off μ before an observer runs: for `best`, tuned on the spectra
of the rest, and for the others if ``bias.method=whole-log``.
"""

from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from vftcli.bias import RefinementChoice
from vftcli.bias.whole_log import WholeLogBias, whole_log_bias
from vftcli.free_motion.free_motion import FreeLoad, FreeMotion, FreePart, free_load, without_load
from vftcli.observers.observer import Observer
from vftcli.observers.spectra import Spectra, looks_free, spectra_of
from vftcli.observers.table import BEST, LogSpectra
from vftcli.observers.tuning import Goal, tune_all
from vftcli.robots.run import LONG, Run, RunSamples
from vftcli.signals.arrays import Array, Mask
from vftcli.signals.errors import ParameterError, ReferenceTorqueError, VftError
from vftcli.signals.external_torque import ExternalTorque
from vftcli.signals.remarks import Remark, caution, fact

STANDS = 0.5  #: Stiction limits a joint at rest for more than this share.


@dataclass(frozen=True, kw_only=True)
class Baseline:
    """Evidence of a log before any observer runs."""

    motion: FreeMotion  #: The log and its free motion, less samples that stand alone.
    part: FreePart | None = None  #: Its free part, None where there is none.
    #: Of the raw disturbance; None where the free part is short.
    spectra: Spectra | None = None
    #: Why there is no free part, or no spectra; None with both.
    missing: Remark | None = None
    #: A load of the free part that the model lacks, None where none shows.
    load: FreeLoad | None = None
    #: The whole log's bias, off the terms; None if none was fitted.
    correction: WholeLogBias | None = None
    #: Whether the bias's fit found the free part: a lasting load may be in it.
    by_fit: bool = False
    #: Its parts in use or not, and the substitute for a free part.
    on_correction: tuple[Remark, ...] = ()
    _made: dict[Run, Run] = field(init=False, repr=False, compare=False, default_factory=dict)

    def of(self, run: Run) -> Run:
        """The log or a free run as the observers have it, made once."""
        if not self.on_correction:
            return run
        run = run.steadied
        if self.correction is None:
            return run
        if run not in self._made:
            own = run is self.motion.log
            self._made[run] = (self.correction.corrected if own else self.correction.of)(run)
        return self._made[run]

    def spare(self) -> None:
        """Free what the observers ran on, of a long log."""
        if self.motion.log.recording.samples > LONG:
            self._made.clear()

    def measured(self, part: FreePart) -> Spectra:
        """The spectra outside of the free part, and of the free samples."""
        # As the observers have them, less a load, which is no noise.
        free = [
            RunSamples(without_load(self.of(run), self.load), inside)
            for run, inside in part.pieces
        ]
        return spectra_of(RunSamples(self.of(self.motion.log), ~part.own), free)

    @property
    def pieces(self) -> tuple[RunSamples, ...]:
        """The free samples of the log and free runs, if any."""
        return self.part.pieces if self.part is not None else ()

    @property
    def untouched(self) -> tuple[RunSamples, ...]:
        """The pieces in which nothing at all touches the arm."""
        return () if self.by_fit else self.pieces

    @property
    def stuck(self) -> Mask:
        """Joints that stand in most samples, where stiction decides. (n,)"""
        return np.asarray(self.motion.log.standing.mean(axis=0) > STANDS)

    @property
    def remarks(self) -> tuple[Remark, ...]:
        """Findings, and the missing ones with reasons."""
        found = () if self.part is None else self.part.remarks
        load = () if self.load is None else (self.load.remark,)
        missing = () if self.missing is None else (self.missing,)
        return (*found, *load, *missing, *self.on_correction)


def baseline_of(motion: FreeMotion) -> Baseline:
    """Free part and spectra of a log, or why there are none."""
    bare = Baseline(motion=motion)
    try:
        part = motion.part
    except ReferenceTorqueError as error:
        return replace(bare, missing=caution("no-free-part", reason=str(error)))
    known = replace(bare, part=part, load=free_load(part.pieces))
    try:
        spectra = known.measured(part)
    except ParameterError as error:
        return replace(known, missing=caution("no-spectra", reason=str(error)))
    if not part.doubted or looks_free(spectra):
        return replace(known, spectra=spectra)
    residuals = motion.free_cycles.residuals
    listed = np.zeros(0) if residuals is None else residuals[np.isfinite(residuals)]
    return replace(bare, missing=caution("free-part-not-quiet", residuals=listed))


@dataclass(frozen=True, kw_only=True)
class Baselines:
    """Input of a log's observers."""

    plain: Baseline  #: What all but `best` run on.
    #: What `best` runs on: less the whole log's bias, if fitted.
    best: Baseline

    def of(self, name: str) -> Baseline:
        """Input of the observer of this name."""
        return self.best if name == BEST else self.plain

    @property
    def remarks(self) -> tuple[Remark, ...]:
        """Findings, and the missing ones with reasons."""
        apart = () if self.best is self.plain else self.best.on_correction
        return (*self.plain.remarks, *apart)

    def spectra(self, *, gains: bool) -> LogSpectra:
        """Spectra for the observers built for the log."""
        # Not of a fit's free part with a load: 2.8 kg on a UR10e gave the slowest gains.
        plain, best = (
            None if one.by_fit and one.load is not None else one.spectra
            for one in (self.plain, self.best)
        )
        called_for = None
        if gains and plain is not None:
            least = tune_all(plain, Goal("auto"))
            called_for = {line.section: dict(line.gains) for line in least}
        return LogSpectra(plain=plain, best=best, gains=called_for)


class FreeReading(NamedTuple):
    """One observer's reading of a log, and its free samples."""

    observer: Observer  #: The observer.
    estimate: ExternalTorque  #: Its estimate of the log.
    #: Its reading in all free samples, less a load. (S, n) [N·m]
    samples: Array
    resting: Mask  #: Whether a joint rests in them. (S, n)


def free_reading(found: Baseline, observer: Observer, estimate: ExternalTorque) -> FreeReading:
    """An observer's reading of the free pieces."""
    log = found.motion.log
    read, rests = [np.zeros((0, estimate.joints))], [np.zeros((0, estimate.joints), bool)]
    for run, inside in found.pieces:
        tau = estimate.tau if run is log else observer.estimate(found.of(run).terms).tau
        if found.load is not None:
            # A load is torque, and no error of who reads it.
            tau = tau - found.load.torque(run)
        read.append(tau[inside])
        rests.append(run.rests[inside])
    return FreeReading(observer, estimate, np.concatenate(read), np.concatenate(rests))


def find_baselines(motion: FreeMotion, choice: RefinementChoice, *, best: bool) -> Baselines:
    """Input of a log's observers: `best` and, if asked, all less the bias."""
    motion, as_read = motion.steadied, motion.log
    found = baseline_of(motion)
    if choice.bias == "none" or not (best or choice.corrects_all):
        return Baselines(plain=found, best=found)
    try:
        bias = whole_log_bias(motion.log)
    except (VftError, np.linalg.LinAlgError) as error:
        failed = caution("whole-log-bias-failed", reason=str(error))
        found = replace(found, on_correction=(failed,))
        return Baselines(plain=found, best=found)
    if found.spectra is None and bias.fitted:
        # In its place the samples that the fit calls free, if enough.
        share = bias.free.mean()
        remark = fact("free-by-the-fit", share=share)
        if motion.choice.is_given and found.missing is not None:
            # What was given is dropped, and why has to be said.
            reason = found.missing.values["reason"]
            remark = caution("free-by-the-fit-instead", share=share, reason=reason)
        part = FreePart((RunSamples(motion.log, bias.free),), bias.free, (remark,))
        made = replace(found, part=part, load=free_load(part.pieces), by_fit=True, missing=None)
        with suppress(ParameterError):  # never free for long enough
            found = replace(made, spectra=made.measured(part))
    evened = () if motion.log is as_read else motion.log.recording.source.remarks[-1:]
    fitted = bias if bias.fitted else None
    made = replace(found, on_correction=(*evened, *bias.remarks), correction=fitted)
    # Off where the guards of the fit apply any of it.
    if bias.applied.any() and made.part is not None and made.spectra is not None:
        made = replace(made, spectra=made.measured(made.part))
    return Baselines(plain=made if choice.corrects_all else found, best=made)
