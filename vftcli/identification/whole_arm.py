"""Method "base": all parameters of the arm together."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from vftcli.identification.base_parameters import base_parameters
from vftcli.identification.clean_fit import fit_without_contacts
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
from vftcli.identification.physical_links import (
    TABLE,
    WEIGHTS,
    nearest_physical_links,
    predicts_best_unpulled,
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
from vftcli.signals.remarks import caution, fact

#: Share of undetermined base parameters from which on a motion tells the links too little.
NARROW = 0.7
#: The same where the weakest pull predicts best, as of rounds of one motion: each knows the others,
#: whatever the links are.
MOST = 0.5


def whole_arm(data: Training) -> MethodResult:
    """Base parameters by weighted least squares, and the robot of the nearest physical links.

    Friction models are chosen twice: with the profile's links, and again with the links that come
    out, so that an error of the profile is not taken for friction.
    """
    fits, weights, remarks = fit_without_contacts(data, strict=False)
    layout, start = initial_columns(data, fits)
    x = nearest_physical_links(stack_training(data, layout, start, weights), start)
    refined = with_links(data, layout, x)
    fits = fit_frictions(refined, weights)
    layout, start = initial_columns(data, fits)
    triangles = stack_training(refined, layout, start, weights)
    base = base_parameters(triangles, start)
    count = len(base.values) - (layout.size - layout.inertial - layout.rotors)
    open_ones = sum(not known for known in base.determined[:count])
    share = open_ones / max(count, 1)
    narrow = share > NARROW or (share > MOST and predicts_best_unpulled(triangles, start))
    x = nearest_physical_links(triangles, start, TABLE if narrow else WEIGHTS[0])
    remarks.append(fact("nearest-physical-model"))
    level = caution if narrow else fact
    remarks.append(level("undetermined-base-parameters", count=count, undetermined=open_ones))
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
                data, j, shape, values, friction_source(data, "base", sd)
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


def stack_training(
    data: Training, layout: ParameterColumns, start: Array, weights: Sequence[Array]
) -> Triangles:
    """The stacked, weighted equations of all training logs."""
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
