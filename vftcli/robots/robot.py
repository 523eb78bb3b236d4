"""Robot: everything known about one arm, from any file."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import field, replace
from functools import cached_property
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from vftcli.robots.chain import Chain, Payload
from vftcli.signals.arrays import Array, seal
from vftcli.signals.errors import RobotError
from vftcli.signals.pose import Pose
from vftcli.signals.remarks import Remark
from vftcli.signals.shown import Shown, record

if TYPE_CHECKING:
    import polars as pl

#: Joint temperature that friction is for where nobody says one: a warm arm's. [°C]
REFERENCE = 35.0

ITERATIONS = 12  #: Steps of the inverse kinematics at most.
#: λ² of a damped step is this times the error, so that it vanishes at the pose.
DAMPING = 1e-3
#: Share of the error that is left after three steps where a pose is out of reach.
STALLED = 0.7
LARGEST_STEP = 0.2  #: Longest joint step of one iteration. [rad]

TORQUE_SOURCES = ("current", "link_torque", "joint_torque")


@record
class JointFriction(Shown):
    """Friction of one joint: a model's name and its parameters."""

    model: str = "none"  #: A name in `vftcli.robots.friction.FRICTION_MODELS`, or "none".
    #: Numbers by key, in SI units; `presliding` and `presliding_length` both or neither.
    parameters: Mapping[str, float] = field(default_factory=dict)
    speeds: tuple[float, ...] = ()  #: Of the model "points", rising. [rad/s]
    torques: tuple[float, ...] = ()  #: Friction at these speeds. [N·m]
    #: p₁ to p₄ of the temperature law (`vftcli.robots.friction`), or empty.
    temperature: tuple[float, ...] = ()
    #: Joint temperature of the model's numbers, None if not stated. [°C]
    temperature_at: float | None = None
    confidence: str = ""  #: Where the numbers come from, in words.

    @property
    def reference_temperature(self) -> float:
        """Joint temperature of the numbers, `REFERENCE` if not stated. [°C]"""
        return REFERENCE if self.temperature_at is None else self.temperature_at

    @property
    def table(self) -> dict[str, Any]:
        """The model as ``[joints.friction]`` of a robot file; empty for none."""
        if self.model == "none":
            return {}
        known = {key: value for key, value in vars(self).items() if value not in ((), None, "")}
        table = {"model": known.pop("model"), **known.pop("parameters"), **known}
        return {
            k: list(value) if isinstance(value, tuple) else value for k, value in table.items()
        }


class PerJoint(Shown):
    """A record of arrays with a number a joint."""

    def __post_init__(self) -> None:
        seal(self, *vars(self))


@record
class Limits(PerJoint):
    """Joint limits; NaN where the description gives none."""

    q_min: Array  #: Lower position limits. (n,) [rad]
    q_max: Array  #: Upper position limits. (n,) [rad]
    qd_max: Array  #: Speed limits. (n,) [rad/s]
    tau_max: Array  #: Torque limits. (n,) [N·m]
    qdd_max: Array  #: Acceleration limits. (n,) [rad/s²]


@record
class SensorNoise(PerJoint):
    """SDs of the joint measurements; NaN where unknown."""

    current: Array  #: Motor current. (n,) [A]
    tau: Array  #: Joint torque. (n,) [N·m]
    q: Array  #: Position. (n,) [rad]
    qd: Array  #: Velocity. (n,) [rad/s]


class Mesh(NamedTuple):
    """The shape of a part of the arm, in a file."""

    name: str  #: The file as the description names it.
    file: Path | None  #: The file, None without one to draw.
    link: int  #: The joint that moves it, from 1; 0 on the base.
    pose: Pose  #: Its pose in the chain's frame of that joint.
    scale: Array  #: Its size, as a factor along each of its axes. (3,)


@record
class Robot(Shown):
    """One arm: chain, drives, friction, limits and gains of its observers."""

    name: str  #: Short name, as used with ``--robot``.
    chain: Chain  #: Geometry and inertia of the bare arm.
    title: str = ""  #: Name for headings.
    #: What a log of this arm measures: "current", "link_torque" or "joint_torque".
    torque_source: str = "joint_torque"
    #: Joint torque per motor current, gear included. (n,) [N·m/A]
    torque_constant: Array | None = None
    #: Motor turns a joint turn; None for logs of joints. (n,)
    gear: Array | None = None
    #: Share of the motors' torque that arrives behind it, None for all. (n,)
    efficiency: Array | None = None
    friction: tuple[JointFriction, ...] = ()  #: One model a joint.
    limits: Limits  #: Joint limits.
    noise: SensorNoise  #: Measurement noise.
    sample_rate_hz: float = float("nan")  #: The vendor's rate, or NaN. [Hz]
    #: ROS 2 message of its whole state, "" for JointState alone.
    ros_state: str = ""
    #: Joints that turn on and on: positions may be logged within a turn.
    endless: tuple[str, ...] = ()
    #: The joints' friction in a simulator's description, or empty.
    simulated_friction: tuple[JointFriction, ...] = ()
    payload: Payload | None = None  #: The load mounted on the flange, or None.
    #: Further loads by name, for ``--payload NAME``.
    payloads: Mapping[str, Payload] = field(default_factory=dict)
    #: Observer name → parameter → number, list or word, as in ``[observers.*]``.
    gains: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    #: Poses of tools in the flange frame, from ``[tool]`` (under "") and ``[tool.NAME]``.
    tools: Mapping[str, Pose] = field(default_factory=dict)
    #: Poses of force/torque sensors in the flange frame, likewise.
    sensors: Mapping[str, Pose] = field(default_factory=dict)
    #: The parameters of ``[admittance]``, as the file has them.
    admittance: Mapping[str, Any] = field(default_factory=dict)
    #: Where numbers come from: id, what and ref, in words.
    sources: tuple[Mapping[str, Any], ...] = ()
    #: The whole parsed robot file, for writing a changed one.
    document: Mapping[str, Any] = field(default_factory=dict)
    remarks: tuple[Remark, ...] = ()  #: What a user should know.
    path: Path | None = None  #: The file it was loaded from, or None.
    meshes: tuple[Mesh, ...] = ()  #: Shapes of its parts, if known.

    def __post_init__(self) -> None:
        n = self.joints
        seal(self, "torque_constant", "gear", "efficiency", shape=(n,), called=self.name)
        if self.friction and len(self.friction) != n:
            raise RobotError(f"{self.name}: {len(self.friction)} friction models for {n} joints")

    def _headline(self) -> str:
        friction = ", ".join(dict.fromkeys(joint.model for joint in self.friction)) or "none"
        load = "" if self.payload is None else f", payload {self.payload.mass:g} kg"
        effort = self.torque_source.replace("_", " ")
        return f"{self.name}: {self.joints} joints, logs {effort}, friction {friction}{load}"

    def _rows(self) -> Iterator[Sequence[object]]:
        yield "joint", "link mass [kg]", "K [N·m/A]", "friction", "speed limit [rad/s]"
        for j, name in enumerate(self.chain.names):
            constant = None if self.torque_constant is None else self.torque_constant[j]
            model = self.friction[j].model if self.friction else "none"
            mass, speed = self.chain.mass[j], self.limits.qd_max[j]
            yield f"J{j + 1} {name}", mass, constant, model, speed

    def to_polars(self) -> "pl.DataFrame":
        """One row a joint, units in the columns' names."""
        import polars as pl

        names = ("joint", "mass_kg", "torque_constant_Nm_A", "friction", "speed_limit_rad_s")
        kinds = dict.fromkeys(names, pl.Float64) | {"joint": pl.String, "friction": pl.String}
        _, *rows = self._rows()
        return pl.DataFrame(rows, kinds, orient="row").fill_nan(None)

    @cached_property
    def joints(self) -> int:
        """Number of joints n."""
        return self.chain.joints

    @cached_property
    def loaded_chain(self) -> Chain:
        """The chain with the mounted payload merged into the last link."""
        return self.chain.with_payload(self.payload)

    @cached_property
    def model(self) -> Any:  # noqa: ANN401 - Pinocchio is untyped
        """Pinocchio's model of the loaded chain, with a frame ``flange``."""
        return self.loaded_chain.to_pinocchio(self.name)

    def save(self, file: "str | Path", *, force: bool = False) -> None:
        """Write its file, which `load_robot` reads.

        Raises:
            OutputError: If the file exists, unless it may be overwritten.
        """
        write = import_module("vftcli.outputs.files").write_text
        write(Path(file), import_module("vftcli.robots.profile").robot_toml(self), force)

    def with_payload(self, payload: str | Payload | None) -> "Robot":
        """The robot with a load on its flange: a name in its file, a Payload, or None."""
        if isinstance(payload, str):
            if payload not in self.payloads:
                there = ", ".join(self.payloads) or "none"
                raise RobotError(
                    f"{self.name}: no payload {payload!r}; the robot file has {there}. "
                    "Add a [payload.NAME] section with mass, com and inertia."
                )
            payload = self.payloads[payload]
        return replace(self, payload=payload)


class FlangeSolver:
    """Joint positions with the flange at a pose, inside joint limits if `limited`.

    A pose counts as reached when position and rotation error are below `reached`. [m, rad]
    """

    def __init__(self, robot: Robot, reached: float = 1e-6, *, limited: bool = True) -> None:
        self.model, self.reached = robot.model, reached  # an error without Pinocchio
        import pinocchio as pin
        from scipy.linalg.lapack import dposv

        self.pin, self.solve = pin, dposv
        self.data: Any = self.model.createData()
        self.frame = self.model.getFrameId("flange")
        self.lower: Array | float = robot.limits.q_min if limited else np.nan
        self.upper: Array | float = robot.limits.q_max if limited else np.nan

    def pose(self, q: Array) -> Pose:
        """Flange orientation (3, 3) and origin (3,) [m] in the base, at `q` (n,) [rad]."""
        self.pin.framesForwardKinematics(self.model, self.data, np.asarray(q, float))
        place = self.data.oMf[self.frame]
        return Pose(np.array(place.rotation), np.array(place.translation))

    def reach(self, rotation: Array, translation: Array, guess: Array) -> tuple[Array, bool]:
        """Joint positions at a pose, from a guess nearby, and whether it is reached.

        A step is Jᵀ(JJᵀ + λ²I)⁻¹e in base axes, cut at the joint limits.
        """
        pin, model, data, frame = self.pin, self.model, self.data, self.frame
        q, error, sizes = guess, np.empty(6), [np.inf, np.inf, np.inf]
        for _ in range(ITERATIONS):
            J = pin.computeFrameJacobian(model, data, q, frame, pin.LOCAL_WORLD_ALIGNED)
            place = pin.updateFramePlacement(model, data, frame)
            error[:3] = translation - place.translation
            error[3:] = pin.log3(rotation @ place.rotation.T)
            size = float(np.sqrt(error @ error))
            if size < self.reached:
                return q, True
            if size > STALLED * sizes[-3]:
                break
            sizes.append(size)
            normal = J @ J.T
            normal.flat[::7] += DAMPING * min(size, 1.0) ** 2
            _, weights, _ = self.solve(normal, error)
            step = J.T @ weights
            step *= LARGEST_STEP / max(abs(step).max(), LARGEST_STEP)
            q = np.fmin(np.fmax(q + step, self.lower), self.upper)
        return q, False
