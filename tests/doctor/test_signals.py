"""Findings about the signals: each with a known amount of its fault, inside and outside."""

import numpy as np
import pytest
from swinging import DQ, TORQUE, Q, T, found, log_of, scaled

from vftcli.doctor import examine
from vftcli.doctor.signals import inverted_effort
from vftcli.signals.arrays import Array
from vftcli.signals.recording import Recording
from vftcli.signals.remarks import Remark

FRICTION = np.sign(DQ) * (1 + 1e-3 * np.sin(np.arange(len(T)))[:, None])
"""Dry friction of 1 N·m, with a ripple of a thousandth lest it stays at its extreme. (T, 6)"""


def test_a_sound_log_has_no_finding() -> None:
    for effort in ("torque", "current", "torque_without_gravity"):
        assert found(**{"torque": None, effort: TORQUE}) == {}
        assert found(**{"torque": None, effort: FRICTION}) == {}


def test_a_log_without_velocity_or_effort() -> None:
    assert set(found(dq=None)) == {"no-velocity"}
    assert set(found(torque=None)) == {"no-effort"}
    assert {finding.level for finding in found(dq=None, torque=None).values()} == {"warning"}


@pytest.mark.parametrize(("peak", "reported"), [(12.9, False), (13.1, True), (-13.1, True)])
def test_positions_beyond_two_turns_may_be_degrees(peak: float, reported: bool) -> None:
    q = Q.copy()
    q[7, 2] = peak
    findings = found(q=q)
    assert ("degrees" in findings) == reported
    if reported:
        assert findings["degrees"].values["largest_rad"] == pytest.approx(13.1)


@pytest.mark.parametrize(("joint", "reported"), [(6, False), (5, True)])
def test_the_last_joint_of_an_arm_may_turn_without_end(joint: int, reported: bool) -> None:
    """Wrist 3 of a UR3 has no limit: ten turns of it are 63 rad."""
    q = Q.copy()
    q[:, joint - 1] += 63.0
    assert ("degrees" in found(q=q)) == reported


@pytest.mark.parametrize(("size", "reported"), [(59.0, False), (61.0, True)])
def test_currents_beyond_sixty_ampere_may_be_milliamperes(size: float, reported: bool) -> None:
    findings = found(current=size * FRICTION, torque=None)
    assert set(findings) == ({"milliamperes"} if reported else set())
    if reported:
        assert findings["milliamperes"].values["typical_A"] == pytest.approx(61.0, rel=2e-3)


@pytest.mark.parametrize(("per_thousand", "reported"), [(9, False), (11, True)])
def test_a_few_currents_of_any_size_are_outliers(per_thousand: int, reported: bool) -> None:
    current = FRICTION.copy()
    current.flat[: current.size * per_thousand // 1000] = 500.0
    assert ("milliamperes" in found(current=current, torque=None)) == reported


def straight(x: Array, every: int, bend: float = 0.0) -> Array:
    """A signal of every such sample, joined by lines whose slope changes by a share within."""
    knots = np.arange(0, len(T), every)
    lines = np.column_stack([np.interp(T, T[knots], column[knots]) for column in x.T])
    rise = np.repeat(np.diff(x[knots], axis=0), every, axis=0)
    odd = np.arange(len(rise)) % every == every // 2
    lines[:-1] += 0.5 * bend * rise / every * odd[:, None]
    return lines


RISING = (0.2 * T + 0.05 * np.sin(3.0 * T))[:, None] * np.ones(6)


@pytest.mark.parametrize(
    ("q", "torque", "rate"),
    [
        (straight(Q, 4), straight(20 * Q, 4), 25.0),
        (straight(Q, 10), straight(20 * Q, 10), 10.0),
        (straight(Q, 2), straight(20 * Q, 2), None),  # half of it runs straight, less than .6
        (straight(Q, 4), 20 * Q, None),
        (Q, straight(20 * Q, 4), None),
        # what only rises or only falls
        (straight(RISING, 10), straight(-RISING, 10), 10.0),
        (RISING, -RISING, None),
        # a slope that changes by less than a thousandth of both sides' is the same
        (straight(Q, 4), straight(20 * Q, 4, bend=0.5e-3), 25.0),
        (straight(Q, 4), straight(20 * Q, 4, bend=8e-3), None),
        # what holds does not run straight, and is no motion: lines for 16 s, then steps
        (
            straight(Q, 4),
            np.where(T[:, None] < 16.0, straight(20 * Q, 4), 20 * Q[np.arange(len(T)) // 4 * 4]),
            25.0,
        ),
        # a tenth of the values has to change
        (straight(Q, 4), straight(20 * Q, 4) * (T[:, None] < 2.0), None),
        (straight(Q, 4), straight(20 * Q, 4) * (T[:, None] < 6.0), 25.0),
    ],
)
def test_signals_that_run_from_corner_to_corner_are_interpolated(
    q: Array, torque: Array, rate: float | None
) -> None:
    finding = found(q=q, torque=torque).get("interpolated")
    assert (finding is not None) == (rate is not None)
    if finding is not None:
        assert finding.values == pytest.approx({"rate_Hz": rate, "logged_Hz": 100.0})


@pytest.mark.parametrize(
    ("changes", "codes"),
    [
        ({"t": np.append(T[:-1], 0.9e18)}, []),
        ({"t": np.append(T[:-1], 1.1e18)}, ["absurd-clock"]),
        ({"t": 1e-12 * T}, ["absurd-steps"]),
        ({"t": 1e-10 * T}, []),
        ({"t": 1.1e12 * T}, ["absurd-steps"]),
        ({"torque": 1.1e9 * DQ / DQ.max()}, ["absurd-values"]),
        ({"torque": 0.9e9 * DQ / DQ.max()}, []),
        ({"tau_ext": 1e300 * DQ, "q": 1e300 * Q, "torque": TORQUE}, ["absurd-values"] * 2),
    ],
)
def test_numbers_that_no_clock_and_no_robot_gives(
    changes: dict[str, Array], codes: list[str]
) -> None:
    """The limits are beyond every unit: 30 years in ns, steps from 0.1 ps to 300 years."""
    findings = examine(log_of(**changes)).findings
    assert [f.code for f in findings if f.code.startswith("absurd")] == codes
    if codes:
        assert len(findings) == len(codes)  # nothing else is examined
    if codes == ["absurd-clock"]:
        assert findings[0].values == {"least_s": T[0], "largest_s": 1.1e18}


@pytest.mark.parametrize(("samples", "reported"), [(1, True), (2, True), (3, False)])
def test_two_samples_are_too_short(samples: int, reported: bool) -> None:
    findings = examine(Recording(t=T[:samples], q=Q[:samples], dq=DQ[:samples])).findings
    assert ([(f.code, f.level) for f in findings] == [("too-short", "warning")]) == reported
    if reported:
        assert findings[0].values["samples"] == samples


def effort_of_share(share: float, *joints: int) -> Array:
    """Effort whose net work over its gross work is as given on some joints, 1 on the others.

    It drives for (1 + share)/2 of all the way and brakes for the rest.
    """
    way = np.cumsum(np.abs(DQ), axis=0) / np.sum(np.abs(DQ), axis=0)
    drives = np.where(way <= (1 + share) / 2 + 1e-9, 1.0, -1.0)
    chosen = np.isin(np.arange(6), [j - 1 for j in joints])
    return FRICTION * np.where(chosen, drives, 1.0)


def by_work(**changes: Array | None) -> list[tuple[str, tuple[int, ...], Remark]]:
    """Findings on the sign of an effort of which nobody knows the arm, with code and joints."""
    findings = inverted_effort(log_of(**changes))
    return [(finding.code, finding.where.joints, finding) for finding in findings]


ALL = (1, 2, 3, 4, 5, 6)


@pytest.mark.parametrize(
    ("share", "joints", "code"),
    [
        (0.0, ALL, ""),
        (-0.35, ALL[:4], ""),
        (-0.45, ALL[:4], "effort-sign-by-work"),
        (-1.0, ALL, "effort-sign-by-work"),
        # of few joints less than .85 of the work may be gravity's
        (-0.8, (5,), ""),
        (-0.8, (2, 3, 5), ""),
        (-0.9, (5,), "effort-sign-of-some"),
        (-0.9, (2, 3, 5), "effort-sign-of-some"),
    ],
)
def test_an_effort_that_takes_energy_is_inverted(
    share: float, joints: tuple[int, ...], code: str
) -> None:
    said = by_work(torque=effort_of_share(share, *joints))
    assert [each[:2] for each in said] == ([(code, joints)] if code else [])
    for *_, finding in said:
        assert finding.values["shares_percent"] == pytest.approx(
            [100 * share] * len(joints), abs=0.2
        )


def test_joints_that_tell_nothing_are_not_judged() -> None:
    """Too little way, one direction only, no effort: each alone."""
    ways, turned = np.sum(np.abs(np.diff(Q, axis=0)), axis=0), -FRICTION
    for way, known in ((0.29, False), (0.31, True)):
        assert bool(by_work(q=Q * way / ways, torque=turned)) == known
    for slowest, known in ((0.9e-3, False), (1.1e-3, True)):
        for dq in (np.maximum(DQ, -slowest), np.minimum(DQ, slowest)):
            assert bool(by_work(dq=dq, torque=turned)) == known
    assert not by_work(torque=0 * turned)
    assert not by_work(torque=turned, dq=None)


def test_the_numbers_of_an_inverted_effort() -> None:
    turned = scaled(-3.0 * FRICTION, -1.0, 1)
    for name, unit, column in (("torque", "N·m", "tau"), ("current", "A", "current")):
        ((*_, finding),) = by_work(**{"torque": None, name: turned})
        assert finding.level == "warning"
        values = dict(finding.values)
        assert values.pop("shares_percent") == pytest.approx([-100.0] * 5)
        assert values == {
            "signal": name,
            "mean": pytest.approx(-3.0, rel=2e-3),
            "unit": unit,
            "first": 2,
            "column": column,
            "width": 6,
        }
    assert by_work(torque=FRICTION, current=-FRICTION) == []  # torque is judged first


@pytest.mark.parametrize(
    ("judged", "least"), [(1, 2), (2, 2), (3, 2), (4, 2), (5, 3), (6, 4), (7, 4), (8, 5)]
)
def test_most_are_three_in_five_and_two_at_least(judged: int, least: int) -> None:
    """Of most joints less than half of the work tells the sign, of fewer it does not."""
    columns = np.arange(judged) % 6
    half = effort_of_share(-0.45, *ALL)[:, columns]
    for turned in range(least - 1, min(least, judged) + 1):
        effort = np.where(np.arange(judged) < turned, half, FRICTION[:, columns])
        said = by_work(q=Q[:, columns], dq=DQ[:, columns], torque=effort)
        assert [code for code, *_ in said] == ["effort-sign-by-work"] * (turned >= least)
