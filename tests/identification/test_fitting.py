"""Identification of logs made here: planted numbers come back, bad logs are refused."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from vftcli.free_motion.free_motion import PARTLY
from vftcli.identification import Task
from vftcli.identification.fitting import (
    Trace,
    identify,
    repeated_share,
    score_remarks,
)
from vftcli.identification.training import apparent_load, prepare
from vftcli.robots import JointFriction, Payload, load_robot
from vftcli.robots.friction import friction_torque
from vftcli.robots.kernels import chain_parameters, torque_regressor
from vftcli.robots.terms import gravity_torque
from vftcli.signals import errors
from vftcli.signals.arrays import root_mean_squares
from vftcli.signals.recording import Recording


def motion(seed, duration=30.0, joints=6):
    """Sums of three sines a joint, 0.1 to 0.3 Hz, some rad/s fast; 125 Hz."""
    rng = np.random.default_rng(seed)
    t = np.arange(0, duration, 1 / 125.0)
    q, dq, ddq = (np.zeros((len(t), joints)) for _ in range(3))
    for k in (1, 2, 3):
        w = 2 * np.pi * 0.1 * k
        a, b = rng.uniform(-0.4, 0.4, (2, joints))
        phase = rng.uniform(0, 6, joints)
        s, c = np.sin(w * t[:, None] + phase), np.cos(w * t[:, None] + phase)
        q += a * s + b * c
        dq += w * (a * c - b * s)
        ddq -= w * w * (a * s + b * c)
    return t, q - q[0] + [0.0, -1.2, 1.3, -0.5, 0.4, 0.2][:joints], dq, ddq


def drive(robot, q, dq, ddq):
    Y = torque_regressor(robot.chain, q, dq, ddq)
    torque = Y @ chain_parameters(robot.loaded_chain) + robot.chain.rotor_inertia * ddq
    return torque + friction_torque(robot.friction, dq, gravity_torque(robot, q))


def log(robot, seed=0, noise=0.2):
    t, q, dq, ddq = motion(seed, joints=robot.joints)
    rng = np.random.default_rng(seed + 100)
    torque = drive(robot, q, dq, ddq) + noise * rng.normal(size=q.shape)
    if robot.torque_constant is None:
        return Recording(t=t, q=q, dq=dq, torque=torque)
    return Recording(t=t, q=q, dq=dq, current=torque / robot.torque_constant)


def rubbed(robot, model="coulomb-viscous-load", **values):
    """The robot with one friction in every joint."""
    parameters = {"coulomb": 5.0, "viscous": 8.0, "offset": 0.3, **values}
    friction = JointFriction(model=model, parameters=parameters)
    return replace(robot, friction=(friction,) * robot.joints)


UR5 = load_robot("ur5")


def test_friction_and_rotor_come_back():
    rotor = UR5.chain.rotor_inertia * 1.3
    # 8 − 2·1·v is above zero up to the joints' π rad/s: the parabola may compete
    true = rubbed(UR5, load_coulomb=0.08, quadratic=-1.0)
    true = replace(true, chain=replace(true.chain, rotor_inertia=rotor))
    made = identify([log(true)], UR5, Task(method="friction"))
    found = made.robot
    assert made.shape_choices.filter("chosen")["joint"].to_list() == [1, 2, 3, 4, 5, 6]
    # 30 s of 0.2 N·m noise; coefficients of 5 and 8 within their spread of 1 or 2 %
    np.testing.assert_allclose(found.chain.rotor_inertia, rotor, rtol=0.05)
    for j in (1, 2):  # the joints that carry weight
        values = found.friction[j].parameters
        assert found.friction[j].model == "coulomb-viscous-load"
        assert values["load_coulomb"] == pytest.approx(0.08, rel=0.1)
        assert values["coulomb"] == pytest.approx(5.0, rel=0.05)
    v = np.linspace(0.1, 0.6, 6)[:, None] * np.ones(6)
    expected = friction_torque(true.friction, v)
    np.testing.assert_allclose(friction_torque(found.friction, v), expected, rtol=0.03)


@pytest.mark.slow
def test_a_fall_beside_the_links_is_replaced_by_the_joints_own_fit(monkeypatch):
    from vftcli.identification import methods

    recording = log(rubbed(UR5, "coulomb-viscous-offset"))
    together = identify([recording], UR5, Task(method="base")).robot.friction
    monkeypatch.setattr(methods, "is_dissipative", lambda *_: False)
    alone = identify([recording], UR5, Task(method="base")).robot.friction
    for one, other in zip(alone, together, strict=True):
        assert one.model == other.model
        assert one.parameters != other.parameters
        # both of noise that moves 5 and 8 by 1 or 2 %
        for key in ("coulomb", "viscous"):
            assert one.parameters[key] == pytest.approx(other.parameters[key], rel=0.05)


def test_a_stribeck_effect_is_seen():
    true = rubbed(UR5, "coulomb-viscous-stribeck", stribeck=4.0, stribeck_velocity=0.1)
    found = identify([log(true, noise=0.05)], UR5, Task(method="friction")).robot
    values = found.friction[0].parameters
    assert found.friction[0].model == "coulomb-viscous-stribeck"
    assert values["stribeck"] == pytest.approx(4.0, rel=0.1)
    assert values["stribeck_velocity"] == 0.1  # one of the velocities that compete


@pytest.mark.slow
def test_links_are_identified_for_another_trajectory():
    scale = np.linspace(0.85, 1.2, 6)
    inertia = UR5.chain.inertia * scale[:, None, None]
    chain = replace(UR5.chain, mass=UR5.chain.mass * scale, inertia=inertia)
    true = replace(rubbed(UR5, "coulomb-viscous-offset"), chain=chain)
    found = identify([log(true, 0)], UR5, Task(method="base"), [log(true, 7)])
    test = found.residuals.filter(role="held-out", model="identified")
    noisy, exact = (prepare(log(true, 7, noise), true).tau for noise in (0.2, 0.0))
    floor = root_mean_squares(noisy - exact)
    # the filter's rounding of reversals is in both; 1.3 covers the 46 numbers of 1400 samples
    assert test["rms_Nm"].mean() < 1.3 * floor.mean()
    assert len(found.base) == 40 + 6 * 3


HAND = Payload(mass=2.0, com=np.array([0.02, -0.03, 0.08]), inertia=np.zeros((3, 3)))


@pytest.mark.parametrize("seed", [1, 2])
def test_the_payload_comes_back_from_one_motion(seed):
    """In every joint another friction than the profile's; the load's inertia counts too."""
    carried = log(rubbed(UR5, "coulomb-viscous-offset").with_payload(HAND), seed)
    found = identify([carried], UR5, Task(method="payload"))
    origin = found.remarks[-1]
    assert origin.code == "load-from-motion"
    assert 0.0 < origin.values["left_percent"] < 100.0 * PARTLY
    assert found.parameters["determined"].to_list() == [True] * 4
    sd = dict(zip(found.parameters["parameter"], found.parameters["sd"], strict=True))
    # .2 N·m of noise on 900 samples: what is left is how friction is rounded around reversals
    assert found.robot.payload.mass == pytest.approx(2.0, rel=0.02)
    for name, value, true in zip("xyz", found.robot.payload.com, HAND.com, strict=True):
        assert abs(value - true) < 3.0 * sd[f"com_{name}"] < 0.05
    # its drives carry 18 kg of arm: 3 % of that weigh more than 3 % of the load
    assert 0.06 < sd["mass"] < 0.4


@pytest.mark.slow
def test_a_joint_that_rests_keeps_its_numbers():
    t, q, dq, ddq = motion(0)
    dq[:, 3], q[:, 3], ddq[:, 3] = 0.0, 0.4, 0.0
    torque = drive(rubbed(UR5), q, dq, ddq)
    recording = Recording(t=t, q=q, dq=dq, current=torque / UR5.torque_constant)
    found = identify([recording], UR5, Task(method="friction"))
    assert [r.where.joints for r in found.remarks if r.code == "static-joint"] == [(4,)]
    assert found.robot.friction[3] == UR5.friction[3]
    assert found.robot.chain.rotor_inertia[3] == UR5.chain.rotor_inertia[3]
    assert found.robot.document["joints"][3]["rotor_inertia_source"] == "profile ur5"


@pytest.mark.slow
@pytest.mark.parametrize(("push", "terms"), [(-0.1, "coulomb and viscous"), (0.1, None)])
def test_a_joint_that_hardly_rubs_is_bounded_at_zero_and_named(push, terms):
    """Of joint 6 noise of .2 N·m and a model that is .1 N·m wrong are all there is to fit."""
    recording = log(rubbed(UR5, "coulomb-viscous-offset"), 3)
    current = recording.current.copy()
    dq = recording.dq[:, 5]
    more = (push - 5.0) * np.tanh(dq / 0.01) + (push - 8.0) * dq
    current[:, 5] += more / UR5.torque_constant[5]
    found = identify([replace(recording, current=current)], UR5, Task(method="friction"))
    friction = found.robot.friction[5].parameters
    assert friction.get("coulomb", 0.0) >= 0.0
    assert friction.get("viscous", 0.0) >= 0.0
    bounded = [r for r in found.remarks if r.code == "friction-at-bound"]
    said = [((6,), terms)] if terms else []
    assert [(r.where.joints, r.values["terms"]) for r in bounded] == said
    # the other joints are none the worse: 5 N·m on 3000 samples of .2 N·m
    assert found.robot.friction[4].parameters["coulomb"] == pytest.approx(5.0, rel=0.05)


def good():
    return log(rubbed(UR5))


def weighed(mass):
    """A log of an arm that rubs little, with so much of a hand on its flange."""
    light = replace(HAND, mass=mass) if mass else None
    rubbing = rubbed(UR5, "coulomb-viscous-offset", coulomb=2.0)
    return log(rubbing.with_payload(light), 1)


def hardly(share):
    moved = weighed(2.0)
    return replace(moved, q=moved.q[0] + share * (moved.q - moved.q[0]), dq=share * moved.dq)


HEAVY = replace(HAND, mass=2.5, com=np.array([0.0, 0.0, 0.05]))
LITTLE, MISSING = errors.IdentificationError, errors.MissingSignalError


@pytest.mark.parametrize(
    ("made", "method", "error", "words"),
    [
        (lambda: hardly(0.0), "friction", LITTLE, "a log at rest identifies no friction"),
        (lambda: hardly(0.01), "payload", LITTLE, "the arm passes 1 different poses"),
        (lambda: weighed(2.0).between(5.0, 14.0), "payload", LITTLE, "too short .* record 10 s"),
        (lambda: weighed(0.0), "payload", LITTLE, "no load shows; in this motion one from"),
        (lambda: weighed(0.15), "payload", LITTLE, "no load shows"),
        (lambda: replace(good(), current=None), "friction", MISSING, "no motor currents"),
        (good, "targets", MISSING, "no target currents"),
        (lambda: replace(good(), current=-good().current), "friction", LITTLE, "another sign or"),
        (lambda: replace(good(), dq=-good().dq), "friction", LITTLE, "it would push"),
        (lambda: log(UR5.with_payload(HEAVY)), "friction", LITTLE, "kg on the flange .* payload"),
    ],
)
def test_a_log_that_tells_little_or_contradicts_its_arm_is_refused(made, method, error, words):
    with pytest.raises(error, match=words):
        identify([made()], UR5, Task(method=method))


@pytest.mark.parametrize(
    ("name", "error"), [("panda", errors.RobotError), ("ur10e", errors.IdentificationError)]
)
def test_the_wrong_robot_is_refused(name, error):
    with pytest.raises(error, match="another"):
        identify([good()], load_robot(name), Task(method="friction"))


@pytest.mark.parametrize(
    ("options", "match"),
    [
        ({"method": "targets", "friction": False}, "leave model.friction=none out"),
        ({"method": "base", "constants": True}, "--method friction"),
        ({"cutoff": 0.0}, "it must be positive"),
        ({"cutoff": 1e4}, "it must be positive"),
    ],
)
def test_tasks_that_make_no_sense_are_refused(options, match):
    with pytest.raises(errors.ParameterError, match=match):
        Task(**options)


def test_the_controllers_own_model_is_read_off():
    """A controller with other K, rotor and friction than the profile, and a hand on the arm."""
    K = UR5.torque_constant * [1.05, 0.95, 1.0, 1.1, 1.0, 1.0]
    true = rubbed(UR5, "coulomb-viscous-quadratic", offset=0.0, quadratic=-1.5)
    chain = replace(true.chain, rotor_inertia=UR5.chain.rotor_inertia * 1.2)
    true = replace(true, chain=chain, torque_constant=K)
    t, q, dq, ddq = motion(4, 60.0)
    asked = drive(replace(true, friction=()), q, dq, ddq)
    wanted = (asked + friction_torque(true.friction, dq)) / K
    hand = 20.0 * np.sin(t)[:, None]
    targets = {"target_current": np.round(wanted, 4), "target_torque": np.round(asked, 4)}
    recording = Recording(t=t, q=q, dq=dq, current=wanted + hand / K, **targets)
    found = identify([recording], UR5, Task(method="targets"))
    known = found.parameters.filter(parameter="torque_constant")
    for row in known.filter(known["determined"]).iter_rows(named=True):
        # rounded to 1e-4 A and filtered alike on both sides
        assert row["value"] == pytest.approx(K[row["joint"] - 1], rel=5e-3)
    assert known["determined"].to_list()[1:3] == [True, True]
    np.testing.assert_allclose(found.robot.chain.rotor_inertia, chain.rotor_inertia, rtol=0.02)
    v = np.linspace(0.2, 0.8, 4)[:, None] * np.ones(6)
    read, planted = (friction_torque(x.friction, v) for x in (found.robot, true))
    np.testing.assert_allclose(read, planted, rtol=0.1)


def two_folders(*logs):
    """The logs as `a/log.csv`, `b/log.csv` …: one file name, another folder each."""
    return [
        replace(r, source=replace(r.source, path=Path(f"{folder}/log.csv"), sha256=folder))
        for folder, r in zip("abcd", logs, strict=False)
    ]


@pytest.mark.slow
def test_two_logs_of_one_file_name_stay_two_logs():
    """Their rows were pooled: 12 residuals for 6 joints, in the terminal and the robot file."""
    true = rubbed(UR5, "coulomb-viscous-offset")
    found = identify(two_folders(log(true, 1), log(true, 2)), UR5, Task(method="friction"))
    tables = found.robot.document["identification"]["residuals"]
    assert [len(table["rms_Nm"]) for table in tables] == [6, 6]
    assert tables[0] != tables[1]
    assert found.residuals["log_index"].unique().sort().to_list() == [1, 2]


def test_a_pair_of_one_file_name_is_a_pair():
    """The loaded log is known by its content, not by its name."""
    true = rubbed(UR5, "coulomb-viscous-offset")
    logs = log(true, 1), log(true.with_payload(HAND), 1)
    named = identify(two_folders(*logs), UR5, Task(method="payload", name="mine"))
    plain = identify(logs, UR5, Task(method="payload"))
    assert named.parameters.equals(plain.parameters)
    assert len(named.traces) == 1  # the log without the load
    assert (named.robot.name, plain.robot.name) == ("mine", "ur5-identified")
    document = named.robot.document
    assert document["payload"]["source"].startswith("load from")
    assert document["identification"]["sha256"] == ["a", "b"]
    table = document["identification"]["payload"]
    assert (table["loaded"], len(table["residual_Nm"])) == ("log.csv", 6)
    assert table["mass_sd"] == named.parameters["sd"][0]
    source = document["sources"][-1]
    assert (source["id"], source["ref"]) == ("log-2", "log.csv, 3750 samples, 29.992 s")


def test_an_identified_arm_has_no_file_and_says_so_in_its_title():
    robot = identify([log(UR5.with_payload(HAND), 1)], UR5, Task(method="payload")).robot
    assert (robot.path, robot.title) == (None, f"{UR5.title}, identified")


def test_the_heavier_log_is_refused_as_the_free_one_whatever_its_name():
    free, loaded = two_folders(log(UR5, 1), log(UR5.with_payload(HAND), 1))
    with pytest.raises(errors.IdentificationError, match="swap the two logs"):
        identify([free], UR5, Task(method="payload"), free=loaded)


@pytest.mark.parametrize("method", ["friction", "base"])
def test_a_simulators_arm_has_no_friction(method):
    """Rotors and links are fitted, friction neither competes nor stands in the file."""
    rotor = UR5.chain.rotor_inertia * 1.2
    true = replace(UR5, chain=replace(UR5.chain, rotor_inertia=rotor), friction=())
    profile = replace(UR5, friction=())
    found = identify([log(true)], profile, Task(method=method, friction=False), [log(true, 7)])
    assert found.robot.friction == ()
    joints, account = (found.robot.document[key] for key in ("joints", "identification"))
    assert not any("friction" in joint for joint in joints)
    own = f"identified ({method}) from recording"
    sources = {"rotor_inertia": own, "torque_constant": "profile ur5"}
    sources["inertial"] = own if method == "base" else "profile ur5"
    for key, source in sources.items():
        assert {joint[f"{key}_source"] for joint in joints} == {source}
    assert (account["method"], account["profile"]) == (method, "ur5")
    assert ("base_parameters" in account) is (method == "base")
    assert [table["role"] for table in account["residuals"]] == ["train", "held-out"]
    assert found.shape_choices.is_empty()
    assert "presliding-length" not in [remark.code for remark in found.remarks]
    # white noise of .2 N·m, 8 of 62.5 Hz of which pass the filter: .07
    assert np.all(found.traces[1].rms <= 0.09)
    if method == "friction":
        # five standard deviations by the noise at these slow accelerations
        np.testing.assert_allclose(found.robot.chain.rotor_inertia, rotor, rtol=0.05)


def test_torques_behind_the_gears_leave_the_friction_method_nothing_to_find():
    """Without friction: the rotor is before the gear, the links are the profile's."""
    robot = replace(UR5, torque_source="link_torque", torque_constant=None, friction=())
    with pytest.raises(errors.IdentificationError, match="nothing to find"):
        identify([log(robot)], robot, Task(method="friction", friction=False))
    found = identify([log(robot)], robot, Task(method="base", friction=False))
    assert found.robot.friction == ()


@pytest.fixture
def sine_motion(prepared, sines):
    """Eight seconds of motion of a UR5, without torque."""
    t, q, dq, ddq = sines()
    return prepared(t, q=q, dq=dq, ddq=ddq)


def trace(sine_motion, residual, role="held-out"):
    nothing = np.zeros(sine_motion.q.shape[1])
    rms = root_mean_squares(residual)
    return Trace(sine_motion, role, residual, 0.0 * residual, residual, rms, nothing)


def test_rigid_torque_is_pinocchios_without_rotors(sine_motion):
    data = UR5.model.createData()
    plain = UR5.model.copy()
    plain.armature = np.zeros(6)
    for k in (0, 500, -1):
        expected = pin.rnea(plain, data, sine_motion.q[k], sine_motion.dq[k], sine_motion.ddq[k])
        np.testing.assert_allclose(sine_motion.rigid[k], expected, atol=1e-9)


@pytest.mark.parametrize("mass", [1.5, -0.8])
def test_a_load_on_the_flange_is_named(sine_motion, mass):
    load = Payload(mass=abs(mass), com=np.array([0.0, 0.0, 0.05]), inertia=np.zeros((3, 3)))
    effect = sine_motion.with_robot(UR5.with_payload(load)).rigid - sine_motion.rigid
    residual = np.sign(mass) * effect
    found, share = apparent_load(sine_motion, residual)
    # m, m·c alone are fitted; the point mass's own tensor about the last frame is 2e-3 of it
    assert found == pytest.approx(mass, rel=0.02)
    assert share > 0.99


def test_the_share_of_a_repeated_path(prepared, sines):
    t, q, dq, _ = sines(seconds=8.0)
    whole = prepared(t, q=q, dq=dq)
    half = prepared(t[:500], q=q[:500], dq=dq[:500])
    assert repeated_share(whole, half) == 1.0
    # the sines of 1/6, 1/3 and 1/2 Hz repeat after 6 s only
    assert repeated_share(half, whole) == pytest.approx((500 + 250) / 1000, abs=0.01)
    # the same places at half the speed are another trajectory, but where it stands nearly still
    assert repeated_share(whole, prepared(t, q=q, dq=0.5 * dq)) < 0.1
    assert repeated_share(whole, prepared(t, q=q + 0.009, dq=dq)) > 0.9
    assert repeated_share(whole, prepared(t, q=q + 0.2, dq=dq)) < 0.1
    assert repeated_share(replace(half, t=t[:0]), whole) == 0.0


@pytest.mark.parametrize(("before", "worse"), [(1.9, True), (2.0, False), (3.0, False)])
def test_a_model_that_leaves_more_than_the_profile_is_reported(sine_motion, before, worse):
    left = trace(sine_motion, np.full(sine_motion.q.shape, 2.0), "train")
    remarks = list(score_remarks([left._replace(before=np.full(6, before))]))
    reported = [r.values["profile_Nm"] for r in remarks if r.code == "worse-than-profile"]
    assert reported == pytest.approx([before] if worse else [])


def test_a_repeated_log_is_no_test_and_the_training_level_is_said(sine_motion):
    train = trace(sine_motion, np.full(sine_motion.q.shape, 2.0), "train")
    remarks = list(score_remarks([train, trace(sine_motion, np.full(sine_motion.q.shape, 2.0))]))
    assert [r.code for r in remarks] == ["repeated-trajectory", "training-residual"]
    assert remarks[0].values["share_percent"] == 100.0
    assert remarks[1].values["mean_Nm"] == 2.0
    assert not list(score_remarks([]))
