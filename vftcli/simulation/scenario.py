"""Scenarios: all settings of a simulated experiment, from TOML and back."""

import types
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import MISSING, fields
from pathlib import Path
from typing import Any, TypeVar, Union, get_args, get_origin, get_type_hints

from vftcli.robots.robot_file import (
    LIST,
    SWITCH,
    TABLE,
    TEXT,
    WHOLE,
    ValueKind,
    is_finite,
    lines_of,
)
from vftcli.signals.errors import ParameterError
from vftcli.signals.option import assignment
from vftcli.signals.parsing import check_known, toml_file, toml_tables
from vftcli.simulation.trajectories import HoldSpec, Spec, TrajectorySpec

FOLDER = Path(__file__).parent / "scenarios"
SCENARIOS = tuple(sorted(path.stem for path in FOLDER.glob("*.toml")))  #: Built-in names.
Section = TypeVar("Section")
#: Largest number of a scenario in any unit; clocks that count from 1970 begin below it.
LARGEST = 1e10
#: Type of a field → its kind.
KINDS = {
    bool: SWITCH,
    float: ValueKind(
        f"a finite number, {LARGEST:g} at most", lambda v: is_finite(v) and abs(v) <= LARGEST
    ),
    int: WHOLE,
    str: TEXT,
}
Vector = tuple[float, float, float]
ORIGIN = (0.0, 0.0, 0.0)


class ServoSpec(Spec):
    """The joint position controller."""

    #: "stiff", "soft", or the loop's natural frequency. [rad/s]
    stiffness: str | float = "stiff"
    damping: float = 0.8  #: Damping ratio of that loop.
    #: Whether the nominal model's torque is added (gravity is always compensated).
    feed_forward: bool = True
    torque_limits: bool = True  #: Whether the drives saturate at the robot's limits.


class FrictionSpec(Spec):
    """True friction's differences in kind from the profile's smoothed curve."""

    enabled: bool = True  #: False for a frictionless arm.
    #: Dry friction of an arm without friction in its robot file. (n,) [N·m]
    coulomb: tuple[float, ...] | None = None
    viscous: tuple[float, ...] | None = None  #: Its viscous friction. (n,) [N·m·s/rad]
    #: Torque at breakaway above the sliding Coulomb torque, as a share of it.
    stribeck: float = 0.0
    stribeck_velocity: float = 0.05  #: Velocity over which that excess fades. [rad/s]
    #: For sigmoid friction: share of its amplitude that is dry and can stick.
    sticking: float = 0.0
    presliding: float = 0.0  #: Share of the Coulomb torque that is presliding friction.
    presliding_length: float = 3e-4  #: Deflection at which that is full. [rad]
    #: Of the joints at the start; None: the friction's own. [°C]
    temperature_begin: float | None = None
    #: Temperature at the end of a straight line from the start; the start's if not given.
    #: Friction follows it where the robot has a law. [°C]
    temperature_end: float | None = None


class MismatchSpec(Spec):
    """Relative SDs of the arm from its profile.

    Each is drawn by the seed, a normal deviate cut at two deviations. 0 keeps the profile.
    """

    mass: float = 0.0  #: Link masses (tensors scale with them).
    com: float = 0.0  #: Centres of mass, per axis. [m]
    rotor_inertia: float = 0.0  #: Reflected rotor inertias.
    friction: float = 0.0  #: Every friction parameter.
    torque_constant: float = 0.0  #: Drive constants (or the gain of the link torque sensors).
    torque_offset: float = 0.0  #: Zero error of the link torque sensors. [N·m]
    payload: float = 0.0  #: Mass of the payload.


class PayloadSpec(Spec):
    """A rigid load on the flange."""

    mass: float  #: Mass. [kg]
    com: Vector = ORIGIN  #: Centre of mass in flange axes. (3,) [m]
    inertia: Vector = ORIGIN  #: Principal moments about it. (3,) [kg·m²]
    #: Whether the controller (its gravity compensation and vendor estimates) knows it.
    known: bool = False


class ForceSensorSpec(Spec):
    """A force/torque sensor between flange and handle; it weighs what lies beyond it."""

    position: Vector = (0.0, 0.0, 0.03)  #: Origin of the sensor frame in flange axes. (3,) [m]
    #: Fixed-axis angles of the sensor frame on the flange. (3,) [rad]
    rpy: Vector = ORIGIN
    #: Mass of the sensor's own body and everything it carries, felt by the arm. [kg]
    mass: float = 0.0
    com: Vector = (0.0, 0.0, 0.02)  #: Its centre of mass in flange axes. (3,) [m]
    #: The part of `mass` beyond the measuring element, felt by the sensor. [kg]
    tool_mass: float = 0.0
    tool_com: Vector = (0.0, 0.0, 0.03)  #: Its centre of mass in sensor axes. (3,) [m]
    #: Zero offset. (6,) [N, N·m]
    bias: tuple[float, float, float, float, float, float] = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    noise_force: float = 0.0  #: SD of a force sample. [N]
    noise_torque: float = 0.0  #: SD of a torque sample. [N·m]
    drift_force: float = 0.0  #: Drift of the force zero. [N/s]
    drift_torque: float = 0.0  #: Drift of the torque zero. [N·m/s]
    known: bool = False  #: Whether the controller knows its weight.


class SensingSpec(Spec):
    """Imperfections of the log. Zeros and ones switch each of them off."""

    rate: float = 0.0  #: Samples per second; 0 takes the vendor's own. [Hz]
    torque: str = "average"  #: "average" over the sampling interval, or "instant".
    #: Factor on the profile's noise of position, velocity, current and torque.
    noise: float = 1.0
    #: SD of the current in place of the profile's. [A]
    current_noise: float | None = None
    position_step: float = 5e-6  #: Quantisation of positions. [rad]
    dropped: float = 0.0  #: Share of samples lost.
    repeated: float = 0.0  #: Share of rows that repeat the row before.
    jitter: float = 0.0  #: SD of the time stamps. [s]
    clock_drift: float = 0.0  #: Relative rate error of the log's clock (0.003: 0.3 % fast).
    vendor_cutoff: float = 5.0  #: Cut-off of the vendor's own external-force estimate. [Hz]
    start: float = 100.0  #: The first time stamp on the controller's clock. [s]


class OnLink(Spec):
    """Where a contact acts with a wrench."""

    name: str  #: Name of the contact.
    link: int = 0  #: The link it acts on; 0 for the flange.
    point: Vector = ORIGIN  #: The point in the link's frame. (3,) [m]


class ProfileSpec(OnLink, kind="profile"):
    """A stated wrench in base axes, switched on and off smoothly at stated times."""

    spans: tuple[tuple[float, float], ...]  #: Start and end of each application. (K, 2) [s]
    force: Vector = ORIGIN  #: Force ON the robot. (3,) [N]
    torque: Vector = ORIGIN  #: Moment ON the robot about the point. (3,) [N·m]
    rise: float = 0.2  #: Time to the full wrench. [s]
    fall: float = 0.2  #: Time of the release. [s]


class PushesSpec(OnLink, kind="pushes"):
    """Pushes of random strength and direction, like a hand's, drawn by the seed."""

    style: str = "slow"  #: "slow", "taps" or "mixed"; the ranges below override its own.
    begin: float = 0.0  #: No push before this. [s]
    end: float = 0.0  #: No push after this; 0 for the end of the log. [s]
    length: tuple[float, float] | None = None  #: Shortest and longest push. [s]
    pause: tuple[float, float] | None = None  #: Shortest and longest pause. [s]
    force: tuple[float, float] | None = None  #: Smallest and largest peak force. [N]
    torque: tuple[float, float] | None = None  #: Smallest and largest peak moment. [N·m]
    vertical: float = 0.5  #: Share of the force that may point along base z.


class HandSpec(OnLink, kind="hand"):
    """A hand on the handle for some spans: a spring and damper to a moving anchor."""

    #: When it grabs and when it lets go, one pair a grab. (K, 2) [s]
    spans: tuple[tuple[float, float], ...]
    #: Displacement of the hand's anchor in each grab, in base axes. (K, 3) [m]
    moves: tuple[Vector, ...] = ()
    #: Rotation vector of the anchor in each grab, in base axes. (K, 3) [rad]
    turns: tuple[Vector, ...] = ()
    reach: float = 0.6  #: Time in which the hand makes its move. [s]
    release: float = 0.08  #: Time in which the hand lets go, before the end of each span. [s]
    stiffness: float = 200.0  #: Spring to the hand's position. [N/m]
    damping: float = 15.0  #: Damper. [N·s/m]
    twist_stiffness: float = 0.0  #: Spring to the hand's orientation. [N·m/rad]
    twist_damping: float = 0.0  #: Damper. [N·m·s/rad]


class StopSpec(OnLink, kind="stop"):
    """A hard stop: a plane that pushes back when the point goes beyond it."""

    through: Vector  #: A point of the plane in the base frame. (3,) [m]
    normal: Vector = (0.0, 0.0, 1.0)  #: Its normal, pointing to the free side. (3,)
    stiffness: float = 2e4  #: Stiffness of the plane. [N/m]
    damping: float = 200.0  #: Damping while pressed. [N·s/m]


#: Every kind of ``[[contacts]]`` a scenario can have.
ContactSpec = ProfileSpec | PushesSpec | HandSpec | StopSpec


class Scenario(Spec):
    """One simulated experiment."""

    name: str  #: Short name.
    title: str = ""  #: One line on what it shows.
    robot: str = "ur5"  #: Profile name or robot file.
    seed: int = 1  #: Seed of everything drawn, unless another is given.
    duration: float = 0.0  #: Length of the log, 0 for the trajectory's own. [s]
    step: float = 1e-3  #: Inner step of the integration, at most 1 ms. [s]
    format: str = ""  #: Log format, "" for the vendor's usual one.
    columns: str = "full"  #: "full" or "short" recipe of the RTDE log.
    #: Whether a second log of the same motion without the payload is written.
    pair: bool = False
    trajectory: TrajectorySpec = HoldSpec()  #: The commanded motion.
    servo: ServoSpec = ServoSpec()  #: The position controller.
    friction: FrictionSpec = FrictionSpec()  #: The true friction's kind.
    #: How far the arm lies from its profile.
    mismatch: MismatchSpec = MismatchSpec()
    payload: PayloadSpec | None = None  #: A load on the flange.
    force_sensor: ForceSensorSpec | None = None  #: A force/torque sensor on the flange.
    contacts: tuple[ContactSpec, ...] = ()  #: Everything that touches the arm.
    sensing: SensingSpec = SensingSpec()  #: What the log sees.


def load_scenario(name: str | Path, overrides: Sequence[str] = ()) -> Scenario:
    """A built-in scenario or a user's TOML file, with `key=value` overrides applied.

    Overrides are as ``servo.stiffness=soft`` or ``contacts.hand.style=taps``: values are
    TOML, a bare word is a string.

    Raises:
        ParameterError: If there is no such scenario, key or kind, or a value has the wrong type.
    """
    path = FOLDER / f"{name}.toml"
    if not path.is_file():
        path = Path(name)
        if path.suffix.lower() != ".toml":
            check_known(str(name), SCENARIOS, f"no FILE.toml and no scenario {str(name)!r}")
    table = toml_file(path, "a scenario")
    table.setdefault("name", path.stem)
    for override in overrides:
        apply_override(table, override)
    return section_from(Scenario, table, "")


def apply_override(table: dict[str, Any], override: str) -> None:
    """Put one `key=value` into the parsed file; contacts go by name."""
    key, text = assignment(override, "--set", "key=value")
    parts = key.split(".")
    node: Any = {"": table}
    for depth, part in enumerate(["", *parts[:-1]]):
        where = ".".join(parts[:depth])
        if isinstance(node, list):
            node = {str(c.get("name")): c for c in reversed(node) if isinstance(c, dict)}
            check_known(part, [*node][::-1] or ["no contact"], f"no contact {where!r}")
        node = node.setdefault(part, {})
        if not isinstance(node, dict if depth == len(parts) - 1 else dict | list):
            raise ParameterError(f"{where} is a value, not a section")
    try:
        node[parts[-1]] = toml_tables(f"x = {text}")["x"]
    except ParameterError:
        node[parts[-1]] = text


def section_from(cls: type[Section], table: Mapping[str, Any], where: str) -> Section:
    """A section's dataclass from its TOML table; errors name the wrong key."""
    keys = fields(cls)  # type: ignore[arg-type]
    paths = {key.name: f"{where}.{key.name}".lstrip(".") for key in keys}
    for name in table:
        check_known(name, paths, f"no key {f'{where}.{name}'.lstrip('.')!r}")
    for key in keys:
        if key.name not in table and key.default is key.default_factory is MISSING:
            raise ParameterError(
                f"{paths[key.name]} is missing; [{where or 'scenario'}] takes {', '.join(paths)}"
            )
    hints = get_type_hints(cls)
    return cls(
        **{name: convert(value, hints[name], paths[name]) for name, value in table.items()}
    )


def convert(value: Any, hint: Any, where: str) -> Any:  # noqa: ANN401 - TOML values
    """A TOML value as its field declares; its `kind` names a table's section."""
    items = get_args(hint)
    if get_origin(hint) in {Union, types.UnionType}:
        if tagged := {o.kind: o for o in items if getattr(o, "kind", "")}:
            TABLE.check(where, value)
            name = str(value.get("kind", ""))
            check_known(name, tagged, f"no {where}.kind {name!r}")
            table = {k: v for k, v in value.items() if k != "kind"}
            return section_from(tagged[name], table, where)
        *others, last = (item for item in items if item is not type(None))
        for other in others:
            with suppress(ParameterError):
                return convert(value, other, where)
        return convert(value, last, where)
    if get_origin(hint) is tuple:
        LIST.check(where, value)
        items = items[:1] * len(value) if items[-1] is Ellipsis else items
        if len(value) != len(items):
            raise ParameterError(f"{where} has {len(value)} entries; it must have {len(items)}")
        pairs = enumerate(zip(value, items, strict=True))
        return tuple(convert(v, item, f"{where}[{i}]") for i, (v, item) in pairs)
    KINDS.get(hint, TABLE).check(where, value)
    if hint in KINDS:
        return float(value) if hint is float else value
    return section_from(hint, value, where)


def to_toml(scenario: Scenario) -> str:
    """A scenario as a TOML file that makes the same log again."""
    return "".join(lines_of(as_table(scenario)))


def as_table(value: Any) -> Any:  # noqa: ANN401 - of a section, what it holds
    """A section as a table of TOML, without what is not given."""
    if isinstance(value, Spec):
        kind = {"kind": value.kind} if value.kind else {}
        return kind | {k: as_table(v) for k, v in vars(value).items() if v is not None}
    return list(map(as_table, value)) if isinstance(value, tuple) else value
