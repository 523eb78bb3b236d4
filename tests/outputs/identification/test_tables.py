import polars as pl
import pytest

from vftcli.outputs.grid import terminal
from vftcli.outputs.identification import (
    parameter_grid,
    residual_grid,
    shape_choice_grid,
    tables_text,
)


def test_one_row_a_log_role_and_model_with_its_mean(found):
    result, log = found
    lines = terminal(residual_grid(result)).splitlines()
    assert lines[0].split()[-7:] == ["J1", "J2", "J3", "J4", "J5", "J6", "mean"]
    assert ["held-out" in line for line in lines[1:]] == [False, False, True, True]
    numbers = [float(x) for x in lines[1].split()[-7:]]
    assert numbers[-1] == pytest.approx(sum(numbers[:-1]) / 6, abs=1e-3)  # three printed digits
    assert log.name in lines[1]


def test_two_logs_of_one_label_are_two_rows(found):
    """They were one row of twelve numbers for six joints."""
    result, _ = found
    second = result.residuals.with_columns(log_index=pl.col("log_index") + 10)
    both = result._replace(residuals=pl.concat([result.residuals, second]))
    rows = residual_grid(both).rows
    assert len(rows) == 2 * len(residual_grid(result).rows)
    assert {len(row) for row in rows} == {8}


def test_what_the_log_does_not_determine_is_said(found):
    result, _ = found
    doubted = result.parameters.with_columns(determined=pl.lit(False))
    lines = terminal(parameter_grid(result._replace(parameters=doubted))).splitlines()
    assert lines[0].split() == ["number", "joint", "value", "sd", "profile", "unit"]
    assert all(line.endswith("  (not determined)") for line in lines[1:])


def test_what_is_no_number_is_a_dash(found):
    """A profile without a term read "nan", a spread that nothing bounds "inf"."""
    result, _ = found
    unknown = result.parameters.with_columns(
        profile=pl.lit(float("nan")), sd=pl.lit(float("inf"))
    )
    lines = terminal(parameter_grid(result._replace(parameters=unknown))).splitlines()[1:]
    assert all(line.count(" –") == 2 for line in lines)
    assert not any(word in line for line in lines for word in ("nan", "inf"))


def test_the_chosen_friction_is_marked():
    choices = pl.DataFrame(
        {
            "friction": ["viscous", "coulomb"],
            "joint": [1, 1],
            "cv_rms_Nm": [0.5, 0.25],
            "chosen": [False, True],
        }
    )
    lines = terminal(shape_choice_grid(choices)).splitlines()
    assert lines[2].split() == ["viscous", "J1", "0.500"]
    assert lines[3].split() == ["coulomb", "J1", "0.250", "chosen"]


def test_what_was_not_identified_has_no_table(found):
    result, _ = found
    bare = result._replace(
        residuals=result.residuals.clear(), parameters=result.parameters.clear()
    )
    assert tables_text(bare) == ""
    only = result._replace(residuals=result.residuals.clear())
    assert tables_text(only).startswith("number ")
