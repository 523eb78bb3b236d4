"""Rows of a log: the same columns whatever was asked, and the errors of `compare`."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from contact_rows import contact, contact_list
from made_runs import analyse_log

from vftcli.analysis import Analysis
from vftcli.batch.log_work import SCHEMA, rows_of, size_of
from vftcli.evaluation import ReferenceChoice
from vftcli.observers import ObserverChoice
from vftcli.pipeline import AnalysisChoice
from vftcli.readers.reader import ReadChoice
from vftcli.robots import RobotChoice
from vftcli.signals.remarks import warning
from vftcli.wrench import WrenchChoice

CIRCLE = Path(__file__).parents[2] / "fixtures" / "ur5_circle.csv"


@pytest.fixture(scope="module")
def analysis() -> Analysis:
    choice = AnalysisChoice(
        robot=RobotChoice(name="ur5"),
        read=ReadChoice(interval=(0.0, 3.0)),
        observers=ObserverChoice(names=("fdo", "gmo")),
        reference=ReferenceChoice(name="zero"),
        wrench=WrenchChoice(),
        contacts=False,
    )
    return analyse_log(CIRCLE, choice)


def test_one_row_an_observer_and_joint_with_its_error(analysis: Analysis) -> None:
    rows = rows_of(analysis, "key")
    assert dict(rows.schema) == SCHEMA
    torques = rows.filter(rows["joint"].is_not_null())
    assert torques.select("observer", "joint").rows() == [
        (name, j) for name in ("fdo", "gmo") for j in range(1, 7)
    ]
    assert analysis.errors is not None
    expected = analysis.errors.filter(analysis.errors["joint"].is_not_null())
    assert torques["rmse_Nm"].to_list() == expected["rmse_Nm"].to_list()
    assert torques["compared_samples"].to_list() == expected["samples"].to_list()
    tau = analysis.estimates[0].tau[:, 0]
    assert torques["rms_Nm"][0] == pytest.approx(np.sqrt(np.mean(tau**2)), rel=1e-12)
    assert set(rows["samples"]) == {analysis.recording.samples}


def test_one_row_an_observer_and_axis_where_a_wrench_is_asked(analysis: Analysis) -> None:
    rows = rows_of(analysis, "key")
    axes = rows.filter((rows["observer"] == "gmo") & rows["axis"].is_not_null())
    assert axes["axis"].to_list() == ["fx", "fy", "fz", "mx", "my", "mz"]
    assert axes["rms_N"].is_null().to_list() == [False] * 3 + [True] * 3
    assert axes["rms_Nm"].is_null().to_list() == [True] * 3 + [False] * 3


def test_a_log_without_an_observer_has_one_row(analysis: Analysis) -> None:
    bare = replace(analysis, estimates=(), observers=(), errors=None, virtual_sensor=None)
    rows = rows_of(bare, "key")
    assert rows.height == 1
    assert rows["observer"][0] is None
    assert rows["robot"][0] == "ur5"


def test_every_row_has_the_facts_of_its_log(analysis: Analysis) -> None:
    """A finding of the free run beside it is none of the log's."""
    (own, *_) = analysis.examinations
    twice = (warning("saturation", signal="current"), warning("saturation", signal="dq"))
    beside = replace(own, findings=(warning("light-load", load_kg=1.2, sd_kg=0.1, robot="ur5"),))
    examined = (replace(own, findings=twice), beside)
    found = contact_list(contact(), contact(number=2, peak_force=30.0))
    touched = replace(analysis, contacts=found, examinations=examined)
    bare = replace(analysis, contacts=None)
    for made, listed in ((touched, (2, False, 64.8, 7.1, 4.69, 6.5)), (bare, (None,) * 6)):
        row = rows_of(made, "key").row(-1, named=True)
        keys = ("contacts", "load", "hardest_N", "hardest_band_N", "hardest_s", "detectable_N")
        assert tuple(row[key] for key in keys) == listed
        assert (row["key"], row["samples"], row["duration_s"]) == ("key", 376, 3.0)
        assert row["rate_hz"] == pytest.approx(125.0)
    assert rows_of(touched, "key")["findings"][0].to_list() == ["saturation"]


def test_the_size_of_what_is_known() -> None:
    """99 % of 0…100 lie below 99, by linear interpolation."""
    assert size_of(np.array([np.nan, 3.0, -4.0]))[0] == pytest.approx(np.sqrt(12.5), rel=1e-15)
    assert size_of(-np.arange(101.0))[1] == pytest.approx(99.0, rel=1e-15)
    assert size_of(np.array([np.nan])) == (None, None)
