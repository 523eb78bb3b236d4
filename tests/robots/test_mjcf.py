"""MJCF: the arm in it, its armature and friction, and what is refused."""

import sys
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from made_urdfs import written

from vftcli.robots import load_robot
from vftcli.robots.choice import RobotChoice
from vftcli.signals.errors import RobotError
from vftcli.signals.recording import Recording

INERTIAL = '<inertial mass="{}" pos="0.02 -0.01 0.1" diaginertia="0.02 0.018 0.01"/>'


def mjcf(joint: str = "", hand: str = "", extra: str = "") -> str:
    """An arm of five hinges: `joint` holds attributes of the second one, `hand` stands on it."""
    text, ends = "", ""
    for k in range(1, 6):
        axis = ("0 0 1", "0 1 0", "1 1 0")[k % 3]
        own = joint if k == 2 else ""
        text += (
            f'<body name="link{k}" pos="0.05 0 0.2" quat="0.9 0.1 0.2 0.3">{INERTIAL.format(4 / k)}'
            f'<joint name="joint{k}" axis="{axis}" range="-90 90" {own}/>'
        )
        ends += "</body>"
    site = '<site name="attachment_site" pos="0 0 0.1"/>'
    return (
        f'<mujoco model="made">{extra}<worldbody><body name="base">{text}{site}{hand}{ends}'
        "</body></worldbody></mujoco>"
    )


HAND = "".join(
    f'<body name="finger{k}" pos="0 0 0.1">{INERTIAL.format(0.05)}'
    f'<joint name="slide{k}" type="slide" axis="0 1 0"/></body>'
    for k in (1, 2)
)


def test_an_mjcf_is_pinocchio_s_model_of_it(tmp_path: Path) -> None:
    """Two sliding fingers are locked, the site is the flange, the armature the rotor's inertia."""
    path = written(tmp_path, mjcf('armature="0.4"', HAND), "arm.mjcf.xml")
    found = load_robot(path)
    assert found.chain.names == tuple(f"joint{k}" for k in range(1, 6))
    np.testing.assert_array_equal(found.chain.rotor_inertia, [0, 0.4, 0, 0, 0])
    np.testing.assert_allclose(found.limits.q_max, np.pi / 2)
    assert found.remarks[0].values["flange"] == "attachment_site"
    assert set(found.remarks[0].values["locked"]) == {"slide1", "slide2"}
    model = pin.buildModelFromMJCF(str(path))
    locked = [model.getJointId(name) for name in ("slide1", "slide2")]
    theirs = pin.buildReducedModel(model, locked, pin.neutral(model))
    ours = found.chain.to_pinocchio()
    for q, v, a in np.random.default_rng(0).uniform(-2, 2, (10, 3, 5)):
        expected = pin.rnea(theirs, theirs.createData(), q, v, a)
        np.testing.assert_allclose(pin.rnea(ours, ours.createData(), q, v, a), expected, atol=1e-12)


def test_a_body_is_a_tip(tmp_path: Path) -> None:
    path = written(tmp_path, mjcf(), "arm.xml")
    assert load_robot(path, tip="link4").chain.names[-1] == "joint4"


def test_a_pendulum_is_an_arm_of_one_joint(tmp_path: Path) -> None:
    body = f'<body name="bob">{INERTIAL.format(1)}<joint name="swing" axis="0 1 0"/></body>'
    text = f"<mujoco><worldbody>{body}</worldbody></mujoco>"
    np.testing.assert_allclose(
        load_robot(written(tmp_path, text, "arm.xml")).chain.rotation[0][:, 2],
        [0, 1, 0],
        atol=1e-15,
    )


def test_the_friction_of_a_simulation_is_left_out_and_said(tmp_path: Path) -> None:
    path = written(tmp_path, mjcf('damping="20" frictionloss="0.3"'), "arm.xml")
    log = Recording(t=np.array([0.0, 0.1]), q=np.zeros((2, 5)))
    robot = RobotChoice(name=str(path)).load(log)
    assert robot.friction == ()
    (left,) = (r for r in robot.remarks if r.code == "simulator-friction-left")
    assert left.values["damping_Nms_rad"] == [0, 20, 0, 0, 0]
    taken = RobotChoice(name=str(path), friction="model").load(log)
    assert taken.friction[1].parameters == {"coulomb": 0.3, "viscous": 20.0}
    with pytest.raises(RobotError, match=r"model\.friction=model is what an MJCF gives its joints"):
        RobotChoice(name="ur5", friction="model").load(log)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("<mujoco/>", "no moving joint|Pinocchio can read"),
        (mjcf('axis="0 0 0"').replace('axis="1 1 0"', "", 1), "'joint2': its axis points nowhere"),
        (mjcf('armature="-1"'), "joint 'joint2': armature is -1"),
        (mjcf().replace('mass="4.0"', 'mass="1e9"'), "'joint1': mass is 1e.09 kg; on a robot"),
        (mjcf(extra='<include file="nowhere.xml"/>'), r"includes 'nowhere\.xml', which Pin"),
        ("<mujoco>" + "<body>" * 5000, "more than 500 elements within one another"),
        ('<!DOCTYPE m [<!ENTITY a "1">]><mujoco/>', "defines XML entities"),
    ],
)
def test_an_mjcf_that_is_no_arm_is_refused(
    text: str, words: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(RobotError, match=words) as caught:
        load_robot(written(tmp_path, text, "arm.xml"))
    assert "\n" not in str(caught.value)
    assert capfd.readouterr() == ("", "")  # the parser's own words stand in the error


def test_without_pinocchio_an_mjcf_is_refused_and_a_urdf_is_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from made_urdfs import fingered

    monkeypatch.setitem(sys.modules, "pinocchio", None)
    with pytest.raises(
        RobotError, match="an MJCF needs pin, which is not installed here: pip install pin"
    ):
        load_robot(written(tmp_path, mjcf(), "arm.xml"))
    assert load_robot(written(tmp_path, fingered())).joints == 7
