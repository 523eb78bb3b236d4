"""Pairs of runs: the same motion with and without the payload."""

from dataclasses import replace

from vftcli.signals.errors import ParameterError
from vftcli.simulation.experiment import Progress, Simulation, simulate
from vftcli.simulation.scenario import Scenario

PAIR_SEED = 1_000_003
"""Offset between the seeds of the two runs' sensors, so that their noise differs."""


def simulate_pair(
    scenario: Scenario, seed: int | None = None, progress: Progress | None = None
) -> list[Simulation]:
    """Run an experiment, and if it is one of a pair also the free run of the same arm.

    The free run has the same arm and motion, no payload and no contacts; its noise differs.

    Raises:
        ParameterError: If a pair has nothing to leave out, or the scenario is impossible.
    """
    run = simulate(scenario, seed, progress)
    if not scenario.pair:
        return [run]
    if scenario.payload is None and not scenario.contacts:
        raise ParameterError("pair = true needs a payload or contacts that the free run lacks")
    free = replace(scenario, payload=None, contacts=(), pair=False)
    return [run, simulate(free, run.seed, progress, noise_seed=run.seed + PAIR_SEED)]
