"""Interface of every observer: parameters in, external torque out."""

from abc import abstractmethod
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vftcli.signals.arrays import Array, frozen, handed_over, number_array, seal
from vftcli.signals.errors import ShapeError
from vftcli.signals.external_torque import DynamicsTerms, ExternalTorque, HasTerms
from vftcli.signals.parsing import check_kind
from vftcli.signals.shown import Shown

Complex = NDArray[np.complex128]

LEAD = 60.0  #: Assumed rest of the arm before a log, in 1/ω_n of the slowest joint.
LONGEST = 1 << 17  #: Samples of that time at most.
SETTLED = 0.01  #: Share of its start that an estimate has forgotten once it counts as settled.


@dataclass(frozen=True, kw_only=True, repr=False)
class Tuning(Shown):
    """Meaning of an observer's parameters, joint by joint."""

    omega_n: Array  #: Natural frequency; for a first-order observer its cutoff. (n,) [rad/s]
    zeta: Array  #: Damping ratio; NaN for a first-order observer. (n,)
    delay: Array  #: Lag behind a slow ramp. (n,) [s]
    bandwidth: Array  #: Frequency at which the gain has fallen by 3 dB. (n,) [Hz]
    dc_gain: Array  #: Gain to a constant torque, 1 where unbiased. (n,)
    parameter_count: int  #: How many numbers there are to tune for an n-joint arm.

    def __post_init__(self) -> None:
        seal(self, "omega_n", "zeta", "delay", "bandwidth", "dc_gain")


class Observer(Protocol):
    """A disturbance observer; it knows only (t, p, μ) of robot and log."""

    @property
    def name(self) -> str:
        """Its name at the command line."""
        ...

    def estimate(self, terms: DynamicsTerms) -> ExternalTorque:
        """Run over a whole log."""
        ...

    def tuning(self, step: float, joints: int) -> Tuning:
        """Meaning of the parameters at a sample time. [s]"""
        ...

    def frequency_response(self, frequency: Array, step: float, joints: int) -> Complex:
        """Complex gain from external torque to estimate at `frequency` [Hz]. (F, n)"""
        ...


class BlockObserver(Shown):
    """An observer that continues after the last block; a log is one block."""

    @property
    @abstractmethod
    def name(self) -> str:
        """Its name at the command line."""

    @abstractmethod
    def run(self, terms: DynamicsTerms, state: Any = None) -> tuple[ExternalTorque, Any]:  # noqa: ANN401
        """Estimate of a block, and the observer's state after; None at a log's start."""

    def estimate(self, terms: DynamicsTerms | HasTerms) -> ExternalTorque:
        """The estimate of a whole log, from rest at its first sample, by its run or its terms."""
        found: Any = getattr(terms, "terms", terms)
        return self.run(found)[0]

    def estimated(self, terms: DynamicsTerms, tau: Array, **more: Any) -> ExternalTorque:  # noqa: ANN401
        """An estimate (T, n) [N·m] under the observer's name, its array for good."""
        return ExternalTorque(name=self.name, t=terms.t, tau=handed_over(tau), **more)


def per_joint(value: Array | float, joints: int) -> Array:
    """One number a joint from one number or one a joint. (n,)"""
    found = np.asarray(value, dtype=np.float64)
    if found.size != 1 and found.shape != (joints,):
        words = f"an observer's parameter has shape {found.shape}"
        raise ShapeError(f"{words}; expected one number, or one a joint: ({joints},)")
    return np.full(joints, found.ravel())


def numbers_of(value: ArrayLike, name: str, observer: str) -> Array:
    """A parameter as a list of numbers, one or one a joint. (1,) or (n,)"""
    found = number_array(value, name, observer)
    if found.ndim > 1:
        words = f"{name} of {observer} has shape {found.shape}"
        raise ShapeError(f"{words}; expected one number, or one a joint: (n,)")
    return frozen(np.atleast_1d(found))


def angular(frequency: Array) -> Array:
    """ω of frequencies [Hz], at 0 Hz so near that quotients have their limit. (F, 1) [rad/s]"""
    omega = 2.0 * np.pi * np.asarray(frequency, dtype=np.float64)[:, None]
    return np.where(omega == 0.0, 1e-9, omega)


def check_terms(terms: DynamicsTerms) -> None:
    """Raise a ParameterError unless what an observer runs over are dynamics terms."""
    check_kind(terms, DynamicsTerms, "run", "Run(recording=…, robot=…)")


def estimate_from_rest(observer: Observer, terms: DynamicsTerms) -> ExternalTorque:
    """Run an observer as if the log's first sample had lasted for long: τ̂⁰ = −μ⁰ where unbiased.

    From zero a log that begins in contact rises over some delays; with ṗ = μ + τ_ext it is −μ⁰.
    """
    step = terms.clock.step
    count = lead_samples(observer, step, terms.joints)
    before = terms.t[0] - step * np.arange(count, 0, -1)
    p, mu = (np.vstack([np.repeat(x[:1], count, axis=0), x]) for x in (terms.p, terms.mu))
    found = observer.estimate(DynamicsTerms(t=np.concatenate([before, terms.t]), p=p, mu=mu))
    sd = None if found.sd is None else found.sd[count:]
    return replace(found, t=terms.t, tau=found.tau[count:], sd=sd)


def settling_samples(observer: Observer, step: float, joints: int) -> int:
    """Samples until `SETTLED` of a start is left at a sample time [s], of the slowest joint."""
    samples = 2 + lead_samples(observer, step, joints)
    zero = np.zeros((samples, joints))
    terms = DynamicsTerms(t=step * np.arange(float(samples)), p=zero, mu=zero - 1.0)
    answer = observer.estimate(terms).tau
    left = np.max(np.abs(answer - answer[-1]), axis=1)
    return int(np.flatnonzero(left > SETTLED * np.max(np.abs(answer[-1])))[-1]) + 1


def lead_samples(observer: Observer, step: float, joints: int) -> int:
    """Samples in which an observer forgets all that was before. [s] → count"""
    slowest = float(np.min(observer.tuning(step, joints).omega_n))
    return min(LONGEST, max(1, int(np.ceil(LEAD / (slowest * step)))))
