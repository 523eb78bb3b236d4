"""What `best` is made of: the whole log's bias off where it may be, and what stands in for it."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from made_runs import analyse_log

from vftcli.analysis import Analysis
from vftcli.bias import RefinementChoice, baseline
from vftcli.evaluation import ReferenceChoice
from vftcli.free_motion import FreeChoice
from vftcli.observers import ObserverChoice
from vftcli.pipeline import AnalysisChoice
from vftcli.readers.reader import ReadChoice
from vftcli.robots import RobotChoice
from vftcli.robots.friction import dry_friction
from vftcli.signals.errors import MissingSignalError

FIXTURE = Path(__file__).parent.parent.parent / "fixtures" / "ur5_circle.csv"
BY_DENSITY = ObserverChoice.parsed(
    observer=["kfo-rts"], settings={"kfo.noise_convention": "density"}
)
"""What `best` falls back to."""
MOVING = [0, 1, 2, 3, 5]
"""Joint 5 of the circle rests."""


@pytest.fixture(scope="module")
def request_() -> AnalysisChoice:
    return AnalysisChoice(
        robot=RobotChoice(name="ur5"),
        observers=ObserverChoice(names=("best", "gmo", "rts-auto")),
        reference=ReferenceChoice(name=f"file:{FIXTURE}.truth.parquet"),
    )


@pytest.fixture(scope="module")
def automatic(request_: AnalysisChoice) -> Analysis:
    return analyse_log(FIXTURE, request_)


def rmse(analysis: Analysis, name: str) -> float:
    """Of the joints that move, against the truth. [N·m]"""
    (estimate,) = (e for e in analysis.estimates if e.name == name)
    error = (estimate.tau - analysis.reference.tau)[:, MOVING]
    return float(np.sqrt(np.mean(error**2, axis=0)).mean())


def codes(analysis: Analysis) -> list[str]:
    return [remark.code for remark in analysis.remarks]


@pytest.mark.slow
def test_the_bias_is_off_for_the_best_alone(automatic: Analysis) -> None:
    """Measured .27 and .60 N·m, seed 1: .46; a prototype had .37 of it in the mean of four."""
    found = automatic.refinement.baselines
    best = found.of("best")
    assert found.of("gmo").correction is None
    assert not best.by_fit  # the free cycles are known
    plain, off = automatic.motion.log.terms, best.of(best.motion.log).terms
    assert best.of(automatic.motion.log) is best.of(best.motion.log)  # made once
    np.testing.assert_allclose(plain.mu - off.mu, best.correction.bias, atol=1e-9)
    np.testing.assert_array_equal(plain.p, off.p)
    assert rmse(automatic, "best") < 0.6 * rmse(automatic, "rts-auto")
    band = automatic.estimates[0].error_sd
    assert np.all(band >= np.where(best.correction.applied, best.correction.sd, 0.0))
    # Each is what its own observer makes of its own terms.
    for observer, estimate in zip(automatic.observers, automatic.estimates, strict=True):
        run = automatic.run_of(observer.name, automatic.motion.log)
        np.testing.assert_array_equal(estimate.tau, observer.estimate(run.terms).tau)


@pytest.mark.slow
def test_whole_log_is_off_for_everyone_and_none_for_no_one(
    request_: AnalysisChoice, automatic: Analysis
) -> None:
    everyone = analyse_log(
        FIXTURE, replace(request_, refinement=RefinementChoice(bias="whole-log"))
    )
    nobody = analyse_log(FIXTURE, replace(request_, refinement=RefinementChoice(bias="none")))
    best, gmo, auto = (e.tau for e in everyone.estimates)
    np.testing.assert_array_equal(best, auto)
    np.testing.assert_array_equal(best, automatic.estimates[0].tau)
    assert np.max(np.abs(gmo - automatic.estimates[1].tau)) > 0.5
    best, gmo, auto = (e.tau for e in nobody.estimates)
    np.testing.assert_array_equal(best, auto)
    np.testing.assert_array_equal(best, automatic.estimates[2].tau)
    np.testing.assert_array_equal(gmo, automatic.estimates[1].tau)
    assert not any(code.startswith("whole-log") for code in codes(nobody))


@pytest.mark.slow
def test_a_log_without_a_free_part_leans_on_what_the_fit_takes_for_free(
    request_: AnalysisChoice,
) -> None:
    """From 4.3 s on every cycle is pushed, so that none is believed to be free."""
    pushed = replace(request_, read=ReadChoice(interval=(4.3, 20.0)))
    analysis = analyse_log(FIXTURE, pushed)
    assert "free-by-the-fit" in codes(analysis)
    assert "free-part-not-quiet" not in codes(analysis)
    assert analysis.refinement.baselines.plain.by_fit
    assert analysis.refinement.baselines.plain.untouched == ()
    assert all(estimate.error_sd is not None for estimate in analysis.estimates)
    by_hand = BY_DENSITY
    smoothed = analyse_log(FIXTURE, replace(pushed, observers=by_hand))
    assert rmse(analysis, "best") < 0.5 * rmse(smoothed, "kfo-rts")


@pytest.mark.slow
def test_a_free_part_that_does_not_do_is_dropped_with_a_reason(request_: AnalysisChoice) -> None:
    """0.1 s are 13 samples, and a spectrum needs 32."""
    given = replace(request_, free=FreeChoice(spans=((0.0, 0.1),)))
    analysis = analyse_log(FIXTURE, given)
    assert "free-by-the-fit" not in codes(analysis)
    (said,) = (r for r in analysis.refinement.remarks if r.code == "free-by-the-fit-instead")
    assert "a spectrum needs 32 samples" in str(said)


@pytest.mark.slow
def test_a_short_log_takes_what_is_left(request_: AnalysisChoice) -> None:
    """6 s tell friction alone, the free part tunes. 1.5 s tell nothing: the robot file's gains.

    The band of the best is there in any case, at rest no narrower than what stiction holds.
    """
    six = analyse_log(
        FIXTURE,
        replace(
            request_, read=ReadChoice(interval=(0.0, 6.0)), free=FreeChoice(spans=((0.0, 4.0),))
        ),
    )
    assert "whole-log-friction-alone" in codes(six)
    assert rmse(six, "best") < rmse(six, "rts-auto")
    names = replace(BY_DENSITY, names=("best", "kfo-rts"))
    tiny = analyse_log(
        FIXTURE, replace(request_, read=ReadChoice(interval=(4.5, 6.0)), observers=names)
    )
    np.testing.assert_array_equal(tiny.estimates[0].tau, tiny.estimates[1].tau)
    assert {"no-free-part", "tuning-without-free-part", "no-band"} <= set(codes(tiny))
    band, log = tiny.estimates[0].error_sd, tiny.motion.log
    assert tiny.estimates[1].error_sd is None
    dry = dry_friction(log.robot.friction, 6)
    # a fifth of the dry friction and .05 N·m is what is expected of its sign alone
    assert np.all(band[~log.rests] >= np.broadcast_to(0.19 * dry, band.shape)[~log.rests])
    assert np.all(band[log.rests] >= np.broadcast_to(0.45 * dry, band.shape)[log.rests])


@pytest.mark.slow
def test_a_fit_that_fails_is_said_and_costs_nothing_else(
    request_: AnalysisChoice, automatic: Analysis, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails(_run: object) -> None:
        raise MissingSignalError("no current")

    monkeypatch.setattr(baseline, "whole_log_bias", fails)
    analysis = analyse_log(FIXTURE, request_)
    (said,) = [r for r in analysis.remarks if r.code == "whole-log-bias-failed"]
    assert said.level == "caution"
    np.testing.assert_array_equal(analysis.estimates[0].tau, automatic.estimates[2].tau)
