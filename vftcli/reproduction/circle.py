"""Table I and Fig. 3: the tapped circle, judged by the difference to its free cycle."""

from typing import Any

import numpy as np
import polars as pl

from vftcli.analysis import Analysis
from vftcli.evaluation.reference_choice import ReferenceChoice
from vftcli.evaluation.selection import facts
from vftcli.observers import PAPER
from vftcli.observers.choice import ObserverChoice
from vftcli.outputs.page.torque_part import torque_chart
from vftcli.pipeline import AnalysisChoice, analyse
from vftcli.repetition.choice import FreeChoice
from vftcli.reproduction.paper import AS_PRINTED, CORRECTED, DENSITY, FLOOR, RunResult
from vftcli.robots import load_robot
from vftcli.robots.run import Runs
from vftcli.simulation import load_scenario, simulate

#: Variant → how its observers are chosen; the last moves all to FDO's bandwidth, 10 rad/s.
VARIANTS: dict[str, dict[str, Any]] = {
    AS_PRINTED: {"as_printed": True},
    CORRECTED: {},
    DENSITY: {"assignments": ["kfo.noise_convention=density"]},
    "at 1.59 Hz": {"match": "bandwidth=1.59"},
}


def tapped_circle(seed: int, *, scenario: str, period: float) -> RunResult:
    """Errors joint by joint, lags, rms of the free cycle, and the guidelines' facts.

    Args:
        seed: Of the simulation.
        scenario: Its name.
        period: Length of a cycle, the first of which nobody touches. [s]
    """
    recording = simulate(load_scenario(scenario, ()), seed).recording
    robot, models, result = load_robot("ur5"), Runs(), RunResult()
    # The paper's difference: cycle by cycle, neither corrected nor filtered.
    free = FreeChoice(period=period, alignment="period", low_pass=None)
    for variant, chosen in VARIANTS.items():
        choice = AnalysisChoice(
            observers=ObserverChoice.parsed(observer=PAPER, **chosen),
            free=free,
            contacts=False,
            reference=ReferenceChoice(name="two-cycle"),
        )
        made = analyse(recording, robot, choice, models)
        put_errors(result, variant, made, period)
        put_facts(result, variant, made)
        if variant == CORRECTED:
            chart = torque_chart(made)
            # Four bands would hide one another.
            lines = (line._replace(shown=True, leads=False, half=None) for line in chart.series)
            result.charts["fig3"] = chart._replace(series=tuple(lines))
    return result


def put_errors(result: RunResult, variant: str, made: Analysis, period: float) -> None:
    """RMSE and floor by joint, lag and free rms as means of joints 1 to 3."""
    assert made.errors is not None, "a reference was asked for"
    rows = made.errors.filter(pl.col("joint").is_not_null())
    for row in rows.iter_rows(named=True):
        key = f"{row['observer']}/{row['joint']}"
        result.put(variant, {key: row["rmse_Nm"]})
        result.put(FLOOR, {key: row["reference_floor_Nm"]})
    for estimate in made.estimates:
        free = (estimate.t > 1.0) & (estimate.t < period)
        rms = float(np.sqrt(np.mean(estimate.tau[free, :3] ** 2)))
        result.put(variant, {f"free/{estimate.name}": rms})
        own = rows.filter((pl.col("observer") == estimate.name) & (pl.col("joint") <= 3))
        if lags := own["lag_s"].drop_nulls().to_list():
            result.put(variant, {f"lag/{estimate.name}": float(np.mean(lags))})


def put_facts(result: RunResult, variant: str, made: Analysis) -> None:
    """What the guidelines go by."""
    for fact in facts(made.observers, made.tunings, made.motion.log, made.errors):
        found = {
            "response": fact.response,
            "delay": fact.delay,
            "passed": 100.0 * fact.passed,
            "rmse": fact.rmse,
            "numbers": float(fact.parameter_count),
        }
        result.put(variant, {f"{key}/{fact.name}": value for key, value in found.items()})
