"""recording.rrd: contacts, torques, residuals, motion and the arm for Rerun.

Where contacts are listed each has its arrow and its words in `/contacts/1` …, and
`/remarks` has the list's limits. Else the force of a wrench, if asked for, is an arrow,
`/robot/flange_force`.
"""

from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from vftcli.analysis import Analysis
from vftcli.contacts.contact_list import ContactList
from vftcli.free_motion.free_motion import within
from vftcli.observers.table import BEST
from vftcli.outputs import FULL, LEVELS
from vftcli.outputs.charts import COLOURS, GREY, PLACES, REFERENCE, SPARE, Chart, ChartLine
from vftcli.outputs.contacts import answer, beginning
from vftcli.outputs.error_tables import DAGGER, to_markdown
from vftcli.outputs.grid import at_least_shown, escape_markdown
from vftcli.outputs.page.log_charts import (
    estimate_lines,
    reference_name,
    torque_chart,
    wrench_chart,
)
from vftcli.outputs.rerun_file import (
    BAR,
    CONTACTS,
    EDGES,
    ArmPoses,
    LogLine,
    Tab,
    arrow_scale,
    motion,
    painted_links,
    rerun_file,
    send_arm,
    send_contacts,
    send_force,
    thinned,
)
from vftcli.outputs.run_record import CONVENTIONS, all_remarks
from vftcli.robots.terms import drive_torque
from vftcli.signals.arrays import Z_95, Array
from vftcli.signals.progress import steps
from vftcli.signals.remarks import sentence
from vftcli.signals.wrench import Wrench
from vftcli.wrench.solvers import ForceArrow

#: Stretches of a long plot, lowest and highest sample each.
STRETCHES = 5000
#: Every sample stays so long about a contact's start. [s]
AROUND = 1.0
WHOLE_TIME = 20.0  #: Total time with every sample, over all contacts. [s]
#: Meaning of a dagger in a plot's title.
DOUBT = " (the joint rests: do not trust the reference)"
BELOW = 0.06  #: Contact spans are at this share of the largest force below zero.
BAND = "#e98aa2"  #: The band of |F|: the colour of `best`, paler.


def write_rrd(path: Path, analysis: Analysis, detail: str = LEVELS) -> None:
    """Write the recording with its layout."""
    robot, found = analysis.robot, analysis.contacts
    tabs = tabs_of(analysis, detail)
    words, arrow, painted = {"Summary": summary(analysis)}, None, {}
    if analysis.errors is not None and (table := to_markdown(analysis.errors)):
        words["Errors"] = table
    if found is not None:
        tabs[0] = tabs[0]._replace(log=contact_log(found))
        painted = painted_links(found, robot.joints)
    poses = motion(robot.chain, analysis.t, analysis.recording.q)
    if found is None or any(wrench.name == BEST for wrench in analysis.wrenches):
        arrow = force_arrow(analysis, poses, np.searchsorted(analysis.t, poses.t))
    scale, name = arrow_scale(found), analysis.recording.name
    space = f"Arm (arrow: 1 m is {scale:g} N)"
    analysis.recording.release()
    with rerun_file(path, name, tabs, words, poses, space) as stream:
        send_arm(stream, robot, poses, painted)
        if found is not None:
            send_contacts(stream, found, poses, arrow and arrow.force, scale)
        elif arrow is not None:
            send_force(stream, "/robot/flange_force", poses.t, arrow.origin, arrow.force)


def tabs_of(analysis: Analysis, detail: str) -> list[Tab]:
    """All plots; those of a long log thinned."""
    hardest = sorted(analysis.listed, key=lambda c: -(c.peak_force or 0.0))
    strongest, tabs = hardest[: int(0.5 * WHOLE_TIME / AROUND)], []
    whole = [(c.start - AROUND, c.start + AROUND) for c in strongest]
    for name, group in steps(list(plot_groups(analysis).items())):
        # One after the other: all of a long log would fill the memory.
        shown = group if detail == FULL else (thinned(plot, STRETCHES, whole) for plot in group)
        if plots := list(shown):
            tabs.append(Tab(name, plots))
    return tabs


def plot_groups(analysis: Analysis) -> dict[str, Iterable[Chart]]:
    """All plots by tab."""
    reference, joints = analysis.reference, range(analysis.recording.joints)
    # One 95 % band, of `best`, else the last: all would hide each other.
    banded = [e.name for e in analysis.estimates if e.error_sd is not None]
    last = BEST if BEST in banded else next(reversed(banded), "")
    found = estimate_lines(analysis)
    lines = [line if line.name == last else line._replace(half=None) for line in found]
    bare = tuple(line._replace(half=None) for line in found)
    if reference is not None:
        lines.insert(0, ChartLine(reference_name(analysis), reference.tau, REFERENCE))
    torque = torque_chart(analysis)._replace(series=tuple(lines))
    left = torque._replace(title="estimate − reference", series=bare)
    return {
        "Contacts": (force_plot(analysis, w) for w in analysis.wrenches if w.name == BEST),
        "Joint torques": (plot_of(torque, j, f"/tau_ext/J{j + 1}") for j in joints),
        "Residual": (
            plot_of(left, j, f"/residual/J{j + 1}", reference.tau[:, j : j + 1])
            for j in joints
            if reference is not None
        ),
        "Wrench": (
            plot_of(wrench, k, f"/wrench/{axis}")
            for wrench in (wrench_chart(analysis),)
            if wrench is not None
            for k, axis in enumerate(wrench.panels)
        ),
        "Motion": motion_plots(analysis),
    }


def plot_of(chart: Chart, j: int, key: str, minus: Array | float = 0.0) -> Chart:
    """One panel less `minus`, a band as its two edges."""
    lines, edges = [], []
    for line in chart.series:
        values = line.values[:, j : j + 1] - minus
        lines.append(line._replace(values=values, half=None, shown=True))
        if line.half is not None:
            half = line.half[:, j : j + 1]
            ends = zip(EDGES, (values + half, values - half), strict=True)
            edges += [ChartLine(f"{line.name} {name}", end, line.colour) for name, end in ends]
    panel = chart.panels[j]
    named = f"{panel.replace(DAGGER, DOUBT)}: {chart.title}" if panel != chart.title else panel
    unit, family = chart.units[j : j + 1], chart.families[j : j + 1]
    return Chart(key, named, unit, (panel,), chart.x, (*lines, *edges), family)


def force_plot(analysis: Analysis, wrench: Wrench) -> Chart:
    """|F| with its 95 % band, contacts' spans below, peaks as points."""
    found, sensed, t = analysis.contacts, analysis.virtual_sensor, analysis.t
    size, sd = wrench.size[:, None], wrench.size_sd
    lines = [ChartLine("|F|", size, COLOURS[BEST], leads=True)]
    if sensed is not None and sensed.reference is not None:
        lines.insert(0, ChartLine("reference", sensed.reference.size[:, None], REFERENCE))
    if sd is not None:
        half = Z_95 * sd[:, None]
        edges = zip(EDGES, (size + half, np.maximum(size - half, 0.0)), strict=True)
        lines += [ChartLine(name, edge, BAND) for name, edge in edges]
    title = "|F| on the robot"
    if found is not None:
        title += " as at the flange, 95 % band; bars: touched; diamonds: peaks by place"
        if (least := found.detectable_force) is not None:
            lines.append(
                ChartLine("smallest that is listed", np.full_like(size, least), SPARE[7])
            )
            title += f"; green: {at_least_shown(least)}, the smallest that is listed"
        # Peaks of contacts with a force; a load has none.
        felt = [c for c in found.contacts if c.peak_force is not None and not c.is_load]
        force = np.array([c.peak_force for c in felt], dtype=float)
        level = -BELOW * np.nanmax(np.concatenate([size[:, 0], [1.0], force]))
        # A line a part of the arm, so that the legend names them.
        for where, colour in PLACES.items():
            spans = [(c.start, c.stop) for c in found.contacts if c.where == where]
            bar = np.where(within(t, spans), level, np.nan)[:, None]
            if np.isfinite(bar).any():
                lines.append(ChartLine(f"{BAR}{where}", bar, colour))
        if felt:
            when = np.array([c.peak for c in felt])
            lines.append(ChartLine("peaks", force[:, None], COLOURS[BEST], x=when))
    return Chart.of_one("/force", title, "N", t, lines)


def contact_log(found: ContactList) -> list[LogLine]:
    """Start of each contact, its facts, and limits of the list."""
    lines = [
        LogLine(f"{CONTACTS}/{c.number}", c.start, beginning(c), PLACES[c.where])
        for c in found.contacts
    ]
    for remark in found.remarks:
        begins, _ = remark.where.span or (0.0, 0.0)
        lines.append(LogLine("/remarks", begins, sentence(remark), GREY, "WARN"))
    if not found.contacts:
        lines.append(LogLine("/remarks", 0.0, answer(found), GREY))
    return lines


def motion_plots(analysis: Analysis) -> Iterator[Chart]:
    """Positions, velocities and drive torques, one line a joint."""
    recording = analysis.recording
    for key, title, unit, values in (
        ("/q", "position", "rad", recording.q),
        ("/dq", "velocity", "rad/s", recording.dq),
        ("/drive_torque", "drive torque", "N·m", drive_torque(recording, analysis.robot)),
    ):
        if values is not None:
            lines = (
                ChartLine(f"J{j + 1}", values[:, j : j + 1], SPARE[j % len(SPARE)])
                for j in range(values.shape[1])
            )
            yield Chart.of_one(key, title, unit, analysis.t, lines)


def summary(analysis: Analysis) -> str:
    """Log, robot, and the meaning of numbers, arrow and colours."""
    recording, robot, source = analysis.recording, analysis.robot, analysis.recording.source
    drawing = (remark for remark in robot.remarks if remark.code == "meshes-not-found")
    notes = (*source.remarks, *all_remarks(analysis), *drawing)
    scale = f"1 m is {arrow_scale(analysis.contacts):g} N"
    arrow = (
        "the force on the robot as the tables of the wrench have it, where one was asked for: "
        f"that of best, else of the first observer; {scale}; none where the pose leaves it open"
    )
    if analysis.contacts is not None:
        arrow = (
            "the force on the robot while it is touched, at the flange or in the middle of the "
            f"link that the list names, which has its colour then; {scale}. On the wrist it is the "
            "force as it runs, elsewhere that of the contact's peak"
        )
    lines = [
        f"# {escape_markdown(recording.name)}",
        f"{escape_markdown(robot.title or robot.name)}, {recording.samples} samples in "
        f"{recording.duration:.3f} s at {1.0 / recording.median_step:.4g} Hz; "
        f"format {source.format}.",
        "",
        *(f"- **{name}**: {escape_markdown(text)}" for name, text in CONVENTIONS.items()),
        f"- **arrow**: {arrow}",
        *("", "## Notes"),
        *(f"- {escape_markdown(str(note))}" for note in notes),
        *("", f"Log sha256 {source.sha256 or 'unknown'}", ""),
    ]
    return "\n".join(lines)


def force_arrow(
    analysis: Analysis, poses: ArmPoses, sampled: NDArray[np.intp]
) -> ForceArrow | None:
    """The tables' force at the drawn poses: that of `best`, else the first's.

    None without a wrench. `sampled` are the drawn poses' samples. (S,)
    """
    sensed = analysis.virtual_sensor
    found = () if sensed is None else sensed.wrenches
    wrench = min(found, key=lambda wrench: wrench.name != BEST, default=None)
    if sensed is None or wrench is None:
        return None
    return sensed.sensor.arrow(wrench.force[sampled], poses.q, analysis.robot.chain)
