"""Interface of every observer: parameters in, external torque out."""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from vftcli.signals.arrays import Array, seal
from vftcli.signals.external_torque import DynamicsTerms, ExternalTorque
from vftcli.signals.shown import Shown, record

Complex = NDArray[np.complex128]


@record
class Tuning(Shown):
    """Meaning of an observer's parameters, joint by joint."""

    omega_n: Array  #: Natural frequency; for a first-order observer its cutoff. (n,) [rad/s]
    zeta: Array  #: Damping ratio; NaN for a first-order observer. (n,)
    delay: Array  #: Lag behind a slow ramp. (n,) [s]
    bandwidth: Array  #: Frequency at which the gain has fallen by 3 dB. (n,) [Hz]
    dc_gain: Array  #: Gain to a constant torque, 1 where unbiased. (n,)
    parameter_count: int  #: Count of numbers to tune for an n-joint arm.

    def __post_init__(self) -> None:
        seal(self, "omega_n", "zeta", "delay", "bandwidth", "dc_gain")


class Observer(Protocol):
    """A disturbance observer; it knows only (t, p, μ) of robot and log."""

    @property
    def name(self) -> str:
        """Its name at the command line."""

    def estimate(self, terms: DynamicsTerms) -> ExternalTorque:
        """Run over a whole log."""

    def tuning(self, step: float, joints: int) -> Tuning:
        """Meaning of the parameters at a sample time. [s]"""

    def frequency_response(self, frequency: Array, step: float, joints: int) -> Complex:
        """Complex gain from torque to estimate at `frequency` [Hz]. (F, n)"""
