"""Several logs as one experiment: pooled rows below those of each log."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import polars as pl

from vftcli.evaluation.errors import SCHEMA, Scored, scored, table
from vftcli.evaluation.intervals import Resampled
from vftcli.signals.arrays import Array
from vftcli.signals.external_torque import ExternalTorque

POOLED = "pooled"  #: Name of the pooled rows in the column `recording`.


class PoolMember(NamedTuple):
    """One log's estimates and what they are judged by."""

    robot: str  #: The arm's name.
    estimates: Sequence[ExternalTorque]  #: One an observer.
    reference: ExternalTorque  #: On the same clock.


def evaluate_pooled(members: Sequence[PoolMember]) -> pl.DataFrame:
    """Rows over all samples of several logs together, each log resampled on its own.

    An error is an arm's: logs of two arms are not pooled, nor those of other observers; the table
    is then empty, as it is for fewer than two logs.
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
    weight = np.array([len(p.reference) for p in parts], dtype=np.float64)
    share = weight / max(weight.sum(), 1.0)
    lag = np.array([p.lag for p in parts])
    # A log in which no lag fits says nothing of it: the others' shares are weighed anew.
    weights = np.isfinite(lag) * share[:, None]
    total = weights.sum(axis=0)
    mean_lag = np.nansum(lag * weights, axis=0) / np.where(total > 0, total, np.nan)
    return parts[0]._replace(
        estimates=np.concatenate([p.estimates for p in parts]),
        missing=np.sum([p.missing for p in parts], axis=0),
        reference=np.concatenate([p.reference for p in parts]),
        moving=np.concatenate([p.moving for p in parts]),
        floor=float(np.sqrt(np.sum(share * np.array([p.floor for p in parts]) ** 2))),
        paired=weighed([p.paired for p in parts], share),
        own=tuple(weighed(each, share) for each in zip(*(p.own for p in parts), strict=True)),
        lag=mean_lag,
        within=np.sum([p.within for p in parts], axis=0),
        banded=np.sum([p.banded for p in parts], axis=0),
    )


def weighed(parts: Sequence[Resampled], share: Array) -> Resampled:
    """Draws of several logs as those of one; each log has a share of the samples. (L,)"""
    draws = sum(w * p.draws for w, p in zip(share, parts, strict=True))
    return Resampled(np.asarray(draws), sum(p.blocks for p in parts))
