"""Methods "base" and "consistent": all parameters of the arm together."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from vftcli.identification.base_parameters import BaseParameters, base_parameters
from vftcli.identification.consistent import fit_consistent, nearest_physical
from vftcli.identification.friction_fit import PLAIN
from vftcli.identification.friction_shapes import FrictionColumns, Shape, rounded
from vftcli.identification.method_result import (
    MethodResult,
    confidence,
    friction_numbers,
    held,
    odd_friction,
    profile_friction,
)
from vftcli.identification.processing import gravity_torque
from vftcli.identification.scoring import rigid_torque
from vftcli.identification.stacking import Data, ParameterColumns, Triangles, stack
from vftcli.identification.training import JointFit, Training, fit_frictions, fitted
from vftcli.robots.regressor import chain_parameters, with_parameters
from vftcli.robots.robot import JointFriction, Robot
from vftcli.signals.arrays import Array
from vftcli.signals.errors import IdentificationError


def base_method(data: Training) -> MethodResult:
    """Base parameters by weighted least squares; the file gets the nearest physical model."""
    return whole_arm(data, "base")


def consistent_method(data: Training) -> MethodResult:
    """A physical model near the profile, its pull chosen by cross-validation."""
    return whole_arm(data, "consistent")


def whole_arm(data: Training, method: str) -> MethodResult:
    """Identify all parameters of the arm together.

    Friction models are chosen twice: with the profile's links, and again with the links that come
    out, so that an error of the profile is not taken for friction.
    """
    fits, weights, notes = fitted(data, strict=False)
    layout, start = layout_of(data, fits)
    x = nearest_physical(stacked(data, layout, start, weights), start)
    refined = with_links(data, layout, x)
    fits = fit_frictions(refined, weights)
    layout, start = layout_of(data, fits)
    triangles = stacked(refined, layout, start, weights)
    base = base_parameters(triangles, start)
    x, remark = METHODS[method](triangles, start)
    notes += [remark, undetermined(base, layout)]
    if data.robot.payload is not None:
        notes.append("the mounted payload is part of the last link now")
    numbers = []
    frictions = list(profile_friction(data.robot))
    for j, (shape, place) in enumerate(zip(layout.shapes, layout.frictions, strict=True)):
        if data.excited.moves[j]:
            sd = base.sd[-(layout.size - place.start) :][: place.stop - place.start]
            frictions[j] = shape.friction(x[place], confidence(data, method, sd))
            numbers += friction_numbers(j, shape, x[place], sd, profile_friction(data.robot)[j])
            notes += odd_friction(j, frictions[j], data)
    robot = with_vector(data.robot, layout, x, tuple(frictions))
    contests = [c for f in fits if f is not None for c in f.contests]
    return MethodResult(robot, numbers, contests, base, [*notes, *held(data)])


def from_base(triangles: Triangles, start: Array) -> tuple[Array, str]:
    """The physical model nearest to the base parameters, and what is said of it."""
    return nearest_physical(triangles, start), (
        "the robot file holds the physically consistent model nearest to the base parameters; "
        "observers use that, [[identification.base_parameters]] lists the least-squares values"
    )


def from_consistent(triangles: Triangles, start: Array) -> tuple[Array, str]:
    """The physical model with a cross-validated pull to the profile, and what is said of it."""
    found = fit_consistent(triangles, start)
    return found.x, (
        f"pull to the profile {found.weight:g}, chosen by cross-validation among "
        f"{', '.join(f'{w:g}' for w in sorted(found.errors))}"
    )


METHODS: dict[str, Callable[[Triangles, Array], tuple[Array, str]]] = {
    "base": from_base,
    "consistent": from_consistent,
}
"""Method → parameters of the whole arm from its stacked equations."""


def undetermined(base: BaseParameters, layout: ParameterColumns) -> str:
    """How many base parameters the logs leave open."""
    count = len(base.values) - (layout.size - layout.inertial - layout.rotors)
    doubtful = sum(not known for known in base.determined[:count])
    return (
        f"{count} base parameters, of which {doubtful} are not determined by these logs "
        "(standard deviation above 30 % of the value)"
    )


def stacked(
    data: Training, layout: ParameterColumns, start: Array, weights: Sequence[Array]
) -> Triangles:
    """The stacked equations of all logs."""
    logs = [Data(m, c, w) for m, c, w in zip(data.motions, data.columns, weights, strict=True)]
    check_size(layout, logs)
    return stack(layout, logs, start)


def with_links(data: Training, layout: ParameterColumns, x: Array) -> Training:
    """The training data with other links: their rigid-body torque, their gravity as load."""
    robot = with_vector(data.robot, layout, x, data.robot.friction)
    columns = (
        FrictionColumns(m, np.abs(gravity_torque(robot, m.recording.q))) for m in data.motions
    )
    return replace(
        data,
        columns=tuple(columns),
        rigid=tuple(rigid_torque(robot, m) for m in data.motions),
    )


def layout_of(data: Training, fits: Sequence[JointFit | None]) -> tuple[ParameterColumns, Array]:
    """The unknowns of the whole arm, and the profile with its fitted friction. (size,)"""
    shapes, values = [], []
    for j, fit in enumerate(fits):
        if fit is None:
            known = profile_friction(data.robot)[j].parameters
            shapes.append(Shape(PLAIN, float(known.get("smoothing", 0.01))))
            values.append(np.array([float(known.get(term, 0.0)) for term in PLAIN]))
        else:
            shapes.append(fit.shape)
            values.append(fit.fit.values[: len(fit.shape.terms)])
    chain = data.robot.loaded_chain
    rotor = list(chain.rotor_inertia) if data.rotor else []
    for j, fit in enumerate(fits):
        if data.rotor and fit is not None and (J := fit.fit.values[len(fit.shape.terms)]) > 0:
            rotor[j] = float(J)
    start = np.concatenate([chain_parameters(chain), rotor, *values])
    return ParameterColumns(data.robot.chain, data.rotor, tuple(shapes)), start


def with_vector(
    robot: Robot, layout: ParameterColumns, x: Array, friction: tuple[JointFriction, ...]
) -> Robot:
    """The robot with a whole vector of parameters; a mounted payload is in it already."""
    phi = np.array([rounded(v, 12) for v in x[: layout.inertial]])
    spots = slice(layout.inertial, layout.inertial + layout.rotors)
    rotor = np.array([rounded(v) for v in x[spots]]) if layout.rotor else None
    chain = with_parameters(robot.chain, phi, rotor)
    return replace(robot, chain=chain, payload=None, friction=friction)


def check_size(layout: ParameterColumns, logs: Sequence[Data]) -> None:
    """Raise unless there are clearly more equations than unknowns."""
    rows = sum(int(np.count_nonzero(data.weights)) for data in logs)
    if rows < 4 * layout.size:
        raise IdentificationError(
            f"{rows} equations for {layout.size} unknowns; record a longer log, "
            "or use --method friction"
        )
