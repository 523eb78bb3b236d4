"""What other programs write of a log: bands and lists of contacts."""

from pathlib import Path

import numpy as np
import pytest

from vftcli.reproduction.manifest import read_list
from vftcli.reproduction.scoring import read_outside
from vftcli.signals.errors import LogError


@pytest.mark.parametrize("inner", ["", "mine/"])
def test_a_band_is_one_deviation_of_the_error(tmp_path: Path, inner: str) -> None:
    path = tmp_path / "a.csv"
    path.write_text(f"t,tau_ext/{inner}1,band/{inner}1\n0.0,1.0,0.5\n0.1,2.0,0.25\n")
    torque, wrench = read_outside(path, "mine")
    assert wrench is None
    assert torque.error_sd is not None
    assert np.array_equal(torque.error_sd[:, 0], [0.5, 0.25])


def test_a_list_needs_no_forces(tmp_path: Path) -> None:
    path = tmp_path / "a.contacts.csv"
    path.write_text("start_s,stop_s\n1,2.5\n")
    assert read_list(path) == [(1.0, 2.5, 0.0, 0.0, False)]
    path.write_text("start_s,stop_s,kind,peak_force_N,peak_force_band_N\n1,2,load,30,4\n3,4,,,\n")
    assert read_list(path) == [(1.0, 2.0, 30.0, 4.0, True), (3.0, 4.0, 0.0, 0.0, False)]


@pytest.mark.parametrize("text", ["start_s\n1\n", "start_s,stop_s,peak_force_N\n1,2,hard\n"])
def test_a_wrong_list_is_one_line(tmp_path: Path, text: str) -> None:
    path = tmp_path / "a.contacts.csv"
    path.write_text(text)
    with pytest.raises(LogError, match="a list has columns start_s, stop_s, peak_force_N"):
        read_list(path)
