"""Table I, Figs. 3, 4, 12: observers and virtual sensor beside the truth."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import polars as pl

from vftcli.admittance import ControlChoice
from vftcli.admittance.motion import SHARES, Drag, return_time
from vftcli.admittance.replay import Replay, replay, stored_force
from vftcli.analysis import Analysis
from vftcli.evaluation import ReferenceChoice
from vftcli.evaluation.errors import correlation, joint_means
from vftcli.free_motion import FreeChoice
from vftcli.observers import ObserverChoice
from vftcli.observers.observer import Observer
from vftcli.observers.table import PAPER
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
STEP_TIME = 3.0  #: Length of the step for response times. [s]
REACHED = 0.9  #: A step is seen from this share on.
#: People's contacts are slower; the rest is noise. [Hz]
FAST = 5.0


def dragged_sensor(seed: int, *, sensor_pose: str, unloaded: Sequence[float]) -> Iterator[Given]:
    """RMSE of the virtual sensor against the real one, in flange axes."""
    hard = simulate(load_scenario("ur5-sensor", ()), seed)
    # A soft position loop: joints slide where a stiff one holds them.
    soft = simulate(load_scenario("ur5-sensor", ("servo.stiffness=soft",)), seed)
    start, stop = unloaded
    asked = {
        **{variant: (hard, observers, ()) for variant, observers in OBSERVERS.items()},
        "zero removed": (hard, OBSERVERS[CORRECTED], ((start, stop),)),
        "soft servo": (soft, OBSERVERS[CORRECTED], ()),
    }
    compared = AnalysisChoice(contacts=False, reference=ReferenceChoice(name="sensor"))
    for variant, (run, observers, spans) in asked.items():
        wrench = WrenchChoice(sensor_pose=sensor_pose, zero=ZeroChoice(spans=spans))
        choice = replace(compared, observers=observers, wrench=wrench)
        made = analyse(run_of(run.recording, load_robot("ur5"), choice), choice)
        for row in error_rows(made, "axis"):
            force, moment = row["rmse_N"], row["rmse_Nm"]
            yield variant, row["axis"], moment if force is None else force
        assert made.virtual_sensor is not None, "a wrench was asked for"
        real = made.virtual_sensor.reference
        assert real is not None, "the sensor is the reference"
        q, true, tau = made.recording.q, run.truth.wrench, run.truth.tau_ext
        touched = np.linalg.norm(true[:, :3], axis=1) > UNTOUCHED
        error = (made.wrenches[0].known - real.known)[:, 1]
        # The observer of the true torque alone: p is 0, μ is −τ_ext.
        ideal = DynamicsTerms(t=made.recording.t, p=np.zeros_like(tau), mu=-tau)
        late = made.observers[0].estimate(ideal)
        missed = replace(late, tau=late.tau - tau)
        lag = VirtualSensor().wrench(missed, q, made.robot.chain).known
        yield variant, "fy/untouched", float(rms_of_known(error[~touched]))
        yield variant, "fy/touched", float(rms_of_known(error[touched]))
        for axis in ("mx", "my"):
            yield variant, f"{axis}/lag", float(rms_of_known(lag[:, AXES.index(axis)]))
        if variant == CORRECTED:
            # The real sensor's own error against the simulated truth.
            turn = link_poses(made.robot.chain, q).rotation[:, -1]
            true = np.einsum("tji,tkj->tki", turn, true.reshape(-1, 2, 3)).reshape(-1, 6)
            for axis, off in zip(AXES, (real.known - true).T, strict=True):
                yield FLOOR, axis, float(rms_of_known(off))
            yield "", "fig4", wrench_chart(made)


def error_rows(made: Analysis, of: str) -> list[dict[str, Any]]:
    """The error rows of joints, or of axes."""
    assert made.errors is not None, "a reference was asked for"
    return list(made.errors.filter(pl.col(of).is_not_null()).iter_rows(named=True))


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
    recording, robot, asked = run.recording, load_robot("panda"), WrenchChoice(frame="base")
    vendor = stored_force(recording, robot, asked, "libfranka").wrench
    choice = AnalysisChoice(contacts=False, wrench=asked)
    for variant, observers in OBSERVERS.items():
        choice = replace(choice, observers=observers)
        made = analyse(run_of(recording, robot, choice), choice)
        (wrench,) = made.wrenches
        drift = mean_of(wrench, unloaded)
        yield from weights(variant, drift, mean_of(wrench, hung))
        zeroed = replace(wrench, values=wrench.values - drift)
        true = run.truth.wrench[: len(wrench.t)]
        for phase, span in phases.items():
            rows = within(wrench, span)
            for name, seen in ((variant, zeroed), (FLOOR, vendor)):
                squares = np.sum((seen.known - true)[rows, :3] ** 2, axis=1)
                yield name, f"error/{phase}", np.sqrt(np.nanmean(squares))
        yield variant, "agreement", correlation(zeroed.known[:, 2], vendor.known[:, 2])
        controlled = replay_bearing(zeroed, made, as_printed=variant == AS_PRINTED)
        yield from motion_under_knocks(variant, controlled, phases["knocked"])
        if variant == CORRECTED:
            yield from weights(FLOOR, mean_of(vendor, unloaded), mean_of(vendor, hung))
            soon = replay_bearing(zeroed, made, period=sampled)
            yield from motion_under_knocks("control at 1 ms", soon, phases["knocked"])
            lines = (
                ChartLine("libfranka", vendor.known, REFERENCE),
                ChartLine("virtual sensor, drift removed", zeroed.known, "#0b6fb8"),
            )
            units = tuple(map(unit_of, AXES))
            yield "", "fig12", Chart("wrench", "", units, AXES, zeroed.t, lines)
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


def replay_bearing(
    wrench: Wrench, made: Analysis, *, period: float | None = None, as_printed: bool = False
) -> Replay:
    """One force through Table IV's traditional and variable controllers."""
    words = [] if period is None else [f"admittance.period={period}"]
    control = ControlChoice(assignments=tuple(words), as_printed=as_printed)
    laws = control.controllers(made.robot)
    source = fact("force-of-observer", observer=wrench.name)
    return replay(wrench, made.recording.q, made.robot, laws, source=source)


def motion_under_knocks(variant: str, found: Replay, knocked: Sequence[float]) -> Iterator[Given]:
    """Return time of a guided arm, its rest, and its motion under knocks."""
    t, (start, stop) = found.motion.t, knocked
    for n, controller in enumerate(found.controllers):
        x = found.motion.x[:, n, :3]
        own = [row for row in found.rows if row["controller"] == controller.kind]
        guided = max((row for row in own if row["axis"] == "x"), key=lambda row: abs(row["peak"]))
        # Noise begins drags of its own: they do not end this return.
        begin, end = t.searchsorted((guided["release_s"] - 1e-9, start)).tolist()
        led = Drag(axis=0, number=1, begin=begin, release=begin, end=end)
        before = x[t <= start][-1]
        moved = np.linalg.norm(x[(t > start) & (t < stop)] - before, axis=1)
        back = return_time(t, x[:, 0], led, SHARES["return_10_s"])
        yield variant, f"back/{controller.kind}", back
        yield variant, f"left/{controller.kind}", 1e3 * float(np.linalg.norm(before))
        yield variant, f"knocked/{controller.kind}", 1e3 * moved.max()


def guideline_numbers(made: Analysis) -> dict[str, dict[str, float]]:
    """Observer of known response → numbers of the paper's guidelines (Sec. IV-A).

    Of the slowest joint the 90 % time of a step and the delay behind a ramp [s]; means of
    joints are the share of noise above 5 Hz that passes [%] and the RMSE [N·m].
    """
    step, joints = made.recording.median_step, made.recording.joints
    frequency = np.linspace(0.0, 0.5 / step, 513)[1:]
    fast = frequency >= min(FAST, frequency[-1])
    means = {} if made.errors is None else joint_means(made.errors).errors
    found = {}
    for observer in made.observers:
        if (tuning := made.tunings.get(observer.name)) is not None:
            gain = abs(observer.frequency_response(frequency[fast], step, joints)) ** 2
            found[observer.name] = {
                "response": float(step_response(observer, step, joints).max()),
                "delay": float(tuning.delay.max()),
                "passed": 100.0 * np.sqrt(gain.mean(axis=0)).mean(),
                "rmse": means.get(observer.name, float("nan")),
                "numbers": float(tuning.parameter_count),
            }
    return found


def step_response(observer: Observer, step: float, joints: int) -> Array:
    """Time of a unit step's estimate to 90 %, NaN if never. (n,) [s]"""
    t = np.arange(0.0, STEP_TIME, step)
    p = t[:, None].repeat(joints, axis=1)
    seen = observer.estimate(DynamicsTerms(t=t, p=p, mu=np.zeros_like(p))).tau >= REACHED
    return np.where(seen.any(axis=0), t[seen.argmax(axis=0)], np.nan)


def tapped_circle(seed: int, *, scenario: str, period: float) -> Iterator[Given]:
    """Errors by joint, lags, free rms, and numbers of the guidelines."""
    recording = simulate(load_scenario(scenario, ()), seed).recording
    # The paper's difference: cycle by cycle, neither corrected nor filtered.
    free = FreeChoice(period=period, alignment="period", low_pass=None)
    reference, robot = ReferenceChoice(name="two-cycle"), load_robot("ur5")
    choice = AnalysisChoice(contacts=False, free=free, reference=reference)
    # The last has all at FDO's 10 rad/s.
    for variant, chosen in {**VARIANTS, "at 1.59 Hz": {"gains": "bandwidth=1.59"}}.items():
        observers = ObserverChoice.parsed(observer=PAPER, **chosen)
        choice = replace(choice, observers=observers)
        made = analyse(run_of(recording, robot, choice), choice)
        rows = error_rows(made, "joint")
        for row in rows:
            key = f"{row['observer']}/{row['joint']}"
            yield variant, key, row["rmse_Nm"]
            yield FLOOR, key, row["reference_floor_Nm"]
        # Free rms and lag are means of joints 1 to 3.
        for estimate in made.estimates:
            tau = estimate.tau[(estimate.t > 1.0) & (estimate.t < period), :3]
            yield variant, f"free/{estimate.name}", float(rms_of_known(tau.ravel()))
            own = (r["lag_s"] for r in rows if r["observer"] == estimate.name and r["joint"] <= 3)
            if lags := [lag for lag in own if lag is not None]:
                yield variant, f"lag/{estimate.name}", np.mean(lags)
        for name, numbers in guideline_numbers(made).items():
            for key, value in numbers.items():
                yield variant, f"{key}/{name}", value
        if variant == CORRECTED:
            chart = torque_chart(made)
            # Four bands would hide one another.
            lines = (line._replace(shown=True, leads=False, half=None) for line in chart.series)
            yield "", "fig3", chart._replace(series=tuple(lines))
