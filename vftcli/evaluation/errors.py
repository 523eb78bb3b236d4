"""Errors of estimates against a reference: one table, units in the columns' names.

Several logs of one arm are one experiment, with pooled rows below each log's. A log has
one mean over the joints with a trusted reference.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import polars as pl

from vftcli.evaluation.intervals import Resampled, block_lengths, interval, resample
from vftcli.evaluation.scores import skill
from vftcli.signals.arrays import (
    Z_95,
    Array,
    Mask,
    median_step,
    number_array,
    rms_of_known,
    root_mean_square,
)
from vftcli.signals.errors import ParameterError, ShapeError
from vftcli.signals.external_torque import ExternalTorque
from vftcli.signals.lag import lags_of_each
from vftcli.signals.parsing import check_kind
from vftcli.signals.progress import steps

Schema = dict[str, type[pl.DataType]]  #: Column of a table → its type.
#: Columns of the errors table; `joint` counts from 1, `at_rest` is a share of the samples.
#:
#: `coverage_95` is the share of samples within the estimate's 95 % band, if it has one;
#: `missing` the share without an answer, which counts as the answer 0, so that failures
#: show. `l1_Nm` is the mean |error|; `skill` is 1 less the RMSE over the reference's rms:
#: 1 for the reference itself, 0 for an estimate of zero.
SCHEMA: Schema = {
    "recording": pl.String,
    "observer": pl.String,
    "joint": pl.Int64,
    "rmse_Nm": pl.Float64,
    "rmse_low_Nm": pl.Float64,
    "rmse_high_Nm": pl.Float64,
    "bias_Nm": pl.Float64,
    "max_Nm": pl.Float64,
    "l1_Nm": pl.Float64,
    "skill": pl.Float64,
    "reference_rms_Nm": pl.Float64,
    "correlation": pl.Float64,
    "lag_s": pl.Float64,
    "reference": pl.String,
    "reference_floor_Nm": pl.Float64,
    "reference_trusted": pl.Boolean,
    "at_rest": pl.Float64,
    "rmse_moving_Nm": pl.Float64,
    "coverage_95": pl.Float64,
    "missing": pl.Float64,
    "samples": pl.Int64,
}

#: Share of trusted samples from which a joint's reference is trusted.
TRUSTED_SHARE = 0.5
#: Fewest samples of a coverage: fewer give ±30 % only.
LEAST = 10
POOLED = "pooled"  #: Name of the pooled rows in the column `recording`.


def rmse(estimate: Array, reference: Array) -> Array:
    """Root-mean-square error per joint over the samples where both are finite. (n,)

    Raises:
        ShapeError: If the two have different shapes, or are no arrays of numbers.
    """
    estimate = number_array(estimate, "the estimate", "the error")
    reference = number_array(reference, "the reference", "the error")
    if estimate.shape != reference.shape:
        raise ShapeError(f"estimate {estimate.shape} against reference {reference.shape}")
    return rms_of_known(estimate - reference)


def correlation(x: Array, y: Array) -> float:
    """Pearson's correlation of two series, NaN if one is constant."""
    x, y = x - x.mean(), y - y.mean()
    power = float(np.sqrt(np.sum(x**2) * np.sum(y**2)))
    return float(np.sum(x * y)) / power if power > 0 else float("nan")


class Scored(NamedTuple):
    """Estimates of one joint beside a reference, over its known samples."""

    names: tuple[str, ...]  #: The observers' names.
    joint: int  #: Joint number, from 1.
    estimates: Array  #: One column an observer, 0 where it has no answer. (T, m) [N·m]
    missing: Array  #: Samples of each observer without an answer. (m,)
    reference: Array  #: (T,) [N·m]
    moving: Mask  #: Whether the joint moves: then the reference is reliable. (T,)
    floor: float  #: The reference's own error, NaN if unknown. [N·m]
    #: Bootstrap draws of each observer's mean squared error.
    own: tuple[Resampled, ...]
    lag: Array  #: Best-fitting delay of each observer, NaN where nothing fits. (m,) [s]
    within: Array  #: Samples with an error within each observer's 95 % band. (m,)
    #: Samples with a band in which the joint moves. (m,)
    banded: Array

    @property
    def error(self) -> Array:
        """Estimate less reference. (T, m) [N·m]"""
        return self.estimates - self.reference[:, None]


def evaluate(
    recording: str, estimates: Iterable[ExternalTorque], reference: ExternalTorque
) -> pl.DataFrame:
    """One row per observer and joint, over the samples where the reference is known.

    A sample without an answer counts as the answer 0. All are on the reference's clock;
    its `floor` is beside every error, the log's name in the first column.

    Raises:
        ShapeError: If an estimate and the reference have different shapes.
        ParameterError: If one of them is something else.
    """
    check_kind(recording, str, "the recording", "recording.name")
    if not isinstance(estimates, Iterable):
        raise ParameterError("the estimates are one thing; expected a list of ExternalTorque")
    estimates = tuple(estimates)
    for torque in (*estimates, reference):
        check_kind(torque, ExternalTorque, "a torque", "observer.estimate(terms)")
    return table(recording, reference.name, scored(estimates, reference))


def scored(estimates: Sequence[ExternalTorque], reference: ExternalTorque) -> Iterator[Scored]:
    """Estimates and reference joint by joint, resampled, with their lags."""
    for estimate in estimates:
        if estimate.tau.shape != reference.tau.shape:
            raise ShapeError(
                f"estimate {estimate.tau.shape} against reference {reference.tau.shape}"
            )
    names = tuple(estimate.name for estimate in estimates)
    step = median_step(reference.t) if len(reference.t) > 1 else 1.0
    lag = lags_of_each([e.tau for e in estimates], reference.tau, step)
    covered = np.array([covered_samples(e, reference) for e in estimates])
    moving = reference.moving if reference.moving is not None else reference.known
    for j in steps(range(reference.joints if estimates else 0)):
        y = reference.tau[:, j]
        known = np.isfinite(y)
        x = np.column_stack([e.tau[known, j] for e in estimates])
        y, answered = y[known], np.isfinite(x)
        x[~answered] = 0.0
        squares = x - y[:, None]
        squares *= squares
        lengths = block_lengths(squares).tolist() if len(squares) else []
        own = tuple(resample(x[:, None], n) for x, n in zip(squares.T, lengths, strict=False))
        floor = float("nan") if reference.floor is None else float(reference.floor[j])
        if reference.floor is not None and reference.sd is not None and known.any():
            floor = float(np.sqrt(np.nanmean(reference.sd[known, j] ** 2)))
        yield Scored(
            names=names,
            joint=j + 1,
            estimates=x,
            missing=np.count_nonzero(~answered, axis=0).astype(float),
            reference=y,
            moving=moving[known, j],
            floor=floor,
            own=own or (Resampled(np.ones((1, 1)), 0),) * len(names),
            lag=lag[:, j],
            within=covered[:, 0, j],
            banded=covered[:, 1, j],
        )


def covered_samples(estimate: ExternalTorque, reference: ExternalTorque) -> Array:
    """Samples within ±1.96 `error_sd` of the estimate, and all judged. (2, n)

    None counts at rest or without a band; one without an answer is in no band.
    """
    if estimate.error_sd is None:
        return np.zeros((2, estimate.joints))
    counted = np.isfinite(reference.tau)
    for torque in (estimate, reference):
        if torque.moving is not None:
            counted &= torque.moving
    within = abs(estimate.tau - reference.tau) <= Z_95 * estimate.error_sd
    return np.array([np.count_nonzero(x, axis=0) for x in (counted & within, counted)], float)


def table(recording: str, reference: str, joints: Iterable[Scored]) -> pl.DataFrame:
    """The tidy table of scored joints, observer by observer."""
    # Joint by joint: all of a long log do not fit at once.
    of_joints = [rows(recording, reference, joint) for joint in joints]
    return tidy([line for observer in zip(*of_joints, strict=True) for line in observer], SCHEMA)


def tidy(rows: Sequence[Mapping[str, object]], schema: Schema) -> pl.DataFrame:
    """A table of rows, null for numbers that are not finite, as JSON needs."""
    number = pl.col(pl.Float64)
    return pl.DataFrame(rows, schema).with_columns(pl.when(number.is_finite()).then(number))


def rows(recording: str, reference: str, joint: Scored) -> list[dict[str, object]]:
    """One row an observer on one joint."""
    error, lines = joint.error, list[dict[str, object]]()
    share = joint.moving.mean() if len(error) else 0.0
    for k, name in enumerate(joint.names):
        here: dict[str, object] = {
            "recording": recording,
            "observer": name,
            "joint": joint.joint,
            "reference": reference,
            "reference_floor_Nm": joint.floor,
            "samples": len(joint.reference),
        }
        if len(error):
            x, draws = np.ascontiguousarray(error[:, k]), joint.own[k]
            square, moving = float(np.mean(x**2)), x[joint.moving]
            rmse, level = np.sqrt(square), root_mean_square(joint.reference)
            low, high = interval(square, draws.draws[:, 0], draws.blocks)
            here |= {
                "rmse_Nm": rmse,
                "rmse_low_Nm": low,
                "rmse_high_Nm": high,
                "bias_Nm": x.mean(),
                "max_Nm": abs(x).max(),
                "l1_Nm": abs(x).mean(),
                "skill": skill(rmse, level),
                "reference_rms_Nm": level,
                "correlation": correlation(joint.estimates[:, k], joint.reference),
                "lag_s": joint.lag[k],
                "reference_trusted": share >= TRUSTED_SHARE,
                "at_rest": 1.0 - share,
                "missing": joint.missing[k] / len(x),
            }
            if len(moving):
                here["rmse_moving_Nm"] = root_mean_square(moving)
            if joint.banded[k] >= LEAST:
                here["coverage_95"] = joint.within[k] / joint.banded[k]
        lines.append(here)
    return lines


class PoolMember(NamedTuple):
    """One log's estimates and their reference."""

    robot: str  #: The arm's name.
    estimates: Sequence[ExternalTorque]  #: One an observer.
    reference: ExternalTorque  #: On the estimate's clock.


def evaluate_pooled(members: Sequence[PoolMember]) -> pl.DataFrame:
    """Rows over all samples of several logs together, each log resampled on its own.

    The table is empty for logs of two arms or of other observers, or fewer than two.
    """
    kinds = {(m.robot, m.reference.joints, tuple(e.name for e in m.estimates)) for m in members}
    if len(members) < 2 or len(kinds) != 1:
        return pl.DataFrame(schema=SCHEMA)
    each = [list(scored(member.estimates, member.reference)) for member in members]
    references = list(dict.fromkeys(member.reference.name for member in members))
    return table(
        POOLED, " + ".join(references), [together(joints) for joints in zip(*each, strict=True)]
    )


def together(parts: Sequence[Scored]) -> Scored:
    """One joint's samples of several logs as one series."""
    parts = [p for p in parts if len(p.reference)] or list(parts[:1])
    weight = np.array([len(p.reference) for p in parts], float)
    share = weight / max(weight.sum(), 1.0)
    lag = np.array([p.lag for p in parts])
    # A log without a fitting lag counts for nothing; the others' shares are renormalised.
    weights = np.isfinite(lag) * share[:, None]
    total = weights.sum(axis=0)
    mean_lag = np.nansum(lag * weights, axis=0) / np.where(total > 0, total, np.nan)
    joined: dict[str, Any] = {
        name: np.concatenate([getattr(p, name) for p in parts])
        for name in ("estimates", "reference", "moving")
    }
    counts: dict[str, Any] = {
        name: np.sum([getattr(p, name) for p in parts], axis=0)
        for name in ("missing", "within", "banded")
    }
    return parts[0]._replace(
        **joined,
        **counts,
        floor=float(np.sqrt(np.sum(share * np.array([p.floor for p in parts]) ** 2))),
        own=tuple(weighed(each, share) for each in zip(*(p.own for p in parts), strict=True)),
        lag=mean_lag,
    )


def weighed(parts: Sequence[Resampled], share: Array) -> Resampled:
    """Draws of several logs as one's, by shares of the samples. (L,)"""
    draws = sum(w * p.draws for w, p in zip(share, parts, strict=True))
    return Resampled(np.asarray(draws), sum(p.blocks for p in parts))


class JointMeans(NamedTuple):
    """Means over the joints of one log."""

    #: Observer → mean RMSE of the known ones, in the table's order. [N·m]
    errors: dict[str, float]
    floor: float  #: Mean of the reference's own error, NaN if unknown. [N·m]
    #: Joints that are left out for want of a trusted reference.
    without: tuple[int, ...]
    #: Observer → mean |error| [N·m], and its gain over zero, if known.
    l1: Mapping[str, float] = {}
    skill: Mapping[str, float] = {}

    @property
    def least(self) -> tuple[str, float] | None:
        """The observer with the smallest mean and that mean, None without any. [N·m]"""
        return min(self.errors.items(), key=lambda item: item[1], default=None)

    @property
    def left_out(self) -> str:
        """The joints left out, as " without J5"; "" for none."""
        return f" without {', '.join(f'J{j}' for j in self.without)}" if self.without else ""


def joint_means(errors: pl.DataFrame) -> JointMeans:
    """The mean RMSE of every observer over trusted joints, over all if none is."""
    rows = errors.filter(pl.col("joint").is_not_null())
    trusted = pl.col("reference_trusted").fill_null(value=True)
    doubted = set(rows.filter(~trusted)["joint"])
    without = tuple(sorted(doubted)) if set(rows["joint"]) - doubted else ()
    used = rows.filter(~pl.col("joint").is_in(without))
    floor = (
        used.unique("joint").select(pl.col("reference_floor_Nm").cast(pl.Float64).mean()).item()
    )
    known = used.filter(pl.col("rmse_Nm").is_finite()).group_by("observer", maintain_order=True)
    found, l1, skills = {}, {}, {}
    for name, rmse, size, level in known.agg(
        pl.col("rmse_Nm", "l1_Nm", "reference_rms_Nm").mean()
    ).iter_rows():
        found[name] = rmse
        if size is not None:
            l1[name], skills[name] = size, skill(rmse, level)
    return JointMeans(found, float("nan") if floor is None else floor, without, l1, skills)
