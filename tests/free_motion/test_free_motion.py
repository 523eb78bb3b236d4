"""What is known to be free beside a log: spans, cycles, other runs, and any of them together."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from vftcli.bias.baseline import Baseline, baseline_of, free_reading
from vftcli.free_motion import FreeChoice, cutoff, cycle_numbers
from vftcli.free_motion.difference import RUNGS
from vftcli.free_motion.free_motion import (
    FreeLoad,
    FreeMotion,
    FreeRun,
    columns,
    free_load,
    without_load,
)
from vftcli.free_motion.two_cycle import partners_in_log, partners_in_logs
from vftcli.observers.tuning import tune_to_spectra
from vftcli.robots import Payload, load_robot
from vftcli.robots.chain import flange_jacobian
from vftcli.robots.kernels import load_regressor
from vftcli.robots.run import Run, RunSamples
from vftcli.robots.terms import gain_sd
from vftcli.signals.arrays import rms_of_known
from vftcli.signals.errors import ParameterError, ReferenceTorqueError
from vftcli.signals.external_torque import DynamicsTerms
from vftcli.signals.recording import Recording

ROBOT = load_robot("ur5")


@pytest.fixture(scope="module")
def circle(circle) -> Run:
    """Five circles of 4 s; nothing touches the arm in the first."""
    return Run(recording=circle.recording, robot=ROBOT)


def motion_of(log: Run, *free: Recording, choice: FreeChoice) -> FreeMotion:
    runs = [FreeRun(run=Run(recording=x, robot=ROBOT), log=log) for x in free]
    return FreeMotion(log=log, choice=choice, runs=tuple(runs))


def codes(remarks: Sequence[object]) -> list[str]:
    return [getattr(remark, "code", "") for remark in remarks]


def test_the_cycle_that_is_named_is_the_one_taken(circle):
    """``--set two-cycle.free-cycles=2`` is the second cycle, from 4 to 8 s, and no other."""
    motion = motion_of(circle, choice=FreeChoice(cycles=(2,)))
    clocks, _ = partners_in_log(motion)
    (pairing,) = clocks["found"]
    times = pairing.times[pairing.known]
    assert times.min() >= 4.0 - 0.02
    assert times.max() <= 8.0 + 0.02
    own = motion.part.own
    free = circle.recording.t[own]
    assert (free[0], free[-1]) == (pytest.approx(4.0, abs=0.02), pytest.approx(8.0, abs=0.02))
    assert not pairing.known[own].any()  # a cycle is not laid under itself


@pytest.mark.parametrize("cycle", [0, 6])
def test_cycles_that_are_not_there(circle, cycle):
    assert motion_of(circle, choice=FreeChoice(cycles=(1, 5))).free_cycles.numbers == (0, 4)
    with pytest.raises(ReferenceTorqueError, match=f"no cycle {cycle}; the log holds 5 whole"):
        _ = motion_of(circle, choice=FreeChoice(cycles=(1, cycle))).free_cycles


def test_an_arm_that_only_yields_has_no_free_cycle_but_those_named(circle):
    """The same motion, .09 rad of it: pushes on an arm that holds still move it as much."""
    log = circle.recording
    q = log.q[0] + (log.q - log.q[0]) * 0.09 / np.ptp(log.q, axis=0).max()
    run = replace(circle, recording=replace(log, q=q))
    with pytest.raises(ReferenceTorqueError, match="no joint moves"):
        assert FreeMotion(log=run).known
    assert FreeMotion(log=run, choice=FreeChoice(cycles=(1,))).known.own.any()


def test_a_cycle_inside_a_free_span_is_free(circle):
    motion = motion_of(circle, choice=FreeChoice(spans=((3.9, 8.1), (19.0, np.inf))))
    assert motion.free_cycles.numbers == (1,)
    own = circle.recording.t[motion.part.own]
    assert own.min() >= 3.9
    assert np.any(own >= 19.0)
    assert codes(motion.part.remarks) == ["free-span", "free-span"]
    ends = [(r.values["begin_s"], r.values["end_s"]) for r in motion.part.remarks]
    assert ends == [(3.9, 8.1), (19.0, circle.t[-1])]
    later = Run(recording=replace(circle.recording, t=circle.t + 3.0), robot=ROBOT)
    (first,) = motion_of(later, choice=FreeChoice(spans=((-np.inf, 7.0),))).part.remarks
    assert (first.values["begin_s"], first.values["end_s"]) == (3.0, 7.0)


def test_spans_and_cycles_add_up(circle):
    alone = motion_of(circle, choice=FreeChoice(spans=((0.5, 2.0),)))
    assert alone.free_cycles.numbers == (0,)  # it holds no whole cycle: as found
    motion = motion_of(circle, choice=FreeChoice(spans=((0.0, 4.05),), cycles=(3,)))
    assert motion.free_cycles.numbers == (0, 2)
    own = circle.recording.t[motion.part.own]
    assert not np.any((own > 4.1) & (own < 7.9))


def test_spans_that_carry_nothing_are_free_where_nothing_else_is_given(circle):
    motion, given = (motion_of(circle, choice=FreeChoice(cycles=c)) for c in ((), (2,)))
    assert motion.unloaded(((0.0, 4.0),)).choice.spans == ((0.0, 4.0),)
    assert motion.unloaded(()) is motion
    assert given.unloaded(((0.0, 4.0),)) is given


@pytest.mark.parametrize("spans", [((40.0, 50.0),), ((-1.0, 30.0),)])
def test_a_span_that_is_no_part_of_the_log_is_refused(circle, spans):
    with pytest.raises(ParameterError, match="it must be a part of the log"):
        _ = motion_of(circle, choice=FreeChoice(spans=spans)).part


def test_each_run_is_a_piece(part_of, circle):
    log = Run(recording=part_of(circle.recording, 8.0, 14.0), robot=ROBOT)
    same, more = part_of(circle.recording, 0.0, 4.0), part_of(circle.recording, 4.0, 8.0)
    other = replace(same, q=same.q[:, ::-1] + 0.5, source=replace(same.source, t0=99.0))
    paths = tuple(Path(name) for name in "abc")
    motion = motion_of(log, same, other, more, choice=FreeChoice(logs=paths))
    found = motion.part
    assert codes(found.remarks) == ["free-run", "free-run-of-another-motion", "free-run"]
    assert [piece.run for piece in found.pieces] == [run.run for run in motion.runs]
    assert not found.own.any()
    assert all(piece.inside.all() for piece in found.pieces)
    for _ in range(2):
        with pytest.raises(ReferenceTorqueError, match="not a free run of the trajectory"):
            _ = motion.runs[1].pairing
    # The circle takes 4 s: the log's sample at t is at the place of t + 8 s of the whole log.
    pairing = motion.runs[0].pairing
    off = (pairing.times[pairing.known] - log.t[pairing.known] - 8.0 + 2.0) % 4.0 - 2.0
    np.testing.assert_allclose(off, 0.0, atol=2e-3)  # a quarter of a sample


@pytest.mark.parametrize("rate", [1.004, 1.00005])
def test_shift_rate_and_covered_time_of_a_free_run(part_of, circle, rate):
    """The log's first 4 of 6 s again, on a clock 2 s later; of six joints the fifth rests 10 mrad
    away."""
    log = part_of(circle.recording, 4.0, 10.0)
    part = part_of(log, 0.0, 4.0)
    source, q = replace(part.source, t0=99.0), part.q + 0.01 * np.eye(6)[4]
    free = replace(part, t=rate * part.t + 2.0, q=q, source=source)
    choice = FreeChoice(logs=(Path("a"),))
    motion = motion_of(Run(recording=log, robot=ROBOT), free, choice=choice)
    _, (remark,) = partners_in_logs(motion)
    other = {} if rate < 1.0001 else {"rate": pytest.approx(rate, rel=1e-6)}
    assert remark.code == ("free-run-on-another-clock" if other else "free-run-aligned")
    # Two samples of 8 ms at the ends; the interpolation between samples adds some µrad squared.
    values = {"shift_s": pytest.approx(2.0, abs=1e-5), "covered_s": pytest.approx(4.0, abs=0.02)}
    deviation = {"deviation_mrad": pytest.approx(10.0 / np.sqrt(6.0), rel=5e-4)}
    assert dict(remark.values) == values | deviation | other


def test_the_log_itself_is_no_free_run(circle):
    run = FreeRun(run=Run(recording=circle.recording, robot=ROBOT), log=circle)
    with pytest.raises(ParameterError, match="given as the log or as --free, are one run"):
        FreeMotion(log=circle, runs=(run,))


PAYLOAD = np.array([2.8, 0.05, 0.02, 0.17])  # Mass and first moment. [kg, kg·m]


@pytest.fixture
def log(circle) -> Recording:
    return circle.recording


def carrying(log: Recording) -> Recording:
    """The log as it were had the arm carried the payload: its drives hold the weight."""
    weight = load_regressor(ROBOT.chain, log.q) @ PAYLOAD
    return replace(log, current=log.current - weight / ROBOT.torque_constant)


def baseline(log: Recording) -> Baseline:
    run = Run(recording=log, robot=ROBOT)
    return baseline_of(FreeMotion(log=run, choice=FreeChoice(cycles=(1,))))


def test_a_payload_is_weighed_and_reported(log):
    """Friction the profile misses is 10 % of its own here: some 1 N·m, .2 kg at the elbow.

    The drives' constants are known to a share of what they read: mass and moment alike.
    """
    found = baseline(carrying(log))
    load, gain = found.load, gain_sd(log, ROBOT)
    assert load.mass == pytest.approx(2.8, abs=0.3)
    assert load.sd >= gain * load.mass
    assert np.all(load.moment_sd >= gain * np.abs(load.moment))
    (remark,) = [r for r in found.remarks if r.code == "free-part-loaded"]
    assert remark.values["load_kg"] == load.mass
    assert str(remark)


def test_an_arm_carries_the_inertia_of_a_load_too(log):
    """As with the same load mounted; or every start and stop would look like a push."""
    load = FreeLoad(mass=3.0, moment=PAYLOAD[1:], sd=0.1, moment_sd=np.ones(3), share=0.5)
    body = Payload(mass=3.0, com=PAYLOAD[1:] / 3.0, inertia=np.zeros((3, 3)))
    arm = replace(ROBOT, friction=())
    bare, mounted = (Run(recording=log, robot=robot) for robot in (arm, arm.with_payload(body)))
    found = without_load(bare, load)
    np.testing.assert_allclose(found.terms.p, mounted.terms.p, atol=1e-9)
    np.testing.assert_allclose(found.terms.mu, mounted.terms.mu, atol=1e-9)
    assert np.ptp(found.terms.p - bare.terms.p) > 0.5
    assert without_load(bare, None) is bare


def test_its_wrench_is_what_its_torque_comes_from(log):
    """τ = Jᵀw; of 2.8 ± .1 kg each axis of the force is known to .1 kg of weight."""
    spread = np.array([0.01, 0.02, 0.03])
    load = FreeLoad(mass=2.8, moment=PAYLOAD[1:], sd=0.1, moment_sd=spread, share=0.5)
    run, q = Run(recording=log, robot=ROBOT), log.q
    wrench, covariance = load.wrench(ROBOT.chain, q)
    J = flange_jacobian(ROBOT.chain, q)
    np.testing.assert_allclose(np.einsum("tij,ti->tj", J, wrench), load.torque(run), atol=1e-10)
    sd = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
    np.testing.assert_allclose(sd[:, :3], np.broadcast_to([0, 0, 0.981], (len(q), 3)), rtol=1e-3)
    assert not sd[:, 5].any()  # weight turns about no vertical line
    assert np.all(sd[:, 3:5] <= 9.81 * 0.03 * np.sqrt(2.0))


def test_no_load_is_found_where_there_is_none(log):
    """In a simulation without noise or torque no joint has anything left over to divide by."""
    assert baseline(log).load is None
    assert free_load(()) is None
    still = replace(log, q=0.0 * log.q, dq=0.0 * log.q, current=0.0 * log.current)
    weightless = replace(ROBOT, chain=replace(ROBOT.chain, gravity=np.zeros(3)))
    run = Run(recording=still, robot=weightless)
    assert free_load((RunSamples(run, log.t > 1.0),)) is None


def test_a_payload_is_torque_and_no_noise(log):
    """Gains and free error stay those of the unloaded arm, and the weight stays in the estimate."""
    plain, loaded = baseline(log), baseline(carrying(log))
    blind = replace(loaded, load=None)
    moving = [0, 1, 2, 3, 5]
    rms, weight = {}, load_regressor(ROBOT.chain, log.q) @ PAYLOAD
    for name, found in (("plain", plain), ("loaded", loaded), ("blind", blind)):
        observer = tune_to_spectra("rts-auto", found.spectra)
        terms = found.of(found.motion.log).terms
        reading = free_reading(found, observer, observer.estimate(terms))
        rms[name] = rms_of_known(reading.samples)[moving]
        if found is loaded:
            # what the arm carries is in the estimate, free part and all
            mean = reading.estimate.tau.mean(axis=0)
            np.testing.assert_allclose(mean[1:3], weight.mean(axis=0)[1:3], rtol=0.2)
    assert np.all(rms["loaded"] < 1.5 * rms["plain"])
    assert np.max(rms["blind"] / rms["plain"]) > 3.0


@pytest.mark.parametrize(
    ("mass", "ratio", "seconds", "is_found"),
    [
        (3.0, 1.0, 20.0, True),  # 1/√2 of the disturbance is left
        (0.5, 0.05, 20.0, True),
        (0.3, 0.05, 20.0, False),  # lighter than what drive constants look like
        (3.0, 2.0, 60.0, False),  # 2/√5 is left, whatever the standard deviation
        (3.0, 1.0, 1.1, False),  # four such stretches of .3 s: 3 ± .9 kg
    ],
)
def test_a_load_is_believed_by_its_mass_its_sd_and_what_it_leaves(mass, ratio, seconds, is_found):
    """A disturbance of 3.2 Hz beside the load's torque, `ratio` times as large on each joint."""
    t, k = 0.008 * np.arange(round(seconds / 0.008)), np.arange(6.0)
    phase = t[:, None] * (1.0 + 0.3 * k) + k
    q = np.array([0.0, -1.35, 1.9, -2.1, -1.57, 0.0]) + 0.6 * np.sin(phase)
    dq = 0.6 * (1.0 + 0.3 * k) * np.cos(phase)
    load = load_regressor(ROBOT.chain, q) @ (PAYLOAD * mass / 2.8)
    beside = np.sqrt(2.0 * np.mean(load**2, axis=0)) * np.sin(20.0 * t[:, None] + 2.0 * k)
    still = Run(recording=Recording(t=t, q=q, dq=dq, torque=np.zeros_like(q)), robot=ROBOT)
    offset = 0.05 * still.dry_friction * (-1.0) ** k  # each joint's own, and no load
    terms = DynamicsTerms(t=t, p=np.zeros_like(q), mu=-(load + ratio * beside + offset))
    found = free_load((RunSamples(still.holding(terms=terms), t >= 0.0),))
    assert (found is not None) == is_found
    if found is not None:
        assert found.mass == pytest.approx(mass, rel=0.01)  # ends of the filter
        assert found.share == pytest.approx(ratio / np.hypot(1.0, ratio), abs=0.05)


def test_a_column_of_friction_has_the_direction_of_its_joint(log):
    at, _, A = columns(RunSamples(Run(recording=log, robot=ROBOT), (log.t > 8) & (log.t < 9)))
    dq, friction = log.dq[at], np.diagonal(A[:, :, 4:10], axis1=1, axis2=2)
    fast = abs(dq) > 0.1  # tanh(5) is 1 − 1e-4; the filter takes less than .02 rad/s
    np.testing.assert_allclose(friction[fast], np.sign(dq[fast]), atol=1e-3)


def test_a_span_of_free_is_the_free_part_and_a_log_may_hold_a_colon():
    choice = FreeChoice.parsed(free=["2:4", "run.csv", ":1", "./2:4", "C:/run.csv"])
    assert choice.spans == ((2.0, 4.0), (-np.inf, 1.0))
    assert choice.logs == tuple(map(Path, ("run.csv", "./2:4", "C:/run.csv")))


def test_what_counts_as_given():
    assert not FreeChoice().is_given
    assert not FreeChoice(period=4.0).is_given
    for choice in ({"logs": (Path("a"),)}, {"spans": ((0.0, 1.0),)}, {"cycles": (1,)}):
        assert FreeChoice(**choice).is_given


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"two-cycle.alignment": "best"}, "commanded, period, phase, model"),
        ({"two-cycle.alignment": "commanded"}, "add --set two-cycle.period=S"),
        ({"two-cycle.period": "0"}, "two-cycle.period=0 is not a positive time"),
        ({"two-cycle.period": "nan"}, "is not a positive time"),
        ({"two-cycle.low-pass": "-3"}, "not a positive cutoff"),
        ({"two-cycle.low-pass": "nan"}, "not a positive cutoff"),
        ({"two-cycle.low-pass": "all"}, "not a positive cutoff"),
    ],
)
def test_choices_that_exclude_each_other_or_do_not_exist(options, message):
    with pytest.raises((ParameterError, ReferenceTorqueError), match=message):
        FreeChoice.parsed(**options)


def test_lists_of_cycles_cutoffs_and_names_of_rungs():
    assert cycle_numbers("1") == (1,)
    assert cycle_numbers("1, 3-5,3") == (1, 3, 4, 5)
    for text in ("first", "", "0", "3-2", "1-999999999", "9" * 5000):
        with pytest.raises(ReferenceTorqueError, match="free-cycles"):
            cycle_numbers(text)
    assert (cutoff("auto"), cutoff("none"), cutoff("12")) == ("auto", None, 12.0)
    assert ["auto", *RUNGS] == FreeChoice.option("two-cycle.alignment").values()
