import csv
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from vftcli.admittance.closed_loop import Replayed
from vftcli.admittance.law import controllers
from vftcli.admittance.replay import Replay
from vftcli.outputs.admittance import write_admittance
from vftcli.outputs.admittance_tables import (
    COLUMNS,
    comparison_grid,
    parameter_grid,
    stability_grid,
)
from vftcli.outputs.run_record import to_json


def test_controllers_stand_under_each_other_by_axis_and_drag(release: Replay) -> None:
    rows = [dict(row) for row in release.rows]
    late = [row | {"axis": "z", "drag": 2} for row in rows] + [
        row | {"axis": "z"} for row in rows
    ]
    grid = comparison_grid([*late, *rows])
    keys = list(COLUMNS)
    axes = [(row[keys.index("axis")], row[keys.index("drag")]) for row in grid.rows]
    n = len(rows)
    assert axes == [("x", 1)] * n + [("z", 1)] * n + [("z", 2)] * n


def test_an_overshoot_is_printed_in_per_cent_with_a_true_minus(release: Replay) -> None:
    row = dict(release.rows[0]) | {"overshoot": 0.0523, "peak": -0.1, "return_2_s": None}
    (cells,) = comparison_grid([row]).cells
    assert {"5.2", "−0.1000", "–"} <= {cell.text for cell in cells}


def test_rows_for_machines_are_not_rounded(release: Replay, tmp_path: Path) -> None:
    rows = json.loads(to_json(release.rows))
    assert rows == json.loads(json.dumps(list(release.rows)))
    for name, replay in (("full", release), ("empty", replace(release, drags=()))):
        write_admittance(tmp_path / name, Replayed(replay))
    with (tmp_path / "full/comparison.csv").open(encoding="utf-8") as file:
        read = list(csv.DictReader(file))
    assert [float(r["peak"]) for r in read] == [row["peak"] for row in release.rows]
    empty = (tmp_path / "empty/comparison.csv").read_text(encoding="utf-8")
    assert empty.strip().split(",") == list(COLUMNS)


def test_an_axis_may_have_no_speed_limit(release: Replay) -> None:
    limit = np.array([np.inf, 2.0, 3.0, 4.0, 4.0, 4.0])
    parameters = replace(release.parameters, speed_limit=limit)
    changed = replace(release, controllers=controllers(parameters))
    assert [row[-1] for row in parameter_grid(changed).rows][:2] == ["none", "2 m/s"]


def test_parameters_of_the_profile(release: Replay) -> None:
    """Table III of the paper: 3 kg, 5 N·s/m, 8 N/m, threshold 20 N and 6 N·m."""
    assert "8 ms, hard threshold" in parameter_grid(release).title
    rows = {row[0]: row[1:] for row in parameter_grid(release).rows}
    assert rows["x"][:3] == (3.0, 5.0, 8.0)
    assert rows["x"][-2:] == ("20 N", "0.9 m/s")
    assert rows["rz"][-2:] == ("6 N·m", "1 rad/s")


def test_stability_is_reported_of_the_worst_axis(release: Replay) -> None:
    """The discrete number 2 Ts B/M + Ts² K/M; the traditional controller keeps it in recovery."""
    p = release.parameters
    expected = np.max(
        2 * p.period * p.damping[:3] / p.mass[:3] + p.period**2 * p.stiffness[:3] / p.mass[:3]
    )
    first = stability_grid(release).rows[0]
    assert first[1] == "position"
    assert first[2] == pytest.approx(expected)
    assert [row[1] for row in stability_grid(release).rows] == ["position", "rotation"] * len(
        release.controllers
    )
