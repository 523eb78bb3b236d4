"""Friction from free motion alone: contacts left out, wrong robots doubted."""

from dataclasses import replace

import numpy as np
import pytest

from vftcli.identification.clean_fit import (
    OTHER_LINKS,
    contacts_remark,
    fit_without_contacts,
    fitted_dry_friction,
    heavy_joints,
    links_explain,
    model_doubts,
)
from vftcli.identification.excitation import ContactSpan
from vftcli.identification.processing import Processing
from vftcli.identification.training import all_residuals, fit_frictions, prepare_training
from vftcli.robots import JointFriction, Payload, load_robot
from vftcli.robots.regressor import chain_parameters, torque_regressor
from vftcli.signals.errors import IdentificationError

RUBBING = JointFriction(
    model="coulomb-viscous-offset", parameters={"coulomb": 4.0, "viscous": 6.0, "offset": 0.5}
)
UR5 = replace(load_robot("ur5"), friction=(RUBBING,) * 6)
"""A UR5 with one friction in all joints; the logs are its own."""


@pytest.fixture
def recording(rubbing_log):
    """12 s of a UR5 that rubs."""
    return rubbing_log


@pytest.fixture
def data(rubbing_data):
    """That log as training data for its own robot."""
    return rubbing_data


@pytest.mark.slow
def test_a_push_is_left_out_of_the_fit(recording):
    push = np.where((recording.t > 5) & (recording.t < 6), 40.0, 0.0)[:, None] * np.eye(6)[1]
    pushed = replace(recording, current=recording.current + push / UR5.torque_constant)
    data = prepare_training([pushed], UR5, Processing(), fit_constants=False)
    fits, weights, remarks = fit_without_contacts(data, strict=False)
    assert [r.code for r in remarks] == ["suspected-contacts"]
    t = data.motions[0].t
    np.testing.assert_array_equal(weights[0][(t > 5) & (t < 6)], 0.0)
    assert weights[0][(t < 4.5) | (t > 6.5)].all()
    clean = fit_without_contacts(
        prepare_training([recording], UR5, Processing(), fit_constants=False), strict=False
    )
    assert clean[2] == []
    np.testing.assert_allclose(fits[1].fit.values[:2], clean[0][1].fit.values[:2], rtol=0.05)


@pytest.mark.slow
def test_the_dry_friction_of_a_fit_is_what_a_joint_may_stick_with(data):
    fits = fit_frictions(data, [m.usable.astype(float) for m in data.motions])
    # noise of .1 N·m; Coulomb torque and the smoothing of the sign share the reversals
    np.testing.assert_allclose(fitted_dry_friction(data, 0, fits), 4.0, atol=0.3)


def test_contacts_are_counted_and_timed(data):
    spans = [ContactSpan(1.0, 2.5, 3, -8.0), ContactSpan(4.0, 4.5, 1, 5.0)]
    remark = contacts_remark(data.motions[0], spans)
    assert remark.values["count"] == 2
    assert remark.values["total_s"] == 2.0
    assert (remark.values["starts_s"], remark.values["worst_joints"]) == ([1.0, 4.0], [3, 1])


def test_an_unknown_load_is_doubted_from_half_a_kilogram_on(recording, sines):
    _, q, dq, ddq = sines(seconds=12.0, seed=2)
    for mass, doubted in ((0.4, False), (1.5, True)):
        load = Payload(mass=mass, com=np.array([0.0, 0.0, 0.05]), inertia=np.zeros((3, 3)))
        heavier = chain_parameters(UR5.with_payload(load).loaded_chain)
        extra = torque_regressor(UR5.chain, q, dq, ddq) @ (heavier - chain_parameters(UR5.chain))
        log = replace(recording, current=recording.current + extra / UR5.torque_constant)
        data = prepare_training([log], UR5, Processing(), fit_constants=False)
        ones = [np.ones(m.tau.shape) for m in data.motions]
        remarks = list(model_doubts(data, [np.zeros(m.tau.shape) for m in data.motions], ones))
        assert [r.code for r in remarks] == ["unknown-load"] * doubted
        if doubted:
            assert remarks[0].values["mass_kg"] == pytest.approx(mass, rel=0.02)


@pytest.mark.slow
def test_strict_methods_refuse_what_others_remark_on(recording):
    turned = replace(recording, current=-recording.current)
    data = prepare_training([turned], UR5, Processing(), fit_constants=False)
    with pytest.raises(IdentificationError, match="Choose another --robot"):
        fit_without_contacts(data, strict=True)
    codes = [r.code for r in fit_without_contacts(data, strict=False)[2]]
    assert codes[-2:] == ["unexplained-torque", "absorbed-doubt"]


@pytest.mark.slow
def test_links_of_another_arm_are_told_from_an_effort_that_no_links_explain(recording, data):
    """The same effort through a UR10e's links, and its own links under noise of 30 N·m."""
    weights = [m.usable.astype(float) for m in data.motions]

    def ratio(training):
        fits = fit_frictions(training, weights)
        return np.max(links_explain(training, fits, all_residuals(training, fits), weights))

    # 10 cosines of freedom a link against 2300 equations a joint: a few per cent
    assert ratio(data) == pytest.approx(1.0, abs=0.1)
    ur10 = replace(load_robot("ur10e"), torque_constant=UR5.torque_constant)
    other = prepare_training([recording], ur10, Processing(), fit_constants=False)
    assert ratio(other) > OTHER_LINKS
    rng = np.random.default_rng(4)
    noise = 30.0 * rng.standard_normal(recording.q.shape) / UR5.torque_constant
    noisy = replace(recording, current=recording.current + noise)
    trained = prepare_training([noisy], UR5, Processing(), fit_constants=False)
    remarks = fit_without_contacts(trained, strict=True)[2]
    (said,) = [r for r in remarks if r.code == "noisy-effort"]
    assert said.values["ratio"] < 1.2
    np.testing.assert_array_equal(heavy_joints(data), [False, True, True, False, False, False])
