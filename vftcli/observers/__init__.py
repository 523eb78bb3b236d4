"""Disturbance observers: p and μ along a log in, one estimate of the external torque out."""

from vftcli.observers.observer import Observer, Tuning
from vftcli.observers.paper import FilteredDynamicsObserver, KalmanObserver, MomentumObserver

__all__ = [
    "FilteredDynamicsObserver",
    "KalmanObserver",
    "MomentumObserver",
    "Observer",
    "Tuning",
]
