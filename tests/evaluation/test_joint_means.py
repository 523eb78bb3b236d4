"""The one mean over joints: only of those with a reference to be trusted."""

import numpy as np
import polars as pl

from vftcli.evaluation.errors import SCHEMA, joint_means


def table(*rows: tuple[str, int, float | None, bool | None]) -> pl.DataFrame:
    names = ("observer", "joint", "rmse_Nm", "reference_trusted")
    lines = [dict(zip(names, row, strict=True)) | {"reference_floor_Nm": row[1]} for row in rows]
    return pl.DataFrame(lines, schema=SCHEMA)


def test_a_joint_whose_reference_rests_is_left_out_and_named() -> None:
    means = joint_means(
        table(("a", 1, 1.0, True), ("a", 2, 9.0, False), ("a", 3, 3.0, None), ("b", 1, 0.5, True))
    )
    assert means.errors == {"a": 2.0, "b": 0.5}
    assert means.floor == 2.0  # of J1 and J3
    assert means.left_out == " without J2"
    assert means.least == ("b", 0.5)


def test_where_no_joint_can_be_trusted_all_count() -> None:
    means = joint_means(table(("a", 1, 1.0, False), ("a", 2, 3.0, False)))
    assert (means.errors, means.left_out) == ({"a": 2.0}, "")


def test_nothing_known_has_no_mean() -> None:
    means = joint_means(table(("a", 1, None, True)).with_columns(reference_floor_Nm=pl.lit(None)))
    assert means.errors == {}
    assert means.least is None
    assert np.isnan(means.floor)
