"""Details of the page of one log: drawings of contacts, and tables below the answer.

Drawn are |F| over the log with its band, and the arm at each contact; the tables are of
contacts, errors, observers, budget and print.
"""

from collections.abc import Iterator, Sequence
from itertools import groupby
from operator import itemgetter
from typing import Any, NamedTuple

import numpy as np
import polars as pl

from vftcli.analysis import Analysis
from vftcli.contacts.contact_list import Contact, ContactList
from vftcli.evaluation.published import Comparison, advice, facts
from vftcli.observers.table import OBSERVERS
from vftcli.outputs.charts import Span, thinned
from vftcli.outputs.contacts import by_force
from vftcli.outputs.grid import Column, Grid, GridCell, Rows, joint_columns, keyed_grid, words
from vftcli.outputs.page.shell import Box, Scales, part, path_of, ribbon
from vftcli.outputs.quantity import DASH, banded, signed, significant, vector
from vftcli.outputs.run_record import observer_record
from vftcli.refinement.refine import Budget
from vftcli.robots.chain import link_poses
from vftcli.signals.arrays import Array
from vftcli.signals.errors import VftError
from vftcli.signals.series import resample_columns, runs_of

#: The chart for a screen, and for a telephone with larger letters; stretches of the line
#: in each.
SHAPES = (
    (Box(width=1024, height=300, left=44, bottom=24, top=28, right=10), 600),
    (Box(width=400, height=260, left=38, bottom=24, top=28, right=8), 200),
)
FEWEST = 6  #: Fewest stretches of one contact's line.
LETTER = 7.5  #: Width of a letter: labels must not overlap.
SIZE, EDGE = np.array([84.0, 64.0]), 9.0  #: Size of the arm's drawing, and margin.
ARROW, HEAD = 20.0, 5.0  #: Arrow in the drawing's plane, and its head.
#: Headings of the tables of contacts: vectors, and what follows them.
VECTORS = (
    "force [N]",
    "± sd",
    "moment [N·m]",
    "± sd",
    "mean force [N]",
    "impulse [N·s]",
)
EVIDENCE = (
    "log-likelihood ratio [nats]",
    "margin of the place [nats]",
    "vendor |F| [N]",
    "sensor |F| [N]",
)
#: Headings of the table of what was computed on the log.
COMPUTED = (
    "90 % of a step [ms]",
    "delay [ms]",
    "noise [N·m]",
    "noise > 5 Hz passed",
    "mean RMSE [N·m]",
    "to tune",
)


class Timeline(NamedTuple):
    """The chart of |F| in one shape."""

    scales: Scales  #: From seconds and newtons to places.
    courses: list[tuple[str, str]]  #: Band and line of contacts with a force.
    numbers: list[tuple[int, float]]  #: Contacts with room for a number, and its place.
    #: Place of a peak, place of its size in words, and the words, "" without room or
    #: size.
    peaks: list[tuple[float, float, float, float, str]]


def timelines(analysis: Analysis, found: ContactList) -> list[Timeline]:
    """The chart in both shapes."""
    t, contacts = analysis.t, found.contacts
    x, y = Span(float(t[0]), float(t[-1])), Span(0.0, highest(found))
    return [
        Timeline(
            scales := Scales(box, x, y),
            list(courses_of(scales, contacts, stretches)),
            list(placed_numbers(scales, contacts)),
            list(peaks_of(scales, contacts)),
        )
        for box, stretches in SHAPES
    ]


def free_spans(analysis: Analysis) -> list[tuple[float, float]]:
    """Stretches of the log without contact. [s]"""
    try:
        own = analysis.motion.known.own
    except VftError:
        # Nothing is surely free; the list of contacts says so.
        return []
    t = analysis.t
    return [(float(t[start]), float(t[stop - 1])) for start, stop in runs_of(own)]


def highest(found: ContactList) -> float:
    """Upper end of the axis: peaks with bands, the least visible force, room. [N]"""
    top = max(2.5 * (found.detectable_force or 0.0), 0.0)
    for contact in found.contacts:
        if contact.peak_force is not None and contact.peak_band is not None:
            peak = contact.peak_force + min(contact.peak_band, contact.peak_force)
            top = max(top, 1.12 * peak)
        if (course := contact.course) is not None:
            peaks = course.force + np.minimum(course.band, course.force)
            top = max(top, 1.05 * float(peaks.max()))
    return top or 1.0


def courses_of(
    scales: Scales, contacts: Sequence[Contact], stretches: int
) -> Iterator[tuple[str, str]]:
    """Every contact's |F| with its band, as paths."""
    for course in (c.course for c in contacts if c.course is not None):
        # A contact's share of the log's stretches: hundreds must not make a large page.
        share = float(course.t[-1] - course.t[0]) / (scales.x.high - scales.x.low)
        t, force = thinned(course.t, course.force, max(round(share * stretches), FEWEST))
        half = np.interp(t, course.t, course.band)
        # A band beyond the force leaves the chart.
        above = np.minimum(force + half, scales.y.high)
        yield ribbon(scales, t, np.maximum(force - half, 0.0), above), path_of(scales, t, force)


def placed_numbers(scales: Scales, contacts: Sequence[Contact]) -> Iterator[tuple[int, float]]:
    """The contacts' numbers above the plot, with room."""
    last = -np.inf
    for contact in contacts:
        x = float(scales.across(0.5 * (contact.start + contact.stop)))
        half = 0.5 * LETTER * len(str(contact.number)) + 3.0
        if x - half >= last:
            last = x + half
            yield contact.number, x


def peaks_of(
    scales: Scales, contacts: Sequence[Contact]
) -> Iterator[tuple[float, float, float, float, str]]:
    """Every peak; the hardest with their sizes, with room."""
    labels: list[tuple[float, float]] = []
    for contact in sorted(contacts, key=by_force, reverse=True):
        force, band = contact.peak_force, contact.peak_band
        if force is None or band is None or contact.is_load:
            continue
        x, y = float(scales.across(contact.peak)), float(scales.up(force))
        text = banded(force, band, unit="")
        half = 0.5 * LETTER * len(text)
        middle = min(max(x, scales.box.left + half), scales.side - half)
        above = max(float(scales.up(force + band)), scales.box.top + 8) - 6.0
        room = contact.size_known and all(abs(middle - at) > half + r for at, r in labels)
        labels += [(middle, half)] * room
        yield x, y, middle, above, text * room


class ArmDrawing(NamedTuple):
    """The arm from its side at a peak, as points of a drawing."""

    size: Array  #: Width and height. (2,)
    arm: Array  #: Base, the links' frames, flange. (n + 2, 2)
    hit: list[Array]  #: The probable places, a stretch or point each.
    #: The force: shaft, then head; none if it points out of the drawing.
    arrow: list[Array]


def arm_drawing(analysis: Analysis, contact: Contact) -> ArmDrawing:
    """The arm from its side at a peak, with the probable places."""
    q = resample_columns(np.array([contact.peak]), analysis.t, analysis.recording.q)
    frames = link_poses(analysis.robot.loaded_chain, q).translation[0]
    points = np.vstack([np.zeros(3), frames])
    across = side_of(points)
    flat = np.column_stack([points @ across, points[:, 2]])
    low, high = flat.min(axis=0), flat.max(axis=0)
    scale = float(np.min((SIZE - 2 * EDGE) / np.maximum(high - low, 1e-9)))
    # Drawings count downwards.
    drawn = 0.5 * (SIZE - scale * (high - low)) + scale * (flat - low)
    drawn[:, 1] = SIZE[1] - drawn[:, 1]
    # Point k + 1 is the frame of link k + 1, the last the flange's.
    hit = [drawn[-1:] if link == 0 else drawn[link : link + 2] for link in contact.places]
    shaft: list[Array] = []
    if hit and contact.wrench is not None:
        force = contact.wrench[:3]
        size = max(float(np.linalg.norm(force)), 1e-12)
        direction = np.array([force @ across, -force[2]]) / size
        shaft = arrow(np.vstack(hit).mean(axis=0), direction)
    return ArmDrawing(SIZE, drawn, hit, shaft)


def side_of(points: Array) -> Array:
    """Horizontal direction of the arm's farthest reach, to the right. (3,)"""
    flat = points[:, :2] - points[:, :2].mean(axis=0)
    # An upright arm shows along y.
    if np.linalg.norm(flat) < 1e-9:
        return np.array([1.0, 0.0, 0.0])
    direction = np.linalg.svd(flat, full_matrices=False)[2][0]
    reach = direction @ (points[-1, :2] - points[0, :2])
    return np.append(-direction if reach < 0 else direction, 0.0)


def arrow(tip: Array, direction: Array) -> list[Array]:
    """An arrow that ends at a place, shorter the more it leaves the plane."""
    length = ARROW * float(np.linalg.norm(direction))
    if length < HEAD:
        return []
    along = direction / np.linalg.norm(direction)
    beside, neck = 0.6 * HEAD * np.array([-along[1], along[0]]), tip - HEAD * along
    return [np.vstack([tip - length * along, tip]), np.vstack([neck + beside, tip, neck - beside])]


def contact_details(found: ContactList) -> tuple[Grid, ...]:
    """Moments, impulses, evidence and joint torques of every contact."""
    if not found.contacts:
        return ()
    wrenches: Rows = []
    torques: Rows = []
    for c in found.contacts:
        vectors: list[Array | None] = [None] * 4
        if c.wrench is not None and c.wrench_sd is not None:
            vectors = [c.wrench[:3], c.wrench_sd[:3], c.wrench[3:], c.wrench_sd[3:]]
        shown = (None if v is None else vector(v) for v in (*vectors, c.mean_force, c.impulse))
        rest = (c.evidence, c.lead, c.vendor_force, c.sensor_force)
        wrenches.append((str(c.number), *shown, *rest))
        each = zip(c.joint_torque, c.joint_torque_sd, strict=True)
        torque = (banded(tau, sd, ".2f", "") for tau, sd in each)
        torques.append((str(c.number), *torque, c.at_rest))
    number, joints = Column("#"), joint_columns(len(found.contacts[0].joint_torque))
    return (
        Grid(
            (number, *words(*VECTORS), *map(Column, EVIDENCE)),
            wrenches,
            "Wrench at the peak, base axes, the moment about the flange point",
        ),
        Grid(
            (number, *joints, Column("at rest")),
            torques,
            "Joint torque at the peak in N·m, ± its standard deviation",
        ),
    )


def model_pairs(found: ContactList) -> dict[str, str]:
    """What the list rests on."""
    model, prior = found.model, found.model.prior

    def each(values: Array) -> str:
        """One number a joint."""
        return ", ".join(map(significant, values.tolist()))

    pairs = {
        "basis": found.basis,
        "free motion": f"{found.free_seconds:.1f} s",
        "false contacts in it": DASH if found.false_on_free is None else str(found.false_on_free),
        "evidence asked": DASH if found.threshold is None else f"{found.threshold:.1f} nats",
        "block": f"{model.block:.3g} s",
        "noise, joint by joint": f"{each(model.noise_sd)} N·m",
        "model error": f"{each(model.error_sd)} N·m",
        "its correlation time": f"{each(model.error_time)} s",
    }
    if prior is not None:
        pairs["contacts' force and moment"] = (
            f"{prior.force:.3g} N and {prior.moment:.3g} N·m, which keep for {prior.time:.3g} s"
        )
    return pairs


def bias_grid(table: pl.DataFrame) -> Grid:
    """Bias, largest error and correlation of every estimate and joint."""
    rows = table.filter(pl.col("joint").is_not_null()).with_columns(joint=pl.format("J{}", "joint"))
    columns = {
        "observer": Column("observer", words=True),
        "joint": Column("joint"),
        "bias_Nm": Column("bias [N·m]", form=signed),
        "max_Nm": Column("largest error [N·m]", form=signed),
        "correlation": Column("correlation", form=signed),
        "samples": Column("samples"),
    }
    return keyed_grid(columns, rows.iter_rows(named=True), "Estimate − reference")


def observers_view(analysis: Analysis) -> dict[str, Any]:
    """What each observer's parameters are and mean."""
    rows: Rows = []
    used = {}
    for observer in analysis.observers:
        name, tuning = observer.name, analysis.tunings.get(observer.name)
        what = OBSERVERS[name].title if name in OBSERVERS else ""
        meant: list[Any] = [None] * 5
        if tuning is not None:
            columns = (tuning.omega_n, tuning.zeta, 1e3 * tuning.delay, tuning.bandwidth)
            meant = [GridCell("", html=joint_values(column)) for column in columns]
            meant.append(tuning.parameter_count)
        rows.append((name, what, *meant))
        # The record has parameters as JSON can hold them, also those of a wrapped
        # observer.
        used[name] = observer_record(observer, None)["parameters"]
    heads = ("ω_n [rad/s]", "ζ", "delay [ms]", "−3 dB [Hz]", "to tune")
    title = (
        "What the parameters mean at this log's sample time; one value a joint where they differ"
    )
    grid = Grid((*words("observer", "What"), *map(Column, heads)), rows, title, swatches=True)
    return {"grid": grid, "names": ", ".join(used), "parameters": used}


def joint_values(values: Array) -> str:
    """One number where all joints agree to three digits, else one line a run of equal joints."""
    # Compared as printed: values that look equal are one.
    texts = enumerate(map(significant, values.tolist()), 1)
    runs = [(text, [j for j, _ in run]) for text, run in groupby(texts, itemgetter(1))]
    return part("parts/joint_values", runs)


def selection_guide(analysis: Analysis) -> tuple[Grid, ...]:
    """Which observer for what, by what was computed on this log."""
    found = facts(analysis.observers, analysis.tunings, analysis.motion.log, analysis.errors)
    if not found:
        return ()
    advised = [(a.purpose, a.criterion, ", ".join(a.best) or DASH, a.paper) for a in advice(found)]
    heads = words("For", "what decides", "best here", "the paper advises")
    rows: Rows = []
    for f in found:
        numbers = map(float, (1e3 * f.response, 1e3 * f.delay, f.noise, f.passed, f.rmse))
        rows.append((f.name, *numbers, f.parameter_count))
    columns = *words("observer"), *map(Column, COMPUTED)
    return (
        Grid(heads, advised, "Which observer for what (Sec. IV-A)"),
        Grid(columns, rows, "Computed on this log", swatches=True),
    )


def beside_print(comparison: Comparison) -> Grid:
    """Printed and computed errors side by side."""
    columns = list(words("observer"))
    for j in range(1, len(comparison.floor) + 1):
        columns += (Column(f"J{j} print", form=".2f"), Column("here"))
    rows: Rows = []
    for name in comparison.names:
        both = np.column_stack([comparison.printed(name), comparison.ours[name]])
        rows.append((name, *both.ravel().tolist()))
    return Grid(columns, rows, f"RMSE in N·m: {comparison.published.title}", swatches=True)


def budget_grid(budgets: Sequence[Budget]) -> Grid:
    """Where every observer's error comes from, cause by cause. [N·m]"""
    rows: Rows = [
        (budget.name, cause, *map(float, values))
        for budget in budgets
        # Stiction at rest is a bound, not a cause that adds up: the sum leaves it out.
        for cause, values in (*budget.parts.items(), ("all but stiction at rest", budget.total))
    ]
    return Grid((*words("observer", "cause"), *joint_columns(len(budgets[0].total))), rows)
