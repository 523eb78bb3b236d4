"""An estimate that starts at its first sample's static residual, not at zero."""

from dataclasses import replace

import numpy as np

from vftcli.observers.observer import Observer
from vftcli.signals.external_torque import DynamicsTerms, ExternalTorque

LEAD = 60.0  #: Assumed rest of the arm before a log, in 1/ω_n of the slowest joint.
LONGEST = 1 << 17  #: Samples of that time at most.
SETTLED = 0.01  #: Share of its start that an estimate has forgotten once it counts as settled.


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
