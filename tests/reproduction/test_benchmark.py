"""The benchmark: what it measures, and the keys that scripts read."""

from functools import partial
from importlib.util import find_spec
from itertools import count

import pytest

from vftcli.reproduction.timing import benchmark, median_times, simd


def test_the_median_of_interleaved_rounds_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = iter([0.0, 30.0, 0.0, 4.0, 0.0, 1.0, 0.0, 5.0, 0.0, 2.0, 0.0, 6.0])
    monkeypatch.setattr("time.perf_counter", lambda: next(clock))
    called: list[str] = []
    work = {name: partial(called.append, name) for name in "ab"}
    assert median_times(work, rounds=3) == {"a": 2.0, "b": 5.0}
    assert called == list("ababab")


@pytest.mark.slow
def test_the_keys_that_scripts_read(monkeypatch: pytest.MonkeyPatch) -> None:
    """By a clock on which every call takes a second."""
    ticks = count()
    monkeypatch.setattr("time.perf_counter", lambda: float(next(ticks)))
    found = benchmark("ur5", samples=1200, rounds=2)
    assert [row["name"] for row in found["observers"]] == ["fdo", "gmo", "kfo-fe", "kfo-zoh"]
    assert [row["paper_s"] for row in found["observers"]] == [10.869, 10.541, 17.578, 58.363]
    once = {"total_s": 1.0, "per_sample_us": pytest.approx(1e6 / 1200)}
    for row in (*found["observers"], found["dynamics"]):
        assert {key: row[key] for key in once} == once
    assert found["simd"] == simd()
    names = ["core_over_rnea_loop", "core_over_rnea_loop_jittering"]
    assert found["ratios"] == (dict.fromkeys(names, 1.0) if find_spec("pinocchio") else {})
    assert (found["samples"], found["rounds"], found["robot"]) == (1200, 2, "ur5")
