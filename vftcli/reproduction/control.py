"""Figs. 6, 7, 9, 10 with Tables III and IV: the controller in the loop, and the same force anew."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from vftcli.admittance.choice import ControlChoice
from vftcli.admittance.closed_loop import UNLOADED, ClosedLoop, run_closed_loop
from vftcli.admittance.latency import Latency, latencies
from vftcli.admittance.metrics import drags_of, releases_of, rows_of
from vftcli.admittance.motion import release
from vftcli.admittance.motion import run as follow_force
from vftcli.admittance.parameters import AXES
from vftcli.admittance.replay import Replay, replay, settling
from vftcli.admittance.stability import UnstableError
from vftcli.observers import KalmanObserver
from vftcli.observers.choice import ObserverChoice
from vftcli.outputs.admittance.page import charts as replay_charts
from vftcli.outputs.page.charts import Chart, ChartLine
from vftcli.reproduction.paper import AS_PRINTED, CORRECTED, DENSITY, RunResult, Values
from vftcli.robots import load_robot
from vftcli.signals.remarks import fact
from vftcli.simulation import load_scenario
from vftcli.simulation.sensing import log_rate

#: Variant → how the sensor's Kalman filter reads R and Q.
CONVENTIONS = {AS_PRINTED: "literal", CORRECTED: "discrete", DENSITY: "density"}
#: Variant → the same with a traditional controller that the whole force always drives.
UNGATED = {CORRECTED: "no threshold", DENSITY: "no threshold, R density"}
ALPHAS = (1.0, 1.3, 1.6, 1.9)  #: Values of α that Figs. 7 and 10 compare.
CONTACTS = 2  #: Times that the hand takes hold, in either scenario.
HOLD = 2.5  #: A drag of a contact begins within this time of its force. [s]
#: Deviations up to which a release is tried: from .1 on the turn comes ever sooner. [m, rad]
FARTHEST_RELEASE = 0.5


def closed_loop(scenario: str, figures: tuple[str, str], seed: int) -> RunResult:
    """Latencies of a controller in the loop, and its force through controllers of every α."""
    values: Values = {}
    charts: dict[str, Chart] = {}
    for variant in CONVENTIONS:
        run, found = looped(scenario, variant, seed)
        held = latencies(run)[:CONTACTS]
        add_latencies(values, variant, held)
        other = slice(3, 6) if all(one.axis < 3 for one in held) else slice(0, 3)
        astray = np.linalg.norm(run.moved[:, other], axis=1)
        values.setdefault("astray", {})[variant] = float(astray.max())
        add_returns(values, variant, found, held)
        if variant in UNGATED:
            add_returns(values, UNGATED[variant], ungated(found), held)
        if variant == CORRECTED:
            axes = range(3) if all(one.axis < 3 for one in held) else range(3, 6)
            charts[figures[0]] = loop_chart(figures[0], run, found, axes)
            charts[figures[1]] = deviation_chart(figures[1], found, axes)
    return RunResult(values, charts)


drag = partial(closed_loop, "ur5-drag", ("fig6", "fig7"))
twist = partial(closed_loop, "ur5-twist", ("fig9", "fig10"))


def looped(name: str, variant: str, seed: int) -> tuple[ClosedLoop, Replay]:
    """A scenario with Table III's controller in the loop, and its force through all controllers."""
    scenario = load_scenario(name, ())
    arm = load_robot(scenario.robot)
    alone = ControlChoice.parsed(as_printed=variant == AS_PRINTED)
    control = replace(alone, alphas=ALPHAS)
    parameters = control.parameters(arm)
    observers = ObserverChoice.parsed(
        observer=["kfo-fe"], assignments=[f"kfo.noise_convention={CONVENTIONS[variant]}"]
    )
    observer = observers.build(arm, 1.0 / log_rate(scenario.sensing, arm))[0][0]
    assert isinstance(observer, KalmanObserver)
    inner = alone.controllers(parameters)[-1]
    run = run_closed_loop(scenario, inner, observer, seed=seed, zero=UNLOADED)
    if not run.stable:
        raise UnstableError(f"{name}, seed {seed}: the arm ran away at {run.t[-1]:.2f} s")
    # The same enters, whoever is driven by it: no controller has a tail of the force that another
    # does not see.
    everything = control.controllers(parameters)
    source = fact("force-of-loop")
    return run, replay(run.wrench, run.q, arm, parameters, everything, source=source)


def ungated(found: Replay) -> Replay:
    """A replay with a traditional controller that has no threshold: (45) under the whole force."""
    force, motion = np.nan_to_num(found.wrench), found.motion
    alone = follow_force(found.controllers[:1], force, found.phases.dragged)
    x, v = (
        np.concatenate([one, all_[:, 1:]], axis=1)
        for one, all_ in ((alone.x, motion.x), (alone.v, motion.v))
    )
    motion = replace(motion, x=x, v=v)
    drags = drags_of(found.phases, found.parameters.period)
    return replace(
        found, motion=motion, rows=tuple(rows_of(found.controllers, motion, drags, force))
    )


def add_latencies(values: Values, variant: str, held: Sequence[Latency]) -> None:
    """Times of each contact, None of one that found the arm moving."""
    for k, one in enumerate(held, start=1):
        for key, value in (
            ("detection", one.detection),
            ("motion", one.motion if one.rested else None),
            ("withdrawal", one.withdrawal),
            ("reaction", one.reaction if one.rested else None),
            ("stop", one.turn),
        ):
            values.setdefault(f"{key}/{k}", {})[variant] = value


def add_returns(values: Values, variant: str, found: Replay, held: Sequence[Latency]) -> None:
    """For each contact and α: how much earlier the peak and the turn are, and the time back."""
    for k, one in enumerate(held, start=1):
        rows = [
            row
            for row in found.rows
            if one.force - 0.1 <= row["start_s"] <= one.force + HOLD
            and (AXES.index(row["axis"]) < 3) == (one.axis < 3)
        ]
        before = max(
            (row for row in rows if row["controller"] == "traditional"),
            key=lambda row: abs(row["peak"]),
            default=None,
        )
        if before is None:
            continue
        axis, number = before["axis"], before["drag"]
        turned = turn_after(found, 0, before)
        values.setdefault(f"back/traditional/{k}", {})[variant] = before["return_10_s"]
        for n, controller in enumerate(found.controllers[1:], start=1):
            alpha = f"{controller.alpha[AXES.index(axis)]:g}/{k}"
            row = next(
                row
                for row in rows
                if (row["axis"], row["drag"]) == (axis, number)
                and row["alpha"] == controller.alpha[AXES.index(axis)]
            )
            values.setdefault(f"peak/{alpha}", {})[variant] = row["peak_advance_s"]
            values.setdefault(f"turn/{alpha}", {})[variant] = turned - turn_after(found, n, row)
            values.setdefault(f"back/{alpha}", {})[variant] = row["return_10_s"]


def turn_after(found: Replay, n: int, row: dict[str, object]) -> float:
    """Time from the release until an axis no longer goes on away from its target. [s]"""
    t, axis = found.motion.t, AXES.index(str(row["axis"]))
    start = int(np.searchsorted(t, float(str(row["release_s"])) - 1e-9))
    outward = np.sign(found.motion.x[start, n, axis]) * found.motion.v[start:, n, axis]
    return float(t[start + int(np.argmax(outward <= 0.0))] - t[start])


def latest_turns(_seed: int) -> RunResult:
    """How late the UR5 turns after a release at most, and how much earlier the variable law is.

    Without force x(t) and v(t) of the traditional law turn at the latest where x = 0 at the
    release: after arccos(ζ)/ω_d. The advance is the largest over deviations from 0 on, released at
    the speed limit, in steps of the control period.
    """
    control = ControlChoice(alphas=ALPHAS)
    parameters = control.parameters(load_robot("ur5"))
    omega = np.sqrt(parameters.stiffness / parameters.mass)
    zeta = parameters.damping / (2.0 * parameters.mass * omega)
    latest = np.arccos(zeta) / (omega * np.sqrt(1.0 - zeta**2))
    laws, values = control.controllers(parameters), Values()
    places = np.repeat(np.arange(0.0, FARTHEST_RELEASE, 0.01), len(laws))
    many = [law for _ in range(len(places) // len(laws)) for law in laws]
    for axis in (0, 3):
        x, v = np.zeros((2, len(places), 6))
        x[:, axis], v[:, axis] = places, np.asarray(parameters.speed_limit)[axis]
        motion = release(many, x, 1.1 * float(latest[axis]), v)
        turned = motion.t[np.argmax(motion.v[:, :, axis] <= 0.0, axis=0)].reshape(-1, len(laws))
        values[f"latest/{AXES[axis]}"] = {CORRECTED: float(latest[axis])}
        for n, alpha in enumerate(ALPHAS, start=1):
            most = float(np.max(turned[:, 0] - turned[:, n]))
            values[f"most/{AXES[axis]}/{alpha:g}"] = {CORRECTED: most}
    return RunResult(values)


def released(
    robot: str, axis: int, deviation: float, alphas: Sequence[float], _seed: int
) -> RunResult:
    """Parameters of the robot's table, and how it returns from rest by the law alone.

    Args:
        robot: The arm.
        axis: The axis that is let go.
        deviation: How far off. [m, rad]
        alphas: Values of α; none for the table's own.
    """
    arm = load_robot(robot)
    values: Values = {}
    for variant, xi in ((CORRECTED, None), ("ξ = 1", "1")):
        control = ControlChoice.parsed(xi=xi)
        control = ControlChoice(settings=control.settings, alphas=tuple(alphas))
        parameters = control.parameters(arm)
        x = np.zeros(6)
        x[axis] = deviation
        laws = control.controllers(parameters)
        motion = release(laws, x, settling(laws, x))
        drags = releases_of(x, len(motion.t))
        for row in rows_of(laws, motion, drags, np.zeros((len(motion.t) - 1, 6))):
            name = "traditional" if row["alpha"] is None else f"{row['alpha']:g}"
            for key in ("return_10_s", "return_2_s"):
                values.setdefault(f"{key}/{name}", {})[variant] = row[key]
            values.setdefault(f"overshoot/{name}", {})[variant] = 100.0 * (row["overshoot"] or 0.0)
        if xi is None:
            for key in ("mass", "damping", "stiffness", "alpha", "threshold", "speed_limit"):
                for k, name in enumerate(AXES):
                    line = values.setdefault(f"{key}/{name}", {})
                    line[CORRECTED] = float(getattr(parameters, key)[k])
            for k, name in enumerate(AXES):
                values.setdefault(f"xi/{name}", {})[CORRECTED] = float(parameters.damping_ratio[k])
    return RunResult(values)


def loop_chart(key: str, run: ClosedLoop, found: Replay, axes: Sequence[int]) -> Chart:
    """Force and motion of the loop: what the sensor says and the law commands, and the truth."""
    part = list(axes)

    def both(force: np.ndarray, motion: np.ndarray) -> np.ndarray:
        return np.column_stack([force[:, part], motion[:, part]])

    lines = (
        ChartLine("true force, flange", both(run.truth, run.moved), "#8a929a", "5 3"),
        ChartLine("virtual sensor, command", both(run.estimate, run.commanded), "#0b6fb8"),
    )
    unit = ("N", "m") if part[0] < 3 else ("N·m", "rad")
    names = tuple(f"F_{AXES[k]}" if k < 3 else f"M_{AXES[k][1]}" for k in part)
    names += tuple(AXES[k] for k in part)
    units = (unit[0],) * 3 + (unit[1],) * 3
    band = np.concatenate([found.parameters.threshold[part], np.full(3, np.nan)])
    return Chart(
        key,
        "Force, and deviation from the target pose",
        units,
        names,
        run.t,
        lines,
        families=(1, 1, 1, 2, 2, 2),
        band=band,
        band_label="± threshold",
    )


def deviation_chart(key: str, found: Replay, axes: Sequence[int]) -> Chart:
    """Deviation under every controller, along these axes."""
    chart, part = replay_charts(found)[0], list(axes)
    return chart._replace(
        key=key,
        title="Deviation from the target pose under every controller",
        units=tuple(chart.units[k] for k in part),
        panels=tuple(chart.panels[k] for k in part),
        series=tuple(line._replace(values=line.values[:, part]) for line in chart.series),
        families=tuple(chart.families[k] for k in part),
    )
