"""Recordings from arrays that a notebook already holds, cleaned like any log that is read."""

from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from vftcli.readers.cleaning import cleaned
from vftcli.readers.reader import RawLog
from vftcli.signals.arrays import number_array
from vftcli.signals.errors import MissingSignalError, ShapeError
from vftcli.signals.names import JOINT_SIGNALS
from vftcli.signals.recording import Recording


def assemble(t: ArrayLike, *, name: str = "arrays", **signals: ArrayLike) -> Recording:
    """Make a Recording of arrays: repeated stamps are dropped and counted, gaps are reported.

    Args:
        t: Stamps, not decreasing. (T,) [s]
        name: What to call the recording in tables.
        signals: Fields of `Recording` by name, at least ``q``: (T, n) in SI units.

    Raises:
        ShapeError: If a signal is no array of numbers with a row for each stamp.
        MissingSignalError: If there is no ``q``, or a name is not a signal of a Recording.
        LogError: If a signal holds NaN or infinity.
        ClockError: If the clock runs backwards.
    """
    known = (*JOINT_SIGNALS, "wrench")
    if unknown := [key for key in signals if key not in known]:
        raise MissingSignalError(f"no signal {unknown[0]!r}; a recording has {', '.join(known)}")
    if "q" not in signals:
        raise MissingSignalError(
            "a recording needs joint positions: give q=… of shape (T, n) [rad]"
        )
    arrays = {key: np.array(number_array(value, key, name)) for key, value in signals.items()}
    for key, value in arrays.items():
        if value.ndim != 2 or len(value) != np.size(t):
            told = f"{key} of {name} has shape {value.shape}"
            raise ShapeError(f"{told}; expected ({np.size(t)}, n), a row for each stamp of t")
    raw = RawLog(
        stamps=np.array(number_array(t, "t", name)), tick=1.0, clock="as given", signals=arrays
    )
    return cleaned(raw, Path(name), "arrays")
