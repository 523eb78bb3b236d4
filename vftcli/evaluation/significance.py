"""Whether one observer is better than another, or was lucky: paired bootstrap of their errors."""

from collections.abc import Sequence
from itertools import combinations

import numpy as np
import polars as pl

from vftcli.evaluation.intervals import LEVEL, block_lengths, resample
from vftcli.signals.arrays import Array
from vftcli.signals.external_torque import ExternalTorque

#: Columns of the significance table: RMSE of `observer` less that of `other`, 95 % interval, p.
SCHEMA: dict[str, type[pl.DataType]] = {
    "recording": pl.String,
    "joint": pl.Int64,
    "observer": pl.String,
    "other": pl.String,
    "difference_Nm": pl.Float64,
    "low_Nm": pl.Float64,
    "high_Nm": pl.Float64,
    "p": pl.Float64,
}
SAME = 1e-9  #: RMSEs that differ by less than this share are the same number twice.


def paired_significance(
    recording: str, estimates: Sequence[ExternalTorque], reference: ExternalTorque
) -> pl.DataFrame:
    """Every pair of observers on every joint: difference of RMSE, its interval, and p.

    Both observers' errors are resampled in the same blocks, so that what they share (contacts,
    the reference's own error) cancels. A sample without an answer counts as the answer 0.
    """
    rows = []
    for j in range(reference.joints):
        known = np.isfinite(reference.tau[:, j])
        answers = np.column_stack([e.tau[known, j] for e in estimates])
        answers[~np.isfinite(answers)] = 0.0
        errors = answers - reference.tau[known, j, None]
        if len(errors) < 2:
            continue
        squares = errors**2
        draws = np.sqrt(resample(squares, int(block_lengths(squares).max())).draws)
        observed = np.sqrt(np.mean(errors**2, axis=0))
        for a, b in combinations(range(len(estimates)), 2):
            difference = draws[:, a] - draws[:, b]
            low, high = np.quantile(difference, [0.5 - 0.5 * LEVEL, 0.5 + 0.5 * LEVEL])
            rows.append(
                {
                    "recording": recording,
                    "joint": j + 1,
                    "observer": estimates[a].name,
                    "other": estimates[b].name,
                    "difference_Nm": float(observed[a] - observed[b]),
                    "low_Nm": float(low),
                    "high_Nm": float(high),
                    "p": p_value(draws[:, a], draws[:, b]),
                }
            )
    return pl.DataFrame(rows, schema=SCHEMA)


def p_value(first: Array, second: Array) -> float:
    """Two-sided p that two mean squares differ by chance, from paired draws.

    At least one over the number of draws; 1 where both are the same number.
    """
    size = max(float(np.mean(np.abs(first))), float(np.mean(np.abs(second))), 1e-300)
    if np.max(np.abs(first - second)) <= SAME * size:
        return 1.0
    above = float(np.mean(first > second))
    return float(np.clip(2.0 * min(above, 1.0 - above), 1.0 / len(first), 1.0))
