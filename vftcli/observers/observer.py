"""Interface of every observer: parameters in, external torque out."""

from abc import abstractmethod
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from vftcli.signals.arrays import Array, handed_over, seal
from vftcli.signals.external_torque import DynamicsTerms, ExternalTorque
from vftcli.signals.parsing import check_kind
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
        """Complex gain from external torque to estimate at `frequency` [Hz]. (F, n)"""


class BlockObserver(Shown):
    """An observer that continues after the last block; a log is one block."""

    @property
    @abstractmethod
    def name(self) -> str:
        """Its name at the command line."""

    @abstractmethod
    def run(self, terms: DynamicsTerms, state: Any = None) -> tuple[ExternalTorque, Any]:  # noqa: ANN401
        """Estimate of a block, and the observer's state after; None at a log's start."""

    def estimate(self, terms: Any) -> ExternalTorque:  # noqa: ANN401 - DynamicsTerms, or a Run
        """The estimate of a whole log, from rest, by its terms or its run."""
        found = getattr(terms, "terms", terms)
        check_kind(found, DynamicsTerms, "run", "Run(recording=…, robot=…)")
        return self.run(found)[0]

    def estimated(self, terms: DynamicsTerms, tau: Array, **more: Any) -> ExternalTorque:  # noqa: ANN401
        """An estimate (T, n) [N·m] under the observer's name, its array handed over."""
        return ExternalTorque(name=self.name, t=terms.t, tau=handed_over(tau), **more)


def angular(frequency: Array) -> Array:
    """ω of frequencies [Hz], nearly zero at 0 Hz, for limits. (F, 1) [rad/s]"""
    omega = 2.0 * np.pi * np.asarray(frequency, float)[:, None]
    return np.where(omega == 0.0, 1e-9, omega)
