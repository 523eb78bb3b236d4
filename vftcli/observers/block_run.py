"""Observers along a log that comes block by block: causal ones as they are, the smoother behind."""

from collections.abc import Iterator

from vftcli.observers.observer import BlockObserver, Observer
from vftcli.observers.smoother import KalmanSmoother, SteadyRun, look_ahead
from vftcli.robots.terms import DynamicsTerms
from vftcli.signals.external_torque import ExternalTorque
from vftcli.signals.series import Clock

#: Samples that the smoother looks ahead at most; one that forgets more slowly has the whole log.
FARTHEST = 1 << 17


def runs_in_blocks(observer: Observer, clock: Clock, joints: int) -> bool:
    """Whether an observer's estimate of a log can be made block by block."""
    if not isinstance(observer, KalmanSmoother):
        return isinstance(observer, BlockObserver)
    steady = observer.filter.is_steady(clock)
    return steady and look_ahead(observer, clock.step, joints) <= FARTHEST


def block_run(observer: Observer, clock: Clock, joints: int) -> "CausalRun | SteadyRun":
    """An observer at the beginning of a log of which `runs_in_blocks` holds.

    It takes up block after block, and gives the estimates that are known by then, in order.
    """
    if isinstance(observer, KalmanSmoother):
        return SteadyRun(observer, clock.step, joints)
    assert isinstance(observer, BlockObserver)
    return CausalRun(observer)


class CausalRun:
    """An observer that needs nothing of what follows."""

    def __init__(self, observer: BlockObserver) -> None:
        self._observer, self._state = observer, None

    def take(self, terms: DynamicsTerms) -> Iterator[ExternalTorque]:
        """The estimate of the block."""
        estimate, self._state = self._observer.run(terms, self._state)
        yield estimate

    def end(self) -> Iterator[ExternalTorque]:
        """Nothing is left."""
        return iter(())
