"""Table I beside computed errors: what is said about the differences must follow from them."""

import numpy as np
import polars as pl
import pytest

from vftcli.evaluation.published import TABLE_1, check_published, compare_with
from vftcli.observers import FilteredDynamicsObserver, KalmanObserver, MomentumObserver
from vftcli.signals.errors import ParameterError

STEP = 0.008
GMO = MomentumObserver(gain=np.array([5.0, 3.0, 4.0, 10.0, 10.0, 10.0]))
OBSERVERS = (FilteredDynamicsObserver(omega=10.0), GMO, KalmanObserver())
TUNINGS = {o.name: o.tuning(STEP, 6) for o in OBSERVERS}


def errors(scale: float = 1.0, joints: int = 6) -> pl.DataFrame:
    """The printed numbers times a scale, FDO and GMO equal on J4–J6; a floor of .1 N·m a joint."""
    rows = []
    for name in ("fdo", "gmo", "kfo-fe"):
        for j in range(joints):
            printed = TABLE_1.rmse["fdo" if name == "gmo" and j > 2 else name][min(j, 5)]
            rows.append(("log", name, j + 1, scale * printed, 0.1 * (j + 1)))
    columns = ["recording", "observer", "joint", "rmse_Nm", "reference_floor_Nm"]
    return pl.DataFrame(rows, schema=columns, orient="row")


def test_sizes_and_winners_are_reported() -> None:
    found = compare_with("table1", errors(1.5), OBSERVERS, TUNINGS)
    assert found.names == ("fdo", "gmo", "kfo-fe")
    assert "delay 138 ms on J1" in " ".join(map(str, found.remarks))  # 137.5 ms in closed form
    by_code = {remark.code: remark.values for remark in found.remarks}
    sizes = by_code["print-sizes"]
    # GMO has FDO's numbers on J4 to J6, which the paper prints as larger there
    ratios = np.array(TABLE_1.rmse["fdo"])[3:] / np.array(TABLE_1.rmse["gmo"])[3:]
    found_sizes = [sizes[k] for k in ("median", "least", "most")]
    assert found_sizes == pytest.approx([1.5, 1.5, 1.5 * ratios.max()])
    # J6 of all four in print, and the reference's own error there
    floor = by_code["print-noise-floor"]
    sizes = [floor[k] for k in ("least_Nm", "most_Nm", "floor_Nm")]
    assert sizes == pytest.approx([0.9322, 0.9443, 0.6])
    assert found.floor == pytest.approx([0.1, 0.2, 0.3, 0.4, 0.5, 0.6])
    # FDO, GMO and KFO: of them another one is best on J4 alone
    other = by_code["print-other-best"]
    assert (other["joints"], other["same"]) == (6, 6 - len(other["differing"]))
    assert "J4 (gmo in print, kfo-fe here)" in other["differing"]
    kalman = KalmanObserver(noise_convention="discrete")
    tunings = {**TUNINGS, kalman.name: kalman.tuning(STEP, 6)}
    said = compare_with("table1", errors(), (*OBSERVERS[:2], kalman), tunings).remarks
    delays = {r.code: r.values.get("delay_ms") for r in said}
    assert delays["print-kalman-discrete"] == pytest.approx(39.0, abs=0.5)


def test_what_cannot_be_compared() -> None:
    with pytest.raises(ParameterError, match="there is table1"):
        check_published("table2", "two-cycle")
    with pytest.raises(ParameterError, match="add --reference two-cycle"):
        check_published("table1", None)
    with pytest.raises(ParameterError, match="6 joints, the log has 7"):
        compare_with("table1", errors(joints=7), OBSERVERS, TUNINGS)


def test_fdo_and_gmo_are_one_filter_to_a_millionth() -> None:
    """They agree on J4 to J6; a gap of two millionths on J5 is two filters' already."""
    table = errors()
    off = (pl.col("observer") == "gmo") & (pl.col("joint") == 5)
    rmse = pl.when(off).then(pl.col("rmse_Nm") * (1.0 + 2e-6)).otherwise(pl.col("rmse_Nm"))
    found = compare_with("table1", table.with_columns(rmse), OBSERVERS, TUNINGS)
    remark = next(r for r in found.remarks if r.code == "print-one-filter")
    assert remark.where.joints == (4, 6)
    # The largest printed difference there: J4, 1.5379 − 1.2939 N·m.
    assert remark.values["printed_Nm"] == pytest.approx(0.2440)


PRINTED = """
5.6601 5.2106 4.7472 4.8555
4.2443 3.8767 3.6219 3.6475
4.6620 5.1080 4.0874 4.1538
1.5379 1.2939 1.3828 1.3345
1.2137 1.1976 1.3221 1.3164
0.9443 0.9322 0.9355 0.9440
"""
"""Table I as the paper prints it: a row a joint; FDO, GMO, KFO by FE, KFO by ZOH. [N·m]"""


def test_table_1_is_the_papers() -> None:
    rows = [[float(x) for x in line.split()] for line in PRINTED.strip().splitlines()]
    columns = dict(zip(("fdo", "gmo", "kfo-fe", "kfo-zoh"), zip(*rows, strict=True), strict=True))
    assert dict(TABLE_1.rmse) == columns
