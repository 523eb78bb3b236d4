from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from vftcli.admittance.replay import Replay
from vftcli.outputs.admittance import REPLAY_FIGURES, replay_figures
from vftcli.outputs.paper import WIDTHS, paper_style

pytest.importorskip("matplotlib", reason="no figure is drawn without matplotlib")


def drawn(replay: Replay, width: str) -> Any:
    found = replay_figures(replay)
    assert list(found) == list(REPLAY_FIGURES)
    with paper_style():
        figure = found["release"].draw(WIDTHS[width])
        figure.draw_without_rendering()
    return figure


@pytest.mark.parametrize("width", WIDTHS)
def test_a_release_is_one_plot_of_its_axis_with_a_line_a_controller(
    release: Replay, width: str
) -> None:
    figure = drawn(release, width)
    (axes,) = figure.axes
    assert axes.get_ylabel() == "x (m)"
    assert axes.get_xlabel() == "Time (s)"
    names = [controller.name for controller in release.controllers]
    assert [text.get_text() for text in figure.legends[0].get_texts()] == names
    first = axes.lines[0]
    assert first.get_ydata()[0] == pytest.approx(0.1)
    np.testing.assert_array_equal(first.get_ydata(), release.motion.x[:, 0, 0])


def test_a_push_has_its_force_above_with_the_threshold(push: Replay) -> None:
    figure = drawn(push, "single")
    assert [axes.get_ylabel() for axes in figure.axes] == ["y (N)", "y (m)"]
    assert [axes.get_xlabel() for axes in figure.axes] == ["", "Time (s)"]
    levels = {line.get_ydata()[0] for line in figure.axes[0].lines if len(line.get_ydata()) == 2}
    assert levels == {20.0, -20.0}
    assert "± threshold" in [text.get_text() for text in figure.legends[0].get_texts()]


def test_what_never_moved_is_not_drawn(release: Replay) -> None:
    still = release.motion._replace(x=np.zeros_like(release.motion.x))
    assert replay_figures(replace(release, motion=still, drags=())) == {}
    both = np.array(release.motion.x)
    both[:, :, 4] = both[:, :, 0]
    tilted = replace(release, motion=release.motion._replace(x=both), drags=())
    assert [axes.get_ylabel() for axes in drawn(tilted, "single").axes] == ["x (m)", "ry (rad)"]
