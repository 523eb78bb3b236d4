"""One simulated experiment from scenario and seed to the log and its truth."""

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from vftcli.robots import Robot, load_robot
from vftcli.robots.chain import Chain, flange_jacobian, link_poses
from vftcli.signals.arrays import Array, resample_columns
from vftcli.signals.errors import ParameterError
from vftcli.signals.progress import stage, steps
from vftcli.signals.recording import Recording, Source
from vftcli.signals.remarks import fact
from vftcli.signals.shown import per_joint
from vftcli.signals.wrench import WrenchFrame, per_axis
from vftcli.simulation.arm import Arm
from vftcli.simulation.scenario import Scenario
from vftcli.simulation.sensing import Measured, Samples, check_sensing, measure_run, sample_run
from vftcli.simulation.trajectories import Reference, plan

#: Most inner steps of a run: half an hour at 1 ms, a gigabyte of history.
MOST_STEPS = 2_000_000
#: Offset between the seeds of the two runs' sensors, so that their noise differs.
PAIR_SEED = 1_000_003


class Truth(NamedTuple):
    """True torques and wrenches at each sample, on the log's clock."""

    t: Array  #: Time since the log's first sample, without jitter. (M,) [s]
    tau_ext: Array  #: External torque on the robot, Σ Jᵢᵀ wᵢ over the contacts. (M, n) [N·m]
    #: Wrench of all contacts on the flange, about its origin, in base axes. (M, 6)
    wrench: Array
    #: Name → wrench of each contact elsewhere, about its own point, in base axes. (M, 6)
    contacts: dict[str, Array]

    def columns(self) -> dict[str, Array]:
        """Columns of the truth file, t from the first sample. (M,) each"""
        table = {"t": self.t}
        table |= [*per_joint("tau_ext", self.tau_ext), *per_axis("wrench", self.wrench)]
        for name, values in self.contacts.items():
            table |= per_axis(f"contact/{name}", values)
        return table


class Simulation(NamedTuple):
    """A finished run."""

    scenario: Scenario  #: The experiment.
    seed: int  #: The seed used.
    robot: Robot  #: The profile.
    nominal: Robot  #: The controller's: the profile with its payload.
    samples: Samples  #: True signals at the sampling instants.
    measured: Measured  #: The controller's log.
    truth: Truth  #: What really happened.

    def flanges(self) -> "tuple[FlangeMotion, FlangeMotion]":
        """The flange as it is measured, and as it is commanded."""
        seen, asked, chain = self.measured.signals, self.samples, self.nominal.chain
        commanded = flange_motion(chain, asked.target_q, asked.target_dq)
        return flange_motion(chain, seen["q"], seen["dq"]), commanded

    @property
    def recording(self) -> Recording:
        """The log as from a reader: repeats dropped, losses left as gaps."""
        stamp, written, signals = self.measured
        rows = np.unique(written)
        duplicates = len(written) - len(rows)
        remarks = (fact("repeats-dropped", rows=duplicates),) if duplicates else ()
        # A UR logs temperatures, a Franka its estimate of contact.
        other = "tau_ext" if "current" in signals else "temperature"
        columns: dict[str, Any] = {k: x[rows] for k, x in signals.items() if k != other}
        return Recording(
            t=stamp[rows] - stamp[rows[0]],
            **columns,
            wrench_frame=WrenchFrame("sensor", "sensor") if "wrench" in signals else None,
            joint_names=self.robot.chain.names,
            robot_hint=self.robot.name,
            source=Source(
                format="simulation",
                clock="simulated controller clock",
                rows=len(written),
                duplicates=duplicates,
                remarks=remarks,
            ),
        )


def prepare(scenario: Scenario, seed: int) -> tuple[Arm, Reference]:
    """A scenario's arm, ready for the first step, and its planned motion.

    Raises:
        ParameterError: If the scenario is impossible.
    """
    check_sensing(scenario.sensing)
    robot = load_robot(scenario.robot)
    duration = scenario.duration or scenario.trajectory.motion(robot).duration
    if duration <= 0 or scenario.step <= 0:
        raise ParameterError(
            f"duration {duration:g} s and step {scenario.step:g} s: both must be positive"
        )
    if duration / scenario.step > MOST_STEPS:
        raise ParameterError(
            f"duration {duration:g} s at a step of {scenario.step:g} s is more than {MOST_STEPS} "
            "steps; shorten it"
        )
    steps = int(np.ceil(duration / scenario.step - 1e-9))
    reference = plan(
        scenario.trajectory, robot, np.arange(steps + 1, dtype=float) * scenario.step
    )
    arm = Arm(scenario, seed, Reference(*(rows[:1] for rows in reference)), duration)
    return arm, reference


def simulate(
    scenario: Scenario, seed: int | None = None, noise_seed: int | None = None
) -> Simulation:
    """Run an experiment: one scenario and seed give one result on a platform.

    The seed is of everything drawn, the scenario's own if not given; that of the noise, of
    the sensors alone, is for another log of the same arm and contacts.

    Raises:
        ParameterError: If the scenario is impossible.
    """
    arm, reference = prepare(scenario, scenario.seed if seed is None else seed)
    if noise_seed is not None:
        arm.seeds["sensing"] = np.random.SeedSequence(noise_seed)
    forward = arm.servo.feed_forward(reference)
    stage("simulating")
    for k in steps(range(arm.steps)):
        arm.command(reference.q[k], reference.dq[k], reference.ddq[k], forward[k])
    return observe(arm)


def observe(arm: Arm) -> Simulation:
    """The log and truth of a finished run, whoever commanded it."""
    samples = sample_run(arm)
    truth = truth_of(arm, samples)
    return Simulation(
        scenario=arm.scenario,
        seed=arm.seed,
        robot=arm.robot,
        nominal=arm.true.nominal,
        samples=samples,
        measured=measure_run(arm, samples, truth.wrench),
        truth=truth,
    )


def simulate_pair(scenario: Scenario, seed: int | None = None) -> list[Simulation]:
    """An experiment's run, and if it is one of a pair the free run of the same arm."""
    run = simulate(scenario, seed)
    if not scenario.pair:
        return [run]
    if scenario.payload is None and not scenario.contacts:
        raise ParameterError("pair = true needs a payload or contacts that the free run lacks")
    free = replace(scenario, payload=None, contacts=(), pair=False)
    return [run, simulate(free, run.seed, noise_seed=run.seed + PAIR_SEED)]


def truth_of(arm: Arm, samples: Samples) -> Truth:
    """Evaluate the contacts at the log's sampling instants."""
    made, chain = arm.made, arm.true.chain
    middle = (np.arange(made, dtype=float) + 0.5) * arm.scenario.step
    time, wrenches = samples.time, arm.wrenches[:made].swapaxes(0, 1)
    tau_ext, flange = np.zeros(samples.q.shape), np.zeros((len(samples.time), 6))
    poses, contacts = link_poses(chain, samples.q), dict[str, Array]()
    for contact, exerted in zip(arm.touching.mounted, wrenches, strict=True):
        joint, wrench = contact.joint, resample_columns(time, middle, exerted)
        force, moment = np.hsplit(wrench, 2)
        turn, place = poses.rotation[:, joint - 1], poses.translation[:, joint - 1]
        # About each joint's origin; a joint turns about z.
        levers = (place + turn @ contact.point)[:, None] - poses.translation[:, :joint]
        moved = moment[:, None] + np.cross(levers, force[:, None])
        tau_ext[:, :joint] += np.sum(poses.rotation[:, :joint, :, 2] * moved, axis=2)
        if contact.lever is None:
            contacts[contact.name] = wrench
        else:
            lever = turn @ contact.turn @ contact.lever
            flange += np.hstack([force, moment + np.cross(lever, force)])
    return Truth(t=samples.stamp, tau_ext=tau_ext, wrench=flange, contacts=contacts)


class FlangeMotion(NamedTuple):
    """The flange along a motion, base axes."""

    rotation: Array  # (M, 3, 3)
    position: Array  # (M, 3) [m]
    twist: Array  # linear, angular (M, 6) [m/s, rad/s]
    jacobian: Array  # about the flange (M, 6, n)


def flange_motion(chain: Chain, q: Array, dq: Array) -> FlangeMotion:
    """The flange at positions and velocities (M, n) [rad, rad/s]."""
    poses, jacobian = link_poses(chain, q), flange_jacobian(chain, q)
    twist = np.einsum("kij,kj->ki", jacobian, dq)
    return FlangeMotion(poses.rotation[:, -1], poses.translation[:, -1], twist, jacobian)
