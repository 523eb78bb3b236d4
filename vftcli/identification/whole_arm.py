"""Methods "base" and "consistent": all parameters of the arm together."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from vftcli.identification.base_parameters import BaseParameters, base_parameters
from vftcli.identification.clean_fit import fit_without_contacts
from vftcli.identification.consistent import (
    MARGIN,
    NARROW_MARGIN,
    TABLE,
    WEIGHTS,
    fit_consistent,
    nearest_physical,
)
from vftcli.identification.friction_fit import PLAIN, is_dissipative
from vftcli.identification.friction_shapes import Shape, round_digits
from vftcli.identification.method_result import (
    MethodResult,
    bound_remarks,
    check_friction,
    friction_numbers,
    friction_source,
    held_joints,
    identified_friction,
    presliding_remark,
    profile_friction,
    temperature_remarks,
)
from vftcli.identification.scoring import rigid_torque
from vftcli.identification.stacking import ParameterColumns, Triangles, WeightedLog, stack
from vftcli.identification.training import (
    JointFit,
    Training,
    fit_frictions,
    friction_columns,
)
from vftcli.robots.regressor import chain_parameters, with_parameters
from vftcli.robots.robot import JointFriction, Robot
from vftcli.signals.arrays import Array
from vftcli.signals.errors import IdentificationError
from vftcli.signals.remarks import Remark, caution, fact

NARROW = 0.7
"""Share of undetermined base parameters from which on a motion tells the links too little."""

MOST = 0.5
"""The same where cross-validation takes the weakest pull, as on rounds of one motion."""


def whole_arm(data: Training, method: str) -> MethodResult:
    """Identify all parameters of the arm together.

    Method "base" takes base parameters by weighted least squares, and the file gets the nearest
    physical model; "consistent" a physical model near the profile, its pull cross-validated.

    Friction models are chosen twice: with the profile's links, and again with the links that come
    out, so that an error of the profile is not taken for friction.
    """
    fits, weights, remarks = fit_without_contacts(data, strict=False)
    layout, start = initial_columns(data, fits)
    x = nearest_physical(stack_training(data, layout, start, weights), start)
    refined = with_links(data, layout, x)
    fits = fit_frictions(refined, weights)
    layout, start = initial_columns(data, fits)
    triangles = stack_training(refined, layout, start, weights)
    base = base_parameters(triangles, start)
    count, open_ones = undetermined(base, layout)
    x, narrow, said = fit_links(triangles, start, method, open_ones / max(count, 1))
    level = caution if narrow else fact
    remarks += [said, level("undetermined-base-parameters", count=count, undetermined=open_ones)]
    remarks += bound_remarks(fits)
    if data.robot.payload is not None:
        remarks.append(fact("payload-in-link"))
    numbers = []
    frictions = list(profile_friction(data.robot))
    for j, (shape, place) in enumerate(zip(layout.shapes, layout.frictions, strict=True)):
        if (found := fits[j]) is not None and data.rubs:
            sd = base.sd[-(layout.size - place.start) :][: place.stop - place.start]
            values = x[place]
            # Beside the links' errors a rise may turn into a fall; the joint's own fit does not.
            if not is_dissipative(shape, values, data.top_speed(j)):
                values = found.fit.values[: len(shape.terms)]
            frictions[j] = identified_friction(
                data, j, shape, values, friction_source(data, method, sd)
            )
            numbers += friction_numbers(j, shape, values, sd, profile_friction(data.robot)[j])
            remarks += check_friction(j, frictions[j], data)
    robot = with_vector(data.robot, layout, x, tuple(frictions) if data.rubs else ())
    choices = [c for f in fits if f is not None for c in f.choices]
    return MethodResult(
        robot,
        numbers,
        choices,
        base,
        [*remarks, *presliding_remark(fits), *temperature_remarks(data), *held_joints(data)],
        narrow,
    )


def undetermined(base: BaseParameters, layout: ParameterColumns) -> tuple[int, int]:
    """How many base parameters there are and how many are open, friction not counted."""
    count = len(base.values) - (layout.size - layout.inertial - layout.rotors)
    return count, sum(not known for known in base.determined[:count])


def fit_links(
    triangles: Triangles, start: Array, method: str, share: float
) -> tuple[Array, bool, Remark]:
    """Fit the links by a method.

    The rounds of one motion predict each other whatever the links are: cross-validation then finds
    no use for the profile. Where most base parameters are open too, a table's pull is taken.

    Args:
        triangles: The stacked equations.
        start: The profile's parameters. (size,)
        method: "base" or "consistent".
        share: Share of base parameters that the motion leaves open.

    Returns:
        The parameters (size,), whether the motion tells the links too little, and how it was done.
    """
    narrow, weight = share > NARROW, TABLE
    if method == "consistent" or MOST < share <= NARROW:
        margin = NARROW_MARGIN if narrow else MARGIN
        x, weight, _ = fit_consistent(triangles, start, margin)
    rounds = share > MOST and weight == WEIGHTS[0]
    narrow |= rounds
    if method == "base":
        pull = TABLE if narrow else WEIGHTS[0]
        return nearest_physical(triangles, start, pull), narrow, fact("nearest-physical-model")
    if rounds:
        x, weight = nearest_physical(triangles, start, TABLE), TABLE
    return x, narrow, fact("profile-pull", weight=weight, weights=sorted(WEIGHTS))


def stack_training(
    data: Training, layout: ParameterColumns, start: Array, weights: Sequence[Array]
) -> Triangles:
    """The stacked, weighted equations of all training logs.

    Raises:
        IdentificationError: If there are hardly more equations than unknowns.
    """
    logs = [
        WeightedLog(m, c, w) for m, c, w in zip(data.motions, data.columns, weights, strict=True)
    ]
    check_size(layout, logs)
    return stack(layout, logs, start)


def with_links(data: Training, layout: ParameterColumns, x: Array) -> Training:
    """The training data with other links: their rigid-body torque, their gravity as load."""
    robot = with_vector(data.robot, layout, x, data.robot.friction)
    columns = (friction_columns(m, robot) for m in data.motions)
    return replace(
        data,
        columns=tuple(columns),
        rigid=tuple(rigid_torque(robot, m) for m in data.motions),
    )


def initial_columns(
    data: Training, fits: Sequence[JointFit | None]
) -> tuple[ParameterColumns, Array]:
    """The unknowns of the whole arm, and the profile with its fitted friction. (size,)"""
    shapes, values = [], []
    for j, fit in enumerate(fits):
        if fit is None and not data.rubs:
            shapes.append(Shape(()))
            values.append(np.zeros(0))
        elif fit is None:
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
    phi = np.array([round_digits(v, 12) for v in x[: layout.inertial]])
    spots = slice(layout.inertial, layout.inertial + layout.rotors)
    rotor = np.array([round_digits(v) for v in x[spots]]) if layout.rotor else None
    chain = with_parameters(robot.chain, phi, rotor)
    return replace(robot, chain=chain, payload=None, friction=friction)


def check_size(layout: ParameterColumns, logs: Sequence[WeightedLog]) -> None:
    """Raise unless there are clearly more equations than unknowns."""
    rows = sum(int(np.count_nonzero(data.weights)) for data in logs)
    if rows < 4 * layout.size:
        raise IdentificationError(
            f"{rows} equations for {layout.size} unknowns; record a longer log, "
            "or use --method friction"
        )
