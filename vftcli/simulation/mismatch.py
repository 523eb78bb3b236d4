"""The arm that is simulated: the profile's, with errors of stated size drawn from the seed."""

from dataclasses import dataclass, replace

import numpy as np

from vftcli.robots import Payload, Robot
from vftcli.robots.bounds import out_of_bounds
from vftcli.robots.chain import Chain
from vftcli.signals.arrays import Array
from vftcli.signals.errors import ParameterError
from vftcli.simulation.friction import DRY, WET, TrueFriction, true_friction
from vftcli.simulation.scenario import MismatchSpec, PayloadSpec, Scenario


@dataclass(frozen=True, kw_only=True)
class TrueArm:
    """The arm as it is, beside the robot the controller and the observers believe in."""

    chain: Chain  #: Geometry and inertia, payload and sensor mounted.
    friction: TrueFriction  #: Friction.
    gain: Array  #: What the torque measurement reads for a unit of torque. (n,)
    offset: Array  #: What it reads for none. (n,) [N·m]
    nominal: Robot  #: The controller's robot: the profile with the payload it knows of.


#: Largest relative deviation: drawn twice as large, it leaves nothing negative.
LARGEST_SHARE = 0.45
#: Deviations that are not relative, and their largest. [m, N·m]
ABSOLUTE = {"com": 1.0, "torque_offset": 1e4}


def deviate(rng: np.random.Generator, size: float, shape: tuple[int, ...]) -> Array:
    """Normal deviates of standard deviation `size`, cut at two standard deviations."""
    draw: Array = size * np.clip(rng.standard_normal(shape), -2.0, 2.0)
    return draw


def as_payload(spec: PayloadSpec, scale: float = 1.0) -> Payload:
    """Return a payload section as a load on the flange, its mass and tensor scaled."""
    values = {"mass": (spec.mass,), "com": spec.com, "inertia": spec.inertia}
    for key, numbers in values.items():
        if why := out_of_bounds(key, numbers):
            raise ParameterError(f"payload.{why}")
    inertia = np.diag(scale * np.array(spec.inertia))
    return Payload(mass=scale * spec.mass, com=np.array(spec.com), inertia=inertia)


def build_arm(scenario: Scenario, robot: Robot, rng: np.random.Generator) -> TrueArm:
    """Draw the arm of a scenario.

    The same numbers are drawn whatever the sizes are, so that switching one error off leaves the
    others as they were.
    """
    sizes, n = scenario.mismatch, robot.joints
    for name, size in vars(sizes).items():
        most = ABSOLUTE.get(name, LARGEST_SHARE)
        if not 0 <= size <= most:
            raise ParameterError(f"mismatch.{name} is {size:g}; it lies within 0 to {most:g}")
    chain = perturbed_chain(robot.loaded_chain, sizes, rng)
    friction = perturbed_friction(true_friction(robot, scenario.friction), sizes, rng)
    gain = 1.0 + deviate(rng, sizes.torque_constant, (n,))
    offset = deviate(rng, sizes.torque_offset, (n,))
    # Drawn whether or not there is a payload, so that other draws do not move.
    scale = 1.0 + float(deviate(rng, sizes.payload, (1,))[0])
    nominal = robot.loaded_chain
    if scenario.payload is not None:
        chain = chain.with_payload(as_payload(scenario.payload, scale))
        if scenario.payload.known:
            nominal = nominal.with_payload(as_payload(scenario.payload))
    if (sensor := scenario.force_sensor) is not None:
        if why := out_of_bounds("mass", (sensor.mass, sensor.tool_mass)):
            raise ParameterError(f"force_sensor.{why}")
        body = Payload(mass=sensor.mass, com=np.array(sensor.com), inertia=np.zeros((3, 3)))
        chain = chain.with_payload(body)
        if sensor.known:
            nominal = nominal.with_payload(body)
    believed = replace(robot, chain=nominal, payload=None)
    return TrueArm(chain=chain, friction=friction, gain=gain, offset=offset, nominal=believed)


def perturbed_chain(chain: Chain, sizes: MismatchSpec, rng: np.random.Generator) -> Chain:
    """Return a chain with erring masses, centres of mass and rotor inertias, still physical."""
    n = chain.joints
    mass = 1.0 + deviate(rng, sizes.mass, (n,))
    com = deviate(rng, sizes.com, (n, 3))
    rotor = 1.0 + deviate(rng, sizes.rotor_inertia, (n,))
    return replace(
        chain,
        mass=chain.mass * mass,
        com=chain.com + com,
        inertia=chain.inertia * mass[:, None, None],
        rotor_inertia=chain.rotor_inertia * rotor,
    )


def perturbed_friction(
    friction: TrueFriction, sizes: MismatchSpec, rng: np.random.Generator
) -> TrueFriction:
    """Return friction whose dry and viscous levels err independently, joint by joint."""
    n = len(friction.coulomb)
    dry, wet = (1.0 + deviate(rng, sizes.friction, (n,)) for _ in range(2))
    levels = {**dict.fromkeys(DRY, dry), **dict.fromkeys(WET, wet)}
    return replace(friction, **{name: getattr(friction, name) * k for name, k in levels.items()})
