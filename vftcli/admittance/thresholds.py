"""Which axis is dragged when, and the force that enters the law: threshold modes, hysteresis."""

from typing import NamedTuple

import numpy as np

from vftcli.admittance.parameters import Admittance
from vftcli.signals.arrays import Array, Mask


class Phases(NamedTuple):
    """Algorithm 1's phases along a force record."""

    dragged: Mask  #: Whether each axis is in the drag phase. (T, 6)
    force: Array  #: Force and moment that enter the law, see `entering_force`. (T, 6) [N, N·m]


def phases(wrench: Array, parameters: Admittance) -> Phases:
    """Split a record into drag and recovery phases, axis by axis.

    An axis is dragged from |F_i| > F_tsd,i until |F_i| ≤ (1 − hysteresis) F_tsd,i. An unknown (NaN)
    force counts as none.

    Args:
        wrench: Force and moment on the flange. (T, 6) [N, N·m]
        parameters: Thresholds, hysteresis and mode.
    """
    wrench = np.nan_to_num(wrench, nan=0.0)
    size = np.abs(wrench)
    release = parameters.threshold * (1.0 - np.asarray(parameters.hysteresis))
    dragged = held(size > parameters.threshold, size <= release)
    return Phases(dragged, entering_force(wrench, dragged, parameters))


def entering_force(wrench: Array, dragged: Mask, parameters: Admittance) -> Array:
    """The force that enters (49), by the threshold's mode. (…, 6) [N, N·m]

    "hard" passes the whole force of a dragged axis, "soft" what exceeds its threshold,
    F − F_tsd·sign(F), so that it starts from zero; an axis that recovers has none. "literal" is
    Algorithm 1 as printed: the threshold chooses the parameters, and the whole force always enters.
    """
    if parameters.threshold_mode == "literal":
        return wrench
    soft = parameters.threshold_mode == "soft"
    over = np.abs(wrench) - (parameters.threshold if soft else 0.0)
    return np.where(dragged, np.sign(wrench) * np.maximum(over, 0.0), 0.0)


def held(on: Mask, off: Mask) -> Mask:
    """True from where `on` is until `off` is, False before the first of them. (T, 6)"""
    # The last row at which anything was switched tells the state: no loop over samples.
    rows = np.arange(len(on))[:, None]
    last = np.maximum.accumulate(np.where(on | off, rows, -1), axis=0)
    state = np.take_along_axis(on, np.maximum(last, 0), axis=0)
    return np.where(last >= 0, state, False)
