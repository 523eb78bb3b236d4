"""A Rerun recording: plots, words and arms in one file that opens arranged.

Every plot is one entity holding one scalar a line, on the timeline `t` in seconds from the log's
first sample; words are Markdown documents.
"""

import hashlib
import os
import unicodedata
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple
from uuid import UUID

import numpy as np

from vftcli.outputs.arm import ArmPoses, Capsule, capsules
from vftcli.outputs.files import one_line
from vftcli.outputs.palette import rgb
from vftcli.outputs.plots import Lines, Tab
from vftcli.robots.chain import Chain
from vftcli.signals.arrays import Array
from vftcli.signals.errors import OutputError

NEWTON_PER_METRE = 200.0
"""Length of the force arrow: 200 N are 1 m."""

LINK, JOINT, FORCE = "#b0b8c0", "#4e5c6a", "#dd6415"
"""Colours of links, joints and the force arrow."""

FOOTER, TRAILER = b"RRF2FOOT", 64
"""A whole recording has this mark in its last bytes."""

Stream = Any

SPELLED = {
    "ᵀ": "^T",
    "⁻": "^-",
    "√": "sqrt ",
    "≤": "<=",
    "≥": ">=",
    "≈": "~",
    "→": "->",
    "−": "-",
    "–": "-",
    "—": "-",
    "…": "...",
    "‘": "'",
    "’": "'",
    "“": '"',
    "”": '"',
    "∂": "d",
    "Σ": "sum ",
    "ẋ": "dx",
}
"""How to write what the viewer's font may lack."""


class ArmView(NamedTuple):
    """The space in which arms stand.

    Attributes:
        name: What it is called.
        poses: Where an arm has been, so that the eye sees all of it.
    """

    name: str
    poses: ArmPoses


@contextmanager
def rerun_file(
    path: Path,
    title: str,
    tabs: Sequence[Tab],
    words: Mapping[str, str],
    view: ArmView | None = None,
) -> Iterator[Stream]:
    """Write a recording with its plots and words; yield its stream, to draw arms into it.

    Args:
        path: Where to; an existing file is replaced.
        title: Name of the recording.
        tabs: The plots.
        words: Name of a document → its Markdown.
        view: Where arms will be drawn, None if there are none.

    Raises:
        OutputError: If the file is not whole in the end.
    """
    import rerun as rr

    # The same data make the same recording: no random id, and no time at which it was made.
    identity = recording_id(title, tabs, words)
    # Nor rows put together by how much time has gone by.
    untimed = rr.ChunkBatcherConfig.NEVER()
    stream = rr.RecordingStream(
        "vftcli", recording_id=identity, send_properties=False, batcher_config=untimed
    )
    stream.save(str(path), default_blueprint=blueprint(tabs, list(words), view))
    stream.send_recording_name(drawable(title))
    for tab in tabs:
        for lines in tab.plots:
            send_lines(stream, tab.t, lines)
    for name, text in words.items():
        document = rr.TextDocument(drawable(text), media_type="text/markdown")
        stream.log(f"/{name.lower()}", document, static=True)
    if view is not None:
        stream.log("/robot", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    yield stream
    finish(stream, path)


def recording_id(title: str, tabs: Sequence[Tab], words: Mapping[str, str]) -> UUID:
    """The identity of a recording: equal for equal data and words, which hold the logs' sha256.

    A viewer puts recordings of one identity into one; other gains on the same log make another.
    """
    found = hashlib.sha256("\0".join([title, *words, *words.values()]).encode("utf-8", "replace"))
    for tab in tabs:
        for lines in tab.plots:
            found.update("\0".join([lines.path, *(line.name for line in lines.lines)]).encode())
            found.update(lines.values.tobytes())
    return UUID(bytes=found.digest()[:16])


def finish(stream: Stream, path: Path) -> None:
    """Write what is still in memory, and the footer.

    Raises:
        OutputError: If the file is not whole: Rerun writes in a thread of its own.
    """
    try:
        stream.flush()
        stream.disconnect()
    except RuntimeError as error:
        raise OutputError(f"{path.name} cannot be written: {one_line(error)}") from None
    with path.open("rb") as file:
        file.seek(-min(TRAILER, path.stat().st_size), os.SEEK_END)
        # Rerun writes in a thread, whose error on a full disk reaches nobody.
        if FOOTER not in file.read():
            raise OutputError(f"{path.name} cannot be written whole: is the disk full?")


def blueprint(tabs: Sequence[Tab], words: Sequence[str], view: ArmView | None) -> Any:  # noqa: ANN401
    """How the recording opens: arms and words to the left, plots to the right."""
    import rerun.blueprint as rrb

    documents = [rrb.TextDocumentView(origin=f"/{name.lower()}", name=name) for name in words]
    left: Any = rrb.Tabs(*documents, active_tab=0) if len(documents) > 1 else documents[0]
    if view is not None:
        left = rrb.Vertical(arm_view(view), left, row_shares=[3, 2])
    plots = [grid_of(tab) for tab in tabs]
    shown = rrb.Horizontal(left, rrb.Tabs(*plots, active_tab=0), column_shares=[2, 5])
    return rrb.Blueprint(
        shown if plots else left,
        rrb.TimePanel(timeline="t", state="collapsed", play_state="paused"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.BlueprintPanel(state="collapsed"),
        auto_views=False,
        auto_layout=False,
    )


def arm_view(view: ArmView) -> Any:  # noqa: ANN401 - Rerun is untyped
    """The space with an eye that sees the base and all places where the links have been."""
    import rerun.blueprint as rrb

    corners = view.poses.translation.reshape(-1, 3)
    # The base stands at the origin and shall be seen too.
    low, high = np.minimum(corners.min(axis=0), 0.0), np.maximum(corners.max(axis=0), 0.0)
    centre, radius = 0.5 * (low + high), 0.5 * float(np.linalg.norm(high - low))
    eye = centre + 2.3 * radius * np.array([0.62, -0.66, 0.42])
    return rrb.Spatial3DView(
        origin="/robot",
        contents="/robot/**",
        name=view.name,
        eye_controls=rrb.EyeControls3D(position=eye.tolist(), look_target=centre.tolist()),
        line_grid=rrb.LineGrid3D(visible=True, spacing=0.1),
    )


def grid_of(tab: Tab) -> Any:  # noqa: ANN401 - Rerun is untyped
    """One tab, in two columns if there are many plots; the first one's legend holds for all."""
    import rerun.blueprint as rrb

    views = [
        rrb.TimeSeriesView(
            origin=lines.path,
            name=drawable(lines.title),
            plot_legend=rrb.PlotLegend(rrb.Corner2D.LeftTop, visible=k == 0),
            axis_x=rrb.archetypes.TimeAxis(link="LinkToGlobal"),
            axis_y=rrb.ScalarAxis(range=lines.ends),
        )
        for k, lines in enumerate(tab.plots)
    ]
    return rrb.Grid(*views, grid_columns=2 if len(views) > 3 else 1, name=tab.name)


def send_lines(stream: Stream, t: Array, lines: Lines) -> None:
    """Send one plot: names and colours once, then all samples in one batch."""
    import rerun as rr

    style = rr.SeriesLines(
        names=[drawable(line.name) for line in lines.lines],
        colors=[rgb(line.colour) for line in lines.lines],
        widths=[line.width for line in lines.lines],
        aggregation_policy=rr.components.AggregationPolicy.MinMax,  # an average hides spikes
    )
    stream.log(lines.path, style, static=True)
    values = lines.values
    counts = np.full(len(values), len(lines.lines))
    scalars = rr.Scalars.columns(scalars=values.ravel()).partition(counts)
    stream.send_columns(lines.path, [rr.TimeColumn("t", duration=t)], scalars)


def send_arm(
    stream: Stream, path: str, chain: Chain, poses: ArmPoses, ghost: tuple[int, ...] | None = None
) -> None:
    """Send an arm's shape once and its poses over time.

    A `ghost` is a see-through arm of this red, green, blue and opacity.
    """
    import rerun as rr

    time = rr.TimeColumn("t", duration=poses.t)
    for j, shapes in enumerate(capsules(chain)):
        link = f"{path}/link_{j}" if j else f"{path}/base"
        if shapes:
            stream.log(link, capsule_batch(shapes, ghost), static=True)
        if j:
            columns = rr.Transform3D.columns(
                translation=poses.translation[:, j - 1], quaternion=poses.quat_xyzw[:, j - 1]
            )
            stream.send_columns(link, [time], columns)


def capsule_batch(shapes: Sequence[Capsule], ghost: tuple[int, ...] | None) -> Any:  # noqa: ANN401
    """Capsules in the axes of the link they move with; Rerun's own lie along z from one end."""
    import rerun as rr

    directions = np.array([shape.direction for shape in shapes])
    lengths = np.linalg.norm(directions, axis=1)
    slimmer = 1.0 if ghost is None else 0.8  # ghosts that overlap are told apart
    return rr.Capsules3D(
        lengths=lengths,
        radii=[slimmer * shape.radius for shape in shapes],
        translations=np.array([shape.start for shape in shapes]),
        quaternions=[turn_from_z(d / s) for d, s in zip(directions, lengths, strict=True)],
        colors=[ghost or rgb(JOINT if shape.joint else LINK) for shape in shapes],
        fill_mode="solid",
    )


def turn_from_z(unit: Array) -> Array:
    """Quaternion (x, y, z, w) that turns z to a unit vector the short way. (4,)"""
    # Straight down every turn by half is as short; the formula below would divide by zero.
    if unit[2] < -1.0 + 1e-9:
        return np.array([1.0, 0.0, 0.0, 0.0])
    turn = np.array([-unit[1], unit[0], 0.0, 1.0 + unit[2]])
    turned: Array = turn / np.linalg.norm(turn)
    return turned


def send_force(
    stream: Stream, path: str, t: Array, origin: Array, force: Array, radius: float
) -> None:
    """Send an arrow over time; where the force is not known there is none.

    Args:
        stream: The recording.
        path: Entity of the arrow.
        t: Time. (S,) [s]
        origin: Where it acts, in base axes. (S, 3) [m]
        force: In base axes, NaN where not known. (S, 3) [N]
        radius: Of the arrow's shaft. [m]
    """
    import rerun as rr

    known = np.all(np.isfinite(force), axis=1)
    count = int(known.sum())
    columns = rr.Arrows3D.columns(
        origins=origin[known],
        vectors=force[known] / NEWTON_PER_METRE,
        radii=np.full(count, radius),
        colors=np.tile(np.array([*rgb(FORCE), 255], dtype=np.uint8), (count, 1)),
    ).partition(known.astype(int))
    stream.send_columns(path, [rr.TimeColumn("t", duration=t)], columns)


def drawable(text: str) -> str:
    """Text in Latin-1 and Greek; further accents are dropped, other letters become "?".

    The viewer stops at the first letter that its font lacks.
    """
    spelled = "".join(SPELLED.get(letter, letter) for letter in text)
    return "".join(letter_drawn(letter) for letter in spelled)


def letter_drawn(letter: str) -> str:
    """One letter if the font has it; else what it is made of, or "?"."""
    if letter == "\n" or has_glyph(letter) or "\u00a0" <= letter <= "\u00ff":
        return letter
    parts = [p for p in unicodedata.normalize("NFKD", letter) if not unicodedata.combining(p)]
    if unicodedata.combining(letter):
        return ""
    return "".join(part if has_glyph(part) else "?" for part in parts)


def has_glyph(letter: str) -> bool:
    """Whether a letter is plain ASCII or Greek."""
    return " " <= letter <= "~" or "\u0391" <= letter <= "\u03c9"
