"""Figs. 6, 7, 9, 10, Tables III and IV: the controller in the loop and replayed."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from vftcli.admittance import ControlChoice
from vftcli.admittance.closed_loop import ClosedLoop, Latency, latencies, loop_of
from vftcli.admittance.law import AXES, UnstableError
from vftcli.admittance.motion import release
from vftcli.admittance.motion import run as follow_force
from vftcli.admittance.replay import Replay, replay, replay_release
from vftcli.observers import ObserverChoice
from vftcli.outputs import Record
from vftcli.outputs.admittance import charts as replay_charts
from vftcli.outputs.charts import Chart, ChartLine
from vftcli.reproduction.paper import AS_PRINTED, CORRECTED, DENSITY, Given
from vftcli.robots import load_robot
from vftcli.signals.remarks import fact

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


def closed_loop(
    seed: int, *, scenario: str, figures: Sequence[str], alphas: Sequence[float]
) -> Iterator[Given]:
    """Latencies of a controller in the loop; its force replayed with every α."""
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
    """By contact and α: lead of the peak and the turn, and time back."""
    for k, one in enumerate(held, start=1):
        axes = AXES[FORCE if one.axis < 3 else MOMENT]
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
    """Time from release until an axis stops moving away from its target. [s]"""
    t, axis = found.motion.t, AXES.index(row["axis"])
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
        name = AXES[axis]
        yield CORRECTED, f"latest/{name}", latest[axis]
        for alpha, advance in zip(alphas, most, strict=True):
            yield CORRECTED, f"most/{name}/{alpha:g}", advance


def released(
    _seed: int, *, robot: str, deviation: float, alphas: Sequence[float] = ()
) -> Iterator[Given]:
    """Parameters of a table; its return from a deviation [m] at rest."""
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
                (variant, f"{key}/{axis}", v) for axis, v in zip(AXES, values, strict=True)
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
        (*(f"{letter}_{axis}" for axis in "xyz"), *AXES[part]),
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
