"""Charts of one log: torques, wrenches and force."""

from collections.abc import Iterable, Sequence

import numpy as np

from vftcli.analysis import Analysis
from vftcli.contacts.contact_list import Contact, ContactList
from vftcli.observers.table import BEST
from vftcli.outputs.charts import (
    COLOURS,
    REFERENCE,
    Chart,
    ChartLine,
    LineStyle,
    families_of,
    lines_of_names,
)
from vftcli.outputs.contacts import forces_along
from vftcli.outputs.error_tables import blocks
from vftcli.signals.arrays import Z_95, Array
from vftcli.signals.wrench import AXES, unit_of


def torque_chart(analysis: Analysis) -> Chart:
    """External torque by joint: the best estimate, the reference."""
    n, reference, below = analysis.recording.joints, analysis.reference, list[ChartLine]()
    if reference is not None:
        # A broad line below the others; dotted where not to be trusted.
        tau, moving = reference.tau, reference.moving
        below = [ChartLine(reference_name(analysis), tau, REFERENCE)]
        if moving is not None and np.any(~moving & np.isfinite(tau)):
            resting = np.where(moving, np.nan, tau)
            name = "reference while the joint rests"
            below = [
                below[0]._replace(values=np.where(moving, tau, np.nan)),
                ChartLine(name, resting, "#8a94a0", "1.5 3"),
            ]
    # A dagger, as in the tables, at references not to be trusted.
    heads = next((found.joint_heads for found in blocks(analysis.errors)), joint_panels(n))
    return Chart(
        "tau",
        "External torque on the robot",
        ("N·m",) * n,
        tuple(heads),
        analysis.t,
        (*below, *estimate_lines(analysis)),
        families_of(analysis.robot.limits.tau_max),
        None if reference is None else reference.floor,
        "± floor of the reference",
        contact_spans(analysis.listed),
    )


def observer_styles(analysis: Analysis) -> dict[str, LineStyle]:
    """Colour and dash of every observer."""
    return lines_of_names([estimate.name for estimate in analysis.estimates])


def contact_spans(contacts: Iterable[Contact]) -> tuple[tuple[float, float], ...]:
    """Times of contact. [s]"""
    return tuple((contact.start, contact.stop) for contact in contacts if not contact.is_load)


def lines_of(
    analysis: Analysis, found: Sequence[tuple[str, Array, Array | None]], *, alike: bool
) -> list[ChartLine]:
    """A line an observer; only `best`, else the first, is visible, with its band.

    Beside `best` no other line has its 95 % band: five would hide one another. Without `best`
    every line has one, if they are `alike`. Given are name, values and deviation. (T, n)
    """
    styles, names = observer_styles(analysis), [name for name, *_ in found]
    first = BEST if BEST in names else next(iter(names), "")
    banded, lines = names if alike and first != BEST else [first], []
    for name, values, sd in found:
        half = Z_95 * sd if sd is not None and name in banded else None
        leads = name == first
        lines.append(ChartLine(name, values, *styles[name], half, leads, shown=leads))
    return sorted(lines, key=lambda line: line.leads)


def estimate_lines(analysis: Analysis) -> list[ChartLine]:
    """Every observer's torque."""
    each = [(e.name, e.tau, e.error_sd) for e in analysis.estimates]
    return lines_of(analysis, each, alike=True)


def reference_name(analysis: Analysis) -> str:
    """The reference in a legend, with its kind."""
    reference = analysis.reference
    return f"reference ({reference.name})" if reference is not None else "reference"


def joint_panels(joints: int) -> tuple[str, ...]:
    """Names of the panels of a chart with one a joint."""
    return tuple(f"J{j}" for j in range(1, joints + 1))


def wrench_chart(analysis: Analysis) -> Chart | None:
    """Force and moment by axis: the first wrench, the reference."""
    given = {wrench.name: wrench for wrench in analysis.wrenches}
    reference = given.pop("reference", None)
    if not given:
        return None
    each = [(wrench.name, wrench.known, wrench.sd) for wrench in given.values()]
    lines = lines_of(analysis, each, alike=False)
    smoothed = {} if analysis.virtual_sensor is None else analysis.virtual_sensor.smoothed
    for k, line in enumerate(lines):
        if line.name in smoothed and smoothed[line.name].gate:
            lines[k] = line._replace(quiet=smoothed[line.name].unlisted(analysis.t))
    if reference is not None:
        lines.insert(0, ChartLine(reference_name(analysis), reference.known, REFERENCE))
    return Chart(
        "wrench",
        f"Wrench in {next(iter(given.values())).frame} axes",
        tuple(map(unit_of, AXES)),
        AXES,
        analysis.t,
        tuple(lines),
        spans=contact_spans(analysis.listed),
    )


def force_chart(analysis: Analysis, found: ContactList) -> Chart | None:
    """|F| of every contact and of the log's wrench; None if empty."""
    if found.hardest is None and found.detectable_force is None:
        return None
    t = analysis.t
    force, half = (values[:, None] for values in forces_along(found.contacts, t))
    lines = [ChartLine("best", force, COLOURS[BEST], half=half, leads=True)]
    if (own := analysis.recording.wrench) is not None and own.any():
        size = np.linalg.norm(own[:, :3], axis=1)[:, None]
        lines.insert(0, ChartLine("the log's own wrench", size, REFERENCE))
    chart = Chart.of_one("force", "Force on the robot", "N", t, lines)
    spans = contact_spans(found.contacts)
    return chart._replace(spans=spans, lowest=0.0, highest=highest(found, lines[:-1]))


def highest(found: ContactList, others: Sequence[ChartLine] = ()) -> float:
    """Upper end of the axis, by peaks, detectable force, lines. [N]"""
    tops = [0.0, 2.5 * (found.detectable_force or 0.0)]
    tops += [1.05 * np.nanmax(line.values, initial=0.0) for line in others]
    for contact in found.contacts:
        # A band wider than its force may leave the chart.
        if contact.peak_force is not None and contact.peak_band is not None:
            tops.append(1.12 * (contact.peak_force + min(contact.peak_band, contact.peak_force)))
        if contact.is_load and (course := contact.course) is not None:
            tops.append(float(np.max(course.force + np.minimum(course.band, course.force))))
    return max(tops) or 1.0
