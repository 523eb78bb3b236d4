"""The velocity's fit, and what an effort's work says: each with a known amount, to its error."""

import numpy as np
import pytest
from swinging import DQ, RATES, TORQUE, Q, T, found, log_of, scaled, speed_at
from test_swinging import ALL, FRICTION, filtered

from vftcli.doctor import examine
from vftcli.doctor.signals import inverted_effort
from vftcli.doctor.velocity import velocity_fit
from vftcli.signals.arrays import Array
from vftcli.signals.remarks import Remark


def test_uneven_steps_shift_nothing():
    """Steps of 4 to 16 ms, stamps as exact as the signals: the lag stays below 0.1 ms."""
    t = np.cumsum(np.random.default_rng(0).uniform(0.004, 0.016, 4001))
    t -= t[0]
    fit = velocity_fit(log_of(t=t, q=np.sin(np.outer(t, RATES)), dq=speed_at(t)))
    np.testing.assert_allclose(fit.gain, 1.0, atol=1e-3)
    np.testing.assert_allclose(fit.lag, 0.0, atol=1e-4)


def test_noise_of_the_positions_hides_no_lag():
    """Noise of 1 mrad makes the derivative of the slope ten times as large as the motion's own."""
    q = Q + np.random.default_rng(0).normal(0, 1e-3, Q.shape)
    fit = velocity_fit(log_of(q=q, dq=speed_at(T - 0.03)))
    np.testing.assert_allclose(fit.lag, 0.03, atol=4 * np.max(fit.lag_error))
    assert np.max(fit.lag_error) < 2e-3


def test_the_standard_errors_are_the_scatter():
    """Of 200 noises on a quarter turn to one and a half: 1/√400 = 5 % (one sigma)."""
    chance, short = np.random.default_rng(0), {"t": T[:250], "q": Q[:250]}
    fits = [
        velocity_fit(log_of(**short, dq=2 * DQ[:250] + chance.normal(0, 0.02, (250, 6))))
        for _ in range(200)
    ]
    for values, errors in (("gain", "gain_error"), ("lag", "lag_error")):
        scatter = np.std([getattr(fit, values) for fit in fits], axis=0)
        stated = np.mean([getattr(fit, errors) for fit in fits], axis=0)
        np.testing.assert_allclose(stated, scatter, rtol=0.2)


@pytest.mark.parametrize("cut_off", [0.5, 1.0, 2.0])
def test_a_filter_is_distinct_from_a_delay(cut_off):
    """A first-order low-pass takes 1/(2π f_c) and a part of the size, neither clock nor unit."""
    findings = found(dq=filtered(DQ, cut_off))
    assert set(findings) == {"velocity-filtered"}
    lags = findings["velocity-filtered"].values["lags_ms"]
    # Twice a sample of the recursion, and (ωτ)² of the linear fit on the slowest joint.
    assert lags[0] == pytest.approx(1e3 / (2 * np.pi * cut_off), rel=0.12)


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
def test_numbers_that_no_clock_and_no_robot_gives(changes, codes):
    """The limits are beyond every unit: 30 years in ns, steps from 0.1 ps to 300 years."""
    findings = examine(log_of(**changes)).findings
    assert [f.code for f in findings if f.code.startswith("absurd")] == codes
    if codes:
        assert len(findings) == len(codes)  # nothing else is examined
    if codes == ["absurd-clock"]:
        assert findings[0].values == {"least_s": T[0], "largest_s": 1.1e18}


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
def test_an_effort_that_takes_energy_is_inverted(share, joints, code):
    said = by_work(torque=effort_of_share(share, *joints))
    assert [each[:2] for each in said] == ([(code, joints)] if code else [])
    for *_, finding in said:
        shares = pytest.approx([100 * share] * len(joints), abs=0.2)
        assert finding.values["shares_percent"] == shares


def test_joints_that_tell_nothing_are_not_judged():
    """Too little way, one direction only, no effort: each alone."""
    ways, turned = np.sum(np.abs(np.diff(Q, axis=0)), axis=0), -FRICTION
    for way, known in ((0.29, False), (0.31, True)):
        assert bool(by_work(q=Q * way / ways, torque=turned)) == known
    for slowest, known in ((0.9e-3, False), (1.1e-3, True)):
        for dq in (np.maximum(DQ, -slowest), np.minimum(DQ, slowest)):
            assert bool(by_work(dq=dq, torque=turned)) == known
    assert not by_work(torque=0 * turned)
    assert not by_work(torque=turned, dq=None)


def test_the_numbers_of_an_inverted_effort():
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
def test_most_are_three_in_five_and_two_at_least(judged, least):
    """Of most joints less than half of the work tells the sign, of fewer it does not."""
    columns = np.arange(judged) % 6
    half = effort_of_share(-0.45, *ALL)[:, columns]
    for turned in range(least - 1, min(least, judged) + 1):
        effort = np.where(np.arange(judged) < turned, half, FRICTION[:, columns])
        said = by_work(q=Q[:, columns], dq=DQ[:, columns], torque=effort)
        assert [code for code, *_ in said] == ["effort-sign-by-work"] * (turned >= least)
