"""Disturbance observers: p and μ of a log in, external torque out."""

from typing import TYPE_CHECKING

from vftcli.signals.packages import door

if TYPE_CHECKING:
    from vftcli.observers.observer import Observer, Tuning
    from vftcli.observers.paper import FilteredDynamicsObserver, KalmanObserver, MomentumObserver
else:
    __getattr__ = door(__name__, "observer", "paper")

__all__ = [
    "FilteredDynamicsObserver",
    "KalmanObserver",
    "MomentumObserver",
    "Observer",
    "Tuning",
]
