"""Reference files: torques or a wrench beside a clock, found by name or described."""

import numpy as np
import pytest

from vftcli.readers.references import read_reference
from vftcli.signals.errors import ClockError, LogError


@pytest.fixture
def write(tmp_path):
    """Write a table of four rows under some names."""

    def made(*names, clock=(0.0, 0.1, 0.2, 0.3)):
        rows = [[t, *(t + k for k in range(1, len(names)))] for t in clock]
        text = "\n".join([",".join(names), *(",".join(map(str, row)) for row in rows)])
        path = tmp_path / "reference.csv"
        path.write_text(text + "\n", encoding="utf-8")
        return path

    return made


def test_torques_are_found_by_the_end_of_their_name(write):
    found = read_reference(write("t", "true_tau_ext_1", "true_tau_ext_2", "note"))
    np.testing.assert_allclose(found.stamps, [0.0, 0.1, 0.2, 0.3])
    np.testing.assert_allclose(found.signals["tau_ext"][:, 1], found.stamps + 2)
    assert "wrench" not in found.signals


def test_a_wrench_alone_is_a_reference_too(write):
    found = read_reference(write("t", "fx", "fy", "fz", "mx", "my", "mz"))
    np.testing.assert_allclose(found.signals["wrench"][:, 5], found.stamps + 6)
    assert "tau_ext" not in found.signals


def test_columns_are_scaled_as_described(write):
    found = read_reference(write("ms", "a", "b"), "t[ms]=ms,-tau_ext[mNm]=a|b")
    np.testing.assert_allclose(found.stamps, [0.0, 1e-4, 2e-4, 3e-4])
    np.testing.assert_allclose(found.signals["tau_ext"][0], [-1e-3, -2e-3])


@pytest.mark.parametrize(
    ("names", "said"),
    [
        (("t", "q_1"), "no column ends in tau_ext"),
        (("t", "a_tau_ext_1", "b_tau_ext_1"), "a_tau_ext and b_tau_ext"),
    ],
)
def test_torques_that_cannot_be_reported_are_refused(write, names, said):
    with pytest.raises(LogError, match=said):
        read_reference(write(*names))


def test_a_cell_without_a_number_is_named(write):
    path = write("t", "tau_ext_1", "tau_ext_2")
    path.write_text(path.read_text().replace("2.2", "nan"))
    with pytest.raises(LogError, match="tau_ext 2 is not a number in row 3"):
        read_reference(path)


def test_a_clock_that_stands_still_is_refused(write):
    with pytest.raises(ClockError):
        read_reference(write("t", "tau_ext_1", clock=(0.0, 0.1, 0.1, 0.2)))
