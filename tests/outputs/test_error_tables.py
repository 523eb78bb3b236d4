import numpy as np
import polars as pl
import pytest

from vftcli.evaluation import SCHEMA
from vftcli.outputs.error_tables import (
    blocks,
    detail_grids,
    details,
    logs_of,
    marks_in_words,
    rmse_grid,
)
from vftcli.outputs.grid import GridCell, latex, markdown, terminal
from vftcli.outputs.page.shell import part


def errors(*changed: dict[str, object]) -> pl.DataFrame:
    """Two observers on two joints, rows changed one by one."""
    base = [("fdo", 1, 0.6), ("fdo", 2, 2.0), ("gmo", 1, 0.5999), ("gmo", 2, 1.0)]
    rows = []
    for k, (observer, joint, rmse) in enumerate(base):
        row = {
            "recording": "run.csv",
            "observer": observer,
            "joint": joint,
            "rmse_Nm": rmse,
            "reference": "two-cycle",
            "reference_floor_Nm": 0.5,
            "samples": 100 + k,
        }
        rows.append(row | (changed[k] if k < len(changed) else {}))
    return pl.DataFrame(rows, schema=SCHEMA)


def test_values_that_print_alike_are_both_the_best() -> None:
    (block,) = blocks(errors(*[{"reference_floor_Nm": 0.1}] * 4))
    assert block.best.tolist() == [[True, False], [True, True]]


def test_bold_is_only_where_the_reference_can_tell() -> None:
    """J1: both at the floor of .5; J2: it rests most of the time."""
    (block,) = blocks(errors({}, {"reference_trusted": False}, {}, {"reference_trusted": False}))
    assert not block.best.any()


def test_an_observer_that_fails_is_named_with_the_share() -> None:
    (block,) = blocks(errors({"missing": 0.12}, {"missing": 0.03}))
    assert "fdo: no answer in up to 12 %" in marks_in_words([block])
    assert "no answer" not in marks_in_words(blocks(errors()))


def test_every_output_has_one_mean_and_says_what_it_leaves_out() -> None:
    """J2's reference is not to be trusted: terminal, Markdown, LaTeX and page show J1's error."""
    rests = {"reference_trusted": False}
    (block,) = blocks(errors({}, rests, {"rmse_Nm": 0.9}, rests))
    grid = rmse_grid(block)
    assert block.means.errors == {"fdo": 0.6, "gmo": 0.9}
    for text in (terminal(grid), markdown(grid), latex(grid), part("parts/table", grid)):
        assert "0.600" in text
        assert "1.30" not in text  # the mean of .6 and 2
    assert "mean: without J2" in terminal(grid) + marks_in_words([block])
    assert "mean: without J2" in latex(grid)


def test_at_the_floor_is_within_a_fifth_of_it() -> None:
    """Joint 1: .6 is 1.2 × .5; joint 2: 1 is twice the floor."""
    (block,) = blocks(errors())
    assert block.at_floor.tolist() == [[True, False], [True, False]]
    assert block.title == "run.csv against two-cycle, 100 to 103 samples"
    grid = rmse_grid(block)
    first = grid.rows[0][1]
    assert isinstance(first, GridCell)
    assert first.mark == "*"
    assert "at the floor" in first.html
    assert grid.rows[-1][0] == "floor"
    assert grid.summaries == 1


def test_a_floor_of_one_joint_is_a_floor() -> None:
    (block,) = blocks(errors({"reference_floor_Nm": None}, {}, {"reference_floor_Nm": None}))
    assert block.has_floor
    assert np.isnan(block.floor[0])
    (without,) = blocks(errors(*[{"reference_floor_Nm": None}] * 4))
    assert not without.has_floor
    assert rmse_grid(without).summaries == 0


def test_a_joint_that_rests_bears_a_dagger() -> None:
    (block,) = blocks(errors({}, {"reference_trusted": False}))
    assert block.untrusted == (2,)
    assert block.joint_heads == ["J1", "J2†"]
    assert "do not trust it" in marks_in_words([block])
    (trusted,) = blocks(errors())
    assert "†" not in marks_in_words([trusted])


def test_an_unknown_error_is_not_the_best_and_does_not_count_in_the_mean() -> None:
    (block,) = blocks(errors({"rmse_Nm": None}))
    assert block.best.tolist() == [[False, False], [True, True]]
    assert block.means.errors["fdo"] == 2.0
    assert "no sample" in marks_in_words([block])


def test_logs_of_one_label_stay_apart_also_with_other_joints() -> None:
    both = pl.concat([errors(), errors().filter(pl.col("joint") == 1)])
    assert [len(rows) for rows in logs_of(both, "joint")] == [4, 2]
    assert list(logs_of(both, "axis")) == []


@pytest.mark.parametrize(
    ("values", "texts"),
    [
        ((0.5, 12.34, 0.0604, 0.946, 1.0), ["0.500–12.3", "60", "95 %", "best"]),
        ((None, 1.0, 0.0, 1.0, 0.0312), ["–", "0", "100 %", "0.031"]),
        ((0.5, None, None, None, None), ["–"] * 4),
    ],
)
def test_details_as_text(values: tuple[float | None, ...], texts: list[str]) -> None:
    keys = ("rmse_low_Nm", "rmse_high_Nm", "lag_s", "coverage_95", "p_vs_best")
    assert list(details(dict(zip(keys, values, strict=True)))) == texts


def test_a_detail_that_nobody_knows_has_no_table() -> None:
    known = [{"p_vs_best": 1.0, "lag_s": 0.01}] * 4
    titles = [grid.title for grid in detail_grids(errors(*known))]
    assert len(titles) == 2
    assert titles[0].startswith("run.csv: lag")
    assert titles[1].startswith("run.csv: p of being")
    assert list(detail_grids(errors())) == []
