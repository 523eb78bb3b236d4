"""The whole virtual sensor on the repository's own logs: order, zero, and what is remarked."""

from pathlib import Path

import numpy as np
import pytest
from made_runs import analyse_log

from vftcli.analysis import Analysis
from vftcli.observers import ObserverChoice
from vftcli.pipeline import AnalysisChoice
from vftcli.readers.reader import ReadChoice
from vftcli.readers.reading import read
from vftcli.robots import RobotChoice, load_robot
from vftcli.robots.chain import link_poses
from vftcli.wrench import WrenchChoice, ZeroChoice
from vftcli.wrench.sensing import mask_remark
from vftcli.wrench.sensor import SensorReading, null_space_limit

FIXTURES = Path(__file__).parents[2] / "fixtures"


def analysed(log: str, names: tuple[str, ...], wrench: WrenchChoice, **read: object) -> Analysis:
    choice = AnalysisChoice(
        read=ReadChoice(**read),  # type: ignore[arg-type]
        robot=RobotChoice(name="ur5" if log.startswith("ur5") else "panda"),
        observers=ObserverChoice(names=names),
        wrench=wrench,
    )
    return analyse_log(FIXTURES / log, choice)


def reading(log: str, *names: str, **choice: object) -> SensorReading:
    sensed = analysed(log, names, WrenchChoice(**choice)).virtual_sensor  # type: ignore[arg-type]
    assert all(str(remark) for remark in sensed.remarks)  # the catalogue has words for each
    return sensed


START = ZeroChoice(start=True)


@pytest.mark.slow
@pytest.mark.parametrize("frame", ["base", "flange"])
def test_neither_order_nor_company_nor_frame_moves_the_zero(frame: str) -> None:
    alone = reading("ur5_sensor.parquet", "gmo", zero=START, frame=frame)
    orders = [("gmo", "fdo", "kfo-fe"), ("kfo-fe", "fdo", "gmo")]
    for names in orders:
        found = reading("ur5_sensor.parquet", *names, zero=START, frame=frame)
        assert found.zero_span == alone.zero_span
        ours, theirs = (
            [remark for remark in each.remarks if remark.code.startswith("log-wrench")]
            for each in (found, alone)
        )
        assert ours == theirs != []
        np.testing.assert_array_equal(found.masked, alone.masked)
        (same,) = (w for w in found.wrenches if w.name == "gmo")
        np.testing.assert_array_equal(same.values, alone.wrenches[0].values)
        known = ~found.masked
        np.testing.assert_array_equal(same.sd[known], alone.wrenches[0].sd[known])
    base = reading("ur5_sensor.parquet", "gmo", zero=START, frame="base")
    assert base.zero_span == alone.zero_span


@pytest.mark.slow
def test_further_spans_show_the_drift_and_only_the_first_is_removed() -> None:
    zero = ZeroChoice(spans=((1.0, 2.0), (2.5, 3.5)))
    found = reading("ur5_circle.csv", "gmo", "fdo", zero=zero, frame="base")
    assert [(d.name, d.span[0], d.removed) for d in found.drifts] == [
        ("gmo", 1.0, True), ("fdo", 1.0, True), ("gmo", 2.5, False), ("fdo", 2.5, False),
    ]  # fmt: skip
    for wrench in found.wrenches:
        np.testing.assert_allclose(wrench.between(1.0, 2.0).mean(axis=0), 0.0, atol=1e-12)
    moved = [remark for remark in found.remarks if remark.code == "zero-moved"]
    first, later = found.drifts[0], found.drifts[2]
    assert [remark.where.about for remark in moved] == ["gmo", "fdo"]
    np.testing.assert_allclose(moved[0].values["force_N"], (later.mean - first.mean)[:3])


@pytest.mark.slow
def test_nothing_is_removed_unasked_but_the_start_is_known_to_be_unloaded() -> None:
    found = reading("ur5_circle.csv", "gmo")
    assert found.drifts == ()
    assert found.zero_span is None
    assert ("pose-hides-wrench" in {r.code for r in found.remarks}) == found.masked.any()
    zeroed = reading("ur5_circle.csv", "gmo", zero=START)
    np.testing.assert_array_equal(found.free, zeroed.free)
    assert found.free.any()
    # six joints have no null space, seven have
    assert null_space_limit(zeroed.wrenches[0], zeroed.free) is None
    panda = reading("panda_bearing.csv", "gmo", zero=START)
    assert null_space_limit(panda.wrenches[0], panda.free) > 0.0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("choice", "code"),
    [
        ({"torque_sd": "0.5"}, "band-given"),
        ({"torque_sd": "own"}, "no-covariance"),
        ({"zero": START}, "band-from-free-part"),
        ({}, "no-wrench-band"),
        ({"solver": "map"}, "no-wrench-band"),
    ],
)
def test_the_band_says_where_it_comes_from(choice: dict[str, object], code: str) -> None:
    found = reading("ur5_circle.csv", "gmo", **choice)
    assert code in [remark.code for remark in found.remarks]


def test_an_unknown_band_is_said_of_those_only_that_are_not_smoothed() -> None:
    short = analysed(
        "ur5_circle.csv", ("best", "gmo", "fdo"), WrenchChoice(), interval=(0.0, 2.0)
    )
    found = short.virtual_sensor
    (unknown,) = [remark for remark in found.remarks if remark.code == "no-wrench-band"]
    assert unknown.where.about == "gmo, fdo"
    assert found.wrenches[0].sd is not None


@pytest.mark.slow
def test_a_smoothed_wrench_turns_with_the_flange() -> None:
    """Force and moment about the flange point in its own axes are those in base axes, turned."""
    base, flange = (
        reading("ur5_circle.csv", "best", frame=f).wrenches[0] for f in ("base", "flange")
    )
    log = read(FIXTURES / "ur5_circle.csv")
    turn = link_poses(load_robot("ur5").chain, log.q).rotation[:, -1]
    for part in (slice(0, 3), slice(3, 6)):
        expected = np.einsum("tji,tj->ti", turn, base.values[:, part])
        np.testing.assert_allclose(
            flange.values[:, part], expected, atol=1e-9
        )  # rounding of 100 N


def test_samples_that_a_pose_hides_are_counted_with_the_smallest_singular_value() -> None:
    sigma, hidden = np.array([0.2, 0.03, 0.04, 0.1]), np.array([False, True, True, False])
    (said,) = mask_remark(hidden, sigma)
    assert said.code == "pose-hides-wrench"
    assert said.values == {"masked": 2, "samples": 4, "share": 0.5, "sigma_min_m": 0.03}
    assert mask_remark(np.zeros(4, bool), sigma) == mask_remark(hidden, None) == ()
