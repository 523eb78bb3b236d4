"""Disturbance observers: p and μ of a log in, external torque out."""

from vftcli.observers.observer import Observer, Tuning
from vftcli.observers.paper import FilteredDynamicsObserver, KalmanObserver, MomentumObserver

__all__ = [
    "FilteredDynamicsObserver",
    "KalmanObserver",
    "MomentumObserver",
    "Observer",
    "Tuning",
]
