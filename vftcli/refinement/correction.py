"""What observers run on once the bias of the whole log is off, and what `best` is made of.

The bias of the whole log (`vftcli.refinement.whole_log`) comes off μ before an observer runs.
`best` runs on what is left, tuned on the spectra of that; the other observers do where
``--remove-bias whole-log`` asks for it. Nothing here refuses a log: what cannot be done is said,
and `best` is made of what is left.
"""

from dataclasses import replace

import numpy as np

from vftcli.observers.spectra import spectra_of
from vftcli.refinement.baseline import Baseline, Baselines, baseline_of
from vftcli.refinement.choice import RefinementChoice
from vftcli.refinement.whole_log import WholeLogBias, whole_log_bias
from vftcli.repetition.free_load import free_load
from vftcli.repetition.free_motion import FreeMotion, FreePart
from vftcli.robots.run import RunSamples
from vftcli.signals.arrays import Mask
from vftcli.signals.errors import ParameterError, VftError
from vftcli.signals.remarks import caution, fact


def find_baselines(motion: FreeMotion, choice: RefinementChoice, *, best: bool) -> Baselines:
    """What the observers of a log run on: `best` and, where it is asked, all less the bias."""
    motion, as_read = motion.steadied, motion.log
    found = baseline_of(motion)
    if not (choice.corrects_all or (best and choice.corrects_best)):
        return Baselines(plain=found, best=found)
    try:
        bias = whole_log_bias(motion.log)
    except (VftError, np.linalg.LinAlgError) as error:
        failed = caution("whole-log-bias-failed", reason=str(error))
        found = replace(found, on_correction=(failed,))
        return Baselines(plain=found, best=found)
    if found.spectra is None and bias.fitted:
        found = on_quiet_samples(found, bias.free)
    made = corrected(found, bias)
    if motion.log is not as_read:
        evened = motion.log.recording.source.remarks[-1:]
        made = replace(made, on_correction=(*evened, *made.on_correction))
    return Baselines(plain=made if choice.corrects_all else found, best=made)


def on_quiet_samples(found: Baseline, quiet: Mask) -> Baseline:
    """A baseline whose free part is what the fit of the bias takes for free, where that will do.

    Args:
        found: A baseline without spectra.
        quiet: The samples that are taken for free. (T,)
    """
    log = found.motion.log
    share = float(quiet.mean())
    remark = fact("free-by-the-fit", share=share)
    if found.motion.choice.is_given and found.missing is not None:
        # What was given is dropped, and why has to be said.
        reason = found.missing.values["reason"]
        remark = caution("free-by-the-fit-instead", share=share, reason=reason)
    part = FreePart((RunSamples(log, quiet),), quiet, (remark,))
    made = replace(found, part=part, load=free_load(part.pieces), by_fit=True, missing=None)
    try:
        return replace(made, spectra=spectra_of(RunSamples(log, ~quiet), made.samples))
    except ParameterError:  # all of it or nothing is taken for free, or never for long enough
        return found


def corrected(found: Baseline, bias: WholeLogBias) -> Baseline:
    """A baseline with the bias of the whole log off, where its guards apply any of it.

    What its fit says of contact and of slow loads holds also where none of it is applied.
    """
    fitted = bias if bias.fitted else None
    made = replace(found, on_correction=bias.remarks, correction=fitted)
    if not bias.applied.any() or made.part is None or made.spectra is None:
        return made
    return replace(made, spectra=spectra_of(RunSamples(made.log, ~made.part.own), made.samples))
