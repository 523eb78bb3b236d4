"""What limits a log: friction apart from other error, the largest cause, the paper's gains."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from vftcli.analysis import Analysis
from vftcli.bias.refine import (
    EXPECTED,
    STICTION,
    Budget,
    expected_gap,
    friction_share,
    gap_remark,
    limits_remark,
)
from vftcli.evaluation.references import with_measured_gap
from vftcli.observers.choice import ObserverChoice
from vftcli.pipeline import AnalysisChoice, analyse_log
from vftcli.robots.choice import RobotChoice
from vftcli.signals.remarks import Remark, fact

FIXTURE = Path(__file__).parent.parent.parent / "fixtures" / "ur5_circle.csv"
UR5 = AnalysisChoice(robot=RobotChoice(name="ur5"))
RNG = np.random.default_rng(8)
DQ = RNG.uniform(-1.0, 1.0, (4000, 2))


def test_pure_friction_is_all_friction() -> None:
    tau = 3.0 * np.tanh(DQ / 0.02) + 0.5 * DQ
    np.testing.assert_allclose(friction_share(DQ, tau), 1.0, atol=1e-12)


@pytest.mark.parametrize("size", [0.5, 1.0, 4.0])
def test_friction_beside_another_error_is_its_share_of_the_power(size: float) -> None:
    """tanh has a mean square of nearly 1, the other error `size`²; 4000 samples tell 3 %."""
    other = size * RNG.standard_normal(DQ.shape)
    power = np.mean(np.tanh(DQ / 0.02) ** 2, axis=0)
    found = friction_share(DQ, np.tanh(DQ / 0.02) + other)
    np.testing.assert_allclose(found, power / (power + size**2), atol=0.03)


def test_no_torque_has_no_friction() -> None:
    assert not friction_share(DQ, np.zeros_like(DQ)).any()


def budget() -> Budget:
    sizes = {
        "noise": [3.0, 0.1],
        "friction": [4.0, 0.2],
        "model": [0.0, 0.1],
        "bandwidth": [0.0, 0.5],
    }
    return Budget(
        "gmo", {**{k: np.array(v) for k, v in sizes.items()}, STICTION: np.array([9.0, 7.0])}
    )


def test_stiction_is_no_part_of_the_sum() -> None:
    np.testing.assert_allclose(budget().total, [5.0, np.sqrt(0.31)])


def test_the_largest_cause_of_each_joint_is_named() -> None:
    free = limits_remark(budget(), np.array([False, False]))
    assert free.values["causes"] == ["friction", "bandwidth"]
    assert free.values["size_Nm"] == [4.0, 0.5]
    stuck = limits_remark(budget(), np.array([True, False]))
    assert stuck.values["causes"] == [STICTION, "bandwidth"]
    assert stuck.values["size_Nm"][0] == 9.0
    # 9 N·m beside the 5 of the other causes, and nothing beside the joint that moves
    np.testing.assert_allclose(
        stuck.values["total_Nm"], [np.sqrt(9.0**2 + 5.0**2), np.sqrt(0.31)]
    )
    assert str(stuck).startswith(
        "gmo: largest error per joint, from J1: stiction at rest, bandwidth"
    )


def test_a_joint_at_rest_without_known_friction_is_not_limited_by_stiction() -> None:
    found = budget()
    found.parts[STICTION][0] = 0.0
    assert limits_remark(found, np.array([True, True])).values["causes"] == ["friction", STICTION]


@pytest.fixture(scope="module")
def analysis() -> Analysis:
    return analyse_log(FIXTURE, UR5)


def gaps(analysis: Analysis) -> list[Remark]:
    return [remark for remark in analysis.remarks if remark.code.startswith("paper-gains")]


@pytest.mark.slow
def test_the_ratio_is_that_of_the_bands(analysis: Analysis) -> None:
    (gap,) = gaps(analysis)
    assert gap.code == "paper-gains-expected"
    best, *paper = (np.sqrt(np.mean(e.error_sd**2, axis=0)).mean() for e in analysis.estimates)
    assert gap.values["ratio"] == pytest.approx(np.mean(paper) / best, rel=1e-12)
    assert set(gap.values["ratios"]) == {"fdo", "gmo", "kfo-fe", "kfo-zoh"}
    assert "the paper's gains give " in str(gap)
    assert "(delay 39–333 ms)" in str(gap)


@pytest.mark.slow
def test_other_gains_in_the_run_do_not_change_what_the_paper_s_cost(analysis: Analysis) -> None:
    """Those of --gains auto and of --set ran; the paper's run beside them for the line."""
    for words in ({"gains": "auto"}, {"settings": {"gmo.gain": "30"}}, {"observer": ["best"]}):
        other = analyse_log(FIXTURE, replace(UR5, observers=ObserverChoice.parsed(**words)))
        assert gaps(other)[0].values["ratio"] == pytest.approx(
            gaps(analysis)[0].values["ratio"], rel=1e-12
        )


@pytest.mark.slow
def test_nothing_is_said_where_a_side_is_not_known(analysis: Analysis) -> None:
    assert analysis.refinement is not None
    found, estimates = analysis.refinement.baselines.plain, analysis.estimates
    assert expected_gap(found, estimates[1:], gains_of_file=True) is None
    bare = [replace(estimates[0], error_sd=None), *estimates[1:]]
    assert expected_gap(found, bare, gains_of_file=True) is None
    delay = {"gmo": np.array([0.1, 0.2])}
    assert gap_remark(EXPECTED, {"best": 0.0, "gmo": 1.0}, delay) is None
    assert gap_remark(EXPECTED, {"best": 1.0, "gmo": np.nan}, delay) is None
    said = gap_remark(EXPECTED, {"best": 0.5, "gmo": 1.0}, delay)
    assert said is not None
    assert said.values == {
        "ratio": 2.0,
        "ratios": {"gmo": 2.0},
        "least_delay_ms": 100.0,
        "most_delay_ms": 200.0,
    }


def test_gains_that_do_as_well_are_not_called_off_the_best() -> None:
    delay = {"gmo": np.array([0.1, 0.2])}
    for error, code in ((1.1, "paper-gains-expected"), (0.7, "paper-gains-expected-level")):
        said = gap_remark(EXPECTED, {"best": 1.0, "gmo": error}, delay)
        assert said is not None
        assert said.code == code
        assert str(said)


@pytest.mark.slow
def test_what_is_measured_takes_the_place_of_what_was_expected(analysis: Analysis) -> None:
    rows = [
        ("best", 1, 0.5),
        ("best", 2, 1.5),
        ("gmo", 1, 2.0),
        ("gmo", 2, 4.0),
        ("gmo", 3, None),
    ]
    errors = pl.DataFrame(rows, schema=["observer", "joint", "rmse_Nm"], orient="row")
    unknown = dict.fromkeys(("l1_Nm", "reference_rms_Nm", "reference_floor_Nm"), pl.lit(None))
    errors = errors.with_columns(reference_trusted=pl.lit(True), **unknown)
    other = fact("band")
    before = (gaps(analysis)[0], other)
    after = with_measured_gap(before, errors, analysis.tunings)
    assert [remark.code for remark in after] == ["band", "paper-gains-measured"]
    assert after[1].values["ratio"] == pytest.approx(3.0 / 1.0)
    # Without the best there is nothing to measure against.
    alone = errors.filter(pl.col("observer") == "gmo")
    assert with_measured_gap(before, alone, analysis.tunings) == before
