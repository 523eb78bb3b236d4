"""Scenario: one simulated experiment, everything a user may set, as in its TOML file."""

from dataclasses import dataclass, field

from vftcli.simulation.touch import ContactSpec
from vftcli.simulation.trajectories import HoldSpec, TrajectorySpec

Vector = tuple[float, float, float]


@dataclass(frozen=True, kw_only=True)
class ServoSpec:
    """The joint position controller."""

    stiffness: str | float = "stiff"  #: "stiff", "soft", or the loop's natural frequency. [rad/s]
    damping: float = 0.8  #: Damping ratio of that loop.
    #: Whether the nominal model's torque is added (gravity is always compensated).
    feed_forward: bool = True
    torque_limits: bool = True  #: Whether the drives saturate at the robot's limits.


@dataclass(frozen=True, kw_only=True)
class FrictionSpec:
    """How the true friction differs in kind from the profile's smoothed curve."""

    enabled: bool = True  #: False for a frictionless arm.
    #: Dry friction of an arm whose robot file has no friction. (n,) [N·m]
    coulomb: tuple[float, ...] | None = None
    viscous: tuple[float, ...] | None = None  #: Its viscous friction, likewise. (n,) [N·m·s/rad]
    #: Torque at breakaway above the sliding Coulomb torque, as a share of it.
    stribeck: float = 0.0
    stribeck_velocity: float = 0.05  #: Velocity over which that excess fades. [rad/s]
    #: For sigmoid friction: share of its amplitude that is dry and can stick.
    sticking: float = 0.0
    presliding: float = 0.0  #: Share of the Coulomb torque that is presliding friction.
    presliding_length: float = 3e-4  #: Deflection at which that is full. [rad]
    #: Temperature of the joints at the start; not given, that at which the robot's friction was
    #: taken. [°C]
    temperature_begin: float | None = None
    #: Temperature at the end, on a straight line from the start; not given, that at the start.
    #: Friction follows it where the robot has a law. [°C]
    temperature_end: float | None = None


@dataclass(frozen=True, kw_only=True)
class MismatchSpec:
    """How far the arm's own parameters lie from the profile: one standard deviation, relative.

    Each parameter is drawn from the seed, a normal deviate cut at two standard deviations. Zeros
    make the profile exact.
    """

    mass: float = 0.0  #: Link masses (tensors scale with them).
    com: float = 0.0  #: Centres of mass, per axis. [m]
    rotor_inertia: float = 0.0  #: Reflected rotor inertias.
    friction: float = 0.0  #: Every friction parameter.
    torque_constant: float = 0.0  #: Drive constants (or the gain of the link torque sensors).
    torque_offset: float = 0.0  #: Zero error of the link torque sensors. [N·m]
    payload: float = 0.0  #: Mass of the payload.


@dataclass(frozen=True, kw_only=True)
class PayloadSpec:
    """A rigid load on the flange."""

    mass: float  #: Mass. [kg]
    com: Vector = (0.0, 0.0, 0.0)  #: Centre of mass in flange axes. (3,) [m]
    inertia: Vector = (0.0, 0.0, 0.0)  #: Principal moments about it. (3,) [kg·m²]
    #: Whether the controller (its gravity compensation and vendor estimates) knows it.
    known: bool = False


@dataclass(frozen=True, kw_only=True)
class ForceSensorSpec:
    """A force/torque sensor between flange and handle; what is fixed beyond it, it weighs."""

    position: Vector = (0.0, 0.0, 0.03)  #: Origin of the sensor frame in flange axes. (3,) [m]
    #: Fixed-axis angles of the sensor frame on the flange. (3,) [rad]
    rpy: Vector = (0.0, 0.0, 0.0)
    #: Mass of the sensor's own body and everything it carries, felt by the arm. [kg]
    mass: float = 0.0
    com: Vector = (0.0, 0.0, 0.02)  #: Its centre of mass in flange axes. (3,) [m]
    #: The part of `mass` beyond the measuring element, felt by the sensor. [kg]
    tool_mass: float = 0.0
    tool_com: Vector = (0.0, 0.0, 0.03)  #: Its centre of mass in sensor axes. (3,) [m]
    #: Zero offset. (6,) [N, N·m]
    bias: tuple[float, float, float, float, float, float] = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    noise_force: float = 0.0  #: Standard deviation of a force sample. [N]
    noise_torque: float = 0.0  #: Standard deviation of a torque sample. [N·m]
    drift_force: float = 0.0  #: Drift of the force zero. [N/s]
    drift_torque: float = 0.0  #: Drift of the torque zero. [N·m/s]
    known: bool = False  #: Whether the controller knows its weight.


@dataclass(frozen=True, kw_only=True)
class SensingSpec:
    """What the log sees of the arm. Zeros and ones switch each imperfection off."""

    rate: float = 0.0  #: Samples per second; 0 takes the vendor's own. [Hz]
    torque: str = "average"  #: "average" over the sampling interval, or "instant".
    noise: float = 1.0  #: Factor on the profile's noise of position, velocity, current and torque.
    #: Standard deviation of the current in place of the profile's. [A]
    current_noise: float | None = None
    position_step: float = 5e-6  #: Quantisation of positions. [rad]
    dropped: float = 0.0  #: Share of samples lost.
    repeated: float = 0.0  #: Share of rows that repeat the row before.
    jitter: float = 0.0  #: Standard deviation of the time stamps. [s]
    clock_drift: float = 0.0  #: Relative rate error of the log's clock (0.003: 0.3 % fast).
    vendor_cutoff: float = 5.0  #: Cut-off of the vendor's own external-force estimate. [Hz]
    start: float = 100.0  #: The first time stamp on the controller's clock. [s]


@dataclass(frozen=True, kw_only=True)
class Scenario:
    """One simulated experiment."""

    name: str  #: Short name.
    title: str = ""  #: One line on what it shows.
    robot: str = "ur5"  #: Profile name or robot file.
    seed: int = 1  #: Seed of everything drawn, unless another is given.
    duration: float = 0.0  #: Length of the log, 0 for the trajectory's own. [s]
    step: float = 1e-3  #: Inner step of the integration, at most 1 ms. [s]
    format: str = ""  #: Log format, "" for the vendor's usual one.
    columns: str = "full"  #: "full" or "short" recipe of the RTDE log.
    pair: bool = False  #: Whether a second log of the same motion without the payload is written.
    trajectory: TrajectorySpec = field(default_factory=HoldSpec)  #: The commanded motion.
    servo: ServoSpec = field(default_factory=ServoSpec)  #: The position controller.
    friction: FrictionSpec = field(default_factory=FrictionSpec)  #: The true friction's kind.
    #: How far the arm lies from its profile.
    mismatch: MismatchSpec = field(default_factory=MismatchSpec)
    payload: PayloadSpec | None = None  #: A load on the flange.
    force_sensor: ForceSensorSpec | None = None  #: A force/torque sensor on the flange.
    contacts: tuple[ContactSpec, ...] = ()  #: Everything that touches the arm.
    sensing: SensingSpec = field(default_factory=SensingSpec)  #: What the log sees.
