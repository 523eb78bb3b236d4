"""Disturbance observers: p and μ along a log in, one estimate of the external torque out."""

from typing import TYPE_CHECKING

from vftcli.signals.packages import door

if TYPE_CHECKING:
    from vftcli.observers.observer import Observer, Tuning
    from vftcli.observers.paper import FilteredDynamicsObserver, KalmanObserver, MomentumObserver
    from vftcli.observers.settings import Settings
    from vftcli.observers.table import (
        BEST,
        DEFAULT,
        OBSERVERS,
        PAPER,
        LogSpectra,
        Setup,
        build_observers,
    )
else:
    __getattr__ = door(__name__, "observer", "paper", "settings", "table")

__all__ = [
    "BEST",
    "DEFAULT",
    "OBSERVERS",
    "PAPER",
    "FilteredDynamicsObserver",
    "KalmanObserver",
    "LogSpectra",
    "MomentumObserver",
    "Observer",
    "Settings",
    "Setup",
    "Tuning",
    "build_observers",
]
