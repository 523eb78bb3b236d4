"""Dynamics: from a recording and a robot to (p, μ), all an observer sees."""

from vftcli.dynamics.drive import drive_torque
from vftcli.dynamics.friction import friction_torque
from vftcli.dynamics.kernels import MomentumTerms, momentum_terms
from vftcli.dynamics.terms import DynamicsTerms, dynamics_terms

__all__ = [
    "DynamicsTerms",
    "MomentumTerms",
    "drive_torque",
    "dynamics_terms",
    "friction_torque",
    "momentum_terms",
]
