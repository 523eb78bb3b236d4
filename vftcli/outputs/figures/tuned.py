"""What `vftcli tune` writes: the gains, and figures of what they were chosen from."""

from collections.abc import Sequence
from pathlib import Path

from vftcli.observers.spectra import Spectra
from vftcli.observers.tuning import Tuned, tuning_curves
from vftcli.outputs.figures.paper import Drawing, figure_files, write_figures
from vftcli.outputs.files import OutputFolder, write_text
from vftcli.outputs.log.figures import spectra_drawing, tuning_drawing
from vftcli.robots.writing import lines_of

TUNED_FIGURES = ("spectra", "tuning")  #: Their names.


def tuned_figures(spectra: Spectra, tuned: Sequence[Tuned]) -> dict[str, Drawing]:
    """The spectra with |H| of every observer, and the expected error over each one's rate."""
    running = {line.observer: line.running for line in tuned if line.running is not None}
    chosen = {line.observer: (line.rate, line.rmse) for line in tuned}
    return {
        "spectra": spectra_drawing(spectra, running),
        "tuning": tuning_drawing(tuning_curves(spectra), chosen),
    }


def write_tuned(
    path: Path,
    heading: Sequence[str],
    spectra: Spectra,
    tuned: Sequence[Tuned],
    *,
    force: bool = False,
    form: str | None = None,
) -> None:
    """Write gains, and their figures beside them, all or nothing."""
    comments = "".join(f"# {line}\n" for line in heading)
    gains = {"observers": {line.section: dict(line.gains) for line in tuned}}
    text = comments + "".join(lines_of(gains))
    if form is None:
        write_text(path, text, force)
        return
    before = f"{path.stem}-"
    names = [path.name, *figure_files(form, TUNED_FIGURES, before)]
    with OutputFolder(path.parent, force, names) as folder:
        folder.write(path.name, text)
        write_figures(folder, tuned_figures(spectra, tuned), form, before)
