"""Table I and Fig. 3: the tapped circle, judged by the difference to its free cycle."""

import numpy as np

from vftcli.analysis import Analysis
from vftcli.evaluation.reference_choice import ReferenceChoice
from vftcli.evaluation.selection import facts
from vftcli.observers import PAPER
from vftcli.observers.choice import ObserverChoice
from vftcli.outputs.page.torque_part import torque_chart
from vftcli.pipeline import AnalysisChoice, analyse
from vftcli.repetition.choice import FreeChoice
from vftcli.repetition.free_run import Models
from vftcli.reproduction.paper import AS_PRINTED, CORRECTED, DENSITY, FLOOR, RunResult, Values
from vftcli.robots import load_robot
from vftcli.simulation import load_scenario, simulate

SCENARIO = "ur5-table1"

EQUAL = "at 1.59 Hz"  #: Every observer moved to FDO's bandwidth, 10 rad/s.
#: Variant → its observers.
VARIANTS = {
    AS_PRINTED: ObserverChoice(names=PAPER, as_printed=True),
    CORRECTED: ObserverChoice(names=PAPER),
    DENSITY: ObserverChoice.parsed(observer=PAPER, assignments=["kfo.noise_convention=density"]),
    EQUAL: ObserverChoice.parsed(observer=PAPER, match="bandwidth=1.59"),
}
#: The paper's difference: cycle by cycle, neither corrected nor filtered.
PRINTED_REFERENCE = FreeChoice(period=4.0, alignment="period", low_pass=None)
FREE = 4.0  #: Length of the free cycle, and from when on its estimates are judged. [s]


def tapped_circle(seed: int) -> RunResult:
    """Errors joint by joint, lags, what the free cycle reads, and the guidelines' facts."""
    recording = simulate(load_scenario(SCENARIO, ()), seed).recording
    robot, models = load_robot("ur5"), Models()
    values: Values = {}
    charts = {}
    for variant, observers in VARIANTS.items():
        choice = AnalysisChoice(
            observers=observers,
            free=PRINTED_REFERENCE,
            contacts=False,
            reference=ReferenceChoice(name="two-cycle"),
        )
        made = analyse(recording, robot, choice, models)
        add_errors(values, variant, made)
        add_facts(values, variant, made)
        if variant == CORRECTED:
            chart = torque_chart(made)
            # Four bands would hide one another.
            lines = (line._replace(shown=True, leads=False, half=None) for line in chart.series)
            title = "External torque: observers and reference"
            charts["fig3"] = chart._replace(key="fig3", title=title, series=tuple(lines))
    return RunResult(values, charts)


def add_errors(values: Values, variant: str, made: Analysis) -> None:
    """RMSE and floor by joint, lag and free rms as means of joints 1 to 3."""
    assert made.errors is not None, "a reference was asked for"
    lags: dict[str, list[float]] = {}
    for row in made.errors.filter(made.errors["joint"].is_not_null()).iter_rows(named=True):
        line = values.setdefault(f"{row['observer']}/{row['joint']}", {})
        line[variant] = row["rmse_Nm"]
        line[FLOOR] = row["reference_floor_Nm"]
        if row["joint"] <= 3 and row["lag_s"] is not None:
            lags.setdefault(row["observer"], []).append(row["lag_s"])
    for estimate in made.estimates:
        free = (estimate.t > 1.0) & (estimate.t < FREE)
        rms = float(np.sqrt(np.mean(estimate.tau[free, :3] ** 2)))
        values.setdefault(f"free/{estimate.name}", {})[variant] = rms
        if found := lags.get(estimate.name):
            values.setdefault(f"lag/{estimate.name}", {})[variant] = float(np.mean(found))


def add_facts(values: Values, variant: str, made: Analysis) -> None:
    """What the guidelines go by."""
    for fact in facts(made.observers, made.tunings, made.motion.log, made.errors):
        found = {
            "response": fact.response,
            "delay": fact.delay,
            "passed": 100.0 * fact.passed,
            "rmse": fact.rmse,
            "numbers": float(fact.parameter_count),
        }
        for key, value in found.items():
            values.setdefault(f"{key}/{fact.name}", {})[variant] = value
