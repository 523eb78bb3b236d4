"""Method "base": all parameters of the arm together; "auto": where its links are wrong."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from vftcli.identification.clean_fit import (
    OTHER_LINKS,
    fit_without_contacts,
    heavy_joints,
    links_explain,
    weighted_rms,
)
from vftcli.identification.friction_fit import (
    PLAIN,
    JointFit,
    all_residuals,
    fit_frictions,
    is_dissipative,
)
from vftcli.identification.friction_method import (
    check_friction,
    fitted_result,
    friction_method,
    identified_friction,
    profile_friction,
)
from vftcli.identification.friction_shapes import Shape, friction_columns, round_digits
from vftcli.identification.links import ParameterColumns, base_parameters, stack
from vftcli.identification.physical_links import (
    TABLE,
    WEIGHTS,
    nearest_physical_links,
    predicts_best_unpulled,
)
from vftcli.identification.processing import rigid_torque
from vftcli.identification.result import MethodResult, Number
from vftcli.identification.training import Training
from vftcli.robots.friction import SMOOTHING
from vftcli.robots.regressor import chain_parameters, with_parameters
from vftcli.robots.robot import JointFriction, Robot
from vftcli.signals.arrays import Array
from vftcli.signals.errors import IdentificationError
from vftcli.signals.remarks import caution, fact

#: Share of undetermined base parameters from which a motion is narrow.
NARROW = 0.7
#: That share where the weakest pull predicts best, as of rounds of one motion: each knows the
#: others, whatever the links are.
MOST = 0.5
#: Share of a joint's torque that its profile's links must leave before others are sought.
MATTERS = 0.02


def whole_arm(data: Training) -> MethodResult:
    """Base parameters by weighted least squares, and the robot of the nearest physical links.

    Friction models are chosen twice: with the profile's links, and again with the links that come
    out, so that an error of the profile does not count as friction.
    """
    data, fits, remarks = fit_without_contacts(data, strict=False)
    layout, start = initial_columns(data, fits)
    x = nearest_physical_links(stack(layout, data.logs, start), start)
    data = with_links(data, layout, x)
    fits = fit_frictions(data)
    layout, start = initial_columns(data, fits)
    triangles = stack(layout, data.logs, start)
    base = base_parameters(triangles, start)
    behind = len(base) - layout.size  # of a coefficient's row to its column
    count = layout.rotor_places.stop + behind
    undetermined = int((~base["determined"][:count]).sum())
    share = undetermined / max(count, 1)
    narrow = share > NARROW or (share > MOST and predicts_best_unpulled(triangles, start))
    x = nearest_physical_links(triangles, start, TABLE if narrow else WEIGHTS[0])
    remarks.append(fact("nearest-physical-model"))
    level = caution if narrow else fact
    remarks.append(level("undetermined-base-parameters", count=count, undetermined=undetermined))
    if data.robot.payload is not None:
        remarks.append(fact("payload-in-link"))
    numbers, frictions = list[Number](), list(profile_friction(data.robot))
    for j, (fit, place) in enumerate(zip(fits, layout.frictions, strict=True)):
        if fit is not None and data.rubs:
            values = x[place]
            # Beside errors of the links a rise may fall; the joint's own fit does not.
            if not is_dissipative(fit.shape, values, data.top_speed(j)):
                values = fit.fit.values[: len(fit.shape.terms)]
            sd = base["sd"].to_numpy()[place.start + behind : place.stop + behind]
            frictions[j], more = identified_friction(data, j, fit.shape, values, sd, "base")
            numbers += more
            remarks += check_friction(j, frictions[j], data)
    robot = with_vector(data.robot, layout, x, tuple(frictions) if data.rubs else ())
    result = fitted_result("base", data, fits, robot, numbers, remarks, base)
    return result._replace(is_narrow=narrow)


def with_links(data: Training, layout: ParameterColumns, x: Array) -> Training:
    """The training data with other links: their rigid-body torque and load."""
    robot = with_vector(data.robot, layout, x, data.robot.friction)
    logs = [
        log._replace(
            columns=friction_columns(log.motion, robot), rigid=rigid_torque(robot, log.motion)
        )
        for log in data.logs
    ]
    return replace(data, logs=tuple(logs))


def initial_columns(
    data: Training, fits: Sequence[JointFit | None]
) -> tuple[ParameterColumns, Array]:
    """The unknowns of the whole arm, and the profile with its fitted friction. (size,)"""
    chain = data.robot.loaded_chain
    shapes, values, rotor = list[Shape](), list[float](), chain.rotor_inertia.copy()
    for j, fit in enumerate(fits):
        if fit is None:
            known = profile_friction(data.robot)[j].parameters
            smoothing = float(known.get("smoothing", SMOOTHING))
            shapes.append(Shape(PLAIN if data.rubs else (), smoothing))
            values += [float(known.get(term, 0.0)) for term in shapes[j].terms]
        else:
            shapes.append(fit.shape)
            own, others = np.split(fit.fit.values, [len(fit.shape.terms)])
            values += own.tolist()
            if data.rotor and others[0] > 0:
                rotor[j] = others[0]
    start = np.concatenate([chain_parameters(chain), rotor if data.rotor else [], values])
    return ParameterColumns(data.robot.chain, data.rotor, tuple(shapes)), start


def with_vector(
    robot: Robot, layout: ParameterColumns, x: Array, friction: tuple[JointFriction, ...]
) -> Robot:
    """The robot with a whole vector of parameters; a mounted payload is in it already."""
    phi = np.array([round_digits(v, 12) for v in x[: layout.inertial]])
    rotor = np.array([round_digits(v) for v in x[layout.rotor_places]]) if layout.rotor else None
    chain = with_parameters(robot.chain, phi, rotor)
    return replace(robot, chain=chain, payload=None, friction=friction)


def chosen_method(data: Training) -> MethodResult:
    """Result of "friction", or of "base" where the profile's links are not the arm's.

    The links are identified too where they leave `OTHER_LINKS` times what free ones leave, the logs
    tell them, and nothing suggests a load or another arm.
    """
    fitted = fit_without_contacts(data, strict=True)
    kept = friction_method(data, fitted)
    free, fits = fitted.data, fitted.fits
    spread = np.std(np.concatenate([log.motion.tau for log in free.logs]), axis=0)
    much = weighted_rms(free, all_residuals(free, fits)) > MATTERS * spread
    ratios = links_explain(free, fits)[much[heavy_joints(free)]]
    ratio = float(np.max(ratios, initial=0.0))
    doubted = any(remark.level == "warning" for remark in fitted.remarks)
    if ratio <= OTHER_LINKS or doubted or data.fit_constants:
        return kept
    try:
        freed = whole_arm(data)
    except IdentificationError:
        return kept
    if freed.is_narrow:
        return kept
    remark = caution("links-identified", robot=data.robot.name, ratio=ratio)
    return freed._replace(remarks=[remark, *freed.remarks])
