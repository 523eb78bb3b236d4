"""The simulated arm with servo and contacts, one inner step at a time."""

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from vftcli.robots import Payload, Robot, load_robot
from vftcli.robots.chain import Chain
from vftcli.robots.friction import COLDEST, WARMEST, friction_factor, friction_torque
from vftcli.robots.robot import REFERENCE
from vftcli.robots.robot_file import out_of_bounds
from vftcli.signals.arrays import Array
from vftcli.signals.errors import ParameterError
from vftcli.signals.parsing import check_known
from vftcli.simulation.contacts import Touching
from vftcli.simulation.plant import Plant, TrueFriction, true_friction
from vftcli.simulation.scenario import PayloadSpec, Scenario, ServoSpec
from vftcli.simulation.trajectories import Reference

#: Natural frequency of the position loop by name. [rad/s]
STIFFNESS = {"stiff": 90.0, "soft": 28.0}
#: Largest natural frequency times step: beyond it the loop is badly damped or unstable.
FASTEST_LOOP = 0.4
WARMING_STEPS = 250  #: Inner steps between updates of the temperature.
CHECK_STEPS = 10  #: Inner steps between two looks for a runaway.
RUNAWAY = 200.0  #: Joint velocity no arm reaches. [rad/s]
#: Largest relative deviation: drawn twice as large, it leaves nothing negative.
LARGEST_SHARE = 0.45
#: Signals of the joints that a run keeps: `vftcli.simulation.sensing.Samples` explains them.
KEPT = ("q", "v", "a", "tau", "friction", "target_q", "target_dq", "target_ddq")
#: Deviations that are not relative, and their largest. [m, N·m]
ABSOLUTE = {"com": 1.0, "torque_offset": 1e4}


class Servo:
    """τ = τ_ff + M(q) (ω² (q_d − q) + 2ζω (q̇_d − q̇)), within the drives' limits.

    One number sets the stiffness, and the inertia as gain gives all modes one bandwidth.
    """

    def __init__(self, spec: ServoSpec, robot: Robot, step: float) -> None:
        import pinocchio as pin

        self.inertia = pin.crba
        omega = spec.stiffness
        if isinstance(omega, str):
            check_known(omega, STIFFNESS, f"no servo.stiffness {omega!r}")
            omega = STIFFNESS[omega]
        if omega <= 0 or spec.damping < 0:
            raise ParameterError("servo.stiffness must be positive and damping not negative")
        if omega * step > FASTEST_LOOP:
            raise ParameterError(
                f"servo.stiffness {omega:g} rad/s chatters at a step of {step:g} s; it can be at "
                f"most {FASTEST_LOOP / step:g}, or choose a smaller step"
            )
        self.spec, self.robot = spec, robot
        self.model, self.data = robot.model, robot.model.createData()
        self.omega, self.rate = omega, 2.0 * spec.damping * omega
        limits = robot.limits
        self.limit = np.fmin(limits.tau_max if spec.torque_limits else np.inf, np.inf)
        self.q_min, self.q_max = np.fmax(limits.q_min, -np.inf), np.fmin(limits.q_max, np.inf)

    def feed_forward(self, reference: Reference) -> Array:
        """Nominal torque along a reference; gravity only if so asked. (T, n) [N·m]"""
        if not self.spec.feed_forward:
            reference = Reference(reference.q, *np.zeros((2, *reference.q.shape)))
        rubs = friction_torque(self.robot.friction, reference.dq)
        return rigid_torque(self.model, reference) + rubs

    def torque(self, forward: Array, q_d: Array, dq_d: Array, q: Array, dq: Array) -> Array:
        """The torque commanded at a state (q, dq), within the limits. (n,) [N·m]"""
        pull = self.omega**2 * (q_d - q) + self.rate * (dq_d - dq)
        tau: Array = forward + self.inertia(self.model, self.data, q) @ pull
        return np.minimum(np.maximum(tau, -self.limit), self.limit)


def rigid_torque(model: Any, reference: Reference) -> Array:  # noqa: ANN401
    """Inverse dynamics of a Pinocchio model along a motion. (T, n) [N·m]"""
    import pinocchio as pin

    data, out = model.createData(), np.empty_like(reference.q)
    for k, (q, dq, ddq) in enumerate(zip(*reference, strict=True)):
        out[k] = pin.rnea(model, data, q, dq, ddq)
    return out


class TrueArm(NamedTuple):
    """The true arm, beside the robot of the controller and the observers."""

    chain: Chain  #: Geometry and inertia, payload and sensor mounted.
    friction: TrueFriction  #: Friction.
    gain: Array  #: What is read for a unit of torque. (n,)
    offset: Array  #: What it reads for none. (n,) [N·m]
    nominal: Robot  #: The controller's: the profile with its payload.


class Arm:
    """An arm under its servo, touched by its scenario's contacts.

    A controller in the loop calls `command` and reads `q`, `v`, `mean_torque`.
    """

    def __init__(self, scenario: Scenario, seed: int, start: Reference, duration: float) -> None:
        """Prepare a run of a length [s] from the reference's one row."""
        if not isinstance(seed, (int, np.integer)) or seed < 0:
            raise ParameterError(f"the seed is {seed!r}; it must be zero or positive")
        for name in ("temperature_begin", "temperature_end"):
            value = getattr(scenario.friction, name)
            if value is not None and not COLDEST <= value <= WARMEST:
                raise ParameterError(
                    f"friction.{name} is {value:g} °C; a joint has {COLDEST:g} to {WARMEST:g} °C"
                )
        self.scenario, self.seed = scenario, seed
        self.robot: Robot = load_robot(scenario.robot)
        names = "arm", "contacts", "sensing"
        seeds = np.random.SeedSequence(seed).spawn(3)
        self.seeds: dict[str, Any] = dict(zip(names, seeds, strict=True))
        rng = np.random.default_rng(self.seeds["arm"])
        self.true: TrueArm = build_arm(scenario, self.robot, rng)
        h = scenario.step
        q, v = start.q[0], start.dq[0]
        self.plant = Plant(self.true.chain.to_pinocchio(), self.true.friction, q, v, h)
        self.servo = Servo(scenario.servo, self.true.nominal, h)
        self.steps, self.made = int(np.ceil(duration / h - 1e-9)), 0
        contacts, lasts = scenario.contacts, self.steps * h
        self.touching = Touching(contacts, self.robot.chain, lasts, self.seeds["contacts"])
        #: Row k covers k·step to (k+1)·step, one more is the state after the last. State and
        #: reference are at a step's start, all else holds over it.
        rows = self.steps + 1
        self.history = {name: np.zeros((rows, len(q))) for name in KEPT}
        #: Wrench of each contact at the middle of the step. (N, C, 6) [N, N·m]
        self.wrenches = np.zeros((rows, *self.touching.wrenches.shape))

    @property
    def t(self) -> float:
        """True time since the start of the run. [s]"""
        return self.made * self.scenario.step

    @property
    def q(self) -> Array:
        """True positions now. (n,) [rad]"""
        return self.plant.q

    @property
    def v(self) -> Array:
        """True velocities now. (n,) [rad/s]"""
        return self.plant.v

    def command(
        self,
        q_d: Array,
        dq_d: Array | None = None,
        ddq_d: Array | None = None,
        forward: Array | None = None,
    ) -> None:
        """Make one inner step to commanded positions. (n,) [rad]

        Velocities and accelerations default to zero, feed-forward torque to the servo's own.
        """
        rest = np.zeros_like(q_d)
        dq_d, ddq_d = rest if dq_d is None else dq_d, rest if ddq_d is None else ddq_d
        if forward is None:
            q_d = q_d.clip(self.servo.q_min, self.servo.q_max)
            reference = Reference(q_d[None], dq_d[None], ddq_d[None])
            forward = self.servo.feed_forward(reference)[0]
        history, plant, k = self.history, self.plant, self.made
        if k >= self.steps:
            raise ParameterError(f"the run was prepared for {self.steps} steps and has made them")
        tau = self.servo.torque(forward, q_d, dq_d, plant.q, plant.v)
        history["q"][k], history["v"][k], history["tau"][k] = plant.q, plant.v, tau
        for name, target in zip(KEPT[-3:], (q_d, dq_d, ddq_d), strict=True):
            history[name][k] = target
        t = (k + 0.5) * plant.step
        if k % WARMING_STEPS == 0:
            temperature = self.temperature(np.array([t]))
            if (factor := friction_factor(self.robot.friction, temperature)) is not None:
                plant.true_friction = self.true.friction.times(factor[0], factor[0])
        # Contacts cost Jacobians; most steps have none.
        if any(m.contact.index_at(t) is not None for m in self.touching.mounted):
            plant.advance(tau, lambda m, data, v: self.touching.torque(t, m, data, v))
            self.wrenches[k] = self.touching.wrenches
        else:
            plant.advance(tau)
        history["a"][k], history["friction"][k] = plant.a, plant.friction
        self.made = k + 1
        if k % CHECK_STEPS == 0:
            self.check_motion()

    def check_motion(self) -> None:
        """Raise a ParameterError if the loop has become unstable."""
        fastest = abs(self.plant.v).max()
        if not fastest < RUNAWAY:
            raise ParameterError(
                f"the arm runs away at {self.t:.3f} s: servo or contacts are too stiff for a step "
                f"of {self.scenario.step:g} s; lower servo.stiffness, a contact's stiffness or step"
            )

    def temperature(self, t: Array) -> Array:
        """The joints' temperature at true times (N,) [s]. (N, n) [°C]"""
        spec, friction = self.scenario.friction, self.robot.friction
        references = [joint.reference_temperature for joint in friction]
        begin = np.array(references or [REFERENCE] * len(self.q))
        if spec.temperature_begin is not None:
            begin[:] = spec.temperature_begin
        end = begin if spec.temperature_end is None else np.full_like(begin, spec.temperature_end)
        share = (t / (self.steps * self.scenario.step))[:, None]
        return np.asarray(begin + (end - begin) * share)

    def close(self) -> dict[str, Array]:
        """The history so far, its last row filled."""
        self.check_motion()
        history, k = self.history, self.made
        for array in history.values():
            array[k] = array[k - 1]
        history["q"][k], history["v"][k] = self.plant.q, self.plant.v
        return {name: array[: k + 1] for name, array in history.items()}

    def mean_torque(self, interval: float) -> Array:
        """Mean drive torque over the last `interval` [s], as a log has it. (n,) [N·m]"""
        rows = max(round(interval / self.scenario.step), 1)
        tau = self.history["tau"][max(self.made - rows, 0) : max(self.made, 1)]
        mean: Array = tau.mean(axis=0)
        return mean / self.true.gain + self.true.offset


def deviate(rng: np.random.Generator, size: float, shape: tuple[int, ...]) -> Array:
    """Normal deviates of SD `size`, cut at two SDs."""
    return size * rng.standard_normal(shape).clip(-2.0, 2.0)


def as_payload(spec: PayloadSpec, scale: float = 1.0) -> Payload:
    """A payload section as a load on the flange, scaled."""
    values = {"mass": (spec.mass,), "com": spec.com, "inertia": spec.inertia}
    for key, numbers in values.items():
        if why := out_of_bounds(key, numbers):
            raise ParameterError(f"payload.{why}")
    inertia = np.diag(scale * np.array(spec.inertia))
    return Payload(mass=scale * spec.mass, com=np.array(spec.com), inertia=inertia)


def build_arm(scenario: Scenario, robot: Robot, rng: np.random.Generator) -> TrueArm:
    """The arm of a scenario; sizes do not change what is drawn."""
    sizes, n = scenario.mismatch, robot.joints
    for name, size in vars(sizes).items():
        most = ABSOLUTE.get(name, LARGEST_SHARE)
        if not 0 <= size <= most:
            raise ParameterError(f"mismatch.{name} is {size:g}; it is within 0 to {most:g}")
    nominal = chain = robot.loaded_chain
    mass = 1.0 + deviate(rng, sizes.mass, (n,))
    com = deviate(rng, sizes.com, (n, 3))
    rotor = 1.0 + deviate(rng, sizes.rotor_inertia, (n,))
    chain = replace(
        chain,
        mass=chain.mass * mass,
        com=chain.com + com,
        inertia=chain.inertia * mass[:, None, None],
        rotor_inertia=chain.rotor_inertia * rotor,
    )
    dry, wet = (1.0 + deviate(rng, sizes.friction, (n,)) for _ in range(2))
    friction = true_friction(robot, scenario.friction).times(dry, wet)
    gain = 1.0 + deviate(rng, sizes.torque_constant, (n,))
    offset = deviate(rng, sizes.torque_offset, (n,))
    # Always drawn, so that other draws do not move.
    scale = 1.0 + deviate(rng, sizes.payload, (1,))[0]
    if scenario.payload is not None:
        chain = chain.with_payload(as_payload(scenario.payload, scale))
        if scenario.payload.known:
            nominal = nominal.with_payload(as_payload(scenario.payload))
    if (sensor := scenario.force_sensor) is not None:
        if why := out_of_bounds("mass", (sensor.mass, sensor.tool_mass)):
            raise ParameterError(f"force_sensor.{why}")
        body = Payload(mass=sensor.mass, com=np.array(sensor.com))
        chain = chain.with_payload(body)
        if sensor.known:
            nominal = nominal.with_payload(body)
    believed = replace(robot, chain=nominal, payload=None)
    return TrueArm(chain=chain, friction=friction, gain=gain, offset=offset, nominal=believed)
