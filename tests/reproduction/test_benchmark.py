"""The benchmark: what it measures, and the keys that scripts read."""

from importlib.util import find_spec
from itertools import count

import pytest

from vftcli.reproduction.timing import Timings, benchmark, simd


def test_a_shortened_run_counts_in_full() -> None:
    timings = Timings({"work": [1.0, 2.0, 30.0]})
    assert timings.row("work", 1000) == {"total_s": 2.0, "per_sample_us": 2000.0}
    timings.measure("short", lambda: None, scale=0.0)
    assert timings.median("short") == 0.0


@pytest.mark.slow
def test_the_keys_that_scripts_read(monkeypatch: pytest.MonkeyPatch) -> None:
    """By a clock on which every call takes a second."""
    ticks = count()
    monkeypatch.setattr("time.perf_counter", lambda: float(next(ticks)))
    found = benchmark("ur5", samples=1200, rounds=2)
    assert [row["name"] for row in found["observers"]] == ["fdo", "gmo", "kfo-fe", "kfo-zoh"]
    assert [row["paper_s"] for row in found["observers"]] == [10.869, 10.541, 17.578, 58.363]
    once = {"total_s": 1.0, "per_sample_us": pytest.approx(1e6 / 1200)}
    for row in (*found["observers"], *found["complete_log"], found["dynamics"]):
        assert {key: row[key] for key in once} == once
    assert found["complete_log"][-1]["name"] == "wrench smoother"
    assert found["simd"] == simd()
    names = ["core_over_rnea_loop", "core_over_rnea_loop_jittering"]
    assert found["ratios"] == (dict.fromkeys(names, 1.0) if find_spec("pinocchio") else {})
    assert (found["samples"], found["rounds"], found["robot"]) == (1200, 2, "ur5")
