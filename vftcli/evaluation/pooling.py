"""Several logs as one experiment: pooled rows below those of each log."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import polars as pl

from vftcli.evaluation.errors import SCHEMA, Scored, scored, table
from vftcli.evaluation.intervals import Resampled
from vftcli.signals.external_torque import ExternalTorque

POOLED = "pooled"
"""Name of the pooled rows in the column `recording`."""


class ScoredLog(NamedTuple):
    """One log's estimates and what they are judged by.

    Attributes:
        estimates: One an observer.
        reference: On the same clock.
    """

    estimates: Sequence[ExternalTorque]
    reference: ExternalTorque


def evaluate_pooled(runs: Sequence[ScoredLog]) -> pl.DataFrame:
    """Rows over all samples of several logs together, each log resampled on its own.

    Logs of arms with other joint numbers, or run with other observers, are not pooled: the table
    is then empty, as it is for fewer than two logs.
    """
    shapes = {(r.reference.joints, tuple(e.name for e in r.estimates)) for r in runs}
    if len(runs) < 2 or len(shapes) != 1:
        return pl.DataFrame(schema=SCHEMA)
    each = [scored(run.estimates, run.reference) for run in runs]
    references = list(dict.fromkeys(run.reference.name for run in runs))
    return table(
        POOLED, " + ".join(references), [together(joints) for joints in zip(*each, strict=True)]
    )


def pooled_rows(runs: Sequence[ScoredLog]) -> list[pl.DataFrame]:
    """The pooled table as a list, empty where there is nothing to pool."""
    rows = evaluate_pooled(runs)
    return [rows] if len(rows) else []


def together(parts: Sequence[Scored]) -> Scored:
    """One joint's samples of several logs as one series."""
    parts = [p for p in parts if len(p.reference)] or list(parts[:1])
    weight = np.array([len(p.reference) for p in parts], dtype=np.float64)
    share = weight / max(weight.sum(), 1.0)
    draws = sum(w * p.resampled.draws for w, p in zip(share, parts, strict=True))
    lag = np.array([p.lag for p in parts])
    told = np.isfinite(lag) * share[:, None]
    mean_lag = np.nansum(lag * told, axis=0) / np.where(
        told.sum(axis=0) > 0, told.sum(axis=0), np.nan
    )
    return parts[0]._replace(
        estimates=np.concatenate([p.estimates for p in parts]),
        reference=np.concatenate([p.reference for p in parts]),
        trusted=np.concatenate([p.trusted for p in parts]),
        floor=float(np.sqrt(np.sum(share * np.array([p.floor for p in parts]) ** 2))),
        resampled=Resampled(np.asarray(draws), sum(p.resampled.blocks for p in parts)),
        lag=mean_lag,
    )
