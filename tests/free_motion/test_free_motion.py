"""What is known to be free beside a log: spans, cycles, other runs, and any of them together."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from vftcli.free_motion import FreeChoice
from vftcli.free_motion.free_motion import FreeMotion, FreeRun
from vftcli.free_motion.two_cycle import partners_in_log, partners_in_logs
from vftcli.robots import load_robot
from vftcli.robots.run import Run
from vftcli.signals.errors import ParameterError, ReferenceTorqueError
from vftcli.signals.recording import Recording

ROBOT = load_robot("ur5")
Make = Callable[[Recording, float, float], Recording]


@pytest.fixture(scope="module")
def circle(circle) -> Run:
    """Five circles of 4 s; nothing touches the arm in the first."""
    return Run(recording=circle.recording, robot=ROBOT)


def motion_of(log: Run, *free: Recording, choice: FreeChoice) -> FreeMotion:
    runs = [FreeRun(run=Run(recording=x, robot=ROBOT), log=log) for x in free]
    return FreeMotion(log=log, choice=choice, runs=tuple(runs))


def codes(remarks: Sequence[object]) -> list[str]:
    return [getattr(remark, "code", "") for remark in remarks]


def test_the_cycle_that_is_named_is_the_one_taken(circle: Run) -> None:
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
def test_cycles_that_are_not_there(circle: Run, cycle: int) -> None:
    assert motion_of(circle, choice=FreeChoice(cycles=(1, 5))).cycles_given == (0, 4)
    with pytest.raises(ReferenceTorqueError, match=f"no cycle {cycle}; the log holds 5 whole"):
        _ = motion_of(circle, choice=FreeChoice(cycles=(1, cycle))).cycles_given


def test_a_cycle_inside_a_free_span_is_free(circle: Run) -> None:
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


def test_a_span_without_a_whole_cycle_leaves_the_cycles_to_be_found(circle: Run) -> None:
    motion = motion_of(circle, choice=FreeChoice(spans=((0.5, 2.0),)))
    assert motion.free_cycles.numbers == (0,)  # as found: the first is the free one


def test_spans_and_cycles_add_up(circle: Run) -> None:
    motion = motion_of(circle, choice=FreeChoice(spans=((0.0, 4.05),), cycles=(3,)))
    assert motion.free_cycles.numbers == (0, 2)
    own = circle.recording.t[motion.part.own]
    assert not np.any((own > 4.1) & (own < 7.9))


def test_spans_that_carry_nothing_are_free_where_nothing_else_is_given(circle: Run) -> None:
    motion, given = (motion_of(circle, choice=FreeChoice(cycles=c)) for c in ((), (2,)))
    assert motion.unloaded(((0.0, 4.0),)).choice.spans == ((0.0, 4.0),)
    assert motion.unloaded(()) is motion
    assert given.unloaded(((0.0, 4.0),)) is given


@pytest.mark.parametrize("spans", [((40.0, 50.0),), ((-1.0, 30.0),)])
def test_a_span_that_is_no_part_of_the_log_is_refused(
    circle: Run, spans: tuple[tuple[float, float], ...]
) -> None:
    with pytest.raises(ParameterError, match="it must be a part of the log"):
        _ = motion_of(circle, choice=FreeChoice(spans=spans)).part


def test_each_run_is_a_piece(part_of: Make, circle: Run) -> None:
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
def test_shift_rate_and_covered_time_of_a_free_run(
    part_of: Make, circle: Run, rate: float
) -> None:
    """The log's first 4 of 6 s again, on a clock 2 s later; of six joints the fifth rests 10 mrad
    away."""
    log = part_of(circle.recording, 4.0, 10.0)
    part = part_of(log, 0.0, 4.0)
    source, q = replace(part.source, t0=99.0), part.q + 0.01 * np.eye(6)[4]
    free = replace(part, t=rate * part.t + 2.0, q=q, source=source)
    choice = FreeChoice(logs=(Path("a"),))
    _, (remark,) = partners_in_logs(
        motion_of(Run(recording=log, robot=ROBOT), free, choice=choice)
    )
    other = {} if rate < 1.0001 else {"rate": pytest.approx(rate, rel=1e-6)}
    assert remark.code == ("free-run-on-another-clock" if other else "free-run-aligned")
    # Two samples of 8 ms at the ends; the interpolation between samples adds some µrad squared.
    values = {"shift_s": pytest.approx(2.0, abs=1e-5), "covered_s": pytest.approx(4.0, abs=0.02)}
    deviation = {"deviation_mrad": pytest.approx(10.0 / np.sqrt(6.0), rel=5e-4)}
    assert dict(remark.values) == values | deviation | other


def test_the_log_itself_is_no_free_run(circle: Run) -> None:
    run = FreeRun(run=Run(recording=circle.recording, robot=ROBOT), log=circle)
    with pytest.raises(ParameterError, match="given as the log or as --free, are the same run"):
        FreeMotion(log=circle, runs=(run,))
