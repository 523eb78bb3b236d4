"""Table I beside computed errors: what is said about the differences must follow from them."""

import numpy as np
import polars as pl
import pytest

from vftcli.evaluation.print_table import TABLE_1, check_published, compare_with
from vftcli.observers import FilteredDynamicsObserver, KalmanObserver, MomentumObserver
from vftcli.signals.errors import ParameterError

STEP = 0.008
OBSERVERS = (
    FilteredDynamicsObserver(omega=10.0),
    MomentumObserver(gain=np.array([5.0, 3.0, 4.0, 10.0, 10.0, 10.0])),
    KalmanObserver(),
)
TUNINGS = {o.name: o.tuning(STEP, 6) for o in OBSERVERS}


def errors(scale: float = 1.0, joints: int = 6) -> pl.DataFrame:
    """The printed numbers times a scale, FDO and GMO equal on J4–J6."""
    rows = []
    for name in ("fdo", "gmo", "kfo-fe"):
        for j in range(joints):
            printed = TABLE_1.rmse["fdo" if name == "gmo" and j > 2 else name][min(j, 5)]
            rows.append(
                {
                    "recording": "log",
                    "observer": name,
                    "joint": j + 1,
                    "rmse_Nm": scale * printed,
                    "reference_floor_Nm": 0.4,
                }
            )
    return pl.DataFrame(rows)


def test_sizes_and_winners_are_told() -> None:
    found = compare_with("table1", errors(1.5), OBSERVERS, TUNINGS)
    text = " ".join(found.remarks)
    assert found.names == ("fdo", "gmo", "kfo-fe")
    assert "median 1.50" in text
    assert "J4 (gmo in print, kfo-fe here)" in text
    assert "fdo and gmo agree here on J4, J5, J6" in text
    assert "delay of 138 ms on J1" in text  # 137.5 ms in closed form


def test_the_discrete_reading_is_told() -> None:
    kalman = KalmanObserver(noise_convention="discrete")
    observers = (*OBSERVERS[:2], kalman)
    tunings = {**TUNINGS, kalman.name: kalman.tuning(STEP, 6)}
    text = " ".join(compare_with("table1", errors(), observers, tunings).remarks)
    assert "noise_convention=discrete: a delay of 39 ms on J1" in text


def test_printed_numbers() -> None:
    """Table I: four observers, six joints; J6 of all is about 0.93."""
    assert {name: len(row) for name, row in TABLE_1.rmse.items()} == dict.fromkeys(
        ("fdo", "gmo", "kfo-fe", "kfo-zoh"), 6
    )
    assert np.mean([row[5] for row in TABLE_1.rmse.values()]) == pytest.approx(0.939, abs=0.001)


def test_what_cannot_be_compared() -> None:
    with pytest.raises(ParameterError, match="there is table1"):
        check_published("table2", "two-cycle")
    with pytest.raises(ParameterError, match="add --reference two-cycle"):
        check_published("table1", None)
    with pytest.raises(ParameterError, match="6 joints, the log has 7"):
        compare_with("table1", errors(joints=7), OBSERVERS, TUNINGS)
