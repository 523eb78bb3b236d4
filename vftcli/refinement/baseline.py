"""A log's free part and spectra, and what they make of the observers' estimates."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from vftcli.observers.observer import Observer
from vftcli.observers.spectra import Part, Spectra, spectra_of
from vftcli.repetition.choice import FreeChoice
from vftcli.repetition.free_part import FreePart, find_free_part
from vftcli.repetition.pairing import mean_of
from vftcli.repetition.standstill import at_rest, stops
from vftcli.robots.disturbance import raw_disturbance
from vftcli.robots.robot import Robot
from vftcli.robots.terms import DynamicsTerms, dynamics_terms
from vftcli.signals.arrays import Array, frozen
from vftcli.signals.errors import ParameterError, ReferenceTorqueError
from vftcli.signals.external_torque import ExternalTorque
from vftcli.signals.identity import refuse_repeated_runs
from vftcli.signals.recording import Recording
from vftcli.signals.series import resampled

QUIETER = 0.85
"""A free part that was found is believed if on most joints the loaded part has this share of its
slow power beyond the free one's. Reference runs show 0.96 and more, those that are in contact all
the time 0.82 and less."""

SLOW = 5.0
"""Where contacts are told from noise: below this frequency. [Hz]"""

RESTS = 0.5
"""A joint that rests in more than this share of the samples is limited by stiction."""


@dataclass(frozen=True, kw_only=True)
class Baseline:
    """What a log shows of itself before any observer has run.

    Attributes:
        terms: p and μ of the log.
        part: Its free part, None where there is none.
        run_terms: p and μ of the free runs in other logs.
        spectra: Spectra of the raw disturbance, None where the free part is too short or not free.
        rest: 1 where a joint rests. (T, n)
        notes: What was found, and what was not and why.
    """

    terms: DynamicsTerms
    part: FreePart | None
    run_terms: tuple[DynamicsTerms, ...] = ()
    spectra: Spectra | None = None
    rest: Array
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "rest", frozen(self.rest))

    @property
    def stuck(self) -> Array:
        """1 for a joint that rests in most samples, where stiction decides. (n,)"""
        return np.asarray(self.rest.mean(axis=0) > RESTS, dtype=np.float64)


def survey(
    recording: Recording,
    robot: Robot,
    terms: DynamicsTerms,
    choice: FreeChoice,
    runs: tuple[Recording, ...] = (),
) -> Baseline:
    """Find the free part of a log and its spectra, or say why there are none.

    Raises:
        ReferenceTorqueError: If a free run is the log itself, or two free runs are one.
    """
    refuse_repeated_runs(recording, runs)
    rest = at_rest(recording.t, stops(recording.t, recording.require("dq")))
    try:
        part = find_free_part(recording, robot, choice, runs)
    except ReferenceTorqueError as error:
        why = f"no free part: {error}. State one with --free-part A:B or --free LOG"
        return Baseline(terms=terms, part=None, rest=rest, notes=(why,))
    run_terms = tuple(dynamics_terms(run, robot) for run in part.runs)
    found = Baseline(terms=terms, part=part, run_terms=run_terms, rest=rest, notes=(part.note,))
    try:
        spectra = spectra_of(Part(terms, ~part.inside), free_samples(found))
    except ParameterError as error:
        return replace(found, notes=(part.note, f"no spectra: {error}"))
    if choice.is_given or looks_free(spectra):
        return replace(found, spectra=spectra)
    return Baseline(terms=terms, part=None, rest=rest, notes=(not_free(recording, part),))


def without_free_motion(found: Baseline) -> Spectra | None:
    """Spectra as they are once the free motion at the same phase is subtracted.

    What repeats is gone from both parts. Left in the free one is what does not repeat: the noise
    in S_n, from the log and from the mean of the k free motions, 1 + 1/k of it.
    """
    part, spectra = found.part, found.spectra
    if part is None or spectra is None or not part.pairings:
        return spectra
    terms, clocks = found.terms, {len(x.t): x for x in (*found.run_terms, found.terms)}
    series = [padded(raw_disturbance(clocks[len(p.free.t)])) for p in part.pairings]
    d = padded(raw_disturbance(terms)) - mean_of(part.pairings, series)
    known = np.isfinite(d[:, 0]) & ~part.inside
    step = np.diff(terms.t, prepend=terms.t[0])[:, None]
    p = np.cumsum(step * np.nan_to_num(d), axis=0)
    relieved = Part(DynamicsTerms(t=terms.t, p=p, mu=np.zeros_like(p)), known)
    try:
        loaded = spectra_of(relieved, free_samples(found))
    except ParameterError:
        return spectra
    floor = (1.0 + 1.0 / len(part.pairings)) * spectra.floor
    return replace(loaded, free=resampled(loaded.frequency, spectra.frequency, floor))


def padded(d: Array) -> Array:
    """The raw disturbance with its first sample repeated, so that every sample has one. (T, n)"""
    return np.concatenate([d[:1], d])


def free_samples(found: Baseline) -> list[Part]:
    """The free part's terms and samples, of the log itself or of the free runs."""
    if found.run_terms:
        return [Part(terms, np.ones(terms.samples, dtype=bool)) for terms in found.run_terms]
    inside = found.part.inside if found.part is not None else np.zeros(found.terms.samples, bool)
    return [Part(found.terms, inside)]


def looks_free(spectra: Spectra) -> bool:
    """Whether most joints have clearly less slow power in the free part than in the loaded one."""
    slow = spectra.frequency < SLOW
    power = np.maximum(spectra.loaded[slow].sum(axis=0), np.finfo(float).tiny)
    return bool(np.median(spectra.external[slow].sum(axis=0) / power) > QUIETER)


def not_free(recording: Recording, part: FreePart) -> str:
    """One line on a free part that is not much quieter than the rest."""
    return (
        f"{recording.name}: no free part: the quietest cycle is not much quieter than the rest "
        f"({part.note.removeprefix('free part: ')}), so something touches the arm in all of them, "
        "or in none. State what is free with --free-cycles, --free-part A:B or --free LOG"
    )


def free_estimates(
    found: Baseline, observer: Observer, estimate: ExternalTorque
) -> tuple[ExternalTorque, ...]:
    """What an observer reads in the free runs, or its estimate of the log where that is free."""
    if found.run_terms:
        return tuple(observer.estimate(terms) for terms in found.run_terms)
    return (estimate,)


def free_rms(found: Baseline, estimates: Sequence[ExternalTorque]) -> Array:
    """Root mean square of an estimator's own output on the free part, bias included. (n,) [N·m]"""
    parts = free_samples(found)
    rows = [e.tau[part.inside] for e, part in zip(estimates, parts, strict=True)]
    return np.asarray(np.sqrt(np.nanmean(np.concatenate(rows) ** 2, axis=0)))


def stuck_joints(found: Baseline) -> tuple[str, ...]:
    """The names of the joints that rest, as J5."""
    return tuple(f"J{j + 1}" for j in np.flatnonzero(found.stuck))
