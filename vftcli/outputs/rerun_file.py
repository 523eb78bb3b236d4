"""A Rerun recording: plots, words and the arm in one file that opens arranged.

Every plot is a chart of one panel and one entity, its key, holding one scalar a line, on
the timeline `t` in seconds from the log's first sample; words are Markdown documents.
"""

import hashlib
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple
from unicodedata import combining, normalize
from uuid import UUID

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from vftcli.outputs.charts import GREY, INK, REFERENCE, Chart, ChartLine, level_rows
from vftcli.outputs.files import writing
from vftcli.outputs.rerun_arm import CONTACTS, ROBOT, ArmPoses, Stream, rgba

#: Begin of a bar's name; ends of band edges' names.
BAR, EDGES = "touched: ", ("95 % upper", "95 % lower")


class LogLine(NamedTuple):
    """One line of a text log."""

    path: str  #: The entity.
    t: float  #: When. [s]
    text: str  #: The event.
    colour: str  #: ``#rrggbb``.
    level: str = "INFO"  #: INFO, WARN or ERROR.


class Tab(NamedTuple):
    """Plots shown together."""

    name: str  #: The tab's name.
    plots: list[Chart]  #: Of one panel each; lines with places of their own are points.
    log: Sequence[LogLine] = ()  #: A text log below them, or none.


def lines_of(plot: Chart) -> list[ChartLine]:
    """The lines of a plot, without its points."""
    return [line for line in plot.series if line.x is None]


def thinned(plot: Chart, stretches: int, whole: Sequence[tuple[float, float]]) -> Chart:
    """The plot with the samples of `level_rows`, or all if that saves nothing."""
    values = np.hstack([line.values for line in lines_of(plot)])
    rows = level_rows(plot.x, values, stretches, whole)
    if rows is None:
        return plot
    series = tuple(
        line._replace(values=line.values[rows]) if line.x is None else line
        for line in plot.series
    )
    return plot._replace(x=plot.x[rows], series=series)


@contextmanager
def rerun_file(
    path: Path,
    title: str,
    tabs: Sequence[Tab],
    words: Mapping[str, str],
    poses: ArmPoses,
    space: str,
) -> Iterator[Stream]:
    """Write a recording with plots and words; yields its stream, to draw the arm.

    Plots leave their tabs as they are sent, to save memory. `words` is name → Markdown of
    every document. The eye sees all `poses` of the arm, in a space of this name.
    """
    # Equal data make equal recordings: no random id, no time of writing, no batches by time.
    stream = rr.RecordingStream(
        "vftcli",
        recording_id=recording_id(title, tabs, words),
        send_properties=False,
        batcher_config=rr.ChunkBatcherConfig.NEVER(),
    )
    # Into memory: on a full disk Rerun's thread would never end.
    made = stream.memory_recording()
    # Active: a viewer in a browser ignores a default.
    stream.send_blueprint(blueprint(tabs, words, poses, space))
    stream.send_recording_name(drawable(title))
    for tab in tabs:
        while tab.plots:
            send_plot(stream, tab.plots.pop(0))
        # Each line to its entity, in the order of time.
        for entity in dict.fromkeys(line.path for line in tab.log):
            own = sorted(
                (line for line in tab.log if line.path == entity), key=lambda line: line.t
            )
            rows = rr.TextLog.columns(
                text=[drawable(line.text) for line in own],
                level=[line.level for line in own],
                color=rgba(*(line.colour for line in own)),
            )
            clock = rr.TimeColumn("t", duration=[line.t for line in own])
            stream.send_columns(entity, [clock], rows)
    for name, text in words.items():
        document = rr.TextDocument(drawable(text), media_type="text/markdown")
        stream.log(f"/{name.lower()}", document, static=True)
    stream.log(ROBOT, rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    yield stream
    with writing(Path(path.name)):
        path.write_bytes(made.drain_as_bytes())


def recording_id(title: str, tabs: Sequence[Tab], words: Mapping[str, str]) -> UUID:
    """A recording's identity: equal for equal data and words (with logs' sha256).

    A viewer merges recordings of one identity; other gains make another.
    """
    found = hashlib.sha256("\0".join([title, *words, *words.values()]).encode("utf-8", "replace"))
    for plot in (plot for tab in tabs for plot in tab.plots):
        found.update("\0".join([plot.key, *(line.name for line in plot.series)]).encode())
        for line in plot.series:
            found.update(line.values.tobytes())
    return UUID(bytes=found.digest()[:16])


def blueprint(
    tabs: Sequence[Tab], words: Mapping[str, str], poses: ArmPoses, space: str
) -> rrb.Blueprint:
    """The opening layout: the arm and words to the left, plots to the right, paused.

    The eye sees the base and all places of the links. No file can set Rerun's time cursor: it
    opens at the first sample, and a click on a time of the text log goes there.
    """
    corners = poses.translation.reshape(-1, 3)
    # The base at the origin must be visible too.
    low, high = np.minimum(corners.min(axis=0), 0.0), np.maximum(corners.max(axis=0), 0.0)
    centre, radius = 0.5 * (low + high), 0.5 * np.linalg.norm(high - low)
    eye = centre + 2.3 * radius * np.array([0.62, -0.66, 0.42])
    arm = rrb.Spatial3DView(
        origin=ROBOT,
        contents=[f"{ROBOT}/**", f"{CONTACTS}/**"],
        name=space,
        eye_controls=rrb.EyeControls3D(position=eye.tolist(), look_target=centre.tolist()),
        line_grid=rrb.LineGrid3D(visible=True, spacing=0.1),
    )
    documents = [rrb.TextDocumentView(origin=f"/{name.lower()}", name=name) for name in words]
    said = rrb.Tabs(*documents, active_tab=0) if len(documents) > 1 else documents[0]
    left = rrb.Vertical(arm, said, row_shares=[3, 2])
    return rrb.Blueprint(
        rrb.Horizontal(left, rrb.Tabs(*map(grid_of, tabs), active_tab=0), column_shares=[2, 5]),
        rrb.TimePanel(timeline="t", state="collapsed", play_state="paused"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.BlueprintPanel(state="collapsed"),
        auto_views=False,
        auto_layout=False,
    )


def grid_of(tab: Tab) -> rrb.Grid | rrb.Vertical:
    """One tab, in two columns if it has many plots; the first one has the legend."""
    # Plots of a family, else of a unit, share the ends of their vertical axes.
    kinds, views = [plot.families or plot.units for plot in tab.plots], []
    ends: dict[tuple[object, ...], tuple[float, float]] = {}
    for kind, (low, high) in zip(kinds, (plot.ends(0) for plot in tab.plots), strict=True):
        lowest, highest = ends.get(kind, (low, high))
        ends[kind] = min(low, lowest), max(high, highest)
    for k, (kind, plot) in enumerate(zip(kinds, tab.plots, strict=True)):
        low, high = ends[kind]
        # In small plots few ticks are labelled.
        span = f", {low:.3g} to {high:.3g}" if len(tab.plots) > 3 else ""
        # A legend covers a corner; with points the title is enough.
        named = k == 0 and len(lines_of(plot)) == len(plot.series)
        view = rrb.TimeSeriesView(
            origin=plot.key,
            name=drawable(f"{plot.title} [{plot.units[0]}]{span}"),
            plot_legend=rrb.PlotLegend(rrb.Corner2D.LeftTop, visible=named),
            axis_x=rrb.archetypes.TimeAxis(link="LinkToGlobal"),
            axis_y=rrb.ScalarAxis(range=(low, high)),
        )
        views.append(view)
    plots = rrb.Grid(*views, grid_columns=2 if len(views) > 3 else 1, name=tab.name)
    if not tab.log:
        return plots
    # The path repeats the words.
    shown = [rrb.components.TextLogColumn(kind) for kind in ("LogLevel", "Body")]
    columns = rrb.TextLogColumns(text_log_columns=shown)
    paths = dict.fromkeys(line.path for line in tab.log)
    log = rrb.TextLogView(origin="/", contents=[*paths], name="Log", columns=columns)
    return rrb.Vertical(plots, log, row_shares=[2, 1], name=tab.name)


def send_plot(stream: Stream, plot: Chart) -> None:
    """Send one plot: names and colours once, all samples in one batch, its points."""
    lines = lines_of(plot)
    # Thin edges, thick bars; then the reference, then the best.
    widths = [
        0.6 if line.name.endswith(EDGES)
        else 6.0 if line.name.startswith(BAR)
        else 2.5 if line.colour == REFERENCE
        else 2.0 if line.leads
        else 1.2
        for line in lines
    ]  # fmt: skip
    style = rr.SeriesLines(
        names=[drawable(line.name) for line in lines],
        colors=rgba(
            *(GREY if line.colour in {INK, REFERENCE} else line.colour for line in lines)
        ),
        widths=widths,
        aggregation_policy=rr.components.AggregationPolicy.MinMax,  # an average hides spikes
    )
    stream.log(plot.key, style, static=True)
    values = np.hstack([line.values for line in lines])
    scalars = rr.Scalars.columns(scalars=values.ravel()).partition(
        np.full(len(values), len(lines))
    )
    stream.send_columns(plot.key, [rr.TimeColumn("t", duration=plot.x)], scalars)
    for points in plot.series:
        if points.x is not None:
            path, name = f"{plot.key}/points", drawable(points.name)
            marks = rr.SeriesPoints(
                names=name, colors=rgba(points.colour), markers="diamond", marker_sizes=6.0
            )
            stream.log(path, marks, static=True)
            single = rr.Scalars.columns(scalars=points.values.ravel())
            stream.send_columns(path, [rr.TimeColumn("t", duration=points.x)], single)


#: Spelling of letters that the viewer's font may lack.
SPELLED = str.maketrans({
    "ᵀ": "^T", "⁻": "^-", "√": "sqrt ", "≤": "<=", "≥": ">=", "≈": "~", "→": "->", "−": "-",
    "–": "-", "—": "-", "…": "...", "‘": "'", "’": "'", "“": '"', "”": '"', "∂": "d",
    "Σ": "sum ", "ẋ": "dx",
})  # fmt: skip
LACKED = re.compile("[^\n -~\u00a0-\u00ff\u0391-\u03c9]")  #: Neither Latin-1 nor Greek.


def drawable(text: str) -> str:
    """Text in Latin-1 and Greek; other accents are dropped, other letters are "?".

    The viewer stops at the first letter that its font lacks.
    """
    apart = LACKED.sub(lambda found: normalize("NFKD", found[0]), text.translate(SPELLED))
    return LACKED.sub(lambda found: "" if combining(found[0]) else "?", apart)
