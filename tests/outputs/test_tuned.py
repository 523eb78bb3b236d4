from pathlib import Path

import numpy as np
import pytest

from vftcli.observers.spectra import Spectra
from vftcli.observers.tuning import Tuned, parse_goal, tune_all, tuning_curves
from vftcli.outputs.figures import TUNED_FIGURES, tuned_figures, write_tuned
from vftcli.outputs.paper import WIDTHS, figure_files, paper_style
from vftcli.signals.errors import OutputError

pytest.importorskip("matplotlib", reason="no figure is drawn without matplotlib")


@pytest.fixture(scope="module")
def spectra() -> Spectra:
    """Torque that falls with f⁻⁴ from 1 Hz over white noise, on two joints of different size."""
    f = np.linspace(0.0, 62.5, 251)
    torque = np.outer(1.0 / (1.0 + f**4), [10.0, 1.0])
    noise = np.full((251, 2), 1e-3)
    return Spectra(frequency=f, free=noise, loaded=noise + torque, step=0.008, segments=(9, 9))


@pytest.fixture(scope="module")
def tuned(spectra: Spectra) -> tuple[Tuned, ...]:
    return tune_all(spectra, parse_goal("auto"))


@pytest.mark.slow
def test_spectra_bear_every_response_and_curves_what_was_chosen(
    spectra: Spectra, tuned: tuple[Tuned, ...]
) -> None:
    found = tuned_figures(spectra, tuned)
    assert list(found) == list(TUNED_FIGURES)
    with paper_style():
        first, second = (drawing.draw(WIDTHS["single"]) for drawing in found.values())
        first.draw_without_rendering()
        second.draw_without_rendering()
    named = [text.get_text() for text in first.legends[0].get_texts()]
    assert named[2:] == [f"|H| of {line.observer}" for line in tuned]
    assert first._supylabel.get_text() == "Power density (dB of 1 (N·m)²/Hz)"
    gmo = second.axes[1].lines[3 + 1]
    assert gmo.get_xdata()[0] == pytest.approx(tuned[1].rate[1] / (2.0 * np.pi))
    assert gmo.get_ydata()[0] == pytest.approx(tuned[1].rmse[1])


def test_the_least_of_a_curve_is_what_is_chosen_for_the_smallest_error(
    spectra: Spectra, tuned: tuple[Tuned, ...]
) -> None:
    curves = tuning_curves(spectra)
    for line, name in ((tuned[1], "fdo, gmo"), (tuned[2], "kfo-zoh"), (tuned[3], "kfo-rts")):
        np.testing.assert_array_equal(curves[name].best, line.rate)
        # Both sum the same spectra, in another order.
        np.testing.assert_allclose(curves[name].least, line.rmse, rtol=1e-12)


@pytest.mark.slow
def test_gains_and_figures_appear_together(
    spectra: Spectra, tuned: tuple[Tuned, ...], tmp_path: Path
) -> None:
    path = tmp_path / "gains.toml"
    write_tuned(path, ["why"], spectra, tuned)
    alone = path.read_text(encoding="utf-8")
    assert alone.startswith("# why\n")
    with pytest.raises(OutputError, match="exists"):
        write_tuned(path, ["why"], spectra, tuned, form="svg")
    assert [p.name for p in tmp_path.iterdir()] == ["gains.toml"]
    write_tuned(path, ["why"], spectra, tuned, force=True, form="svg")
    assert path.read_text(encoding="utf-8") == alone
    wanted = {"gains.toml", *figure_files("svg", TUNED_FIGURES, "gains-")}
    assert {p.name for p in tmp_path.iterdir()} == wanted
