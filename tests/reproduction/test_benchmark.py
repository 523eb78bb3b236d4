"""The benchmark: what it measures, and the keys that scripts read."""

from pathlib import Path

import numpy as np
import polars as pl
import pytest

from vftcli.reproduction.benchmark import (
    Timings,
    benchmark,
    circle,
    command_costs,
    examination_costs,
    jittering,
    simd,
    wide_table,
)
from vftcli.robots import load_robot

UR5 = load_robot("ur5")
LOG = circle(UR5, 400)


def test_a_shortened_run_counts_in_full() -> None:
    timings = Timings({"work": [1.0, 2.0, 30.0]})
    assert timings.row("work", 1000) == {"total_s": 2.0, "per_sample_us": 2000.0}
    timings.measure("short", lambda: None, scale=0.0)
    assert timings.median("short") == 0.0


@pytest.mark.slow
def test_the_keys_that_scripts_read() -> None:
    found = benchmark("ur5", samples=1200, rounds=1)
    assert [row["name"] for row in found["observers"]] == ["fdo", "gmo", "kfo-fe", "kfo-zoh"]
    assert {"total_s", "per_sample_us"} <= set(found["observers"][0])
    ratios = {"core_over_rnea_loop", "analytic_script_over_core", "literal_script_over_core"}
    ratios |= {"core_over_rnea_loop_jittering", "core_over_rnea_loop_cold"}
    assert ratios <= set(found["ratios"])
    assert found["complete_log"][-1]["name"] == "wrench smoother"
    assert found["simd"] == simd()
    assert all(value > 0 for value in found["ratios"].values())


def test_the_jittering_clock_strays_by_a_twentieth() -> None:
    steps = np.diff(jittering(LOG).t) * 125.0
    assert 0.95 <= steps.min() < 0.97
    assert 1.03 < steps.max() <= 1.05


def test_the_examination_is_measured_on_a_log_that_reads_back(tmp_path: Path) -> None:
    """The wide table is a log of UR's client: 200 columns, of which an estimate reads its own."""
    log = tmp_path / "long.csv"
    table = wide_table(UR5, samples=300)
    assert len(table) == 200
    pl.DataFrame(table).write_csv(log)
    costs = examination_costs("ur5", log, rounds=1)
    assert costs["over_estimate"] == pytest.approx(
        (costs["examination_s"] + costs["columns_s"]) / costs["estimate_s"]
    )
    assert costs["examination_minute_s"] > 0.0


@pytest.mark.slow
def test_the_command_is_measured_beside_reading_its_columns(tmp_path: Path) -> None:
    log = tmp_path / "long.csv"
    pl.DataFrame(wide_table(UR5, samples=300)).write_csv(log)
    costs = command_costs("ur5", log, rounds=1)
    assert costs["over_reading"] == pytest.approx(costs["command_s"] / costs["reading_s"])
    assert min(costs.values()) > 0.0
