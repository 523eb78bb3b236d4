"""Errors of torques and wrenches as grids: observers down, joints or axes across.

Forces are in newtons, moments in newton-metres; contacts found and zero drift have theirs too.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from html import escape
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import polars as pl

from vftcli.evaluation.errors import JointMeans, joint_means
from vftcli.outputs.grid import Column, Entry, Grid, GridCell, joint_columns, keyed_grid, words
from vftcli.outputs.quantity import DASH, minus, significant
from vftcli.signals.arrays import Array, Mask
from vftcli.signals.wrench import AXES, unit_of
from vftcli.virtual_sensor.solvers import LEAST_SIGMA

if TYPE_CHECKING:
    from vftcli.analysis import Analysis
    from vftcli.virtual_sensor.sensor_reading import Drift

#: An RMSE within this factor of the reference's floor may be the reference's own.
AT_FLOOR = 1.2

DAGGER, LATEX_DAGGER = "†", r"$^\dagger$"
RESTS = "the joint rests most of the time; the reference keeps its stiction: do not trust it"

#: What the page writes behind a number where the terminal has a star.
ON_PAGE = '<span class="mark">at the floor</span>'


class Block(NamedTuple):
    """RMSE of one recording, observers down, joints across."""

    recording: str  #: The log's label, unique in the command.
    reference: str  #: What the estimates are judged by.
    joints: tuple[int, ...]  #: Joint numbers, from 1.
    observers: tuple[str, ...]  #: Names, in the order in which they ran.
    rmse: Array  #: NaN where it is not known. (observers, joints) [N·m]
    floor: Array  #: The reference's own error, NaN where it is not known. (joints,) [N·m]
    samples: tuple[int, int]  #: Fewest and most samples an entry is made of.
    means: JointMeans  #: What the joints are in one number.
    #: Observer → largest share of a joint's samples without its answer, where there is.
    missing: dict[str, float]
    #: Joints at rest: do not trust their reference.
    untrusted: tuple[int, ...] = ()

    @property
    def at_floor(self) -> Mask:
        """Where the reference cannot tell the error from its own. (observers, joints)"""
        return np.asarray(self.rmse <= AT_FLOOR * self.floor)

    @property
    def best(self) -> Mask:
        """Smallest RMSE of each joint, and equals in print. (observers, joints)

        None where the reference cannot tell: of a joint that rests, and of several at the floor.
        """
        # Compared as printed, so that two equal texts in one column are both bold.
        least = np.where(np.isfinite(self.rmse), self.rmse, np.inf).min(axis=0)
        shown = [[significant(value) for value in row] for row in self.rmse]
        best = np.array([significant(value) for value in least])
        tells = ~np.isin(self.joints, self.untrusted) & (np.sum(self.at_floor, axis=0) < 2)
        return np.asarray((np.array(shown) == best) & np.isfinite(self.rmse) & tells)

    @property
    def has_floor(self) -> bool:
        """Whether the reference's own error is known for any joint."""
        return bool(np.any(np.isfinite(self.floor)))

    @property
    def title(self) -> str:
        """Log, reference, number of samples."""
        low, high = self.samples
        samples = f"{high}" if low == high else f"{low} to {high}"
        return f"{self.recording} against {self.reference}, {samples} samples"

    @property
    def joint_heads(self) -> list[str]:
        """J1, J2, …; a dagger where the reference is not to be trusted."""
        return [f"J{j}{DAGGER if j in self.untrusted else ''}" for j in self.joints]


def blocks(errors: pl.DataFrame | None) -> tuple[Block, ...]:
    """One block for each recording and reference, in the table's order; none without errors."""
    return () if errors is None else tuple(map(block, logs_of(errors, "joint")))


def logs_of(errors: pl.DataFrame, place: str) -> Iterator[pl.DataFrame]:
    """The rows of each log and reference that have a place: a ``joint`` or an ``axis``.

    Rows of two logs stay two tables even if the caller gave both one label.
    """
    if place not in errors.columns:
        return
    rows = errors.filter(pl.col(place).is_not_null())
    # An observer's second row of a joint begins another log.
    again = pl.int_range(pl.len()).over("recording", "reference", "observer", place)
    groups = rows.group_by("recording", "reference", again.alias("again"), maintain_order=True)
    yield from (group for _, group in groups)


def block(rows: pl.DataFrame) -> Block:
    """The rows of one recording as a matrix."""
    joints = rows["joint"].unique().sort().to_list()
    observers = tuple(map(str, rows["observer"].unique(maintain_order=True)))
    rmse, floor = np.full((len(observers), len(joints)), np.nan), np.full(len(joints), np.nan)
    # Null is what polars has for unknown.
    known = rows.with_columns(pl.col("rmse_Nm", "reference_floor_Nm").fill_null(float("nan")))
    for row in known.iter_rows(named=True):
        at = joints.index(row["joint"])
        rmse[observers.index(row["observer"]), at] = row["rmse_Nm"]
        floor[at] = row["reference_floor_Nm"]
    # Joints may differ in how many samples have a reference.
    counts = rows["samples"].drop_nulls().to_list() or [0]
    doubtful = rows.filter(~pl.col("reference_trusted").fill_null(True))["joint"].unique().sort()
    missing = rows.group_by("observer", maintain_order=True).agg(pl.col("missing").max())
    return Block(
        recording=str(rows["recording"][0]),
        reference=str(rows["reference"][0]),
        joints=tuple(joints),
        observers=observers,
        rmse=rmse,
        floor=floor,
        samples=(int(min(counts)), int(max(counts))),
        means=joint_means(rows),
        missing={str(name): float(share) for name, share in missing.iter_rows() if share},
        untrusted=tuple(doubtful),
    )


def rmse_grid(table: Block) -> Grid:
    """One recording's RMSE: observers down, joints and their mean across, the floor last."""
    rows: list[tuple[Entry, ...]] = []
    for name, values, bests, floors in zip(
        table.observers, table.rmse, table.best, table.at_floor, strict=True
    ):
        # A star where the reference can tell no more.
        cells = [
            GridCell(text, bool(best), *(("*", text + ON_PAGE) if at_floor else ()))
            for text, best, at_floor in zip(map(significant, values), bests, floors, strict=True)
        ]
        rows.append((name, *cells, table.means.errors.get(name)))
    if table.has_floor:
        rows.append(("floor", *map(float, table.floor), table.means.floor))
    joints = tuple(
        Column(head, symbol=f"$J_{{{j}}}${LATEX_DAGGER * (j in table.untrusted)}")
        for j, head in zip(table.joints, table.joint_heads, strict=True)
    )
    return Grid(
        title=table.title,
        quantity="RMSE",
        unit="N·m",
        columns=(*words("observer"), *joints, Column("mean")),
        rows=tuple(rows),
        summaries=int(table.has_floor),
        marked=True,
        notes=tuple(marks_in_words([table]).splitlines()),
        swatches=True,
    )


def details(row: dict[str, Any]) -> dict[str, str]:
    """Text below the RMSE table for one row, by the table's title."""
    low, high, lag, p = (row[k] for k in ("rmse_low_Nm", "rmse_high_Nm", "lag_s", "p_vs_best"))
    share, unknown = row.get("coverage_95"), low is None or high is None
    return {
        "95 % interval of the RMSE, moving-block bootstrap [N·m]": (
            DASH if unknown else f"{significant(low)}–{significant(high)}"
        ),
        "lag of the estimate behind the reference, best fit [ms]": (
            DASH if lag is None else minus(f"{round(1e3 * lag)}")
        ),
        "samples within the estimate's 95 % band, while the joint moves": (
            DASH if share is None else f"{100 * share:.0f} %"
        ),
        "p of being no worse than the best, paired bootstrap": (
            DASH if p is None else "best" if p >= 1.0 else f"{p:.3f}"
        ),
    }


def detail_grids(errors: pl.DataFrame) -> Iterator[Grid]:
    """Every further table of the RMSE table's shape that has something to say."""
    for group in logs_of(errors.filter(pl.col("p_vs_best").is_not_null()), "joint"):
        columns = *words("observer"), *joint_columns(group["joint"].unique().sort().to_list())
        found: dict[str, dict[str, list[str]]] = {}
        for row in group.iter_rows(named=True):
            for title, text in details(row).items():
                found.setdefault(title, {}).setdefault(row["observer"], []).append(text)
        for title, each in found.items():
            if any(set(texts) != {DASH} for texts in each.values()):
                rows = tuple((name, *texts) for name, texts in each.items())
                above = f"{group['recording'][0]}: {title}"
                yield Grid(title=above, columns=columns, rows=rows, swatches=True)


def marks_in_words(found: Sequence[Block]) -> str:
    """Meaning of floor, star and dash, if present."""
    lines = []
    if any(table.has_floor for table in found):
        lines.append("floor: RMSE that the reference itself is known to have")
    if any(np.any(table.at_floor) for table in found):
        lines.append(f"*: within {AT_FLOOR:g} × the floor; the reference can tell no more")
    if any(table.untrusted for table in found):
        lines.append(f"{DAGGER}: {RESTS}")
    lines += dict.fromkeys(f"mean:{t.means.left_out}" for t in found if t.means.without)
    lines += without_answer(found)
    if not all(np.all(np.isfinite(table.rmse)) for table in found):
        lines.append("–: no sample where the reference is known")
    return "".join(f"{text}\n" for text in lines)


def without_answer(found: Sequence[Block]) -> list[str]:
    """Observers that leave samples without an answer, and their share of a joint's samples."""
    lines = (
        f"{name}: no answer in up to {100.0 * share:.2g} % of a joint's samples, each counted as 0"
        for table in found
        for name, share in table.missing.items()
    )
    return list(dict.fromkeys(lines))


def marks_on_page(found: Sequence[Block]) -> str:
    """Meaning of the RMSE table's marks, as HTML."""
    text = (
        "Torque on the robot about each joint's own axis; bold is the best of its joint; "
        "the mean is over the joints with a reference to be trusted."
    )
    if any(block.has_floor for block in found):
        text += (
            " The floor is the error the reference itself is known to have: an RMSE within "
            f"{AT_FLOOR:g} × the floor is <em>at the floor</em>; the reference can tell no more."
        )
    if any(block.untrusted for block in found):
        text += f" {DAGGER}: {RESTS}."
    return " ".join([text, *(f"{escape(line)}." for line in without_answer(found))])


#: Label of a log → bounds [N, N·m] that the paper gives for the RMSE of this log's arm.
PaperBounds = Mapping[str, tuple[float, float]]


def paper_bounds(analyses: "Iterable[Analysis]") -> PaperBounds:
    """What the paper reports of the arms of these logs, from the arms' own profiles."""
    return {
        a.recording.name: (published["wrench_rmse_N"], published["wrench_rmse_Nm"])
        for a in analyses
        if (published := a.robot.published)
    }


def axis_grids(errors: pl.DataFrame, bounds: PaperBounds | None = None) -> Iterator[Grid]:
    """RMSE of the wrenches, one table for each recording and reference that has any."""
    for group in logs_of(errors, "axis"):
        samples = compared_samples(group)
        if not samples:
            continue
        recording, reference = group["recording"][0], group["reference"][0]
        # A force axis has its number in newtons, a moment axis in newton-metres; never both.
        values = group.select("observer", "axis", rmse=pl.coalesce("rmse_N", "rmse_Nm"))
        found: dict[str, dict[str, float | None]] = {}
        for name, axis, value in values.iter_rows():
            found.setdefault(name, {})[axis] = value
        rows: list[tuple[Entry, ...]] = [(name, *map(own.get, AXES)) for name, own in found.items()]
        # The paper compares with a sensor; beside a simulated truth its bounds mean nothing.
        if reference == "sensor" and (limits := (bounds or {}).get(recording)):
            force, moment = limits
            rows.append(("paper, UR5", *[f"< {force:g}"] * 3, *[f"< {moment:g}"] * 3))
        yield Grid(
            title=f"{recording} against {reference}, wrench, {samples} unmasked samples",
            quantity="RMSE",
            columns=(
                *words("observer"),
                *(Column(a, unit_of(a), symbol=f"${a[0].upper()}_{a[1]}$") for a in AXES),
            ),
            rows=tuple(rows),
            swatches=True,
        )


def compared_samples(rows: pl.DataFrame) -> int:
    """Most samples that an axis of a log's wrenches is compared in."""
    return int(max(rows["samples"].drop_nulls().to_list(), default=0))


def nothing_to_compare(errors: pl.DataFrame) -> Iterator[str]:
    """A line for each log and reference without a sample to compare wrenches in, and why."""
    for rows in logs_of(errors, "axis"):
        if not compared_samples(rows):
            yield (
                f"{rows['recording'][0]} against {rows['reference'][0]}, wrench: nothing to "
                "compare: in no sample of the reference can the pose tell a wrench (σ_min of J is "
                f"below {LEAST_SIGMA:g} all along); the joints' torques are compared"
            )


#: Columns of the contact table, and how they are headed.
CONTACTS = {
    "recording": "recording",
    "observer": "observer",
    "signal": "told from",
    "contacts": "contacts",
    "listed_contacts": "rows",
    "found_contacts": "found",
    "missed_contacts": "missed",
    "merged_contacts": "of them merged",
    "split_contacts": "split",
    "false_alarms": "false",
    "false_alarms_per_h": "false alarms/h",
    "detection_delay_s": "mean delay [s]",
    "longest_delay_s": "longest [s]",
}


def contact_grids(errors: pl.DataFrame) -> Iterator[Grid]:
    """How each observer tells contacts, one row a recording and observer; none if not asked."""
    if "contacts" not in errors.columns:
        return
    rows = errors.filter(pl.col("contacts").is_not_null())
    if len(rows):
        columns = dict(zip(CONTACTS, words(*CONTACTS.values()), strict=True))
        yield keyed_grid(columns, rows.iter_rows(named=True), "contacts against the reference")


def drift_grid(drifts: "Iterable[Drift]", spans: bool = False) -> Grid:
    """Zero drift per observer and axis, with five decimals as the paper prints it."""
    title, width = ("Zero drift; the first span's is removed", 0) if spans else ("", 9)
    axes = (Column(axis, unit_of(axis) if spans else "", ".5f", width=width) for axis in AXES)
    columns = *words("observer"), *[Column("span [s]")] * spans, *axes
    rows: tuple[tuple[Entry, ...], ...] = tuple(
        (d.name, *[f"{d.span[0]:g}–{d.span[1]:g}"] * spans, *map(float, d.mean)) for d in drifts
    )
    return Grid(title=title, columns=columns, rows=rows, swatches=True)
