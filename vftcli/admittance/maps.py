"""Maps for choosing α and ξ: how soon and how smoothly a release returns, and what is safe."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from vftcli.admittance.law import variable
from vftcli.admittance.metrics import SHARES, overshoot, releases_of, return_time
from vftcli.admittance.motion import release
from vftcli.admittance.parameters import AXES, Admittance
from vftcli.admittance.replay import settling
from vftcli.admittance.stability import judge
from vftcli.signals.arrays import Array
from vftcli.signals.errors import ParameterError


@dataclass(frozen=True, kw_only=True)
class ReleaseMap:
    """A release of one axis for every pair of ξ and α. All arrays are (len(xi), len(alpha)).

    Attributes:
        axis: Name of the axis.
        size: Deviation it is released from. [m, rad]
        alpha: Values of α.
        xi: Values of ξ.
        return_10: Time to stay within 10 %; NaN where it does not. [s]
        return_2: Time to stay within 2 %. [s]
        overshoot: Largest deviation to the other side, as a share.
        number: 2TsB/M + Ts²K/M at the speed limit; stable below 4.
        escape: Deviation from which the law would escape without a speed limit. [m, rad]
    """

    axis: str
    size: float
    alpha: tuple[float, ...]
    xi: tuple[float, ...]
    return_10: Array
    return_2: Array
    overshoot: Array
    number: Array
    escape: Array


def release_map(
    parameters: Admittance, axis: str, size: float, alpha: Sequence[float], xi: Sequence[float]
) -> ReleaseMap:
    """Release one axis from rest at `size` [m, rad] for every pair of ξ and α.

    Args:
        parameters: Everything but α and ξ.
        axis: The axis, of `AXES`.
        size: The deviation.
        alpha: Values of α.
        xi: Values of ξ.

    Raises:
        ParameterError: If the axis is unknown or a value is not positive.
    """
    if axis not in AXES:
        raise ParameterError(f"no axis {axis!r}; there is {', '.join(AXES)}")
    k = AXES.index(axis)
    found = [
        variable(replace(parameters.with_alpha(a), xi=np.full(6, float(z))))
        for z in xi
        for a in alpha
    ]
    x = np.where(np.arange(6) == k, size, 0.0)
    motion = release(found, x, settling(found, x))
    (drag,) = releases_of(x, len(motion.t))
    shape = (len(xi), len(alpha))
    columns = [motion.x[:, n, k] for n in range(len(found))]
    verdicts = [judge(controller) for controller in found]
    share_10, share_2 = SHARES["return_10_s"], SHARES["return_2_s"]

    def grid(values: Sequence[float | None]) -> Array:
        return np.array([np.nan if v is None else v for v in values], dtype=float).reshape(shape)

    return ReleaseMap(
        axis=axis,
        size=size,
        alpha=tuple(alpha),
        xi=tuple(xi),
        return_10=grid([return_time(motion.t, column, drag, share_10) for column in columns]),
        return_2=grid([return_time(motion.t, column, drag, share_2) for column in columns]),
        overshoot=grid([overshoot(column, drag) for column in columns]),
        number=grid([float(verdict.recovery[k]) for verdict in verdicts]),
        escape=grid([float(verdict.escape[k]) for verdict in verdicts]),
    )
