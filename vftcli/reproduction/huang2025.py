"""The experiments of huang2025.toml, but the timed one: observers, sensor, controller.

Table I and Figs. 3, 4, 12 are observers and virtual sensor beside the truth; Figs. 6, 7, 9,
10, Tables III and IV the controller in the loop and replayed.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from vftcli.admittance import ControlChoice
from vftcli.admittance.closed_loop import ClosedLoop, Latency, latencies, loop_of
from vftcli.admittance.law import AXES as COORDINATES
from vftcli.admittance.law import UnstableError
from vftcli.admittance.motion import SHARES, Drag, release, return_time
from vftcli.admittance.motion import run as follow_force
from vftcli.admittance.replay import Replay, replay, replay_release, stored_force
from vftcli.analysis import Analysis
from vftcli.evaluation import ReferenceChoice
from vftcli.evaluation.errors import correlation
from vftcli.free_motion import FreeChoice
from vftcli.observers import ObserverChoice
from vftcli.observers.table import PAPER
from vftcli.outputs import Record
from vftcli.outputs.admittance import charts as replay_charts
from vftcli.outputs.charts import REFERENCE, Chart, ChartLine
from vftcli.outputs.page.log_charts import torque_chart, wrench_chart
from vftcli.pipeline import AnalysisChoice, analyse, run_of
from vftcli.reproduction.paper import AS_PRINTED, CORRECTED, DENSITY, FLOOR, Given
from vftcli.robots import load_robot
from vftcli.robots.chain import link_poses
from vftcli.signals.arrays import Array, Mask, rms_of_known
from vftcli.signals.external_torque import DynamicsTerms
from vftcli.signals.remarks import fact
from vftcli.signals.wrench import AXES, Wrench, unit_of
from vftcli.simulation import load_scenario, simulate
from vftcli.wrench import WrenchChoice, ZeroChoice
from vftcli.wrench.solvers import VirtualSensor

#: Variant → the observers' options.
VARIANTS: dict[str, dict[str, Any]] = {
    AS_PRINTED: {"as_printed": True},
    CORRECTED: {},
    DENSITY: {"settings": {"kfo.noise_convention": "density"}},
}
#: Variant → the observer of the paper's virtual sensor.
OBSERVERS = {
    variant: ObserverChoice.parsed(observer=["kfo-fe"], **words)
    for variant, words in VARIANTS.items()
}
#: Parameters of Tables III and IV.
PARAMETERS = ("mass", "damping", "stiffness", "alpha", "threshold", "speed_limit", "xi")
#: Variant → its name with a traditional controller under the whole force.
UNGATED = {CORRECTED: "no threshold", DENSITY: "no threshold, R density"}
#: Axes of force and displacement, of moment and rotation.
FORCE, MOMENT = slice(3), slice(3, 6)
CONTACTS = 2  #: Times that the hand takes hold, in either scenario.
HOLD = 2.5  #: A drag of a contact begins within this time of its force. [s]
#: Farthest release: from .1 on the turn comes ever sooner. [m, rad]
FARTHEST_RELEASE = 0.5
UNTOUCHED = 0.5  #: The arm is untouched below this true flange force. [N]


def dragged_sensor(seed: int, *, sensor_pose: str, unloaded: Sequence[float]) -> Iterator[Given]:
    """RMSE of the virtual sensor against the real one."""
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
    """Zero drift, the bearing's weight, errors, controllers."""
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
                yield name, f"error/{phase}", np.sqrt(np.nanmean(np.sum(error**2, axis=1)))
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
    """Zero drift, and the bearing's weight; down is +."""
    for axis, value in zip(AXES, drift, strict=True):
        yield variant, f"drift/{axis}", value
    yield variant, "weight/raw", -hung[2]
    yield variant, "weight/zeroed", drift[2] - hung[2]


def replay_bearing(wrench: Wrench, made: Analysis, control: ControlChoice) -> Replay:
    """One force through Table IV's controllers."""
    robot, source = made.robot, fact("force-of-observer", observer=wrench.name)
    return replay(wrench, made.recording.q, robot, control.controllers(robot), source=source)


def motion_under_knocks(variant: str, found: Replay, knocked: Sequence[float]) -> Iterator[Given]:
    """Return of a guided arm, its rest, its motion under knocks."""
    t, (start, stop) = found.motion.t, knocked
    for n, controller in enumerate(found.controllers):
        x, kind = found.motion.x[:, n, :3], controller.kind
        own = [r for r in found.rows if r["axis"] == "x" and r["controller"] == kind]
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


def closed_loop(
    seed: int, *, scenario: str, figures: Sequence[str], alphas: Sequence[float]
) -> Iterator[Given]:
    """Latencies in the loop; its force replayed with every α."""
    for variant, observers in OBSERVERS.items():
        control = ControlChoice(as_printed=variant == AS_PRINTED)
        run, arm = loop_of(scenario, control, observers, seed=seed)
        if not run.stable:
            raise UnstableError(f"{scenario}, seed {seed}: the arm ran away at {run.t[-1]:.2f} s")
        # One force enters every controller.
        laws = replace(control, alphas=tuple(alphas)).controllers(arm)
        found = replay(run.wrench, run.q, arm, laws, source=fact("force-of-loop"))
        held = latencies(run)[:CONTACTS]
        forces = all(one.axis < 3 for one in held)
        dragged, other = (FORCE, MOMENT) if forces else (MOMENT, FORCE)
        yield variant, "astray", np.linalg.norm(run.moved[:, other], axis=1).max()
        for k, one in enumerate(held, start=1):
            for key in ("detection", "motion", "withdrawal", "reaction"):
                # Motion says nothing if the arm moved already.
                shown = one.rested or key in {"detection", "withdrawal"}
                yield variant, f"{key}/{k}", getattr(one, key) if shown else None
            yield variant, f"stop/{k}", one.turn
        yield from return_values(variant, found, held)
        if variant in UNGATED:
            yield from return_values(UNGATED[variant], ungated(found), held)
        if variant == CORRECTED:
            yield "", figures[0], loop_chart(run, found, dragged)
            yield "", figures[1], deviation_chart(found, dragged)


def ungated(found: Replay) -> Replay:
    """A replay by a traditional controller without threshold: (45)."""
    force, motion = np.nan_to_num(found.wrench), found.motion
    alone = follow_force(found.controllers[:1], force, found.phases.dragged)
    x, v = motion.x.copy(), motion.v.copy()
    x[:, :1], v[:, :1] = alone.x, alone.v
    return replace(found, motion=motion._replace(x=x, v=v))


def return_values(variant: str, found: Replay, held: Sequence[Latency]) -> Iterator[Given]:
    """By contact and α: lead of peak and turn, time back."""
    for k, one in enumerate(held, start=1):
        axes = COORDINATES[FORCE if one.axis < 3 else MOMENT]
        rows = [
            row
            for row in found.rows
            if one.force - 0.1 <= row["start_s"] <= one.force + HOLD and row["axis"] in axes
        ]
        first = [row for row in rows if row["alpha"] is None]
        if not first:
            continue
        before = max(first, key=lambda row: abs(row["peak"]))
        # A row of every controller.
        same = [row for row in rows if all(row[x] == before[x] for x in ("axis", "drag"))]
        turns = [turn_after(found, n, row) for n, row in enumerate(same)]
        for row, turn in zip(same, turns, strict=True):
            if row is not before:
                yield variant, f"peak/{law_of(row)}/{k}", row["peak_advance_s"]
                yield variant, f"turn/{law_of(row)}/{k}", turns[0] - turn
            yield variant, f"back/{law_of(row)}/{k}", row["return_10_s"]


def law_of(row: Record) -> str:
    """The controller of a row: its α, or "traditional"."""
    return "traditional" if row["alpha"] is None else f"{row['alpha']:g}"


def turn_after(found: Replay, n: int, row: Record) -> float:
    """Time from release until an axis stops moving away. [s]"""
    t, axis = found.motion.t, COORDINATES.index(row["axis"])
    start = int(t.searchsorted(row["release_s"] - 1e-9))
    outward = np.sign(found.motion.x[start, n, axis]) * found.motion.v[start:, n, axis]
    return float(t[start + np.argmax(outward <= 0.0)] - t[start])


def latest_turns(_seed: int, *, alphas: Sequence[float]) -> Iterator[Given]:
    """Latest turn of the UR5 after a release, and the variable law's lead.

    The traditional law turns after arccos(ζ)/ω_d at the latest. The lead is the largest over
    deviations released at the speed limit.
    """
    laws = ControlChoice(alphas=tuple(alphas)).controllers(load_robot("ur5"))
    parameters = laws[0].parameters
    omega = np.sqrt(parameters.stiffness / parameters.mass)
    zeta = parameters.damping / (2.0 * parameters.mass * omega)
    latest = np.arccos(zeta) / (omega * np.sqrt(1.0 - zeta**2))
    places = np.arange(0.0, FARTHEST_RELEASE, 0.01).repeat(len(laws))
    many = [law for _ in range(len(places) // len(laws)) for law in laws]
    for axis in (0, 3):
        x, v = np.zeros((2, len(places), 6))
        x[:, axis], v[:, axis] = places, np.asarray(parameters.speed_limit)[axis]
        motion = release(many, x, 1.1 * latest[axis], v)
        turned = motion.t[np.argmax(motion.v[:, :, axis] <= 0.0, axis=0)].reshape(-1, len(laws))
        most = np.max(turned[:, :1] - turned, axis=0)[1:]
        name = COORDINATES[axis]
        yield CORRECTED, f"latest/{name}", latest[axis]
        for alpha, advance in zip(alphas, most, strict=True):
            yield CORRECTED, f"most/{name}/{alpha:g}", advance


def released(
    _seed: int, *, robot: str, deviation: float, alphas: Sequence[float] = ()
) -> Iterator[Given]:
    """Parameters of a table; return from a deviation [m]."""
    arm, x = load_robot(robot), np.eye(6)[0] * deviation
    for variant, xi in ((CORRECTED, ()), ("ξ = 1", ("admittance.xi=1",))):
        control = ControlChoice(assignments=xi, alphas=tuple(alphas))
        laws = control.controllers(arm)
        found = replay_release(x, arm, laws, start=control.start_pose(arm))
        for row in found.rows:
            for key in ("return_10_s", "return_2_s"):
                yield variant, f"{key}/{law_of(row)}", row[key]
            yield variant, f"overshoot/{law_of(row)}", 100.0 * (row["overshoot"] or 0.0)
        for key in PARAMETERS if not xi else ():
            values = np.asarray(getattr(found.parameters, key))
            yield from (
                (variant, f"{key}/{axis}", v) for axis, v in zip(COORDINATES, values, strict=True)
            )


def loop_chart(run: ClosedLoop, found: Replay, part: slice) -> Chart:
    """Force and motion of the loop: sensor, command and truth."""
    true = np.column_stack([run.truth[:, part], run.moved[:, part]])
    ours = np.column_stack([run.estimate[:, part], run.commanded[:, part]])
    letter, *units = ("F", "N", "m") if part == FORCE else ("M", "N·m", "rad")
    return Chart(
        "loop",
        "",
        tuple(np.repeat(units, 3).tolist()),
        (*(f"{letter}_{axis}" for axis in "xyz"), *COORDINATES[part]),
        run.t,
        (
            ChartLine("true force, flange", true, "#8a929a", "5 3"),
            ChartLine("virtual sensor, command", ours, "#0b6fb8"),
        ),
        band=np.append(found.parameters.threshold[part], np.full(3, np.nan)),
        band_label="± threshold",
    )


def deviation_chart(found: Replay, part: slice) -> Chart:
    """Deviation under every controller, along these axes."""
    chart = replay_charts(found)[0]
    return chart._replace(
        units=chart.units[part],
        panels=chart.panels[part],
        series=tuple(line._replace(values=line.values[:, part]) for line in chart.series),
    )
