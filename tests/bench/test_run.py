"""The developers' bars can be measured: every part runs, on a log far too short to time."""

import importlib.util
from pathlib import Path

import pytest

from vftcli.robots import load_robot

spec = importlib.util.spec_from_file_location("bench", Path(__file__).with_name("run.py"))
assert spec is not None
assert spec.loader is not None
bench = importlib.util.module_from_spec(spec)
spec.loader.exec_module(bench)


@pytest.mark.slow
def test_every_ratio_is_measured(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bench, "SCRIPT_SAMPLES", 50)
    ratios = bench.measured(load_robot("ur5"), samples=1200, rounds=1, long=1000)
    assert ratios.keys() == bench.RATIOS.keys()
    assert all(value > 0.0 for value in ratios.values())
