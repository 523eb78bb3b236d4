"""Scenario: one simulated experiment, everything a user may set, as in its TOML file."""

from dataclasses import dataclass, field

from vftcli.simulation.touch import ContactSpec
from vftcli.simulation.trajectories import HoldSpec, TrajectorySpec

Vector = tuple[float, float, float]


@dataclass(frozen=True, kw_only=True)
class ServoSpec:
    """The joint position controller.

    Attributes:
        stiffness: "stiff", "soft", or the loop's natural frequency. [rad/s]
        damping: Damping ratio of that loop.
        feed_forward: Whether the nominal model's torque is added (gravity is always compensated).
        torque_limits: Whether the drives saturate at the robot's limits.
    """

    stiffness: str | float = "stiff"
    damping: float = 0.8
    feed_forward: bool = True
    torque_limits: bool = True


@dataclass(frozen=True, kw_only=True)
class FrictionSpec:
    """How the true friction differs in kind from the profile's smoothed curve.

    Attributes:
        enabled: False for a frictionless arm.
        coulomb: Dry friction of an arm whose robot file has no friction. (n,) [N·m]
        viscous: Its viscous friction, likewise. (n,) [N·m·s/rad]
        stribeck: Torque at breakaway above the sliding Coulomb torque, as a share of it.
        stribeck_velocity: Velocity over which that excess fades. [rad/s]
        sticking: For sigmoid friction: share of its amplitude that is dry and can stick.
        presliding: Share of the Coulomb torque that is presliding friction.
        presliding_length: Deflection at which that is full. [rad]
        temperature_begin: Temperature of the joints at the start; not given, that at which the
            robot's friction was taken. [°C]
        temperature_end: Temperature at the end, on a straight line from the start; not given, that
            at the start. Friction follows it where the robot has a law. [°C]
    """

    enabled: bool = True
    coulomb: tuple[float, ...] | None = None
    viscous: tuple[float, ...] | None = None
    stribeck: float = 0.0
    stribeck_velocity: float = 0.05
    sticking: float = 0.0
    presliding: float = 0.0
    presliding_length: float = 3e-4
    temperature_begin: float | None = None
    temperature_end: float | None = None


@dataclass(frozen=True, kw_only=True)
class MismatchSpec:
    """How far the arm's own parameters lie from the profile: one standard deviation, relative.

    Each parameter is drawn from the seed, a normal deviate cut at two standard deviations. Zeros
    make the profile exact.

    Attributes:
        mass: Link masses (tensors scale with them).
        com: Centres of mass, per axis. [m]
        rotor_inertia: Reflected rotor inertias.
        friction: Every friction parameter.
        torque_constant: Drive constants (or the gain of the link torque sensors).
        torque_offset: Zero error of the link torque sensors. [N·m]
        payload: Mass of the payload.
    """

    mass: float = 0.0
    com: float = 0.0
    rotor_inertia: float = 0.0
    friction: float = 0.0
    torque_constant: float = 0.0
    torque_offset: float = 0.0
    payload: float = 0.0


@dataclass(frozen=True, kw_only=True)
class PayloadSpec:
    """A rigid load on the flange.

    Attributes:
        mass: Mass. [kg]
        com: Centre of mass in flange axes. (3,) [m]
        inertia: Principal moments about it. (3,) [kg·m²]
        known: Whether the controller (its gravity compensation and vendor estimates) knows it.
    """

    mass: float
    com: Vector = (0.0, 0.0, 0.0)
    inertia: Vector = (0.0, 0.0, 0.0)
    known: bool = False


@dataclass(frozen=True, kw_only=True)
class ForceSensorSpec:
    """A force/torque sensor between flange and handle; what is fixed beyond it, it weighs.

    Attributes:
        position: Origin of the sensor frame in flange axes. (3,) [m]
        rpy: Fixed-axis angles of the sensor frame on the flange. (3,) [rad]
        mass: Mass of the sensor's own body and everything it carries, felt by the arm. [kg]
        com: Its centre of mass in flange axes. (3,) [m]
        tool_mass: The part of `mass` beyond the measuring element, felt by the sensor. [kg]
        tool_com: Its centre of mass in sensor axes. (3,) [m]
        bias: Zero offset. (6,) [N, N·m]
        noise_force: Standard deviation of a force sample. [N]
        noise_torque: Standard deviation of a torque sample. [N·m]
        drift_force: Drift of the force zero. [N/s]
        drift_torque: Drift of the torque zero. [N·m/s]
        known: Whether the controller knows its weight.
    """

    position: Vector = (0.0, 0.0, 0.03)
    rpy: Vector = (0.0, 0.0, 0.0)
    mass: float = 0.0
    com: Vector = (0.0, 0.0, 0.02)
    tool_mass: float = 0.0
    tool_com: Vector = (0.0, 0.0, 0.03)
    bias: tuple[float, float, float, float, float, float] = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    noise_force: float = 0.0
    noise_torque: float = 0.0
    drift_force: float = 0.0
    drift_torque: float = 0.0
    known: bool = False


@dataclass(frozen=True, kw_only=True)
class SensingSpec:
    """What the log sees of the arm. Zeros and ones switch each imperfection off.

    Attributes:
        rate: Samples per second; 0 takes the vendor's own. [Hz]
        torque: "average" over the sampling interval, or "instant".
        noise: Factor on the profile's noise of position, velocity, current and torque.
        current_noise: Standard deviation of the current in place of the profile's. [A]
        position_step: Quantisation of positions. [rad]
        dropped: Share of samples lost.
        repeated: Share of rows that repeat the row before.
        jitter: Standard deviation of the time stamps. [s]
        clock_drift: Relative rate error of the log's clock (0.003: 0.3 % fast).
        vendor_cutoff: Cut-off of the vendor's own external-force estimate. [Hz]
        start: The first time stamp on the controller's clock. [s]
    """

    rate: float = 0.0
    torque: str = "average"
    noise: float = 1.0
    current_noise: float | None = None
    position_step: float = 5e-6
    dropped: float = 0.0
    repeated: float = 0.0
    jitter: float = 0.0
    clock_drift: float = 0.0
    vendor_cutoff: float = 5.0
    start: float = 100.0


@dataclass(frozen=True, kw_only=True)
class Scenario:
    """One simulated experiment.

    Attributes:
        name: Short name.
        title: One line on what it shows.
        robot: Profile name or robot file.
        seed: Seed of everything drawn, unless another is given.
        duration: Length of the log, 0 for the trajectory's own. [s]
        step: Inner step of the integration, at most 1 ms. [s]
        format: Log format, "" for the vendor's usual one.
        columns: "full" or "short" recipe of the RTDE log.
        pair: Whether a second log of the same motion without the payload is written.
        trajectory: The commanded motion.
        servo: The position controller.
        friction: The true friction's kind.
        mismatch: How far the arm lies from its profile.
        payload: A load on the flange.
        force_sensor: A force/torque sensor on the flange.
        contacts: Everything that touches the arm.
        sensing: What the log sees.
    """

    name: str
    title: str = ""
    robot: str = "ur5"
    seed: int = 1
    duration: float = 0.0
    step: float = 1e-3
    format: str = ""
    columns: str = "full"
    pair: bool = False
    trajectory: TrajectorySpec = field(default_factory=HoldSpec)
    servo: ServoSpec = field(default_factory=ServoSpec)
    friction: FrictionSpec = field(default_factory=FrictionSpec)
    mismatch: MismatchSpec = field(default_factory=MismatchSpec)
    payload: PayloadSpec | None = None
    force_sensor: ForceSensorSpec | None = None
    contacts: tuple[ContactSpec, ...] = ()
    sensing: SensingSpec = field(default_factory=SensingSpec)
