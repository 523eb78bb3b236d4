"""Table I beside computed errors."""

import numpy as np
import polars as pl
import pytest

from vftcli.evaluation.published import TABLE_1, check_published, compare_with
from vftcli.signals.errors import ParameterError


def errors(scale: float = 1.0, joints: int = 6) -> pl.DataFrame:
    """The printed numbers times a scale, FDO and GMO equal on J4–J6; a floor of .1 N·m a joint."""
    rows = []
    for name in ("fdo", "gmo", "kfo-fe"):
        for j in range(joints):
            printed = TABLE_1.rmse["fdo" if name == "gmo" and j > 2 else name][min(j, 5)]
            rows.append(("log", name, j + 1, scale * printed, 0.1 * (j + 1)))
    columns = ["recording", "observer", "joint", "rmse_Nm", "reference_floor_Nm"]
    return pl.DataFrame(rows, schema=columns, orient="row")


def test_printed_and_computed_numbers_stand_together() -> None:
    found = compare_with("table1", errors(1.5))
    assert found.names == ("fdo", "gmo", "kfo-fe")
    np.testing.assert_allclose(found.ours["fdo"], 1.5 * found.printed("fdo"), rtol=1e-15)
    assert found.floor == pytest.approx([0.1, 0.2, 0.3, 0.4, 0.5, 0.6])


def test_what_cannot_be_compared() -> None:
    with pytest.raises(ParameterError, match="there is table1"):
        check_published("table2", "two-cycle")
    with pytest.raises(ParameterError, match="add --reference two-cycle"):
        check_published("table1", None)
    with pytest.raises(ParameterError, match="6 joints, the log has 7"):
        compare_with("table1", errors(joints=7))


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
