"""Logs with a truth, as the tests of the contacts use them."""

from pathlib import Path

import numpy as np
import polars as pl

from vftcli.free_motion import FreeChoice
from vftcli.free_motion.free_motion import FreeMotion, FreeRun
from vftcli.robots import load_robot
from vftcli.robots.run import Run
from vftcli.signals.arrays import Array

FIXTURES = Path(__file__).parents[2] / "fixtures"


def motion(recording, robot, free=None, run=None) -> FreeMotion:
    """A log with what is known of its free motion: a span of its own, or another log."""
    arm = load_robot(robot)
    log = Run(recording=recording, robot=arm)
    runs = ()
    if run is not None:
        runs = (FreeRun(run=Run(recording=run, robot=arm), log=log),)
    return FreeMotion(log=log, choice=FreeChoice.parsed(free=[free] if free else ()), runs=runs)


def true_wrench(name: str) -> tuple[Array, Array]:
    """Time from the first sample, and the true wrench of a fixture. (M,), (M, 6)"""
    table = pl.read_parquet(FIXTURES / f"{name}.truth.parquet")
    t = table["t"].to_numpy()
    axes = ("fx", "fy", "fz", "mx", "my", "mz")
    return t - t[0], np.column_stack([table[f"wrench/{axis}"].to_numpy() for axis in axes])
