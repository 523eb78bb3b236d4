"""Files beside a log: references, what other programs write of it, estimates read again."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from vftcli.readers.references import (
    estimates_columns,
    read_list,
    read_outside,
    read_reference,
)
from vftcli.signals.errors import ClockError, LogError


@pytest.fixture
def write(tmp_path: Path) -> Callable[..., Path]:

    def made(*names: str, clock: tuple[float, ...] = (0.0, 0.1, 0.2, 0.3)) -> Path:
        rows = [[t, *(t + k for k in range(1, len(names)))] for t in clock]
        text = "\n".join([",".join(names), *(",".join(map(str, row)) for row in rows)])
        path = tmp_path / "reference.csv"
        path.write_text(text + "\n", encoding="utf-8")
        return path

    return made


def test_torques_are_found_by_the_end_of_their_name_and_a_wrench_alone_is_enough(write):
    found = read_reference(write("t", "true_tau_ext_1", "true_tau_ext_2", "note"))
    np.testing.assert_allclose(found.stamps, [0.0, 0.1, 0.2, 0.3])
    np.testing.assert_allclose(found.signals["tau_ext"][:, 1], found.stamps + 2)
    assert "wrench" not in found.signals
    found = read_reference(write("t", "fx", "fy", "fz", "mx", "my", "mz"))
    np.testing.assert_allclose(found.signals["wrench"][:, 5], found.stamps + 6)
    assert "tau_ext" not in found.signals


def test_columns_are_scaled_as_described(write):
    found = read_reference(write("ms", "a", "b"), "t[ms]=ms,-tau_ext[mNm]=a|b")
    np.testing.assert_allclose(found.stamps, [0.0, 1e-4, 2e-4, 3e-4])
    np.testing.assert_allclose(found.signals["tau_ext"][0], [-1e-3, -2e-3])


def test_what_cannot_be_reported_a_cell_without_a_number_and_a_standing_clock_are_refused(write):
    for names, said in (("q_1", "no column ends in tau_ext"),
                        ("a_tau_ext_1 b_tau_ext_1", "a_tau_ext and b_tau_ext")):  # fmt: skip
        with pytest.raises(LogError, match=said):
            read_reference(write("t", *names.split()))
    path = write("t", "tau_ext_1", "tau_ext_2")
    path.write_text(path.read_text().replace("2.2", "nan"))
    with pytest.raises(LogError, match="tau_ext 2 is not a number in row 3"):
        read_reference(path)
    with pytest.raises(ClockError):
        read_reference(write("t", "tau_ext_1", clock=(0.0, 0.1, 0.1, 0.2)))


@pytest.mark.parametrize("inner", ["", "mine/"])
def test_a_band_is_one_deviation_of_the_error(tmp_path, inner):
    path = tmp_path / "a.csv"
    path.write_text(f"t,tau_ext/{inner}1,band/{inner}1\n0.0,1.0,0.5\n0.1,2.0,0.25\n")
    found = read_outside(path, "mine")
    assert found.signals.keys() == {"tau_ext", "band"}
    assert np.array_equal(found.signals["band"][:, 0], [0.5, 0.25])
    np.testing.assert_allclose(found.stamps, [0.0, 0.1])


def test_a_list_needs_no_forces(tmp_path):
    path = tmp_path / "a.contacts.csv"
    path.write_text("start_s,stop_s\n1,2.5\n")
    assert read_list(path) == [(1.0, 2.5, 0.0, 0.0, False)]
    path.write_text("start_s,stop_s,kind,peak_force_N,peak_force_band_N\n1,2,load,30,4\n3,4,,,\n")
    assert read_list(path) == [(1.0, 2.0, 30.0, 4.0, True), (3.0, 4.0, 0.0, 0.0, False)]
    for text in ("start_s\n1\n", "start_s,stop_s,peak_force_N\n1,2,hard\n"):
        path.write_text(text)
        with pytest.raises(LogError, match="a list has columns start_s, stop_s, peak_force_N"):
            read_list(path)


def test_the_columns_of_an_observer_are_reported_of_our_own_files_alone(tmp_path):
    path = tmp_path / "x"
    path.write_text("t,q1\n0,0\n", encoding="utf-8")
    assert estimates_columns(path, "gmo") is None
    columns = {"t": [0.0], "q/1": [0.0]}
    pl.DataFrame(columns).write_parquet(path)
    assert estimates_columns(path, "gmo") is None
    pl.DataFrame(columns | {"tau_ext/gmo/1": [1.0]}).write_parquet(path)
    assert estimates_columns(path, "gmo") == "t=t,q=q/{i},tau_ext=tau_ext/gmo/{i}"
    with pytest.raises(LogError, match="it holds gmo"):
        estimates_columns(path, "fdo")
