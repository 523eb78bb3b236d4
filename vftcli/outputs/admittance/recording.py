"""recording.rrd of an admittance replay: one ghost arm a controller, moving together."""

from pathlib import Path

import numpy as np

from vftcli.admittance.parameters import AXES
from vftcli.admittance.replay import Replay
from vftcli.outputs.admittance.tables import comparison_text, parameter_text
from vftcli.outputs.arm import motion
from vftcli.outputs.palette import REFERENCE, SPARE, rgb
from vftcli.outputs.plots import Lines, PlotLine, Tab
from vftcli.outputs.rerun_arm import FORCE, NEWTON_PER_METRE, send_arm, send_force
from vftcli.outputs.rerun_file import ArmView, rerun_file
from vftcli.signals.arrays import Array
from vftcli.signals.wrench import unit_of

GHOST = 150  #: Opacity of a ghost arm, of 255.
SHAFT = 0.008  #: Radius of a force arrow. [m]


def write_ghosts(path: Path, replay: Replay, title: str) -> None:
    """Write the recording with its blueprint, so that it opens arranged."""
    paint, chain, t = colours(replay, REFERENCE), replay.robot.chain, replay.motion.t
    poses = [motion(chain, t, replay.path.q[:, n]) for n in range(len(replay.controllers))]
    tabs = [Tab(name, t, group) for name, group in line_groups(replay, paint).items()]
    view = ArmView("One arm a controller", poses[0])
    documents = {"Summary": words(replay)}
    with rerun_file(path, f"{title}: admittance", tabs, documents, view) as stream:
        import rerun as rr

        for n, (pose, colour) in enumerate(zip(poses, paint, strict=True)):
            base = f"/robot/{n}_{replay.controllers[n].name}".replace(" ", "")
            send_arm(stream, base, chain, pose, (*rgb(colour), GHOST))
            flange, force = pose.translation[:, -1], entering_force(replay, pose.t)
            trail = rr.LineStrips3D([flange], colors=[rgb(colour)], radii=[0.002])
            stream.log(f"{base}/path", trail, static=True)
            send_force(stream, f"{base}/force", pose.t, flange, force, SHAFT)


def entering_force(replay: Replay, t: Array) -> Array:
    """The force that enters the law at the drawn poses, in base axes. (S, 3) [N]"""
    if not len(replay.wrench):
        return np.zeros((len(t), 3))
    # The last pose follows from the force of the row before it.
    rows = np.searchsorted(replay.motion.t, t).clip(max=len(replay.wrench) - 1)
    force: Array = replay.phases.force[rows, :3]
    return force


def colours(replay: Replay, traditional: str) -> list[str]:
    """One colour for the traditional controller, another for each variable one."""
    # Every variable controller its own colour, again from the start when there are no more.
    spare = iter(SPARE * len(replay.controllers))
    return [next(spare) if c.kind == "variable" else traditional for c in replay.controllers]


def line_groups(replay: Replay, paint: list[str]) -> dict[str, list[Lines]]:
    """The plots, tab by tab: deviation and force of every axis."""
    painted = [(c.name, n, paint[n]) for n, c in enumerate(replay.controllers)]
    threshold = replay.parameters.threshold
    deviation, force = [], []
    for k, axis in enumerate(AXES):
        moved = finite(replay.motion.x[:, :, k])
        shown = [PlotLine(name, moved[:, n], colour) for name, n, colour in painted]
        title = f"{axis} deviation [{'m' if k < 3 else 'rad'}]"
        deviation.append(Lines(f"/deviation/{axis}", title, shown))
        felt = padded(replay.wrench[:, k])
        bound = np.full(len(felt), threshold[k])
        both = (
            PlotLine("force", felt, FORCE),
            PlotLine("threshold", bound, REFERENCE, 1.0),
            PlotLine("− threshold", -bound, REFERENCE, 1.0),
        )
        force.append(Lines(f"/force/{axis}", f"{axis} force on the robot [{unit_of(k)}]", both))
    return {"Deviation": deviation, "Force": force}


def padded(values: Array) -> Array:
    """Rows with an unknown one more: the last deviation follows from the force before it."""
    return np.concatenate([values, np.full((1, *values.shape[1:]), np.nan)])


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
