"""Look and files of a figure for a paper: widths, type, equal bytes.

Nothing here loads matplotlib before a figure is drawn; it is an extra (``vftcli[figures]``).
"""

import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from itertools import product
from typing import TYPE_CHECKING, Any, NamedTuple

from vftcli.outputs.files import OutputFolder
from vftcli.signals.parsing import printable
from vftcli.signals.version import VERSION

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

WIDTHS = {"single": 3.5, "double": 7.16}  #: One and two columns of the IEEE's journals. [in]
RESOLUTION = 600  #: Of PNG: what the IEEE asks of drawings in black and white. [dots/in]

#: Times-like type of matplotlib itself: equal bytes on every machine.
#:
#: PDF embeds it as TrueType; SVG holds its letters as paths, which need no font. A dollar sign in a
#: log's name is a dollar sign.
STYLE = {
    "font.family": ["STIXGeneral", "DejaVu Sans"],
    "font.size": 8.0,
    "axes.labelsize": 8.0,
    "axes.titlesize": 8.0,
    "xtick.labelsize": 7.0,
    "ytick.labelsize": 7.0,
    "legend.fontsize": 7.0,
    "text.parse_math": False,
    "axes.linewidth": 0.5,
    "xtick.direction": "in",
    "ytick.direction": "in",
    "xtick.major.width": 0.5,
    "ytick.major.width": 0.5,
    "xtick.minor.width": 0.3,
    "ytick.minor.width": 0.3,
    "lines.linewidth": 0.8,
    "legend.frameon": False,
    "legend.handlelength": 2.4,
    "legend.columnspacing": 1.2,
    "legend.labelspacing": 0.3,
    "figure.constrained_layout.h_pad": 0.02,
    "figure.constrained_layout.w_pad": 0.02,
    "figure.constrained_layout.hspace": 0.03,
    "figure.constrained_layout.wspace": 0.03,
    "pdf.fonttype": 42,
    "svg.fonttype": "path",
    "svg.hashsalt": "vftcli",
}

#: Width of a letter in a legend, of a line's sample beside it, and height of its lines. [in]
LETTER, SAMPLE, LINE = 0.043, 0.41, 0.15
LONGEST = 44  #: Letters of a name in a figure; the end of a longer one is cut off.


class Drawing(NamedTuple):
    """A figure that can be drawn in both widths."""

    title: str  #: What it shows, with sign and frame, as its file says.
    #: Its width [in] → the figure; called where the style of a paper holds.
    draw: "Callable[[float], Figure]"


def figure_files(form: str | None, names: Sequence[str], before: str = "figures/") -> list[str]:
    """The files of these figures in both widths; none where no form is asked for."""
    if form is None:
        return []
    return [f"{before}{name}-{width}.{form}" for name, width in product(names, WIDTHS)]


def write_figures(
    folder: OutputFolder,
    drawings: Mapping[str, Drawing],
    form: str,
    before: str = "figures/",
) -> None:
    """Write figures in both widths."""
    for (name, drawing), (width, inches) in product(drawings.items(), WIDTHS.items()):
        with paper_style():
            path, about = folder / f"{before}{name}-{width}.{form}", metadata(form, drawing.title)
            drawing.draw(inches).savefig(path, format=form, dpi=RESOLUTION, metadata=about)


@contextmanager
def paper_style() -> Iterator[None]:
    """Let matplotlib draw as a paper asks, whatever its user's own settings are."""
    from matplotlib import style

    with style.context(["default", STYLE]), warnings.catch_warnings():
        # A log's name may hold letters that no font of a paper has.
        warnings.filterwarnings("ignore", message="Glyph .* missing from")
        yield


def metadata(form: str, title: str) -> dict[str, str | None]:
    """A file's metadata: no date and no machine, so that its bytes stay equal."""
    maker = f"vftcli {VERSION}"
    own: dict[str, dict[str, str | None]] = {
        "pdf": {"Creator": maker, "CreationDate": None},
        "svg": {"Creator": maker, "Date": None},
        "png": {"Software": maker},
    }
    return {"Title": printable(title)} | own[form]


def sheet(
    width: float, cells: int, columns: int, height: float, handles: "Mapping[str, Artist]"
) -> "tuple[Figure, NDArray[Any]]":
    """A figure with room for so many plots, row by row, and one legend above all of them.

    Width, and height of a row, are in inches; the legend has a handle a name, if any.
    """
    from matplotlib.figure import Figure

    rows, lines = -(-cells // columns), 0
    if handles:
        widest = SAMPLE + LETTER * max(map(len, handles))
        lines = -(-len(handles) // max(int(width / widest), 1))
    above = LINE * lines + 0.05 * bool(lines)
    figure = Figure(figsize=(width, rows * height + above + 0.22), layout="constrained")
    if handles:
        # As many columns as rows of about one length need.
        columns_of_names = -(-len(handles) // lines)
        names, drawn = list(handles), list(handles.values())
        figure.legend(drawn, names, loc="outside upper center", ncols=columns_of_names)
    return figure, figure.subplots(rows, columns, squeeze=False).ravel()


def shortened(name: str) -> str:
    """A name as a figure has room for it."""
    text = printable(name)
    return text if len(text) <= LONGEST else f"{text[: LONGEST - 1]}…"
