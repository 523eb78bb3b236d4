"""Robot files written and read back."""

import tomllib
from dataclasses import replace

import numpy as np
import pytest

from vftcli.robots import PROFILES, JointFriction, Payload, load_robot
from vftcli.robots.profile import robot_toml
from vftcli.robots.robot_file import lines_of, value_text
from vftcli.signals.errors import RobotError

CHAIN = ("rotation", "translation", "mass", "com", "inertia", "rotor_inertia", "gravity")


def again(robot, folder):
    path = folder / "again.toml"
    path.write_text(robot_toml(robot, ["written by a test"]), encoding="utf-8")
    return load_robot(path)


@pytest.mark.parametrize("name", PROFILES)
def test_a_profile_reads_back_identically(name, tmp_path):
    robot = load_robot(name)
    read = again(robot, tmp_path)
    for key in (*CHAIN, "flange_rotation", "flange_translation"):
        assert np.array_equal(getattr(read.chain, key), getattr(robot.chain, key)), key
    assert read.chain.names == robot.chain.names
    assert read.friction == robot.friction
    assert read.gains == robot.gains
    assert read.remarks == robot.remarks
    assert read.title == robot.title
    assert read.torque_source == robot.torque_source
    assert read.payloads.keys() == robot.payloads.keys()
    for label in robot.payloads:
        assert np.array_equal(read.payloads[label].com, robot.payloads[label].com)
    for group in ("limits", "noise"):
        for key, values in vars(getattr(robot, group)).items():
            np.testing.assert_array_equal(getattr(getattr(read, group), key), values)


@pytest.mark.parametrize("name", ["ur10e", "panda"])
def test_changed_numbers_are_written(name, tmp_path):
    robot = load_robot(name)
    chain = replace(
        robot.chain,
        mass=robot.chain.mass * 1.1,
        com=robot.chain.com + 0.01,
        inertia=robot.chain.inertia * 1.2,
        rotor_inertia=robot.chain.rotor_inertia + 0.5,
    )
    friction = JointFriction(
        model="coulomb-viscous-load",
        parameters={"coulomb": 1.5, "viscous": 2.5, "load_coulomb": 0.07, "smoothing": 0.02},
        confidence='made up, "quoted" \\ and so on',
    )
    load = Payload(mass=1.25, com=np.array([0.01, 0.0, 0.05]), inertia=np.eye(3) * 1e-3)
    changed = replace(
        robot, chain=chain, friction=(friction,) * robot.joints, payload=load, name="mine"
    )
    read = again(changed, tmp_path)
    for key in CHAIN:
        # turned into the table's frames and back: rounding of a rotation
        np.testing.assert_allclose(getattr(read.chain, key), getattr(chain, key), atol=1e-15)
    assert read.friction == changed.friction
    assert read.name == "mine"
    assert read.payload is not None
    assert read.payload.mass == 1.25
    np.testing.assert_array_equal(read.payload.com, load.com)


def test_a_robot_from_a_urdf_becomes_a_file(tmp_path):
    import pinocchio as pin

    source = load_robot("ur5")
    links = "".join(f'<link name="l{j}">{INERTIAL}</link>' for j in range(3))
    urdf = tmp_path / "arm.urdf"
    urdf.write_text(
        f'<robot name="arm"><link name="base"/>{links}'
        f"{joint(0, 'base', 'l0', '0 0 1')}{joint(1, 'l0', 'l1', '0 1 0')}"
        f"{joint(2, 'l1', 'l2', '1 0 0')}</robot>"
    )
    robot = load_robot(urdf)
    read = again(robot, tmp_path)
    rng = np.random.default_rng(0)
    q, dq, ddq = rng.normal(size=(3, 3))
    torques = [pin.rnea(r.model, r.model.createData(), q, dq, ddq) for r in (robot, read)]
    # angles and back: rounding
    np.testing.assert_allclose(torques[0], torques[1], atol=1e-12)
    assert source.joints == 6


INERTIAL = (
    '<inertial><origin xyz="0.1 0.02 0.03"/><mass value="2"/>'
    '<inertia ixx="0.02" ixy="0.001" ixz="0" iyy="0.03" iyz="0" izz="0.025"/></inertial>'
)


def joint(j, parent, child, axis):
    return (
        f'<joint name="j{j}" type="revolute"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="0.1 0 0.3" rpy="0.3 -0.2 0.5"/><axis xyz="{axis}"/>'
        '<limit lower="-3" upper="3" effort="50" velocity="2"/></joint>'
    )


def test_what_toml_has_not_is_refused():
    with pytest.raises(RobotError, match="cannot hold a complex"):
        value_text(1j, "here")


def test_every_value_that_toml_has_is_written_as_it_was():
    text = """day = 2026-01-02
at = 2026-01-02T03:04:05+01:00
hour = 03:04:05
mixed = [1, {a = 2, "b c" = [true]}]
sign = "\\U000E0001 \\u0007"
"""
    document = tomllib.loads(text)
    assert tomllib.loads("".join(lines_of(document))) == document
