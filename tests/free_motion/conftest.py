"""Repeated motions without dynamics, and the simulated circle with its truth."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import polars as pl
import pytest

from vftcli.readers.reading import read
from vftcli.robots import load_robot
from vftcli.robots.run import SERIES, Run
from vftcli.signals.arrays import Array
from vftcli.signals.recording import Recording

FIXTURES = Path(__file__).parents[2] / "fixtures"


class Circle(NamedTuple):
    """The simulated UR5 circle of the fixtures and what really happened."""

    recording: Recording
    truth: Array  # external torque at its samples (T, n) [N·m]


@pytest.fixture(scope="session")
def circle() -> Circle:
    recording = read(FIXTURES / "ur5_circle.csv")
    table = pl.read_parquet(FIXTURES / "ur5_circle.csv.truth.parquet")
    t = table["t"].to_numpy() - recording.source.t0
    columns = [table[f"tau_ext/{j}"].to_numpy() for j in range(1, 7)]
    truth = np.column_stack([np.interp(recording.t, t, column) for column in columns])
    return Circle(recording=recording, truth=truth)


@pytest.fixture
def repeated() -> Callable[..., Recording]:
    """A log of a periodic joint motion, as six harmonics would draw it."""

    def make(period=3.7, cycles=4, rate=100, approach=0, hold=0, start=0, push=0, seed=0):
        rng = np.random.default_rng(seed)
        t = np.arange(0.0, hold + approach + cycles * period + hold, 1.0 / rate)
        s = np.clip(t - hold - approach, 0.0, cycles * period) + start
        phase = 2.0 * np.pi * s[:, None] / period
        order, turn = np.array([1, 1, 2, 1, 2, 3]), np.arange(6.0)
        q = 0.3 * np.sin(order * phase + turn)
        way = np.clip((t - hold) / approach, 0.0, 1.0)[:, None] if approach else 1.0
        q = q + 0.8 * (np.cos(np.pi * way) + 1.0) * np.ones(6)
        q = q + push * np.sin(0.9 * t)[:, None] ** 8 * np.linspace(1.0, 0.2, 6)
        q = q + 5e-5 * rng.standard_normal(q.shape)
        dq = np.gradient(q, t, axis=0)
        return Recording(t=t, q=q, dq=np.where(np.abs(dq) < 0.008, 0.0, dq))

    return make


@pytest.fixture(scope="session")
def drive_of() -> Callable[..., Run]:
    """A run of some signals; those that are not given are zero."""

    def make(t: Array, q: Array, dq: Array, **signals: Array) -> Run:
        still = np.zeros_like(q)
        given = {name: signals.get(name, still) for name in SERIES}
        log = Run(recording=Recording(t=t, q=q, dq=dq), robot=load_robot("ur5"))
        return log.holding(dry_friction=still[0], **given | {"standing": still > 0})

    return make


@pytest.fixture(scope="session")
def part_of() -> Callable[[Recording, float, float], Recording]:
    """A span of a log as a log of its own, whose clock begins at 0."""

    def make(recording: Recording, start: float, stop: float) -> Recording:
        span = recording.between(start, stop)
        source = replace(span.source, t0=span.t[0], label=f"{start:g}")
        return replace(span, t=span.t - span.t[0], source=source)

    return make
