from collections.abc import Callable

import numpy as np
import polars as pl
import pytest

from vftcli.analysis import Analysis
from vftcli.evaluation import WRENCH_SCHEMA
from vftcli.outputs.error_tables import axis_grids, nothing_to_compare, paper_bounds
from vftcli.outputs.grid import terminal
from vftcli.outputs.grids import contact_grids, drift_grid
from vftcli.signals.wrench import AXES
from vftcli.virtual_sensor.sensor_reading import Drift


@pytest.fixture
def errors() -> pl.DataFrame:
    """gmo against a sensor: 1.5 N on every force axis, .25 N·m on every moment axis."""
    rows = [
        {
            "recording": "run.csv",
            "observer": "gmo",
            "reference": "sensor",
            "axis": axis,
            "rmse_N": 1.5 if k < 3 else None,
            "rmse_Nm": None if k < 3 else 0.25,
            "samples": 90,
        }
        for k, axis in enumerate(AXES)
    ]
    return pl.DataFrame(rows, schema=WRENCH_SCHEMA)


def test_forces_in_newtons_beside_moments_in_newton_metres(errors: pl.DataFrame) -> None:
    (grid,) = axis_grids(errors)
    assert terminal(grid).splitlines() == [
        "run.csv against sensor, wrench, 90 unmasked samples, RMSE",
        "observer  fx [N]  fy [N]  fz [N]  mx [N·m]  my [N·m]  mz [N·m]",
        "gmo         1.50    1.50    1.50     0.250     0.250     0.250",
    ]


def test_a_pose_that_hides_every_wrench_is_said_in_one_line(errors: pl.DataFrame) -> None:
    """It was a table of dashes over "0 unmasked samples"."""
    none = errors.with_columns(
        samples=pl.lit(0, pl.Int64),
        rmse_N=pl.lit(None, pl.Float64),
        rmse_Nm=pl.lit(None, pl.Float64),
    )
    assert list(axis_grids(none)) == []
    (line,) = nothing_to_compare(none)
    assert line.startswith("run.csv against sensor, wrench: nothing to compare: ")
    assert "below 0.05" in line
    assert list(nothing_to_compare(errors)) == []


def test_the_paper_s_bounds_stand_below_its_own_arm_only(
    errors: pl.DataFrame, without_reference: Analysis, as_if: Callable
) -> None:
    """They stood below every arm's numbers, a Panda's too."""
    ur5, panda = (as_if(without_reference, arm=name) for name in ("ur5", "panda"))
    label = ur5.recording.name
    named = errors.with_columns(recording=pl.lit(label))
    (shown,) = axis_grids(named, paper_bounds([ur5]))
    assert shown.rows[-1] == ("paper, UR5", "< 6", "< 6", "< 6", "< 0.65", "< 0.65", "< 0.65")
    assert paper_bounds([panda]) == {}
    (without,) = axis_grids(named, paper_bounds([panda]))
    assert len(without.rows) == 1
    (other,) = axis_grids(errors, paper_bounds([ur5]))
    assert len(other.rows) == 1, "run.csv is not the UR5's log"


def test_the_paper_s_bounds_are_of_a_sensor(
    errors: pl.DataFrame, without_reference: Analysis
) -> None:
    label = without_reference.recording.name
    truth = errors.with_columns(recording=pl.lit(label), reference=pl.lit("file:truth"))
    (grid,) = axis_grids(truth, paper_bounds([without_reference]))
    assert len(grid.rows) == 1


def test_contacts_are_counted_in_whole_numbers() -> None:
    row = {
        "recording": "run.csv",
        "observer": "gmo",
        "signal": "torque",
        "contacts": 3,
        "listed_contacts": 4,
        "found_contacts": 3,
        "missed_contacts": 0,
        "merged_contacts": 0,
        "split_contacts": 1,
        "false_alarms": 0,
        "false_alarms_per_h": 0.0,
        "detection_delay_s": 0.04,
        "longest_delay_s": None,
    }
    (grid,) = contact_grids(pl.DataFrame([row, row | {"contacts": None}]))
    assert terminal(grid, width=200).splitlines()[2].split() == [
        "run.csv", "gmo", "torque", "3", "4", "3", "0", "0", "1", "0", "0", "0.0400", "–",
    ]  # fmt: skip
    assert list(contact_grids(pl.DataFrame({"recording": ["a"]}))) == []


def test_zero_drift_has_five_decimals_as_the_paper_prints_it() -> None:
    mean = np.array([-0.43166, -0.53348, 0.83768, -0.16294, 0.13407, 0.09103])
    drift = Drift(
        name="kfo-fe", span=(1.0, 4.5), mean=mean, sd=np.zeros(6), samples=9, frame="base"
    )
    text = terminal(drift_grid([drift]))
    assert text.split() == [
        "observer", *AXES,
        "kfo-fe", "-0.43166", "-0.53348", "0.83768", "-0.16294", "0.13407", "0.09103",
    ]  # fmt: skip
    page = drift_grid([drift], spans=True)
    assert [column.heading for column in page.columns[:3]] == ["observer", "span [s]", "fx [N]"]
    assert page.rows[0][1] == "1–4.5"
