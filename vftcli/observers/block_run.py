"""Observers along a log that comes block by block: causal ones as they are, the smoother behind.

The smoother's backward recursion forgets: started from zero L samples behind a sample it errs there
by ρᴸ, with ρ the size of its largest pole. So it goes along in one pass, L samples behind.
"""

from collections.abc import Iterator
from typing import Any, Protocol, runtime_checkable

import numpy as np

from vftcli.observers.kalman import error_filter, second_entry, transition
from vftcli.observers.observer import Observer
from vftcli.observers.smoother import (
    SETTLED,
    KalmanSmoother,
    backward_filter,
    innovations,
    steady_deviation,
)
from vftcli.observers.steady_filter import steady_filter
from vftcli.robots.terms import DynamicsTerms
from vftcli.signals.arrays import Array, handed_over
from vftcli.signals.external_torque import ExternalTorque
from vftcli.signals.series import Clock

FARTHEST = 1 << 17
"""Samples that the smoother looks ahead at most; one that forgets more slowly has the whole log."""


@runtime_checkable
class Resumable(Protocol):
    """An observer that goes on from where it stood after the block before."""

    def run(self, terms: DynamicsTerms, state: Any = None) -> tuple[ExternalTorque, Any]:  # noqa: ANN401
        """The estimate of a block, and where it stands after it."""
        ...


class BlockRun(Protocol):
    """An observer on its way along a log."""

    def take(self, terms: DynamicsTerms) -> Iterator[ExternalTorque]:
        """Take up the next block; the estimates of the blocks that are known by now, in order."""
        ...

    def end(self) -> Iterator[ExternalTorque]:
        """The estimates of the blocks that are left behind the log's last one."""
        ...


def runs_in_blocks(observer: Observer, clock: Clock, joints: int) -> bool:
    """Whether an observer's estimate of a log can be made block by block.

    Args:
        observer: The observer.
        clock: The log's clock.
        joints: Number of joints n.
    """
    if not isinstance(observer, KalmanSmoother):
        return isinstance(observer, Resumable)
    steady = clock.uniform and observer.filter.initial_covariance is None
    return steady and look_ahead(observer, clock.step, joints) <= FARTHEST


def look_ahead(smoother: KalmanSmoother, step: float, joints: int) -> float:
    """Samples after which the backward recursion has forgotten where it began, L.

    Args:
        smoother: The smoother.
        step: Sample time. [s]
        joints: Number of joints n.
    """
    gains, model = smoother.filter.steady(step, joints).gains, smoother.filter.model(step, joints)
    F = np.moveaxis(np.stack(transition(gains, model.a12, model.a22)), 0, -1)
    pole = float(np.max(np.abs(np.linalg.eigvals(F.reshape(-1, 2, 2)))))
    return float(np.ceil(np.log(SETTLED) / np.log(pole))) if pole < 1.0 else np.inf


def block_run(observer: Observer, clock: Clock, joints: int) -> BlockRun:
    """An observer at the beginning of a log of which `runs_in_blocks` holds."""
    if isinstance(observer, KalmanSmoother):
        return SmootherRun(observer, clock.step, joints)
    return CausalRun(observer)


class CausalRun:
    """An observer that needs nothing of what follows."""

    def __init__(self, observer: Any) -> None:  # noqa: ANN401 - each has a state of its own
        self._observer, self._state = observer, None

    def take(self, terms: DynamicsTerms) -> Iterator[ExternalTorque]:
        """The estimate of the block."""
        estimate, self._state = self._observer.run(terms, self._state)
        yield estimate

    def end(self) -> Iterator[ExternalTorque]:
        """Nothing is left."""
        return iter(())


class SmootherRun:
    """The smoother with settled gains, as many samples behind as its backward recursion needs."""

    def __init__(self, smoother: KalmanSmoother, step: float, joints: int) -> None:
        self._smoother, zero = smoother, np.zeros((2, joints))
        self._settled = smoother.filter.steady(step, joints)
        self._model = smoother.filter.model(step, joints)
        self._ahead = int(look_ahead(smoother, step, joints))
        self._S = self._settled.prior.p11 + self._model.r
        gains, limit = self._settled.gains, self._ahead + 1
        # Of the log's last sample first.
        self._deviation = steady_deviation(gains, self._model, self._S, limit)
        self._zero = self._state = zero
        self._blocks: list[tuple[Array, Array, Array]] = []
        self._before: Array | None = None

    def take(self, terms: DynamicsTerms) -> Iterator[ExternalTorque]:
        """The estimates of earlier blocks that are known by this one."""
        gains, model = self._settled.gains, self._model
        F, g = error_filter(gains, model.a12, model.a22)
        d = self._smoother.filter.unexplained(terms)
        tau, self._state = steady_filter(F, g, d, self._state, second_entry(terms.joints))
        before = tau[:1] if self._before is None else self._before
        nu = innovations(np.concatenate([before, tau]), gains.l2, model.a22)[1:]
        if self._before is None:
            nu[0] = 0.0
        self._before = tau[-1:]
        self._blocks.append((terms.t, tau, nu))
        while sum(len(t) for t, _, _ in self._blocks[1:]) > self._ahead:
            yield self._smoothed()

    def end(self) -> Iterator[ExternalTorque]:
        """The estimates of the blocks that are left, up to the log's end."""
        while self._blocks:
            yield self._smoothed()

    def _smoothed(self) -> ExternalTorque:
        """The estimate of the first block that waits, by those behind it."""
        gains, model = self._settled.gains, self._model
        nu = np.concatenate([nu for _, _, nu in self._blocks])
        t, tau, _ = self._blocks.pop(0)
        left = len(nu) - len(t)
        nu = nu[: len(t) + self._ahead + 1]
        backward, b = backward_filter(gains, model.a12, model.a22)
        driven = np.zeros_like(nu)
        driven[1:] = nu[:0:-1] / self._S
        weights = np.stack([gains.posterior.p12, gains.posterior.p22])
        correction, _ = steady_filter(backward, b, driven, self._zero, weights)
        tau = tau - correction[::-1][: len(t)]
        # Samples from the log's end, as far as it is known.
        behind = np.minimum(np.arange(left + len(t) - 1, left - 1, -1), len(self._deviation) - 1)
        sd = self._deviation[behind]
        return ExternalTorque(
            name=self._smoother.name, t=t, tau=handed_over(tau), sd=handed_over(sd)
        )
