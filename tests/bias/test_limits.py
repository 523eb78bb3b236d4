"""What limits a log: friction apart from other error, the largest cause, the paper's gains."""

import numpy as np
import polars as pl
import pytest

from vftcli.bias.refine import STICTION, Budget, friction_share, limits_remark
from vftcli.evaluation.references import paper_gap
from vftcli.observers.paper import MomentumObserver

RNG = np.random.default_rng(8)
DQ = RNG.uniform(-1.0, 1.0, (4000, 2))


def test_friction_beside_another_error_is_its_share_of_the_power() -> None:
    """tanh has a mean square of nearly 1, the other error `size`²; 4000 samples tell 3 %."""
    size = 4.0
    other = size * RNG.standard_normal(DQ.shape)
    power = np.mean(np.tanh(DQ / 0.02) ** 2, axis=0)
    found = friction_share(DQ, np.tanh(DQ / 0.02) + other)
    np.testing.assert_allclose(found, power / (power + size**2), atol=0.03)
    friction = 3.0 * np.tanh(DQ / 0.02) + 0.5 * DQ
    np.testing.assert_allclose(friction_share(DQ, friction), 1.0, atol=1e-12)
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


def test_the_largest_cause_of_each_joint_is_named() -> None:
    np.testing.assert_allclose(budget().total, [5.0, np.sqrt(0.31)])  # stiction is no part of it
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
    found = budget()
    found.parts[STICTION][0] = 0.0
    assert limits_remark(found, np.array([True, True])).values["causes"] == ["friction", STICTION]


@pytest.mark.parametrize(
    ("error", "code"), [(3.0, "paper-gains-measured"), (0.7, "paper-gains-measured-level")]
)
def test_the_cost_of_the_papers_gains_is_measured_beside_the_best(
    error: float, code: str
) -> None:
    rows = [
        ("best", 1, 0.5),
        ("best", 2, 1.5),
        ("gmo", 1, 0.5 * error),
        ("gmo", 2, 1.5 * error),
        ("gmo", 3, None),
    ]
    errors = pl.DataFrame(rows, schema=["observer", "joint", "rmse_Nm"], orient="row")
    unknown = dict.fromkeys(("l1_Nm", "reference_rms_Nm", "reference_floor_Nm"), pl.lit(None))
    errors = errors.with_columns(reference_trusted=pl.lit(True), **unknown)
    tunings = {"gmo": MomentumObserver(gain=np.array([10.0, 5.0])).tuning(0.002, 2)}
    (gap,) = paper_gap(errors, tunings)
    assert gap.code == code
    assert str(gap)
    assert gap.values == {
        "ratio": pytest.approx(error),
        "ratios": {"gmo": pytest.approx(error)},
        "least_delay_ms": pytest.approx(100.0),
        "most_delay_ms": pytest.approx(200.0),
    }
    # Without the best there is nothing to measure against, nor beside one without an error.
    assert paper_gap(errors.filter(pl.col("observer") == "gmo"), tunings) == ()
    assert paper_gap(errors.filter(pl.col("observer") == "best"), tunings) == ()
    none = pl.when(pl.col("observer") == "best").then(0.0).otherwise(pl.col("rmse_Nm"))
    assert paper_gap(errors.with_columns(rmse_Nm=none), tunings) == ()
