"""The wrench of a log: what it states of its frame, and what is known of its samples."""

import numpy as np
import pytest

from vftcli.signals.errors import ParameterError, ShapeError
from vftcli.signals.wrench import FRANKA_FRAME, Wrench, WrenchFrame


@pytest.mark.parametrize(
    ("text", "frame"),
    [
        ("base", WrenchFrame("base", "flange")),
        ("sensor", WrenchFrame("sensor", "sensor")),
        ("tool", WrenchFrame("tool", "tool")),
        ("base@tool", WrenchFrame("base", "tool")),
        (" base@base , by-robot ", FRANKA_FRAME),
        ("ft_link,on-robot", WrenchFrame("ft_link", "ft_link")),
    ],
)
def test_a_frame_is_read_and_written(text: str, frame: WrenchFrame) -> None:
    assert WrenchFrame.parsed(text) == frame
    assert WrenchFrame.parsed(frame.notation) == frame


@pytest.mark.parametrize("text", ["", "base@", "@tool", "base axes", "base,turned", "base@a b"])
def test_what_is_no_frame(text: str) -> None:
    with pytest.raises(ParameterError, match=r"not AXES\[@POINT\]"):
        WrenchFrame.parsed(text)


@pytest.mark.parametrize("notation", ["base axes, moment about the flange point", "", None])
def test_a_converted_log_of_an_earlier_version_states_no_frame(notation: object) -> None:
    assert WrenchFrame.of_conversion(notation) is None
    assert WrenchFrame.of_conversion("base@tool") == WrenchFrame("base", "tool")


def test_a_frame_in_words_and_the_factor_to_force_on_the_robot() -> None:
    words = "base axes at the base's origin, as force BY the robot ON the environment"
    assert str(FRANKA_FRAME) == words
    tool = WrenchFrame("base", "tool")
    assert str(tool) == "base axes at the tool's point, as force on the robot"
    assert (FRANKA_FRAME.factor, tool.factor) == (-1.0, 1.0)


def wrench(masked: np.ndarray | None = None) -> Wrench:
    values = np.arange(24.0).reshape(4, 6)
    t = np.arange(4.0)
    return Wrench(name="x", t=t, values=values, frame="base", sd=values, masked=masked)


def test_hidden_samples_are_not_known() -> None:
    """Without a mask all is; it has one entry a sample."""
    found = wrench(np.array([False, True, False, False]))
    assert np.isnan(found.known[1]).all()
    assert np.isnan(found.force[1]).all()
    assert np.isnan(dict(found.columns())["wrench_sd/x/fz"][1])
    np.testing.assert_array_equal(found.moment[2], [15, 16, 17])
    np.testing.assert_array_equal(found.between(0.5, 2.0), [found.values[2]])
    assert not wrench().hidden.any()
    with pytest.raises(ShapeError, match="masked of x"):
        wrench(np.zeros(3, dtype=bool))


def test_the_size_of_a_force_has_the_deviation_along_it() -> None:
    """(3, 0, 4) N: sd = √((.6 · 1)² + (.8 · 2)²); no force: the largest; hidden: unknown."""
    values, t = np.zeros((3, 6)), np.arange(3.0)
    values[0, [0, 2]] = 3.0, 4.0
    sd, masked = np.tile([1.0, 5.0, 2.0, 9.0, 9.0, 9.0], (3, 1)), np.array([False, False, True])
    wrench = Wrench(name="best", t=t, values=values, frame="flange", sd=sd, masked=masked)
    np.testing.assert_allclose(wrench.size, [5.0, 0.0, np.nan])
    assert wrench.size_sd is not None
    # rounding
    np.testing.assert_allclose(wrench.size_sd, [np.hypot(0.6, 1.6), 5.0, np.nan], rtol=1e-12)
    assert Wrench(name="gmo", t=t, values=values, frame="flange").size_sd is None
