"""Table II's ratios come from parts that are all there."""

import pytest

from vftcli.reproduction import timing
from vftcli.reproduction.paper import AS_PRINTED, CORRECTED


def test_every_observer_has_its_time_with_the_dynamics_in_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(timing, "SCRIPT_SAMPLES", 50)
    monkeypatch.setattr(timing, "SAMPLES", 400)
    monkeypatch.setattr(timing, "ROUNDS", 1)
    values = timing.computing_time(0).values
    for variant in (AS_PRINTED, CORRECTED):
        seconds = {name: values[f"seconds/{name}"][variant] for name in timing.PAPER}
        assert all(value > 0.0 for value in seconds.values())
        assert values["zoh/fdo"][variant] == seconds["kfo-zoh"] / seconds["fdo"]
        assert values["cost/gmo"][variant] == pytest.approx(1e6 * seconds["gmo"] / 400)
