"""The choice of a joint's friction model on equations made here."""

import numpy as np
import pytest

from vftcli.identification.friction_fit import (
    PLAIN,
    JointData,
    candidate_shapes,
    choose_presliding,
    choose_shape,
    is_dissipative,
    non_negative_fit,
)
from vftcli.identification.shapes import Shape

LIMIT = 1.2
"""Speed up to which friction may not fall: 5 − 2·2 v = 0 lies above it, at 1.25. [rad/s]"""


def equations(prepared, truth, noise=0.05, load=5.0, reverses=True, limit=LIMIT):
    """One joint's equations: a slow swing that reverses, friction by `truth` (term → value)."""
    t = np.arange(0, 40, 0.02)
    dq = 0.6 * np.sin(2 * np.pi * 0.2 * t) + 0.2 * np.sin(2 * np.pi * 0.05 * t)
    if not reverses:
        dq = np.abs(dq) + 0.05
    loads = load * (1 + np.cos(2 * np.pi * 0.03 * t))
    log = prepared(t, dq=dq[:, None], load=loads[:, None])
    shape = Shape(tuple(truth), 0.03, 0.1, 0.2)
    data = rubbing(log, shape, [*truth.values()], noise)
    return data._replace(load_spread=float(np.std(loads)), reverses=reverses, speed_limit=limit)


def rubbing(log, shape, values, noise=0.05, seed=0):
    """Equations of the one joint of a log whose torque is friction and noise."""
    y = log.friction(0, shape) @ np.array(values)
    y = y + noise * np.random.default_rng(seed).standard_normal(log.samples)
    own = {"y": y, "fixed": np.zeros((len(y), 0)), "weights": np.ones(len(y)), "logs": [log]}
    return JointData(joint=0, **own, load_spread=0.0, reverses=True, speed_limit=LIMIT)


@pytest.mark.parametrize(
    "truth",
    [
        {"coulomb": 3.0, "viscous": 5.0, "offset": 0.2},
        {"coulomb": 3.0, "viscous": 5.0, "offset": 0.2, "quadratic": -2.0},
        {"coulomb": 3.0, "viscous": 5.0, "offset": 0.2, "load_coulomb": 0.1},
        {"coulomb": 3.0, "logarithmic": 4.0, "offset": 0.2},
        {"coulomb": 3.0, "logarithmic": 4.0, "offset": 0.2, "load_coulomb": 0.1},
    ],
)
def test_the_planted_model_wins(prepared, truth):
    shape, scores = choose_shape(equations(prepared, truth))
    assert set(shape.terms) == set(truth)
    assert shape.smoothing == 0.03
    # the planted model leaves its noise of 0.05 on the stretches left out, to 2000 samples' 2 %
    assert scores[shape] == pytest.approx(0.05, rel=0.1)


def test_a_parabola_that_falls_in_the_joints_range_does_not_compete(prepared):
    truth = {"coulomb": 3.0, "viscous": 5.0, "offset": 0.2, "quadratic": -2.0}
    shape, scores = choose_shape(equations(prepared, truth, limit=3.0))  # it falls from 1.25 on
    assert all("quadratic" not in candidate.terms for candidate in scores)
    assert "logarithmic" in shape.terms
    # .2 N·m rms is what the fall at the log's .8 rad/s differs by from the best logarithm
    assert scores[shape] < 0.2


def test_candidates_are_what_the_motion_can_tell(prepared):
    """Growth with the load where the load varies, Stribeck velocities beyond twice .03 rad/s."""
    for load, tells in ((0.1, False), (5.0, True)):
        data = equations(prepared, {"coulomb": 3.0, "viscous": 5.0}, load=load)
        shapes = candidate_shapes(Shape((), 0.03), data)
        assert any("load_coulomb" in shape.terms for shape in shapes) is tells
    assert {s.stribeck_velocity for s in shapes if "stribeck" in s.terms} == {0.1, 0.2}


@pytest.mark.parametrize(
    ("pushes", "reverses", "limit", "terms"),
    [
        (0.0, True, 100.0, ("offset",)),
        (0.05, True, 100.0, ("offset",)),  # a fit's rest and no friction
        (0.05, False, 100.0, ()),
        (3.0, True, 100.0, PLAIN),  # the velocity has the other sign: the reader is warned
        (3.0, True, 1000.0, ("offset",)),  # as much of a strong joint may be a model's error
    ],
)
def test_what_pushes_is_no_friction(prepared, pushes, reverses, limit, terms):
    truth = {"coulomb": -pushes, "viscous": -pushes, "offset": 0.2 * reverses}
    noise = 0.05 if pushes else 0.0
    data = equations(prepared, truth, noise, reverses=reverses)._replace(torque_limit=limit)
    shape, scores = choose_shape(data)
    assert (shape.terms, scores) == (terms, {})


@pytest.mark.parametrize(
    ("terms", "values", "good"),
    [
        (("coulomb", "viscous"), (0.0, -1.0), False),
        (("coulomb", "viscous", "quadratic"), (1.0, -1.0, 2.0), False),  # falls up to .25 rad/s
        (("coulomb", "viscous", "quadratic"), (1.0, 3.0, -1.0), True),  # 1.5 is out of range
        (("coulomb", "viscous", "quadratic"), (1.0, 2.0, -1.0), False),  # falls from 1 rad/s on
        (("coulomb", "logarithmic"), (1.0, 2.0), True),
        (("coulomb", "viscous"), (-0.1, 1.0), False),
        (("coulomb", "stribeck"), (1.0, -0.1), False),
        (("coulomb", "load_coulomb"), (1.0, -0.1), False),
        (("coulomb", "offset"), (1.0, -3.0), True),
    ],
)
def test_dry_friction_must_not_push(terms, values, good):
    assert is_dissipative(Shape(terms), np.array([*values, -9.0]), LIMIT) == good


def reversing(prepared, dry, presliding, length=1e-3, seed=0):
    """40 s of slow reversals; tanh and play rub beside viscous friction, noise of .05 N·m."""
    t = np.arange(0, 40, 0.02)
    q = 0.05 * np.sin(2 * np.pi * 0.2 * t) + 0.01 * np.sin(2 * np.pi * 0.57 * t)
    log = prepared(t, q=q[:, None], dq=np.gradient(q, t)[:, None])
    shape = Shape(("coulomb", "viscous", "presliding"), 0.003, presliding_length=length)
    return rubbing(log, shape, [dry, 5.0, presliding], seed=seed), shape


def test_the_arms_presliding_length_is_found_and_only_where_there_is_one(prepared):
    data, planted = reversing(prepared, dry=1.0, presliding=2.0)
    other, _ = reversing(prepared, dry=0.5, presliding=1.0, seed=1)
    found = choose_presliding([data, other])
    assert found.length == planted.presliding_length
    assert found.errors[0.0] == pytest.approx(1.0)
    assert found.errors[found.length] == min(found.errors.values()) < 0.5
    shape, _ = choose_shape(data, found.length)
    assert "presliding" in shape.terms
    none, _ = reversing(prepared, dry=3.0, presliding=0.0)
    assert choose_presliding([none]).length == 0.0


def test_presliding_and_sign_share_one_dry_torque(prepared):
    """All of it presliding's, and more: the smoothed sign that came out negative is left out."""
    data, planted = reversing(prepared, dry=-0.5, presliding=3.0)
    shape, values = non_negative_fit(planted, data)
    assert shape.terms == ("viscous", "presliding")
    assert values[1] > 2.0
    assert is_dissipative(shape, values, LIMIT)


def test_whole_logs_are_left_out_where_the_joint_moves_in_several(prepared):
    data = equations(prepared, {"coulomb": 3.0, "viscous": 5.0})
    resting = prepared(np.arange(0, 2, 0.02), dq=np.zeros((100, 1)))
    moving = data.logs[0]
    both = data._replace(logs=[moving, resting, moving])
    assert [len(part) for part in both.parts] == [moving.samples, moving.samples]
    assert len(data._replace(logs=[moving, resting]).parts) == 5
