"""The developers' bars can be measured: every part runs, on a log far too short to time."""

import importlib.util
import math
from pathlib import Path

import pytest

from vftcli.robots import load_robot

spec = importlib.util.spec_from_file_location("bench", Path(__file__).with_name("run.py"))
assert spec is not None
assert spec.loader is not None
bench = importlib.util.module_from_spec(spec)
spec.loader.exec_module(bench)


UR5 = load_robot("ur5")


@pytest.mark.slow
def test_every_ratio_of_the_core_is_measured(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bench, "SCRIPT_SAMPLES", 50)
    ratios = bench.core_ratios(UR5, samples=1200, rounds=1)
    assert ratios.keys() < bench.RATIOS.keys()
    assert all(value > 0.0 for value in ratios.values())
    assert bench.memory_per_sample(1000) > 0.0


@pytest.mark.slow
def test_every_ratio_of_a_wide_log_is_measured() -> None:
    ratios = bench.log_ratios(UR5, samples=300, rounds=1)
    assert ratios.keys() < bench.RATIOS.keys()
    # Differences of commands of a second: of so short a log even the sign is chance.
    assert all(math.isfinite(value) for value in ratios.values())
