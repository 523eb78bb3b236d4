"""recording.rrd of an admittance replay: one ghost arm a controller, moving together."""

import gc
from pathlib import Path
from typing import Any

import numpy as np

from vftcli.admittance.parameters import AXES
from vftcli.admittance.replay import Replay
from vftcli.outputs.admittance.tables import comparison_text, parameter_text
from vftcli.outputs.arm import ArmPoses, Capsule, capsules, motion
from vftcli.outputs.log.rerun_blueprint import Scene, Tab, grid
from vftcli.outputs.log.rerun_recording import (
    ARM_RATE,
    NEWTON_PER_METRE,
    Lines,
    plot_of,
    scene_of,
    send_lines,
    turn_from_z,
)
from vftcli.outputs.log.rerun_text import drawable
from vftcli.outputs.palette import REFERENCE, SPARE, rgb
from vftcli.signals.arrays import Array
from vftcli.signals.wrench import unit_of

GHOST = 150
"""Opacity of a ghost arm, of 255."""

FORCE = "#dd6415"


def write_ghosts(path: Path, replay: Replay, title: str) -> None:
    """Write the recording with its blueprint, so that it opens arranged.

    Args:
        path: Where to; an existing file is replaced.
        replay: What to show.
        title: Name of the log.
    """
    import rerun as rr

    paint = colours(replay)
    poses = [
        motion(replay.robot.chain, replay.motion.t, replay.path.q[:, n], ARM_RATE)
        for n in range(len(replay.controllers))
    ]
    groups = line_groups(replay, paint)
    stream = rr.RecordingStream("vftcli")
    stream.save(str(path), default_blueprint=arrangement(groups, scene_of(poses[0])))
    stream.send_recording_name(drawable(f"{title}: admittance"))
    for lines in (lines for group in groups.values() for lines in group):
        send_lines(stream, replay.motion.t, lines)
    stream.log("/robot", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    for n, (pose, colour) in enumerate(zip(poses, paint, strict=True)):
        send_ghost(stream, replay, n, pose, colour)
    document = rr.TextDocument(drawable(words(replay)), media_type="text/markdown")
    stream.log("/summary", document, static=True)
    stream.flush()
    stream.disconnect()
    del stream
    gc.collect()  # the footer is written when the last reference goes


def colours(replay: Replay) -> list[str]:
    """Grey for the traditional controller, a colour for each variable one."""
    spare = iter(SPARE * len(replay.controllers))
    return [next(spare) if c.kind == "variable" else REFERENCE for c in replay.controllers]


def line_groups(replay: Replay, paint: list[str]) -> dict[str, list[Lines]]:
    """The plots, tab by tab: deviation and force of every axis."""
    names = [controller.name for controller in replay.controllers]
    widths = [1.5] * len(names)
    deviation = [
        Lines(
            f"/deviation/{axis}",
            f"{axis} deviation [{'m' if k < 3 else 'rad'}]",
            names,
            paint,
            widths,
            finite(replay.motion.x[:, :, k]),
        )
        for k, axis in enumerate(AXES)
    ]
    threshold = replay.parameters.threshold
    force = []
    for k, axis in enumerate(AXES):
        felt = np.append(replay.wrench[:, k], np.nan)
        bounds = [np.full(len(felt), sign * threshold[k]) for sign in (1.0, -1.0)]
        force.append(
            Lines(
                f"/force/{axis}",
                f"{axis} force on the robot [{unit_of(k)}]",
                ["force", "threshold", "− threshold"],
                [FORCE, REFERENCE, REFERENCE],
                [1.5, 1.0, 1.0],
                np.column_stack([felt, *bounds]),
            )
        )
    return {"Deviation": deviation, "Force": force}


def finite(values: Array) -> Array:
    """Values with NaN for what has run away."""
    return np.where(np.abs(values) < 1e6, values, np.nan)


def arrangement(groups: dict[str, list[Lines]], scene: Scene) -> Any:  # noqa: ANN401
    """The blueprint: arms and words to the left, plots to the right."""
    import rerun.blueprint as rrb

    view = rrb.Spatial3DView(
        origin="/robot",
        contents="/robot/**",
        name="One arm a controller",
        eye_controls=rrb.EyeControls3D(position=scene.eye, look_target=scene.centre),
        line_grid=rrb.LineGrid3D(visible=True, spacing=0.1),
    )
    words_view = rrb.TextDocumentView(origin="/summary", name="Summary")
    tabs = [Tab(name, tuple(plot_of(lines) for lines in group)) for name, group in groups.items()]
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Vertical(view, words_view, row_shares=[3, 2]),
            rrb.Tabs(*(grid(tab) for tab in tabs), active_tab=0),
            column_shares=[2, 3],
        ),
        rrb.TimePanel(timeline="t", state="collapsed", play_state="paused"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.BlueprintPanel(state="collapsed"),
        auto_views=False,
        auto_layout=False,
    )


def send_ghost(stream: Any, replay: Replay, n: int, poses: ArmPoses, colour: str) -> None:  # noqa: ANN401
    """One controller's arm over time, the path of its flange, and the force on it."""
    import rerun as rr

    base = f"/robot/{n}_{replay.controllers[n].name}".replace(" ", "")
    time = rr.TimeColumn("t", duration=poses.t)
    for j, shapes in enumerate(capsules(replay.robot.chain)):
        path = f"{base}/link_{j}"
        if shapes:
            stream.log(path, ghost_batch(shapes, colour), static=True)
        if j:
            columns = rr.Transform3D.columns(
                translation=poses.translation[:, j - 1], quaternion=poses.quat_xyzw[:, j - 1]
            )
            stream.send_columns(path, [time], columns)
    strip = rr.LineStrips3D([poses.translation[:, -1]], colors=[rgb(colour)], radii=[0.002])
    stream.log(f"{base}/path", strip, static=True)
    sampled = np.searchsorted(replay.motion.t, poses.t).clip(max=max(len(replay.wrench) - 1, 0))
    entered = (
        replay.phases.force[sampled, :3] if len(replay.wrench) else np.zeros((len(poses.t), 3))
    )
    columns = rr.Arrows3D.columns(
        origins=poses.translation[:, -1],
        vectors=entered / NEWTON_PER_METRE,
        radii=np.full(len(poses.t), 0.008),
        colors=np.tile(np.array([*rgb(FORCE), 255], dtype=np.uint8), (len(poses.t), 1)),
    )
    stream.send_columns(f"{base}/force", [time], columns)


def ghost_batch(shapes: list[Capsule], colour: str) -> Any:  # noqa: ANN401 - Rerun is untyped
    """Capsules in one see-through colour, in the axes of the link they move with."""
    import rerun as rr

    directions = np.array([shape.direction for shape in shapes])
    lengths = np.linalg.norm(directions, axis=1)
    return rr.Capsules3D(
        lengths=lengths,
        radii=[0.8 * shape.radius for shape in shapes],
        translations=np.array([shape.start for shape in shapes]),
        quaternions=[turn_from_z(d / s) for d, s in zip(directions, lengths, strict=True)],
        colors=[(*rgb(colour), GHOST)] * len(shapes),
        fill_mode="solid",
    )


def words(replay: Replay) -> str:
    """What is shown, in Markdown."""
    lines = [
        f"# Admittance replay: {replay.robot.title or replay.robot.name}",
        f"{replay.source}. {parameter_text(replay)}.",
        "",
        "Grey: traditional; colours: variable, see the legend of the plots. The orange arrow is "
        f"the force that enters the law; 1 m is {NEWTON_PER_METRE:g} N.",
        "",
        *(f"- {note}" for note in replay.notes),
        "",
        "```",
        comparison_text(replay.rows),
        "```",
    ]
    return "\n".join(lines) + "\n"
