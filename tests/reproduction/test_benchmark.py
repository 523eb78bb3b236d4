"""The benchmark: what it measures, and the keys that scripts read."""

from importlib.util import find_spec

import pytest

from vftcli.reproduction.timing import Timings, benchmark, simd


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
    assert found["complete_log"][-1]["name"] == "wrench smoother"
    assert found["simd"] == simd()
    names = ["core_over_rnea_loop", "core_over_rnea_loop_jittering"]
    assert list(found["ratios"]) == (names if find_spec("pinocchio") else [])
    assert all(ratio > 0.0 for ratio in found["ratios"].values())
