"""A Rerun recording: plots, words and the arm in one file that opens arranged.

Every plot is a chart of one panel and one entity, its key, with one scalar
per line, on the timeline `t` in seconds from the log's first sample. A contact's
arrow is at its place while it lasts; the touched links have its colour.
"""

import hashlib
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple
from unicodedata import combining, normalize
from uuid import UUID

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from vftcli.contacts.contact_list import ContactList
from vftcli.outputs.charts import GREY, INK, PLACES, REFERENCE, Chart, ChartLine, level_rows
from vftcli.outputs.files import writing
from vftcli.outputs.shapes import capsules, touched_point
from vftcli.robots.chain import Chain, link_poses
from vftcli.robots.meshes import COLOURED, FORMATS, collada
from vftcli.robots.robot import Mesh, Robot
from vftcli.signals.arrays import Array
from vftcli.signals.pose import matrix_quaternion, rotation_onto

Stream = rr.RecordingStream  #: A recording in the making.
Packed = NDArray[np.uint32]  #: Colours in Rerun's form.
#: When a link's colour changes [s] → ``#rrggbb``, "" for its own.
Changes = Mapping[float, str]

ROBOT, CONTACTS = "/robot", "/contacts"  #: Roots of the arm and of the contacts, by number.
RATE = 50.0  #: Drawn poses a second. [Hz]
MOST_POSES = 20_000
NEWTON_PER_METRE = 200.0  #: Default scale of a force arrow: 200 N are 1 m.
#: Colours of links, joints and the force arrow.
LINK, JOINT, FORCE = "#b0b8c0", "#4e5c6a", "#dd6415"
#: Lengths that a force arrow may have. [N/m]
SCALES = (5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0, 1000.0, 2000.0)
SHAFT = 0.012  #: Radius of a force arrow. [m]
LONGEST = 0.5  #: Longest arrow, that of the hardest force. [m]


class ArmPoses(NamedTuple):
    """Poses of the links over time."""

    t: Array  #: Time. (S,) [s]
    translation: Array  #: Origins in the base frame, the flange last. (S, n+1, 3) [m]
    quat_xyzw: Array  #: Orientations as unit quaternions. (S, n+1, 4)
    q: Array  #: Joint positions. (S, n) [rad]


def rgba(*colours: str) -> Packed:
    """Colours as 0xRRGGBBAA: [r, g, b] is three colours to Rerun 0.30."""
    return np.array([int(f"{colour[1:]}ff", 16) for colour in colours], dtype=np.uint32)


def motion(chain: Chain, t: Array, q: Array) -> ArmPoses:
    """Poses of all links at about `RATE` Hz, at most `MOST_POSES`."""
    # A slow log is drawn as it is.
    every = max(1, int(len(t) / max(float(t[-1] - t[0]) * RATE, 1.0)), -(-len(t) // MOST_POSES))
    t, q = t[::every], np.ascontiguousarray(q[::every])
    poses = link_poses(chain, q)
    return ArmPoses(t, poses.translation, xyzw(poses.rotation), q)


def xyzw(rotation: Array) -> Array:
    """Quaternions of rotation matrices, the scalar last. (…, 4)"""
    return np.roll(matrix_quaternion(rotation), -1, axis=-1)


def arrow_scale(found: ContactList | None) -> float:
    """Newtons of 1 m of arrow, to see the hardest force. [N/m]"""
    if found is None or (hardest := found.hardest) is None:
        return NEWTON_PER_METRE
    force = hardest.peak_force or NEWTON_PER_METRE
    return next((scale for scale in SCALES if force <= LONGEST * scale), SCALES[-1])


def send_arm(
    stream: Stream, robot: Robot, poses: ArmPoses, painted: Mapping[int, Changes]
) -> None:
    """Send the arm's shape, its poses and its changes of colour."""
    time = rr.TimeColumn("t", duration=poses.t)
    for j, shapes in enumerate(capsules(robot.chain)):
        link = f"{ROBOT}/link_{j}" if j else f"{ROBOT}/base"
        meshes = [mesh for mesh in robot.meshes if mesh.link == j]
        changes = {float(poses.t[0]): "", **painted[j]} if j in painted else {}
        if not send_meshes(stream, link, meshes, changes) and shapes:
            # Rerun's own capsules are along z from one end.
            turns = np.array([rotation_onto(shape.direction) for shape in shapes])
            batch = rr.Capsules3D(
                lengths=[np.linalg.norm(shape.direction) for shape in shapes],
                radii=[shape.radius for shape in shapes],
                translations=np.array([shape.start for shape in shapes]),
                quaternions=xyzw(turns),
                fill_mode="solid",
            )
            stream.log(link, batch, static=True)
            own = rgba(*(JOINT if shape.kind == "joint" else LINK for shape in shapes))
            send_colours(stream, link, own, changes)
        if j:
            columns = rr.Transform3D.columns(
                translation=poses.translation[:, j - 1], quaternion=poses.quat_xyzw[:, j - 1]
            )
            stream.send_columns(link, [time], columns)


def send_meshes(stream: Stream, link: str, meshes: Sequence[Mesh], changes: Changes) -> bool:
    """Send the meshes of a link; whether it has any, and all."""
    found = [(mesh, mesh.file) for mesh in meshes if mesh.file is not None]
    try:
        contents = [collada(file.read_bytes()) for _, file in found]
    except OSError:  # gone since the robot was loaded
        return False
    for k, (mesh, file) in enumerate(found):
        path, ending = f"{link}/mesh_{k}", file.suffix.lower()
        asset = rr.Asset3D(contents=contents[k][0], media_type=FORMATS[ending])
        shape = mesh.pose.rotation * mesh.scale * contents[k][1]
        place = rr.Transform3D(translation=mesh.pose.translation, mat3x3=shape)
        stream.log(path, asset, place, static=True)
        own = rgba(*() if ending in COLOURED else (LINK,))
        send_colours(stream, path, own, changes, mesh=True)
    return 0 < len(found) == len(meshes)


def send_colours(
    stream: Stream, path: str, own: Packed, changes: Changes, *, mesh: bool = False
) -> None:
    """Send the colours of shapes: their own, and changes."""
    kind, field = (rr.Asset3D, "albedo_factor") if mesh else (rr.Capsules3D, "colors")
    given: dict[str, Any] = {field: own}
    if not changes:
        if len(own):  # else those in a mesh's file show
            stream.log(path, kind.from_fields(**given), static=True)
        return
    count, times = max(len(own), 1), sorted(changes)
    colours = [rgba(*[changes[t]] * count) if changes[t] else own for t in times]
    given[field] = np.concatenate(colours)
    columns = kind.columns(**given).partition([*map(len, colours)])
    stream.send_columns(path, [rr.TimeColumn("t", duration=times)], columns)


def painted_links(found: ContactList, joints: int) -> dict[int, dict[float, str]]:
    """Number of a touched link → changes of its colour."""
    spans: dict[int, dict[float, str]] = {}
    for c in found.contacts:
        for link in {place or joints for place in c.places}:
            spans.setdefault(link, {}).update({c.start: PLACES[c.where], c.stop: ""})
    return spans


def send_force(
    stream: Stream,
    path: str,
    t: Array,
    origin: Array,
    force: Array,
    *,
    scale: float = NEWTON_PER_METRE,
    colour: str = FORCE,
) -> None:
    """Send an arrow over time, none where the force is unknown.

    `origin` [m] and `force` [N] are in base axes, (S, 3); `scale` newtons are 1 m.
    """
    known = np.all(np.isfinite(force), axis=1)
    count = int(known.sum())
    columns = rr.Arrows3D.columns(
        origins=origin[known],
        vectors=force[known] / scale,
        radii=np.full(count, SHAFT),
        colors=np.repeat(rgba(colour), count),
    ).partition(known.astype(int))
    stream.send_columns(path, [rr.TimeColumn("t", duration=t)], columns)


def send_contacts(
    stream: Stream, found: ContactList, poses: ArmPoses, force: Array | None, scale: float
) -> None:
    """Send the arrow of each contact, while it lasts; `scale` newtons are 1 m.

    On the wrist it is `force`, that of `best` at these poses in base axes [N], (S, 3);
    elsewhere, where the flange's would be wrong, that of the contact's peak.
    """
    for contact in found.contacts:
        if contact.wrench is None:
            continue
        first = int(np.searchsorted(poses.t, contact.start))
        # One more: the first pose after the contact ends the arrow.
        rows = slice(first, int(np.searchsorted(poses.t, contact.stop, side="right")) + 1)
        t, origin = poses.t[rows], touched_point(contact, poses.translation[rows])
        arrows = np.tile(contact.wrench[:3], (len(t), 1))
        if force is not None and contact.where == "wrist":
            arrows = np.where(np.isfinite(force[rows]), force[rows], arrows)
        arrows[t > contact.stop] = np.nan
        path, colour = f"{CONTACTS}/{contact.number}", PLACES[contact.where]
        send_force(stream, path, t, origin, arrows, scale=scale, colour=colour)


#: Begin of a bar's name; ends of band edges' names.
BAR, EDGES = "touched: ", ("95 % upper", "95 % lower")


class LogLine(NamedTuple):
    """One line of a text log."""

    path: str
    t: float  #: When. [s]
    text: str
    colour: str  #: ``#rrggbb``.
    level: str = "INFO"  #: INFO, WARN or ERROR.


class Tab(NamedTuple):
    """Plots shown together."""

    name: str
    plots: list[Chart]  #: Of one panel each; lines with places of their own are points.
    log: Sequence[LogLine] = ()  #: A text log below them, or none.


def lines_of(plot: Chart) -> list[ChartLine]:
    """The lines of a plot, without its points."""
    return [line for line in plot.series if line.x is None]


def thinned(plot: Chart, stretches: int, whole: Sequence[tuple[float, float]]) -> Chart:
    """The plot with the samples of `level_rows`."""
    lines = [column for line in lines_of(plot) for column in line.values.T]
    rows = level_rows(plot.x, lines, stretches, whole)
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
    # Equal data make equal recordings: no random id, no time of writing.
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

    No file can set Rerun's time cursor: it opens at the first sample.
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
    """One tab, in two columns if it has many plots."""
    # Plots of a family, else of a unit, share their vertical ends.
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
    """Send one plot: names and colours, all samples, its points."""
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
