"""Methods "base" and "consistent": all parameters of the arm together."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from vftcli.arrays import Array
from vftcli.errors import IdentificationError
from vftcli.identification.base_parameters import base_parameters
from vftcli.identification.consistent import fit_consistent, nearest_physical
from vftcli.identification.friction_fit import PLAIN
from vftcli.identification.friction_shapes import Shape, rounded
from vftcli.identification.outcome import (
    Outcome,
    confidence,
    friction_numbers,
    held,
    odd_friction,
    profile_friction,
)
from vftcli.identification.regressor import chain_parameters, with_parameters
from vftcli.identification.stacking import Data, Layout, stack
from vftcli.identification.training import JointFit, Training, fitted
from vftcli.robots.robot import JointFriction, Robot


def base_method(data: Training) -> Outcome:
    """Base parameters by weighted least squares; the file gets the nearest physical model."""
    return whole_arm(data, "base")


def consistent_method(data: Training) -> Outcome:
    """A physical model near the profile, its pull chosen by cross-validation."""
    return whole_arm(data, "consistent")


def whole_arm(data: Training, method: str) -> Outcome:
    """Identify all parameters of the arm together."""
    fits, weights, notes = fitted(data, strict=False)
    layout, start = layout_of(data, fits)
    logs = [Data(m, c, w) for m, c, w in zip(data.motions, data.columns, weights, strict=True)]
    check_size(layout, logs)
    triangles = stack(layout, logs, start)
    base = base_parameters(triangles, start)
    if method == "base":
        x = nearest_physical(triangles, start)
        notes.append(
            "the robot file holds the physically consistent model nearest to the base parameters; "
            "observers use that, [[identification.base_parameters]] lists the least-squares values"
        )
    else:
        found = fit_consistent(triangles, start)
        x = found.x
        notes.append(
            f"pull to the profile {found.weight:g}, chosen by cross-validation among "
            f"{', '.join(f'{w:g}' for w in sorted(found.errors))}"
        )
    doubtful = sum(not ok for ok in base.determined[: -len(layout.names) + layout.inertial])
    notes.append(
        f"{len(base.values)} base parameters and friction coefficients; {doubtful} of the inertial "
        "ones are not determined by these logs (standard deviation above 30 % of the value)"
    )
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
    return Outcome(robot, numbers, contests, base, [*notes, *held(data)])


def layout_of(data: Training, fits: Sequence[JointFit | None]) -> tuple[Layout, Array]:
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
    return Layout(data.robot.chain, data.rotor, tuple(shapes)), start


def with_vector(
    robot: Robot, layout: Layout, x: Array, friction: tuple[JointFriction, ...]
) -> Robot:
    """The robot with a whole vector of parameters; a mounted payload is in it already."""
    phi = np.array([rounded(v, 12) for v in x[: layout.inertial]])
    spots = slice(layout.inertial, layout.inertial + layout.rotors)
    rotor = np.array([rounded(v) for v in x[spots]]) if layout.rotor else None
    chain = with_parameters(robot.chain, phi, rotor)
    return replace(robot, chain=chain, payload=None, friction=friction)


def check_size(layout: Layout, logs: Sequence[Data]) -> None:
    """Raise unless there are clearly more equations than unknowns."""
    rows = sum(int(np.count_nonzero(data.weights)) for data in logs)
    if rows < 4 * layout.size:
        raise IdentificationError(
            f"{rows} equations for {layout.size} unknowns; record a longer log, "
            "or use --method friction"
        )
