"""Figs. 4 and 12: the virtual sensor beside a real one on the UR5, and beside libfranka's."""

from dataclasses import replace

import numpy as np

from vftcli.admittance.choice import ControlChoice
from vftcli.admittance.driving_force import stored_force
from vftcli.admittance.metrics import SHARES, Drag, return_time
from vftcli.admittance.replay import Replay, replay
from vftcli.analysis import Analysis
from vftcli.evaluation.errors import correlation
from vftcli.evaluation.reference_choice import ReferenceChoice
from vftcli.observers.choice import ObserverChoice
from vftcli.outputs.page.charts import REFERENCE, Chart, ChartLine
from vftcli.outputs.page.wrench_part import wrench_chart
from vftcli.pipeline import AnalysisChoice, analyse
from vftcli.repetition.free_run import Models
from vftcli.reproduction.control import deviation_chart
from vftcli.reproduction.paper import AS_PRINTED, CORRECTED, DENSITY, FLOOR, RunResult, Values
from vftcli.robots import load_robot
from vftcli.robots.kinematics import link_poses
from vftcli.robots.terms import DynamicsTerms
from vftcli.signals.arrays import Array, Mask
from vftcli.signals.remarks import fact
from vftcli.signals.wrench import AXES, Wrench
from vftcli.simulation import Simulation, load_scenario, simulate
from vftcli.virtual_sensor.choice import WrenchChoice, ZeroChoice
from vftcli.virtual_sensor.virtual_sensor import VirtualSensor

KFO = ("kfo-fe",)  #: The observer that the paper's virtual sensor takes.
#: Variant → its observer.
VARIANTS = {
    AS_PRINTED: ObserverChoice(names=KFO, as_printed=True),
    CORRECTED: ObserverChoice(names=KFO),
    DENSITY: ObserverChoice.parsed(observer=KFO, assignments=["kfo.noise_convention=density"]),
}
ZEROED = "zero removed"  #: Corrected, and the mean of an unloaded span taken off.
#: Corrected, on an arm with a soft position loop: its joints slide where a stiff one holds them.
SOFT = "soft servo"
UNTOUCHED = 0.5  #: True force on the flange below which nothing touches the arm. [N]
#: Where the simulated sensor sits on the flange, as its scenario says. [m, rad]
SENSOR_POSE = "0,0,0.02,0,0,0.5"
UNLOADED = {"ur5": (0.5, 2.8), "panda": (2.0, 3.9)}  #: When nothing touches the arm. [s]
HUNG = (6.0, 8.7)  #: When the bearing alone hangs on the Panda. [s]
#: What is done with the Panda, and when. [s]
PHASES = {"guided": (9.2, 12.0), "pressed": (13.8, 16.4), "knocked": (23.8, 26.4)}
#: The Panda's sampling interval: the control period that no thread of its own would need. [s]
SAMPLED = 0.001


def dragged_sensor(seed: int) -> RunResult:
    """RMSE of the virtual sensor against the real one, axis by axis, in flange axes."""
    run = simulate(load_scenario("ur5-sensor", ()), seed)
    soft = simulate(load_scenario("ur5-sensor", ("servo.stiffness=soft",)), seed)
    zero = ZeroChoice(spans=(UNLOADED["ur5"],))
    asked = {
        **{name: (run, chosen, ZeroChoice()) for name, chosen in VARIANTS.items()},
        ZEROED: (run, VARIANTS[CORRECTED], zero),
        SOFT: (soft, VARIANTS[CORRECTED], ZeroChoice()),
    }
    values: Values = {}
    models, charts = Models(), {}
    for variant, (run, observers, off) in asked.items():
        choice = AnalysisChoice(
            observers=observers,
            contacts=False,
            wrench=WrenchChoice(sensor_pose=SENSOR_POSE, zero=off),
            reference=ReferenceChoice(name="sensor"),
        )
        made = analyse(run.recording, load_robot("ur5"), choice, models)
        assert made.errors is not None, "a reference was asked for"
        rows = made.errors.filter(made.errors["axis"].is_not_null())
        for row in rows.iter_rows(named=True):
            known = row["rmse_N"] if row["rmse_N"] is not None else row["rmse_Nm"]
            values.setdefault(row["axis"], {})[variant] = known
        add_causes(values, variant, run, made)
        if variant == CORRECTED:
            for axis, error in zip(AXES, sensor_error(run, made), strict=True):
                values[axis][FLOOR] = error
            chart = wrench_chart(made)
            assert chart is not None, "a wrench was asked for"
            title = "Virtual and real sensor, flange axes"
            charts["fig4"] = chart._replace(key="fig4", title=title)
    return RunResult(values, charts)


def add_causes(values: Values, variant: str, run: Simulation, made: Analysis) -> None:
    """Errors of f_y, touched and not, and of m_x, m_y by the observer's lag alone."""
    true = run.truth.wrench[: len(made.recording.q)]
    touched = np.linalg.norm(true[:, :3], axis=1) > UNTOUCHED
    error = (made.wrenches[0].known - real_sensor(made).known)[: len(true)]
    for name, rows in (("untouched", ~touched), ("touched", touched)):
        values.setdefault(f"fy/{name}", {})[variant] = rms(error[rows, 1])
    # What the observer makes of the true torque and of nothing else: p is 0, μ is −τ_ext.
    tau = run.truth.tau_ext[: len(true)]
    ideal = DynamicsTerms(t=made.recording.t[: len(true)], p=np.zeros_like(tau), mu=-tau)
    late = made.observers[0].estimate(ideal)
    missed = replace(late, tau=late.tau - tau)
    wrench = VirtualSensor().wrench(missed, made.recording.q[: len(true)], made.robot.chain)
    for axis in ("mx", "my"):
        values.setdefault(f"{axis}/lag", {})[variant] = rms(wrench.known[:, AXES.index(axis)])


def rms(values: Array) -> float:
    """Root mean square of what is known."""
    return float(np.sqrt(np.nanmean(values**2)))


def real_sensor(made: Analysis) -> Wrench:
    """The reference that was asked for."""
    assert made.virtual_sensor is not None, "a wrench was asked for"
    reference = made.virtual_sensor.reference
    assert reference is not None, "the sensor is the reference"
    return reference


def sensor_error(run: Simulation, made: Analysis) -> Array:
    """How far the real sensor itself is from the simulation's truth, rms. (6,) [N, N·m]"""
    reference = real_sensor(made)
    turn = link_poses(made.robot.chain, made.recording.q).rotation[:, -1]
    known = run.truth.wrench[: len(turn)].reshape(-1, 2, 3)
    true = np.einsum("tji,tkj->tki", turn[: len(known)], known).reshape(-1, 6)
    error: Array = np.sqrt(np.nanmean((reference.known[: len(true)] - true) ** 2, axis=0))
    return error


def assembled_bearing(seed: int) -> RunResult:
    """Zero drift, the bearing's weight, errors by phase, and what the controllers make of it."""
    run = simulate(load_scenario("panda-bearing", ()), seed)
    recording, robot, models = run.recording, load_robot("panda"), Models()
    vendor = stored_force(recording, robot, WrenchChoice(frame="base"), "libfranka").wrench
    values: Values = {}
    charts: dict[str, Chart] = {}
    for variant, observers in VARIANTS.items():
        choice = AnalysisChoice(
            observers=observers, contacts=False, wrench=WrenchChoice(frame="base")
        )
        made = analyse(recording, robot, choice, models)
        (wrench,) = made.wrenches
        drift = mean_of(wrench, UNLOADED["panda"])
        add_weights(values, variant, wrench, drift)
        zeroed = replace(wrench, values=wrench.values - drift)
        add_phases(values, variant, zeroed, run, vendor)
        controlled = replay_bearing(zeroed, made, as_printed=variant == AS_PRINTED)
        add_motion(values, variant, controlled)
        if variant == CORRECTED:
            add_weights(values, FLOOR, vendor, mean_of(vendor, UNLOADED["panda"]))
            add_motion(values, "control at 1 ms", replay_bearing(zeroed, made, period=SAMPLED))
            charts["fig12"] = beside_vendor(zeroed, vendor)
            charts["fig13"] = deviation_chart("fig13", controlled, range(6))
    return RunResult(values, charts)


def within(wrench: Wrench, span: tuple[float, float]) -> Mask:
    """The samples of a span."""
    inside: Mask = (wrench.t > span[0]) & (wrench.t < span[1])
    return inside


def mean_of(wrench: Wrench, span: tuple[float, float]) -> Array:
    """Mean wrench over a span. (6,) [N, N·m]"""
    mean: Array = np.nanmean(wrench.known[within(wrench, span)], axis=0)
    return mean


def add_weights(values: Values, variant: str, wrench: Wrench, drift: Array) -> None:
    """The zero drift, and what the bearing weighs before and after it is removed; down is +."""
    for axis, value in zip(AXES, drift, strict=True):
        values.setdefault(f"drift/{axis}", {})[variant] = float(value)
    weight = -float(mean_of(wrench, HUNG)[2])
    values.setdefault("weight/raw", {})[variant] = weight
    values.setdefault("weight/zeroed", {})[variant] = weight + float(drift[2])


def add_phases(
    values: Values, variant: str, wrench: Wrench, run: Simulation, vendor: Wrench
) -> None:
    """Force error against the truth by phase, with the vendor's own, and how both agree."""
    true = run.truth.wrench[: len(wrench.t)]
    for phase, span in PHASES.items():
        rows = within(wrench, span)
        for name, seen in ((variant, wrench), (FLOOR, vendor)):
            error = (seen.known - true)[rows, :3]
            rms = float(np.sqrt(np.nanmean(np.sum(error**2, axis=1))))
            values.setdefault(f"error/{phase}", {})[name] = rms
    agreed = correlation(wrench.known[:, 2], vendor.known[:, 2])
    values.setdefault("agreement", {})[variant] = float(agreed)


def replay_bearing(
    wrench: Wrench, made: Analysis, *, period: float | None = None, as_printed: bool = False
) -> Replay:
    """The same force through the traditional and the variable controller of Table IV."""
    words = [] if period is None else [f"admittance.period={period}"]
    control = ControlChoice.parsed(assignments=words, as_printed=as_printed)
    parameters = control.parameters(made.robot)
    return replay(
        wrench,
        made.recording.q,
        made.robot,
        parameters,
        control.controllers(parameters),
        source=fact("force-of-observer", observer=wrench.name),
    )


def add_motion(values: Values, variant: str, found: Replay) -> None:
    """How soon the arm is back from where it was guided, what is left, how far knocks move it."""
    t, (start, stop) = found.motion.t, PHASES["knocked"]
    for n, controller in enumerate(found.controllers):
        own = [row for row in found.rows if row["controller"] == controller.kind]
        guided = max((row for row in own if row["axis"] == "x"), key=lambda row: abs(row["peak"]))
        # Noise beyond the threshold begins drags of its own, which are no end of this one's return.
        begin, end = np.searchsorted(t, (guided["release_s"] - 1e-9, start)).tolist()
        led = Drag(axis=0, number=1, begin=begin, release=begin, end=end)
        before = found.motion.x[t <= start, n, :3][-1]
        moved = np.linalg.norm(found.motion.x[(t > start) & (t < stop), n, :3] - before, axis=1)
        for key, value in (
            ("back", return_time(t, found.motion.x[:, n, 0], led, SHARES["return_10_s"])),
            ("left", 1e3 * float(np.linalg.norm(before))),
            ("knocked", 1e3 * float(moved.max())),
        ):
            values.setdefault(f"{key}/{controller.kind}", {})[variant] = value


def beside_vendor(wrench: Wrench, vendor: Wrench) -> Chart:
    """The virtual sensor's wrench, drift removed, over libfranka's."""
    lines = (
        ChartLine("libfranka", vendor.known, REFERENCE),
        ChartLine("virtual sensor, drift removed", wrench.known, "#0b6fb8"),
    )
    units = ("N",) * 3 + ("N·m",) * 3
    families = (1, 1, 1, 2, 2, 2)
    return Chart(
        "fig12", "Virtual sensor and libfranka, base axes", units, AXES, wrench.t, lines, families
    )
