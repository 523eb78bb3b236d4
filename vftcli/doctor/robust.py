"""Least squares over windows that sets contact aside, with terms that cannot be negative.

The normal equations of every window are made once; a round of trimming then only adds up those of
the windows that are kept.
"""

from typing import NamedTuple

import numpy as np

from vftcli.signals.arrays import Array, Mask
from vftcli.signals.least_squares import inverse_of

KEPT = 0.7  #: Share of the windows that a fit is made from and judged by: the rest may be contact.
ROUNDS = 4  #: Rounds of fitting and trimming; the kept windows no longer change by then.
OVERLAP = 2.0  #: Windows that overlap by half count half.


class Terms(NamedTuple):
    """Torques that may explain another one, column by column."""

    columns: Array  #: Torque per unit of each coefficient. (W, n, k)
    positive: Mask  #: Coefficients that only make sense above zero, as friction's do. (k,)
    prior: Array  #: Standard deviation that a coefficient has before any data; inf for none. (k,)

    def beside(self, other: "Terms") -> "Terms":
        """These terms and others."""
        return Terms(
            np.concatenate([self.columns, other.columns], axis=2),
            np.append(self.positive, other.positive),
            np.append(self.prior, other.prior),
        )


def terms(columns: Array, *, positive: bool = False, prior: Array | float = np.inf) -> Terms:
    """Terms that are all alike."""
    count = columns.shape[2]
    return Terms(columns, np.full(count, positive), np.full(count, prior))


class RobustFit(NamedTuple):
    """A fit."""

    values: Array  #: Coefficients. (k,)
    sd: Array  #: Their standard deviations by the scatter of the kept windows. (k,)
    rest: Array  #: Torque left over in all windows. (W, n) [N·m]
    kept: Mask  #: Windows that the fit was made from. (W,)

    @property
    def size(self) -> float:
        """Root mean square of the torque left over in the kept windows. [N·m]"""
        return float(np.sqrt(np.mean(self.rest[self.kept] ** 2)))

    @property
    def by_joint(self) -> Array:
        """That of each joint. (n,) [N·m]"""
        size: Array = np.sqrt(np.mean(self.rest[self.kept] ** 2, axis=0))
        return size


def solve(target: Array, by: Terms) -> RobustFit:
    """Fit of a torque by some terms, the windows that fit worst left out.

    Args:
        target: The torque. (W, n) [N·m]
        by: The terms; their priors weigh beside a scatter of 1 N·m.
    """
    columns = by.columns
    across = columns.swapaxes(1, 2)
    gram, moment = across @ columns, (across @ target[:, :, None])[:, :, 0]
    used = np.abs(columns).max(axis=(0, 1), initial=0.0) > 1e-9
    kept = np.ones(len(target), dtype=bool)

    def inverse() -> Array:
        return inverse_of((gram[kept].sum(axis=0) + np.diag(by.prior**-2))[np.ix_(used, used)])

    for _ in range(ROUNDS):
        values = np.zeros(len(used))
        values[used] = inverse() @ moment[kept].sum(axis=0)[used]
        # Friction that would drive the arm is another error in disguise: it is left out.
        wrong = by.positive & (values < 0)
        used &= ~wrong
        values[wrong] = 0.0
        rest = target - columns @ values
        left = np.einsum("wn,wn->w", rest, rest)
        kept = left <= np.quantile(left, KEPT)
    sd = np.zeros(len(used))
    sd[used] = np.sqrt(np.diag(inverse()) * OVERLAP * np.mean(rest[kept] ** 2))
    return RobustFit(values, sd, rest, kept)
