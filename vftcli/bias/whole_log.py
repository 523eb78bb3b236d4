"""The model's bias from the whole log: a torque in every repeat is no contact.

No free part is needed. The model's error δx is fitted to the raw disturbance d = τ_ext −
A δx of all of the log, with contacts rejected and slow external loads left in; where it
predicts unseen motion, b = A δx is subtracted, μ ← μ − b, before any observer.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from vftcli.bias.model_error import (
    CUTOFF,
    ModelError,
    SmoothMotion,
    error_columns,
    error_of,
    expected_error,
    friction_alone,
    smooth_motion,
    usual_friction,
    without_waits,
)
from vftcli.bias.robust_fit import (
    FEWEST,
    Guarded,
    Rows,
    WholeLogFit,
    faded,
    fit_robustly,
    guarded,
    slow_loads,
)
from vftcli.robots.run import Run
from vftcli.signals.arrays import (
    Array,
    Mask,
    handed_over,
    median_step,
    resample_columns,
    root_mean_squares,
    seal,
)
from vftcli.signals.external_torque import DynamicsTerms
from vftcli.signals.filters import derivative, zero_phase
from vftcli.signals.remarks import Remark, caution, fact, on_joints
from vftcli.signals.rest import faster

#: Least motion, first to last: in less, friction alone is fitted. [s]
LEAST_MOTION = 10.0
#: Less motion tells nothing: ten times `CORRELATED`. [s]
LEAST_FRICTION = 3.0
#: An arm that moves a smaller share, and below `LEAST_MOTION`, is held.
LEAST_SHARE = 0.1
#: Up to so many times the error of friction that is expected, rms over a short log, its
#: fit is used in full, … Pieces of 5 s of UR10e logs reach 1.2 on their worst joint. [1]
USUAL = 1.1
#: … and from so many times on not at all: a hand leads the arm. With a hand of 20 N along
#: the flange's path the worst joint reads 1.2 to 2.5. [1]
LED = 1.4
#: A joint's friction is corrected in full with so much error left …
CLEAR = 0.45
#: … and not at all with so much: 5 s of a UR10e leave .3 to .9; led .4 to .9. [1]
UNCLEAR = 0.6
RATE = 30.0  #: Samples a second that are fitted, …
LONG = 60.0  #: … up to a log of this length [s], …
LONG_RATE = 10.0  #: … and in a longer one.
MOST_SAMPLES = 36_000  #: Samples that are fitted at most: an hour's.


@dataclass(frozen=True, kw_only=True)
class WholeLogBias:
    """The model's bias along a log."""

    #: Share of the model's error that a joint loses. (n,)
    weight: Array
    bias: Array  #: Subtracted torque, zero on joints left alone. (T, n) [N·m]
    #: Deviation of the model's error as fitted, and of a part of it where that is
    #: subtracted: all or nothing, by chance. (T, n) [N·m]
    sd: Array
    #: Samples that the fit calls free, all without a fit. (T,)
    free: Mask
    #: τ_ext of the fit's slow loads, kept in estimates, at `fitted_times`. (S, n) [N·m]
    load: Array
    remarks: tuple[Remark, ...]  #: What was applied, or why not.
    fitted: bool = True  #: Whether there was a fit; else `free` and `load` say nothing.
    #: The model's error on all joints, None without a fit.
    error: ModelError | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        seal(self, "weight", "bias", "sd", "load")
        seal(self, "free", kind=bool)

    @property
    def applied(self) -> Mask:
        """Joints on which the correction is used. (n,)"""
        return self.weight > 0.0

    def corrected(self, log: Run) -> Run:
        """The log itself without the bias, μ ← μ − b."""
        return log.less(-self.bias) if self.applied.any() else log

    def of(self, other: Run) -> Run:
        """Another run of the arm without this model error."""
        if self.error is None or not self.applied.any():
            return other
        return other.less(-self.weight * self.error.torque(other, smooth_motion(other.coarse)))


def whole_log_bias(run: Run) -> WholeLogBias:
    """The model's bias along a log, where it predicts unseen samples."""
    run = run.steadied
    terms, coarse = run.terms, run.coarse
    span, refused = motion_of(coarse)
    if refused:
        return untouched(terms, refused)
    expected = (expected_error if span >= LEAST_MOTION else friction_alone)(run.robot)
    # What no arm does overflows, and is refused.
    with np.errstate(all="ignore"):
        try:
            motion = smooth_motion(coarse)
            t, stride = motion.t, stride_of(motion.t)
            d = zero_phase(t, derivative(t, coarse.terms.p) - coarse.terms.mu, CUTOFF)
            loads = slow_loads(run.robot.loaded_chain, t[::stride], motion.q[::stride])
            columns = error_columns(coarse, motion, expected, stride)
            moves = np.any(faster(motion.dq[::stride]), axis=1)
            rows = Rows(columns=columns, loads=loads, d=d[::stride], moves=moves)
            fit = fit_robustly(rows, stride * median_step(t), usual_friction(run.robot)[0])
            tried = guarded(fit, motion.dq[::stride])
            if span < LEAST_MOTION:
                if tried.solution is not None:
                    # A leading hand looks like less friction, of another size.
                    torque = np.mean(fit.rows.modelled(tried.solution.model) ** 2, axis=0)
                    usual = np.array([np.sum(c**2, axis=1).mean() for c in columns])
                    worst = np.sqrt(torque / np.maximum(usual, np.finfo(float).tiny)).max()
                    clear = faded(tried.share, CLEAR, UNCLEAR)
                    tried = tried._replace(weight=faded(worst, USUAL, LED) * clear)
                if not tried.weight.any():
                    return untouched(terms, caution("whole-log-friction-unclear", motion_s=span))
            found = bias_of(run, motion, expected, fit, tried, stride)
        except np.linalg.LinAlgError:
            return untouched(terms, caution("whole-log-without-solution"))
    if not (np.isfinite(found.bias).all() and np.isfinite(found.sd).all()):
        return untouched(terms, caution("whole-log-without-solution"))
    if span >= LEAST_MOTION:
        return found
    shorter = fact("whole-log-friction-alone", motion_s=span, least_s=LEAST_MOTION)
    return replace(found, remarks=(shorter, *found.remarks))


def motion_of(run: Run) -> tuple[float, Remark | None]:
    """Length of a log's motion [s], and a remark if it shows no error."""
    t, dq = without_waits(run.t), run.dq
    duration = t[-1] - t[0]
    if duration < LEAST_FRICTION:
        short = caution("whole-log-too-short", duration_s=duration, least_s=LEAST_FRICTION)
        return duration, short
    if len(t) < FEWEST:
        return duration, caution("whole-log-without-solution")
    # noise is no motion
    moves = faster(zero_phase(t, dq, CUTOFF)).any(axis=1)
    moving = np.count_nonzero(moves) * median_step(t)
    span = np.ptp(t[moves]) if moves.any() else 0.0
    share = moving / duration
    if not moves.any() or (moving < LEAST_MOTION <= span and share < LEAST_SHARE):
        return span, caution("whole-log-at-rest", motion_s=moving, share=share)
    if span < LEAST_FRICTION:
        little = caution("whole-log-little-motion", motion_s=span, least_s=LEAST_FRICTION)
        return span, little
    return span, None


def fitted_times(run: Run) -> Array:
    """Times of the coarse run that are fitted. (S,) [s]"""
    t = run.coarse.t
    return t[:: stride_of(without_waits(t))]


def stride_of(t: Array) -> int:
    """Every how many samples are fitted."""
    rate = RATE if t[-1] - t[0] <= LONG else LONG_RATE
    return max(1, int(1.0 / (rate * median_step(t)) + 1e-9), -(-len(t) // MOST_SAMPLES))


def untouched(terms: DynamicsTerms, why: Remark) -> WholeLogBias:
    """No correction, and why."""
    none = handed_over(np.broadcast_to(0.0, terms.p.shape))
    return WholeLogBias(
        weight=np.zeros(terms.joints),
        bias=none,
        sd=none,
        free=np.ones(terms.samples, bool),
        load=none,
        remarks=(why,),
        fitted=False,
    )


def bias_of(
    run: Run,
    motion: SmoothMotion,
    expected: ModelError,
    fit: WholeLogFit,
    found: Guarded,
    stride: int,
) -> WholeLogBias:
    """The bias on the log's own clock, with its uncertainty and remarks."""
    n, half = run.robot.joints, stride // 2
    nearest = (np.arange(len(run.t)) // run.blocked + half) // stride
    free = fit.free[np.minimum(nearest, len(fit.free) - 1)]
    load = -fit.rows.loads.torque_of(found.loads)
    if found.solution is None:
        said = remarks_of(found, np.zeros(n), fit.free.mean())
        bare = untouched(run.terms, said[0])
        return replace(bare, free=free, load=load, remarks=said, fitted=True)
    error = error_of(expected.values * found.solution.model, n)
    whole = error.torque(run, motion)
    bias = found.weight * whole
    spread = fit.rows.spread(found.solution.covariance)
    spread = resample_columns(run.t, fitted_times(run), spread)
    # all of it with this probability, else nothing: w(1 − w) of its square
    undecided = np.sqrt(found.weight * (1.0 - found.weight)) * whole
    return WholeLogBias(
        weight=found.weight,
        bias=handed_over(bias),
        sd=handed_over(np.hypot(spread, undecided)),
        free=free,
        load=load,
        remarks=remarks_of(found, root_mean_squares(bias), fit.free.mean()),
        error=error,
    )


def remarks_of(found: Guarded, changed: Array, free_share: float) -> tuple[Remark, ...]:
    """Joints corrected, by how much (n,) [N·m] rms, and those left alone."""
    on, share = found.weight > 0.0, found.share
    values = {"changed_Nm": changed[on], "free_share": free_share}
    applied = fact("whole-log-applied", on_joints(on), unseen_share=share[on], **values)
    left = fact("whole-log-left-alone", on_joints(~on), unseen_share=share[~on])
    return tuple(remark for remark in (applied, left) if remark.where.joints)
