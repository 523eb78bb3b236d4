"""ObserverChoice: which observers, and whose gains go before whose."""

from pathlib import Path

import numpy as np
import pytest

from vftcli.observers import DEFAULT
from vftcli.observers.choice import ObserverChoice
from vftcli.robots import load_robot
from vftcli.signals.errors import ParameterError

UR5 = load_robot("ur5")
STEP = 0.008


def gain(choice: ObserverChoice) -> float:
    """The momentum observer's gain on joint 1. [1/s]"""
    return float(choice.build(UR5, STEP)[0][0].gain[0])


def test_nothing_said_runs_the_paper_s_four() -> None:
    assert ObserverChoice.parsed() == ObserverChoice()
    assert [o.name for o in ObserverChoice().build(UR5, STEP)[0]] == list(DEFAULT)


def test_set_goes_before_a_file_and_a_file_before_the_robot(tmp_path: Path) -> None:
    file = tmp_path / "gains.toml"
    file.write_text("[observers.gmo]\ngain = 21.0\n", encoding="utf-8")
    own = gain(ObserverChoice(names=("gmo",)))
    assert own == np.atleast_1d(UR5.gains["gmo"]["gain"])[0]
    assert gain(ObserverChoice(names=("gmo",), gains_file=file)) == 21.0
    both = ObserverChoice.parsed(observer=["gmo"], gains_file=file, assignments=["gmo.gain=33"])
    assert gain(both) == 33.0


def test_a_file_leaves_what_it_does_not_name(tmp_path: Path) -> None:
    file = tmp_path / "gains.toml"
    file.write_text("[observers.gmo]\ngain = 21.0\n", encoding="utf-8")
    there = ObserverChoice(gains_file=file).gains_over(UR5.gains)
    assert there["kfo"] == UR5.gains["kfo"]
    assert UR5.gains["gmo"]["gain"] != 21.0


def test_a_match_moves_the_gains() -> None:
    matched = ObserverChoice.parsed(observer=["gmo"], match="delay=0.05")
    # First order: the delay behind a slow ramp is 1/K.
    assert gain(matched) == pytest.approx(20.0, rel=1e-9)


def test_only_observers_that_a_log_tunes_need_its_spectra() -> None:
    assert not ObserverChoice().from_spectra
    assert ObserverChoice(names=("gmo", "rts-auto")).from_spectra


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ({"observer": ["kalman"]}, "no observer 'kalman'; there is fdo, gmo"),
        ({"assignments": ["gmo"]}, "is not OBSERVER.PARAMETER=VALUE"),
        ({"assignments": ["gmo.gian=3"]}, "Did you mean gain"),
        ({"match": "speed=3"}, "is not delay=S"),
        ({"match": "delay=-1"}, "is not delay=S"),
    ],
)
def test_a_slip_is_refused_before_a_log_is_read(words: dict[str, object], message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        ObserverChoice.parsed(**words)
