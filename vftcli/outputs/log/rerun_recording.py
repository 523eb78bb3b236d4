"""recording.rrd: contacts, torques, residuals, motion and the arm, arranged for the Rerun viewer.

Entities: those of `contact_recording`; `/tau_ext/J1` … (every observer, then the reference),
`/residual/J1` … (every estimate minus the reference), `/drive_torque`, `/q` and `/dq` (one line a
joint), `/wrench/fx` … where wrenches are known, `/robot` with the arm, and the force on it where no
contacts are listed.
"""

from collections.abc import Iterable, Iterator, Sequence
from itertools import chain
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from vftcli.analysis import Analysis
from vftcli.observers.table import BEST
from vftcli.outputs.arm import ArmPoses, motion
from vftcli.outputs.grid import escape_markdown
from vftcli.outputs.log.choice import FULL, LEVELS
from vftcli.outputs.log.contact_recording import (
    SHAFT,
    contact_log,
    flange_force,
    force_lines,
    painted_links,
    send_contacts,
)
from vftcli.outputs.log.run_record import CONVENTIONS, all_remarks
from vftcli.outputs.log.tables import to_markdown
from vftcli.outputs.log.wrench_tables import paper_bounds
from vftcli.outputs.palette import COLOURS, REFERENCE, SPARE, colours_of
from vftcli.outputs.plots import Lines, PlotLine, Tab
from vftcli.outputs.rerun_arm import NEWTON_PER_METRE, arrow_scale, send_arm, send_force
from vftcli.outputs.rerun_file import ArmView, rerun_file
from vftcli.robots.drive import drive_torque
from vftcli.signals.arrays import Array
from vftcli.signals.external_torque import COVERS, ExternalTorque
from vftcli.signals.progress import steps
from vftcli.signals.wrench import AXES, unit_of
from vftcli.virtual_sensor.choice import SMOOTHER
from vftcli.virtual_sensor.virtual_sensor import ForceArrow, VirtualSensor

#: The last joints, whose torques are smaller than the others': they share a vertical axis.
WRIST = 3
#: Stretches of a long log of which a plot keeps the lowest and highest samples of its lines.
STRETCHES = 5000
AROUND = 1.0  #: Time before and after the start of a contact in which every sample is kept. [s]
WHOLE_TIME = 20.0  #: Time of which every sample is kept, all contacts together. [s]
LEADING = 2.0  #: Width of the line of `best`; the others are thinner. [px]


def write_rrd(path: Path, analysis: Analysis, detail: str = LEVELS) -> None:
    """Write the recording with its blueprint, so that it opens arranged."""
    arm, errors, found = analysis.robot.chain, analysis.errors, analysis.contacts
    tabs = tabs_of(analysis, detail)
    if found is not None:
        tabs[0] = tabs[0]._replace(log=contact_log(found))
    table = to_markdown(errors, paper_bounds([analysis])) if errors is not None else ""
    words = {"Summary": summary(analysis)} | ({"Errors": table} if table else {})
    poses = motion(arm, analysis.t, analysis.recording.q)
    sampled = np.searchsorted(analysis.t, poses.t)
    scale = newton_per_metre(analysis)
    view = ArmView(f"Arm (arrow: 1 m is {scale:g} N)", poses)
    first = found.contacts[0] if found is not None and found.contacts else None
    marked = (first.start, first.stop) if first is not None else None
    with rerun_file(path, analysis.recording.name, tabs, words, view, marked) as stream:
        painted = painted_links(found, arm.joints) if found is not None else {}
        send_arm(stream, "/robot", arm, poses, painted=painted)
        if found is not None:
            force = flange_force(analysis, poses.q, sampled, arm)
            send_contacts(stream, found, poses, force, scale)
        elif (arrow := force_arrow(analysis, poses, sampled)) is not None:
            send_force(stream, "/robot/flange_force", poses.t, arrow.origin, arrow.force, SHAFT)


def tabs_of(analysis: Analysis, detail: str) -> list[Tab]:
    """All plots; of a long log what `STRETCHES` show, every sample where contacts begin."""
    t, whole = analysis.t, whole_spans(analysis)
    tabs = []
    for name, group in steps(list(line_groups(analysis).items())):
        # One plot after the other: of a long log all of them have no room at once.
        shown = group if detail == FULL else (lines.thinned(t, STRETCHES, whole) for lines in group)
        tabs.append(Tab(name, t, list(shown)))
    return tabs


def whole_spans(analysis: Analysis) -> list[tuple[float, float]]:
    """Where every sample is kept: around the starts of the strongest contacts. [s]"""
    if analysis.contacts is None:
        return []
    strongest = sorted(analysis.contacts.contacts, key=lambda c: -(c.peak_force or 0.0))
    most = int(WHOLE_TIME / (2.0 * AROUND))
    return [(c.start - AROUND, c.start + AROUND) for c in strongest[:most]]


def newton_per_metre(analysis: Analysis) -> float:
    """How long arrows are: by the hardest contact. [N/m]"""
    found = analysis.contacts
    if found is None or found.hardest is None:
        return NEWTON_PER_METRE
    return arrow_scale(found.hardest.peak_force or NEWTON_PER_METRE)


def line_groups(analysis: Analysis) -> dict[str, Iterable[Lines]]:
    """All plots, tab by tab: the force, torques and residuals joint by joint, then the motion."""
    reference, joints = analysis.reference, range(analysis.recording.joints)
    force = force_lines(analysis)
    groups: dict[str, Iterable[Lines]] = {"Contacts": [force]} if force is not None else {}
    groups["Joint torques"] = (joint_lines("tau_ext", analysis, j, reference) for j in joints)
    if reference is not None:
        groups["Residual"] = (
            joint_lines("residual", analysis, j, None, reference.tau[:, j]) for j in joints
        )
    if analysis.wrenches:
        axes = (wrench_lines(analysis, k) for k in range(len(AXES)))
        groups["Wrench"] = chain(axes, condition_lines(analysis))
    return {**groups, "Motion": motion_lines(analysis)}


#: Group of entities → what its plots show.
TITLES = {"tau_ext": "external torque [N·m]", "residual": "estimate − reference [N·m]"}


def joint_lines(
    group: str,
    analysis: Analysis,
    j: int,
    reference: ExternalTorque | None,
    minus: Array | float = 0.0,
) -> Lines:
    """All estimates of one joint less something, and the reference first if it is wanted."""
    colours = colours_of(analysis.estimates)
    lines = [
        PlotLine(e.name, e.tau[:, j] - minus, colours[e.name], LEADING if e.name == BEST else 1.2)
        for e in analysis.estimates
    ]
    if group == "tau_ext":
        lines += band_lines(analysis, j)
    if reference is not None:
        name = f"reference ({reference.name})"
        lines.insert(0, PlotLine(name, reference.tau[:, j], REFERENCE, 2.5))
    rests = analysis.reference is not None and analysis.reference.mostly_rests[j]
    doubt = " (the joint rests: do not trust the reference)" if rests else ""
    family = "wrist" if j >= analysis.recording.joints - WRIST else "shoulder"
    return Lines(f"/{group}/J{j + 1}", f"J{j + 1} {TITLES[group]}{doubt}", lines, family)


def band_lines(analysis: Analysis, j: int) -> Iterator[PlotLine]:
    """Both edges of one 95 % band of a joint, thin in its colour: that of `best`, else the last.

    Every observer's would hide them all; the table of estimates holds the others.
    """
    colours = colours_of(analysis.estimates)
    last_first = analysis.estimates[::-1]
    for estimate in sorted(last_first, key=lambda estimate: estimate.name != BEST):
        if estimate.error_sd is not None:
            for sign, edge in ((1.0, "upper"), (-1.0, "lower")):
                column = estimate.tau[:, j] + sign * COVERS * estimate.error_sd[:, j]
                name = f"{estimate.name} 95 % {edge}"
                yield PlotLine(name, column, colours[estimate.name], 0.6)
            return


def wrench_lines(analysis: Analysis, k: int) -> Lines:
    """One axis of every wrench, the reference first."""
    colours = colours_of(analysis.estimates)
    # The reference first: it is drawn below the others, and thicker.
    found = sorted(analysis.wrenches, key=lambda wrench: wrench.name != "reference")
    title = f"{AXES[k]} in {found[0].frame} axes [{unit_of(k)}]"
    lines = [
        PlotLine(w.name, w.known[:, k], colours[w.name])
        if w.name in colours
        else PlotLine(w.name, w.known[:, k], REFERENCE, 2.5)
        for w in found
    ]
    for w in found:
        if w.name == BEST and w.known_sd is not None:
            for sign, edge in ((1.0, "upper"), (-1.0, "lower")):
                column = w.known[:, k] + sign * COVERS * w.known_sd[:, k]
                lines.append(PlotLine(f"{w.name} 95 % {edge}", column, COLOURS[BEST], 0.6))
    return Lines(f"/wrench/{AXES[k]}", title, lines, unit_of(k))


def condition_lines(analysis: Analysis) -> list[Lines]:
    """What the pose can tell, and the torque that no wrench at the flange explains."""
    colours = colours_of(analysis.estimates)
    wrenches = [wrench for wrench in analysis.wrenches if wrench.name in colours]
    found, sensed = [], analysis.virtual_sensor
    sigma = next((w.sigma_min for w in wrenches if w.sigma_min is not None), None)
    # The smoother asks no pose: its band grows where the pose tells little.
    if sigma is not None and sensed is not None and sensed.solver != SMOOTHER:
        least = np.full_like(sigma, sensed.sensor.least_sigma)
        lines = [
            PlotLine("σ_min", sigma, REFERENCE),
            PlotLine("masked below", least, SPARE[0], 1.0),
        ]
        found.append(Lines("/wrench/sigma_min", "σ_min of J, angular rows × 0.3 m [m]", lines))
    lines = [
        PlotLine(w.name, w.null_space, colours[w.name])
        for w in wrenches
        if w.null_space is not None
    ]
    if lines:
        title = "torque that no wrench at the flange explains [N·m]"
        found.append(Lines("/wrench/null_space", title, lines))
    return found


def motion_lines(analysis: Analysis) -> list[Lines]:
    """Positions, velocities and drive torques, one line a joint."""
    recording = analysis.recording
    signals = [
        ("/q", "position [rad]", recording.q),
        ("/dq", "velocity [rad/s]", recording.dq),
        ("/drive_torque", "drive torque [N·m]", drive_torque(recording, analysis.robot)),
    ]
    return [
        Lines(
            path,
            title,
            [PlotLine(f"J{j + 1}", x, SPARE[j % len(SPARE)]) for j, x in enumerate(values.T)],
        )
        for path, title, values in signals
        if values is not None
    ]


def summary(analysis: Analysis) -> str:
    """Which log, which robot, what the numbers and the arrow mean."""
    recording, robot = analysis.recording, analysis.robot
    source = recording.source
    lines = [
        f"# {escape_markdown(recording.name)}",
        f"{escape_markdown(robot.title or robot.name)}, {recording.samples} samples in "
        f"{recording.duration:.3f} s at {1.0 / recording.median_step:.4g} Hz; "
        f"format {source.format}.",
        "",
        *(f"- **{name}**: {escape_markdown(text)}" for name, text in CONVENTIONS.items()),
    ]
    lines.append(f"- **arrow**: {arrow_words(analysis)}")
    remarks = [*source.remarks, *all_remarks(analysis)]
    lines += ["", "## Notes", *(f"- {escape_markdown(str(note))}" for note in remarks)]
    lines += ["", f"Log sha256 {source.sha256 or 'unknown'}"]
    return "\n".join(lines) + "\n"


def arrow_words(analysis: Analysis) -> str:
    """What the arrow and the colours of the arm mean."""
    scale = f"1 m is {newton_per_metre(analysis):g} N"
    if analysis.contacts is not None:
        return (
            "the force on the robot while it is touched, at the flange or in the middle of the "
            f"link that the list names, which has its colour then; {scale}. On the wrist it is the "
            "force as it runs, elsewhere that of the contact's peak"
        )
    source = force_source(analysis.estimates)
    name = source.name if source is not None else "no estimate"
    return (
        f"force on the robot from {name}, as in the tables of the wrench where one was asked for, "
        f"else at the flange by the pseudo-inverse of Jᵀ; {scale}; none where the pose cannot tell"
    )


def force_source(estimates: Sequence[ExternalTorque]) -> ExternalTorque | None:
    """The estimate the force arrow is made from: `best`, else a Kalman filter's, else the first."""
    ranks = [
        [estimate for estimate in estimates if estimate.name == BEST],
        [estimate for estimate in estimates if estimate.name.startswith("kfo")],
        estimates,
    ]
    return next((estimate for rank in ranks for estimate in rank), None)


def force_arrow(
    analysis: Analysis, poses: ArmPoses, sampled: NDArray[np.intp]
) -> ForceArrow | None:
    """The force of the virtual sensor at the drawn poses, None for an arm of less than six joints.

    It is that of the wrench that was asked for, its zero removed, as the tables have it; where none
    was asked for, that of the estimate as it stands, at the flange. The drawn poses are those of
    the log's samples `sampled`. (S,)
    """
    source, chain = force_source(analysis.estimates), analysis.robot.chain
    if source is None or chain.joints < 6:
        return None
    if analysis.virtual_sensor is not None:
        (wrench,) = (w for w in analysis.virtual_sensor.wrenches if w.name == source.name)
        return analysis.virtual_sensor.sensor.arrow(wrench.force[sampled], poses.q, chain)
    sensor = VirtualSensor(frame="base")
    # At the drawn poses only: fifty a second, not every sample.
    drawn = ExternalTorque(name=source.name, t=poses.t, tau=source.tau[sampled])
    return sensor.arrow(sensor.wrench(drawn, poses.q, chain).force, poses.q, chain)
