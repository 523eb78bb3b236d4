"""recording.rrd of an admittance replay: one ghost arm a controller, moving together."""

from pathlib import Path

import numpy as np

from vftcli.admittance.parameters import AXES
from vftcli.admittance.replay import Replay
from vftcli.outputs.admittance.tables import comparison_text, parameter_text
from vftcli.outputs.arm import motion
from vftcli.outputs.palette import REFERENCE, SPARE, rgb
from vftcli.outputs.rerun_file import (
    ARM_RATE,
    FORCE,
    NEWTON_PER_METRE,
    ArmView,
    Lines,
    Stream,
    Tab,
    rerun_file,
    send_arm,
    send_force,
)
from vftcli.signals.arrays import Array
from vftcli.signals.wrench import unit_of

GHOST = 150
"""Opacity of a ghost arm, of 255."""

SHAFT = 0.008
"""Radius of a force arrow. [m]"""


def write_ghosts(path: Path, replay: Replay, title: str) -> None:
    """Write the recording with its blueprint, so that it opens arranged.

    Args:
        path: Where to; an existing file is replaced.
        replay: What to show.
        title: Name of the log.

    Raises:
        OutputError: If it cannot be written whole.
    """
    paint, chain, t = colours(replay), replay.robot.chain, replay.motion.t
    poses = [
        motion(chain, t, replay.path.q[:, n], ARM_RATE) for n in range(len(replay.controllers))
    ]
    tabs = [Tab(name, t, group) for name, group in line_groups(replay, paint).items()]
    view = ArmView("One arm a controller", poses[0])
    documents = {"Summary": words(replay)}
    with rerun_file(path, f"{title}: admittance", tabs, documents, view) as stream:
        for n, (pose, colour) in enumerate(zip(poses, paint, strict=True)):
            base = f"/robot/{n}_{replay.controllers[n].name}".replace(" ", "")
            send_arm(stream, base, chain, pose, (*rgb(colour), GHOST))
            send_path(stream, f"{base}/path", pose.translation[:, -1], colour)
            force = entering_force(replay, pose.t)
            send_force(stream, f"{base}/force", pose.t, pose.translation[:, -1], force, SHAFT)


def send_path(stream: Stream, path: str, points: Array, colour: str) -> None:
    """Draw where a flange has been as one line in base axes. (S, 3) [m]"""
    import rerun as rr

    strip = rr.LineStrips3D([points], colors=[rgb(colour)], radii=[0.002])
    stream.log(path, strip, static=True)


def entering_force(replay: Replay, t: Array) -> Array:
    """The force that enters the law at the drawn poses, in base axes. (S, 3) [N]"""
    if not len(replay.wrench):
        return np.zeros((len(t), 3))
    # The last pose follows from the force of the row before it.
    rows = np.searchsorted(replay.motion.t, t).clip(max=len(replay.wrench) - 1)
    force: Array = replay.phases.force[rows, :3]
    return force


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
    # Beyond that the viewer's axis would show nothing of the others.
    return np.where(np.abs(values) < 1e6, values, np.nan)


def words(replay: Replay) -> str:
    """Source, parameters, remarks and comparison of the replay, in Markdown."""
    lines = [
        f"# Admittance replay: {replay.robot.title or replay.robot.name}",
        f"{replay.source}. {parameter_text(replay)}.",
        "",
        "Grey: traditional; colours: variable, see the legend of the plots. The orange arrow is "
        f"the force that enters the law; 1 m is {NEWTON_PER_METRE:g} N.",
        "",
        *(f"- {note}" for note in replay.remarks),
        "",
        "```",
        comparison_text(replay.rows),
        "```",
    ]
    return "\n".join(lines) + "\n"
