from typing import Any

import pytest

from vftcli.outputs.identification import IDENTIFICATION_FIGURES, identification_figures
from vftcli.outputs.paper import WIDTHS, paper_style

pytest.importorskip("matplotlib", reason="no figure is drawn without matplotlib")


def test_torque_measured_and_predicted_and_what_is_left(found: Any) -> None:
    identified, _ = found
    drawings = identification_figures(identified)
    assert list(drawings) == list(IDENTIFICATION_FIGURES)
    with paper_style():
        torque, left = (drawings[n].draw(WIDTHS["double"]) for n in IDENTIFICATION_FIGURES)
        torque.draw_without_rendering()
        left.draw_without_rendering()
    named = [text.get_text() for text in torque.legends[0].get_texts()]
    assert named == ["measured", "predicted"]
    assert {axes.get_ylabel() for axes in left.axes} == {"Residual rms (N·m)"}
    rows = identified.residuals.filter(identified.residuals["joint"] == 1)
    dots = [container.lines[0].get_ydata()[0] for container in left.axes[0].containers]
    assert sorted(dots) == pytest.approx(sorted(rows["rms_Nm"]))


def test_without_logs_there_is_nothing_to_draw(found: Any) -> None:
    identified, _ = found
    bare = identified._replace(traces=(), residuals=identified.residuals.clear())
    assert identification_figures(bare) == {}
