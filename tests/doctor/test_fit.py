"""Which robot a log is from: known misfits and loads, inside and outside the limits."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from moving_arms import gravity, moving

from vftcli.doctor import fit as doctor_fit
from vftcli.doctor.fit import (
    MAKER,
    MEASURED,
    RESIDUAL,
    RobotMatch,
    arm_findings,
    guess_robot,
    is_judgeable,
    match_of,
    ranking,
)
from vftcli.robots import PROFILES, Robot, load_robot
from vftcli.signals.recording import Recording

PANDA = load_robot("panda")
T = 0.01 * np.arange(1000)


def held(robot: Robot = PANDA) -> Recording:
    """An arm held in one pose by exactly its own gravity torques."""
    q = np.tile(np.linspace(0.3, 1.2, robot.joints), (len(T), 1))
    log = Recording(t=T, q=q, dq=np.zeros_like(q))
    return replace(log, torque=gravity(robot, log))


def off(misfit: float) -> float:
    """Factor on a torque that leaves such a share of it unexplained: 1 − 1/factor. [-]"""
    return 1 / (1 - misfit)


def first_match(log: Recording) -> RobotMatch:
    found = match_of(log, PANDA)
    assert found is not None
    return found


@pytest.mark.parametrize(
    ("evidence", "limit"), [(MAKER, 0.02), (RESIDUAL, 0.02), (MEASURED, 0.15)]
)
def test_a_profile_fits_up_to_the_limit_of_its_evidence(evidence: str, limit: float) -> None:
    """In one pose no load is fitted, so the planted share is the misfit to rounding."""
    log = held()
    for misfit, fits in ((limit - 0.01, True), (limit + 0.01, False)):
        torque = off(misfit) * log.require("torque")
        signals = {
            MAKER: {"target_torque": torque},
            RESIDUAL: {"torque": torque - 1, "tau_ext": 1 + 0 * torque},
            MEASURED: {"torque": torque},
        }[evidence]
        found = first_match(replace(log, **signals))  # type: ignore[arg-type]
        assert (found.evidence, found.fits, found.load) == (evidence, fits, 0.0)
        assert found.by_maker == (evidence != MEASURED)
        assert found.misfit == pytest.approx(misfit, abs=1e-9)


def test_signals_of_zeros_are_no_evidence() -> None:
    log = held()
    zeros = np.zeros_like(log.q)
    assert first_match(replace(log, target_torque=zeros)).evidence == MEASURED
    assert first_match(replace(log, tau_ext=zeros)).evidence == MEASURED
    assert match_of(replace(log, torque=zeros), PANDA) is None
    assert match_of(replace(log, torque=None), PANDA) is None


def test_a_load_is_found_where_the_poses_tell_it() -> None:
    """Up to 12 kg; more is another arm. 10 %: the load's inertia is not in the fit."""
    found = match_of(moving("ur10e", load=3.0), load_robot("ur10e"))
    assert found is not None
    assert found.load == pytest.approx(3.0, rel=0.1)
    assert (
        str(found)
        == f"ur10e with {found.load:.1f} kg ({100 * found.misfit:.1f} %) by measured effort"
    )
    heavy = match_of(moving("ur10e", load=14.0), load_robot("ur10e"))
    assert heavy is not None
    assert heavy.load == 0.0
    assert first_match(held()).load == 0.0


def test_a_measured_effort_that_needs_a_heavy_load_is_no_fit() -> None:
    found = match_of(moving("ur10e", load=7.0), load_robot("ur10e"))
    assert found is not None
    assert found.misfit < 0.1
    assert not found.fits


def test_an_effort_with_columns_in_another_order_is_not_another_arm_s() -> None:
    """The controller's own model says which arm it is; no pair of joints is exchanged."""
    log = match_log(moving("ur10e"))
    mixed = replace(log, current=log.require("current")[:, ::-1])
    found = arm_findings(mixed, load_robot("ur10e"))
    assert [finding.code for finding in found.findings] == ["effort-unexplained"]
    assert found.robots[0].fits


def test_a_robot_is_guessed_by_the_maker_s_own_model_alone() -> None:
    """A UR10e's current times its constants settles nothing, its target torque does."""
    log = moving("ur10e")
    assert guess_robot(log)[0] is None
    rigid = match_log(log)
    found, fits = guess_robot(rigid)
    assert found is not None
    assert found.robot == "ur10e"
    assert {fit.robot for fit in fits} == {n for n in PROFILES if load_robot(n).joints == 6}
    # FR3 and Panda are too much alike
    torque = gravity(PANDA, moving("panda"))
    alike = replace(moving("panda"), target_torque=torque)
    assert guess_robot(alike)[0] is None


def match_log(log: Recording) -> Recording:
    """A log with the maker's model of it: what the drives carry, less the friction."""
    constant = np.asarray(load_robot("ur10e").torque_constant)
    friction = 4.0 * np.tanh(log.require("dq") / 0.01)
    return replace(log, target_torque=log.require("current") * constant - friction)


def fake(misfit: float, *, fits: bool = True) -> RobotMatch:
    return RobotMatch(robot="", misfit=misfit, fits=fits, evidence="", load=0.0)


def ranked(monkeypatch: pytest.MonkeyPatch, **fits: RobotMatch) -> list[tuple[str, bool]]:
    """The ranking of profiles whose fits are as given."""

    def given(_log: Recording, robot: Robot) -> RobotMatch:
        return fits[robot.name]._replace(robot=robot.name)

    monkeypatch.setattr(doctor_fit, "match_of", given)
    found = ranking(held(), [replace(PANDA, name=name) for name in fits])
    return [(fit.robot, fit.fits) for fit in found]


def test_profiles_within_three_tenths_of_the_best_are_not_reported_apart(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    found = ranked(monkeypatch, far=fake(0.0131), near=fake(0.0129), best=fake(0.01))
    assert found == [("best", True), ("near", True), ("far", False)]


def test_a_profile_that_fits_goes_before_a_better_one_that_does_not(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    found = ranked(monkeypatch, better=fake(0.15, fits=False), fitting=fake(0.19))
    assert found == [("fitting", True), ("better", False)]


@pytest.mark.parametrize(
    ("share", "more", "cause", "rather"),
    [
        (0.59, 0.0, None, True),
        (0.61, 1.4, None, False),
        (0.79, 1.6, None, True),  # 1/1.25: own needs a load that the other does not
        (0.81, 1.6, None, False),
        (1.24, 0.0, "drive-scale", True),
        (1.26, 0.0, "drive-scale", False),
        (0.61, 0.0, "effort-sign", False),
    ],
)
def test_how_much_better_another_profile_is_where_a_log_is_its_own(
    share: float, more: float, cause: str | None, *, rather: bool
) -> None:
    healed = SimpleNamespace(misfit=0.2)
    diagnosis = SimpleNamespace(cause=cause and SimpleNamespace(code=cause), healed=healed)
    own, other = fake(0.3)._replace(load=more), fake(0.2 * share)
    assert doctor_fit.is_rather(other, own, diagnosis) is rather  # type: ignore[arg-type]
    misfit = other._replace(fits=False)
    assert not doctor_fit.is_rather(misfit, own, diagnosis)  # type: ignore[arg-type]


def test_what_cannot_be_ranked() -> None:
    log, robots = held(), [PANDA, load_robot("ur10e")]
    assert [fit.robot for fit in ranking(log, robots)] == ["panda"]
    assert ranking(replace(log, dq=None), robots) == ()
    assert ranking(log.between(0, T[8]), robots) == ()
    assert len(ranking(log.between(0, T[9]), robots)) == 1
    assert ranking(replace(log, torque=None), robots) == ()


def test_numbers_that_no_arm_has_are_not_judged() -> None:
    log = held()
    assert is_judgeable(log)
    assert not is_judgeable(replace(log, q=1e5 + log.q))
    assert not is_judgeable(replace(log, dq=1e5 + log.q))
    assert not is_judgeable(replace(log, torque=1e10 + log.q))
    assert not is_judgeable(replace(log, t=1e-300 * (1 + np.arange(len(T)))))
