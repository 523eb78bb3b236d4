"""Table I, Figs. 3, 4, 12: observers and virtual sensor beside the truth."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from vftcli.admittance import ControlChoice
from vftcli.admittance.motion import SHARES, Drag, return_time
from vftcli.admittance.replay import Replay, replay, stored_force
from vftcli.analysis import Analysis
from vftcli.evaluation import ReferenceChoice
from vftcli.evaluation.errors import correlation
from vftcli.free_motion import FreeChoice
from vftcli.observers import ObserverChoice
from vftcli.observers.table import PAPER
from vftcli.outputs import Record
from vftcli.outputs.charts import REFERENCE, Chart, ChartLine
from vftcli.outputs.page.log_charts import torque_chart, wrench_chart
from vftcli.pipeline import AnalysisChoice, analyse, run_of
from vftcli.reproduction.control import OBSERVERS, VARIANTS, deviation_chart
from vftcli.reproduction.paper import AS_PRINTED, CORRECTED, FLOOR, Given
from vftcli.robots import load_robot
from vftcli.robots.chain import link_poses
from vftcli.signals.arrays import Array, Mask, rms_of_known
from vftcli.signals.external_torque import DynamicsTerms
from vftcli.signals.remarks import fact
from vftcli.signals.wrench import AXES, Wrench, unit_of
from vftcli.simulation import load_scenario, simulate
from vftcli.wrench import WrenchChoice, ZeroChoice
from vftcli.wrench.solvers import VirtualSensor

UNTOUCHED = 0.5  #: The arm is untouched below this true flange force. [N]


def dragged_sensor(seed: int, *, sensor_pose: str, unloaded: Sequence[float]) -> Iterator[Given]:
    """RMSE of the virtual sensor against the real one, in flange axes."""
    robot, (start, stop) = load_robot("ur5"), unloaded
    # With a soft position loop joints slide where a stiff one holds them.
    hard, soft = (
        simulate(load_scenario("ur5-sensor", words), seed)
        for words in ((), ("servo.stiffness=soft",))
    )
    asked = {
        **{variant: (hard, observers, ()) for variant, observers in OBSERVERS.items()},
        "zero removed": (hard, OBSERVERS[CORRECTED], ((start, stop),)),
        "soft servo": (soft, OBSERVERS[CORRECTED], ()),
    }
    compared = AnalysisChoice(contacts=False, reference=ReferenceChoice(name="sensor"))
    for variant, (run, observers, spans) in asked.items():
        wrench = WrenchChoice(sensor_pose=sensor_pose, zero=ZeroChoice(spans=spans))
        choice = replace(compared, observers=observers, wrench=wrench)
        made = analyse(run_of(run.recording, robot, choice), choice)
        for row in error_rows(made, "axis"):
            yield variant, row["axis"], row["rmse_N"] or row["rmse_Nm"]
        assert made.virtual_sensor is not None, "a wrench was asked for"
        assert made.virtual_sensor.reference is not None, "the sensor is the reference"
        real, t, q = made.virtual_sensor.reference.known, made.t, made.recording.q
        true, tau = run.truth.wrench, run.truth.tau_ext
        touched = np.linalg.norm(true[:, :3], axis=1) > UNTOUCHED
        error = (made.wrenches[0].known - real)[:, 1]
        yield variant, "fy/untouched", rms(error[~touched])
        yield variant, "fy/touched", rms(error[touched])
        # The observer of the true torque alone: p is 0, μ is −τ_ext.
        ideal = DynamicsTerms(t=t, p=np.zeros_like(tau), mu=-tau)
        late = made.observers[0].estimate(ideal)
        missed = replace(late, tau=late.tau - tau)
        lag = VirtualSensor().wrench(missed, q, robot.chain).known
        for axis in ("mx", "my"):
            yield variant, f"{axis}/lag", rms(lag[:, AXES.index(axis)])
        if variant == CORRECTED:
            # The real sensor's own error against the simulated truth.
            turn = link_poses(robot.chain, q).rotation[:, -1]
            true = np.einsum("tji,tkj->tki", turn, true.reshape(-1, 2, 3)).reshape(-1, 6)
            for axis, off in zip(AXES, (real - true).T, strict=True):
                yield FLOOR, axis, rms(off)
            yield "", "fig4", wrench_chart(made)


def rms(values: Array) -> float:
    """Root mean square of the known samples. (T,)"""
    return float(rms_of_known(values))


def error_rows(made: Analysis, of: str) -> list[Record]:
    """The error rows of joints, or of axes."""
    assert made.errors is not None, "a reference was asked for"
    return made.errors.drop_nulls(of).to_dicts()


def assembled_bearing(
    seed: int,
    *,
    unloaded: Sequence[float],
    hung: Sequence[float],
    phases: Mapping[str, Sequence[float]],
    sampled: float,
) -> Iterator[Given]:
    """Zero drift, the bearing's weight, errors by phase, controllers' results."""
    run = simulate(load_scenario("panda-bearing", ()), seed)
    recording, robot = run.recording, load_robot("panda")
    asked = WrenchChoice(frame="base")
    vendor = stored_force(recording, robot, asked, "libfranka").wrench
    for variant, observers in OBSERVERS.items():
        choice = AnalysisChoice(contacts=False, wrench=asked, observers=observers)
        made = analyse(run_of(recording, robot, choice), choice)
        (wrench,) = made.wrenches
        drift = mean_of(wrench, unloaded)
        yield from weights(variant, drift, mean_of(wrench, hung))
        zeroed = replace(wrench, values=wrench.values - drift)
        true = run.truth.wrench[: len(wrench.t)]
        for phase, span in phases.items():
            for name, seen in ((variant, zeroed), (FLOOR, vendor)):
                error = (seen.known - true)[within(wrench, span), :3]
                squares = np.sum(error**2, axis=1)
                yield name, f"error/{phase}", np.sqrt(np.nanmean(squares))
        yield variant, "agreement", correlation(zeroed.known[:, 2], vendor.known[:, 2])
        control = ControlChoice(as_printed=variant == AS_PRINTED)
        controlled = replay_bearing(zeroed, made, control)
        yield from motion_under_knocks(variant, controlled, phases["knocked"])
        if variant == CORRECTED:
            yield from weights(FLOOR, mean_of(vendor, unloaded), mean_of(vendor, hung))
            soon = ControlChoice(assignments=(f"admittance.period={sampled}",))
            replayed = replay_bearing(zeroed, made, soon)
            yield from motion_under_knocks("control at 1 ms", replayed, phases["knocked"])
            lines = (
                ChartLine("libfranka", vendor.known, REFERENCE),
                ChartLine("virtual sensor, drift removed", zeroed.known, "#0b6fb8"),
            )
            chart = Chart(
                "wrench",
                "",
                tuple(map(unit_of, AXES)),
                AXES,
                zeroed.t,
                lines,
            )
            yield "", "fig12", chart
            yield "", "fig13", deviation_chart(controlled, slice(6))


def within(wrench: Wrench, span: Sequence[float]) -> Mask:
    """The samples of a span."""
    return (wrench.t > span[0]) & (wrench.t < span[1])


def mean_of(wrench: Wrench, span: Sequence[float]) -> Array:
    """Mean wrench over a span. (6,) [N, N·m]"""
    return np.asarray(np.nanmean(wrench.known[within(wrench, span)], axis=0))


def weights(variant: str, drift: Array, hung: Array) -> Iterator[Given]:
    """Zero drift, and the bearing's weight before and after; down is +."""
    for axis, value in zip(AXES, drift, strict=True):
        yield variant, f"drift/{axis}", value
    yield variant, "weight/raw", -hung[2]
    yield variant, "weight/zeroed", drift[2] - hung[2]


def replay_bearing(wrench: Wrench, made: Analysis, control: ControlChoice) -> Replay:
    """One force through Table IV's traditional and variable controllers."""
    laws, source = (
        control.controllers(made.robot),
        fact("force-of-observer", observer=wrench.name),
    )
    return replay(wrench, made.recording.q, made.robot, laws, source=source)


def motion_under_knocks(variant: str, found: Replay, knocked: Sequence[float]) -> Iterator[Given]:
    """Return time of a guided arm, its rest, and its motion under knocks."""
    t, (start, stop) = found.motion.t, knocked
    for n, controller in enumerate(found.controllers):
        x, kind = found.motion.x[:, n, :3], controller.kind
        rows = [row for row in found.rows if row["axis"] == "x"]
        own = [row for row in rows if row["controller"] == kind]
        guided = max(own, key=lambda row: abs(row["peak"]))
        # Noise begins drags of its own: they do not end this return.
        begin, end = t.searchsorted((guided["release_s"] - 1e-9, start)).tolist()
        led = Drag(axis=0, number=1, begin=begin, release=begin, end=end)
        before = x[t <= start][-1]
        moved = np.linalg.norm(x[(t > start) & (t < stop)] - before, axis=1)
        yield variant, f"back/{kind}", return_time(t, x[:, 0], led, SHARES["return_10_s"])
        yield variant, f"left/{kind}", 1e3 * float(np.linalg.norm(before))
        yield variant, f"knocked/{kind}", 1e3 * moved.max()


def tapped_circle(seed: int, *, scenario: str, period: float) -> Iterator[Given]:
    """Errors by joint, lags, and free rms."""
    recording = simulate(load_scenario(scenario, ()), seed).recording
    robot = load_robot("ur5")
    # The paper's difference: cycle by cycle, neither corrected nor filtered.
    free = FreeChoice(period=period, alignment="period", low_pass=None)
    compared = AnalysisChoice(
        contacts=False, free=free, reference=ReferenceChoice(name="two-cycle")
    )
    # The last has all at FDO's 10 rad/s.
    for variant, words in {**VARIANTS, "at 1.59 Hz": {"gains": "bandwidth=1.59"}}.items():
        choice = replace(compared, observers=ObserverChoice.parsed(observer=PAPER, **words))
        made = analyse(run_of(recording, robot, choice), choice)
        rows = error_rows(made, "joint")
        for row in rows:
            key = f"{row['observer']}/{row['joint']}"
            yield variant, key, row["rmse_Nm"]
            yield FLOOR, key, row["reference_floor_Nm"]
        # Free rms and lag are means of joints 1 to 3.
        for estimate in made.estimates:
            tau = estimate.tau[(estimate.t > 1.0) & (estimate.t < period), :3]
            name = estimate.name
            yield variant, f"free/{name}", rms(tau.ravel())
            own = [r for r in rows if r["observer"] == name and r["joint"] <= 3]
            lags = [r["lag_s"] for r in own if r["lag_s"] is not None]
            if lags:
                yield variant, f"lag/{name}", np.mean(lags)
        if variant == CORRECTED:
            chart = torque_chart(made)
            # Four bands would hide one another.
            lines = (line._replace(shown=True, leads=False, half=None) for line in chart.series)
            yield "", "fig3", chart._replace(series=tuple(lines))
