"""Findings on load, payload and joint temperatures."""

from collections.abc import Iterator

import numpy as np

from vftcli.doctor.causes import RANGE
from vftcli.doctor.windows import Case, RobustFit, solve
from vftcli.robots.friction import friction_factor, measured_temperature, steady_torque
from vftcli.robots.robot import Robot
from vftcli.robots.terms import gain_sd
from vftcli.signals.arrays import Array
from vftcli.signals.recording import Recording
from vftcli.signals.remarks import Remark, caution, fact, on_joints, warning
from vftcli.signals.rest import MOVES

#: Loads in a note, and in a warning: hands weigh .5–1.1, constants 3 % off
#: seem .3. [kg]
HAND, LOAD = 0.4, 1.2
SURE = 4.0  #: Least load in SDs by the scatter.
EXPLAINED, PARTLY = 0.5, 0.8  #: Share of the misfit that such loads may leave.
#: Share of the misfit that a changing load may leave (sound logs .7 and more, 1.5 kg picked
#: up half-way .2–.6), and its least change. [-, kg]
CHANGED, CHANGE = 0.6, 0.7
#: Share that a change in the middle must leave to try others, and the shares of the log
#: between which they are: pushes last less than a third.
HALVES, BETWEEN = 0.9, (1 / 3, 2 / 3)
#: A declared payload, or a difference from the mounted one, that is none. [kg]
DECLARED = 0.1


def load_remarks(case: Case) -> Iterator[Remark]:
    """Payload findings: declared but not mounted, carried, or not carried."""
    recording, robot = case.windows.recording, case.windows.robot
    declared = recording.payload_mass or 0.0
    missing = declared - case.mounted
    if declared < DECLARED or abs(missing) < max(DECLARED, 0.1 * declared):
        missing = 0.0
    else:
        yield warning("payload-not-mounted", declared_kg=declared, mounted_kg=case.mounted)
    if (changed := load_change(case)) is not None:
        yield changed
        return
    mass, sd = case.loaded.values[0], case.loaded.sd[0]
    if not case.carries_load or abs(mass) < max(HAND, SURE * sd):
        return
    carried = case.windows.load.columns @ case.loaded.values[:4]
    if not case.lasts(case.loaded, carried):
        return
    if missing and abs(mass - missing) < DECLARED + 0.3 * abs(missing):
        return
    share = case.loaded.size / case.bare.size
    heavy = abs(mass) > LOAD and share < EXPLAINED
    if not heavy and share >= PARTLY:
        return
    values = {
        "sd_kg": masses_sd(case, case.loaded, case.windows.load.columns)[0],
        "robot": robot.name,
        "bare_percent": 100 * case.bare.size / case.size,
        "loaded_percent": 100 * case.loaded.size / case.size,
    }
    level = warning if heavy else caution
    if mass < 0:
        values |= {"mounted_kg": case.mounted, "carried_kg": max(case.mounted + mass, 0.0)}
        yield level("payload-not-carried", **values)
    else:
        yield level("unmodelled-load" if heavy else "light-load", load_kg=mass, **values)


def masses_sd(case: Case, fit: RobustFit, loads: Array) -> Array:
    """SDs of masses by scatter, drive constants and usual errors of links. (k,) [kg]

    `loads` are the columns (W, m, 4k) of k loads, which the fit begins with. Of 30
    simulated loads 28 are within 95 % bands.
    """
    log, masses = case.windows, slice(None, loads.shape[2], 4)
    fitted = np.concatenate([loads, log.friction.columns], axis=2)[fit.kept]
    A, B = map(np.concatenate, (fitted, log.weights.columns[fit.kept]))
    by_links = np.linalg.lstsq(A, B)[0][masses]
    by_gain = gain_sd(log.recording, log.robot) * fit.values[masses]
    return np.asarray(
        np.linalg.norm(np.column_stack([fit.sd[masses], by_gain, by_links]), axis=1)
    )


def load_change(case: Case) -> Remark | None:
    """The finding on a load picked up or set down along the log, or None."""
    count, load = len(case.given), case.windows.load

    def with_two_loads(split: int) -> tuple[RobustFit, Array]:
        """Fit by friction and two loads, before a window and from it on; their columns."""
        late = (np.arange(count) >= split)[:, None, None]
        columns = np.concatenate([load.columns * ~late, load.columns * late], axis=2)
        loads = load._replace(columns=columns, prior=np.tile(load.prior, 2))
        return solve(case.given - case.needed, loads, case.windows.friction), columns

    if with_two_loads(count // 2)[0].size > HALVES * case.loaded.size:
        return None
    tried = {k: with_two_loads(k) for k in map(int, np.linspace(*BETWEEN, 7) * count)}
    split, (fit, loads) = min(tried.items(), key=lambda one: one[1][0].size)
    before, after = fit.values[0], fit.values[4]
    sd = np.hypot(fit.sd[0], fit.sd[4])
    # In one pose any residual passes for a load.
    varied = min(np.ptp(part, axis=0).max() for part in np.split(case.gravity, [split]))
    if fit.size > CHANGED * case.loaded.size or varied < RANGE:
        return None
    if abs(after - before) < max(CHANGE, SURE * sd):
        return None
    at, sd = case.windows.t[split, 0], masses_sd(case, fit, loads).max()
    return warning("load-changes", first_kg=before, last_kg=after, sd_kg=sd, at_s=at)


#: Share of friction lost a kelvin: UR's sizes .011–.022.
PER_KELVIN = 0.015
#: Temperature difference at which friction is 8–15 % off. [K]
FAR = 7.0
NOTICED = 0.2  #: Friction that is worth a finding. [N·m]


def temperature_findings(recording: Recording, robot: Robot) -> Iterator[Remark]:
    """Findings on joint temperatures far from the model's, or missing in the log."""
    if not robot.friction or recording.joints != robot.joints or recording.dq is None:
        return
    temperature = measured_temperature(recording)
    if temperature is not None:
        yield from far_temperature(recording, robot, temperature)
        return
    lawful = np.array([j for j, joint in enumerate(robot.friction) if joint.temperature], int)
    reference = [robot.friction[j].reference_temperature for j in lawful]
    colder = np.full((1, robot.joints), np.nan)
    colder[0, lawful] = np.array(reference) - 10.0
    if (factor := friction_factor(robot.friction, colder)) is not None:
        more = 100.0 * (factor[0, lawful] - 1.0)
        values = {"least_percent": more.min(), "most_percent": more.max()}
        values |= {"reference_C": sorted(set(reference)), "robot": robot.name}
        yield fact("no-temperature", **values)


def far_temperature(recording: Recording, robot: Robot, temperature: Array) -> Iterator[Remark]:
    """Joints with a temperature (T, n) [°C], NaN unknown, far from the model's."""
    far = []
    speeds = abs(recording.require("dq"))
    for j, joint in enumerate(robot.friction):
        used = (speeds[:, j] > MOVES) & ~np.isnan(temperature[:, j])
        # A law follows the temperature.
        known = joint.temperature_at is not None and not joint.temperature
        if joint.model == "none" or not known or not used.any():
            continue
        ends = np.percentile(temperature[used, j], [5.0, 95.0])
        reference = joint.reference_temperature
        seen = ends[abs(ends - reference).argmax()]
        torque = steady_torque(joint, np.median(speeds[used, j], keepdims=True))[0]
        wrong = abs(torque * np.expm1(PER_KELVIN * (reference - seen)))
        if abs(seen - reference) > FAR and wrong >= NOTICED:
            far.append((j, seen, reference, wrong))
    if far:
        joints, seen_C, references, torques = zip(*far, strict=True)
        values = {"seen_C": list(seen_C), "reference_C": sorted(set(references))}
        values |= {"wrong_Nm": list(torques)}
        yield warning("far-temperature", on_joints(joints), robot=robot.name, **values)
