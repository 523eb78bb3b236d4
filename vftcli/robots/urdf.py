"""Robots from URDF files, through Pinocchio; drives, friction and gains from a TOML beside them."""

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from vftcli.robots.bounds import weightless
from vftcli.robots.chain import Chain, unphysical
from vftcli.robots.profile import UPRIGHT, assemble, column
from vftcli.robots.robot import Limits, Robot, SensorNoise
from vftcli.robots.robot_file import RobotFile, Section
from vftcli.robots.urdf_text import checked_urdf, parser_words
from vftcli.signals.arrays import Array
from vftcli.signals.errors import RobotError
from vftcli.signals.pose import rotation_onto
from vftcli.signals.remarks import caution

UNBOUNDED = ("JointModelRUB", "JointModelRevoluteUnbounded")
"""How Pinocchio's names of revolute joints without position limits begin."""

FLANGE_NAMES = ("flange", "tool0", "link8", "ee_link", "tcp")


def load_urdf(path: Path) -> Robot:
    """Read a revolute serial arm from a URDF, and what a URDF cannot say from a TOML beside it.

    The TOML has the same name with the ending ``.toml``; its ``[[joints]]`` are matched by name and
    may give `torque_constant`, `rotor_inertia`, `friction`, noise and limits.

    Raises:
        RobotError: If the file is no URDF, the arm is not serial and revolute, or unphysical.
    """
    import pinocchio as pin

    text = checked_urdf(path)
    try:
        with parser_words() as words:
            model = pin.buildModelFromXML(text)
    except (ValueError, RuntimeError) as error:
        reason = " ".join([*words, *str(error).split()])
        raise RobotError(f"{path}: not a URDF that Pinocchio can read: {reason}") from None
    chain = chain_from_model(model, str(path))
    beside = path.with_suffix(".toml")
    limits = urdf_limits(model)
    if not beside.is_file():
        nothing = np.full(chain.joints, np.nan)
        return Robot(
            name=model.name or path.stem,
            title=model.name or path.stem,
            chain=chain,
            limits=limits,
            noise=SensorNoise(current=nothing, tau=nothing, q=nothing, qd=nothing),
            remarks=(caution("urdf-alone", file=beside.name),),
            path=path,
        )
    root = RobotFile(beside).root
    joints = matched_joints(root, chain)
    rotor = column(joints, "rotor_inertia", default=0.0)
    gravity = root.vector("gravity", 3, UPRIGHT)
    chain = replace(chain, rotor_inertia=rotor + chain.rotor_inertia, gravity=gravity)
    robot = assemble(root, joints, chain)
    known = {
        name: np.where(np.isnan(mine := getattr(robot.limits, name)), getattr(limits, name), mine)
        for name in Limits.__dataclass_fields__
    }
    return replace(robot, limits=Limits(**known), path=path)


def matched_joints(root: Section, chain: Chain) -> list[Section]:
    """Return the ``[[joints]]`` of the TOML beside a URDF in the chain's order, matched by name."""
    tables = {str(table.get("name")): table for table in root.tables("joints")}
    if unknown := [name for name in tables if name not in chain.names]:
        raise RobotError(
            f"{root.file.path}: no joint {unknown[0]!r} in the URDF; "
            f"it has {', '.join(chain.names)}"
        )
    return [
        Section(root.file, tables.get(name, {"name": name}), "joints", j)
        for j, name in enumerate(chain.names)
    ]


def chain_from_model(model: Any, owner: str) -> Chain:  # noqa: ANN401 - Pinocchio is untyped
    """Take a chain's constants out of a Pinocchio model, turning each frame so that z is the axis.

    Raises:
        RobotError: If a joint is not revolute, the arm branches, or a body is unphysical.
    """
    names = [str(name) for name in model.names[1:]]
    if not names:
        raise RobotError(f"{owner}: the model has no moving joint; an arm needs revolute ones")
    turn_before = np.eye(3)
    rotations, translations, masses, coms, inertias = [], [], [], [], []
    turn = turn_before
    for k, name in enumerate(names, start=1):
        if model.parents[k] != k - 1:
            raise RobotError(
                f"{owner}: joint {name!r} branches off {model.names[model.parents[k]]!r}; only "
                "serial arms are supported. Remove the gripper or lock its joints (type fixed)."
            )
        turn = rotation_onto(joint_axis(model, k, owner))
        place = model.jointPlacements[k]
        rotations.append(turn_before.T @ place.rotation @ turn)
        translations.append(turn_before.T @ place.translation)
        body = model.inertias[k]
        if why := unphysical(float(body.mass), np.array(body.inertia)):
            raise RobotError(f"{owner}: the link of joint {name!r} is unphysical: {why}")
        masses.append(float(body.mass))
        coms.append(turn.T @ body.lever)
        inertias.append(turn.T @ body.inertia @ turn)
        turn_before = turn
    if why := weightless(sum(masses)):
        raise RobotError(f"{owner}: {why}")
    flange = flange_placement(model, len(names))
    armature = np.array(model.armature)
    slots = [model.joints[k].idx_v for k in range(1, len(names) + 1)]
    return Chain(
        names=tuple(names),
        rotation=np.array(rotations),
        translation=np.array(translations),
        mass=np.array(masses),
        com=np.array(coms),
        inertia=np.array(inertias),
        rotor_inertia=armature[slots],
        gravity=np.array(model.gravity.linear),
        flange_rotation=turn.T @ flange.rotation,
        flange_translation=turn.T @ flange.translation,
    )


def joint_axis(model: Any, index: int, owner: str) -> Array:  # noqa: ANN401
    """The unit axis of a revolute joint in its own frame. (3,)"""
    import pinocchio as pin

    joint = model.joints[index]
    kind = joint.shortname()
    if aligned := re.fullmatch("JointModelR(?:UB)?([XYZ])", kind):
        return np.array(np.eye(3)["XYZ".index(aligned[1])])
    if not kind.startswith("JointModelRevolute"):
        raise RobotError(
            f"{owner}: joint {model.names[index]!r} is a {kind.removeprefix('JointModel')}, not "
            "revolute; only arms of revolute joints are supported. Lock it (type fixed) if it "
            "belongs to a gripper."
        )
    data = model.createData()
    pin.computeJointJacobians(model, data, pin.neutral(model))
    local = pin.getJointJacobian(model, data, index, pin.ReferenceFrame.LOCAL)
    return np.array(local[3:, joint.idx_v])


def flange_placement(model: Any, last: int) -> Any:  # noqa: ANN401
    """The flange in the last joint's frame: a frame of a usual name, else the farthest one."""
    frames = [f for f in model.frames if int(f.parentJoint) == last]
    for wanted in FLANGE_NAMES:
        for frame in frames:
            if frame.name == wanted or frame.name.endswith(f"_{wanted}"):
                return frame.placement
    return max(frames, key=lambda f: float(np.linalg.norm(f.placement.translation))).placement


def urdf_limits(model: Any) -> Limits:  # noqa: ANN401
    """The URDF's joint limits; NaN where it gives none or the joint is continuous."""
    n = model.njoints - 1
    limits = {name: np.full(n, np.nan) for name in Limits.__dataclass_fields__}
    for k in range(1, n + 1):
        joint = model.joints[k]
        speed, effort = model.velocityLimit[joint.idx_v], model.effortLimit[joint.idx_v]
        limits["qd_max"][k - 1] = speed if 0 < speed < 1e300 else np.nan
        limits["tau_max"][k - 1] = effort if 0 < effort < 1e300 else np.nan
        if not joint.shortname().startswith(UNBOUNDED):
            limits["q_min"][k - 1] = model.lowerPositionLimit[joint.idx_q]
            limits["q_max"][k - 1] = model.upperPositionLimit[joint.idx_q]
    return Limits(**limits)
