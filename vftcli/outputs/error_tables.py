"""Errors of torques [N·m] and wrenches [N, N·m] as tables, an observer a row."""

from collections.abc import Iterator, Sequence
from itertools import groupby, starmap
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import polars as pl

from vftcli.doctor.examination import doubt
from vftcli.evaluation.errors import POOLED, JointMeans, joint_means
from vftcli.outputs import Record
from vftcli.outputs.examination import refused_codes
from vftcli.outputs.grid import (
    DASH,
    Column,
    Grid,
    GridCell,
    Rows,
    csv_rows,
    escape_markdown,
    joint_columns,
    latex,
    markdown,
    minus,
    significant,
    terminal,
)
from vftcli.outputs.grids import contact_grids
from vftcli.outputs.run_record import to_json
from vftcli.signals.arrays import Array, Mask
from vftcli.signals.parsing import printable
from vftcli.signals.wrench import AXES, unit_of
from vftcli.wrench.solvers import LEAST_SIGMA

if TYPE_CHECKING:
    from vftcli.analysis import Analysis

#: An RMSE within this factor of the floor may be the reference's own.
AT_FLOOR = 1.2

DAGGER, LATEX_DAGGER = "†", r"$^\dagger$"
OVERRIDDEN = "overridden"  #: Column of the codes of overridden findings.
RESTS = "the joint rests most of the time: stiction is in its reference, do not trust it"


class Block(NamedTuple):
    """RMSE of one recording, observers down, joints across."""

    recording: str  #: The log's label, unique in the command.
    reference: str
    joints: tuple[int, ...]  #: Joint numbers, from 1.
    observers: tuple[str, ...]  #: Names, in the order in which they ran.
    rmse: Array  #: NaN where unknown. (observers, joints) [N·m]
    floor: Array  #: The reference's own error, NaN if unknown. (joints,) [N·m]
    samples: tuple[int, int]  #: Fewest and most samples an entry is made of.
    means: JointMeans  #: Means over the joints.
    #: Observer → largest share of a joint's samples without answer.
    missing: dict[str, float]
    #: Joints at rest: do not trust their reference.
    untrusted: tuple[int, ...] = ()

    @property
    def at_floor(self) -> Mask:
        """Where errors may be the reference's. (observers, joints)"""
        return self.rmse <= AT_FLOOR * self.floor

    @property
    def best(self) -> Mask:
        """Smallest RMSE of each joint, and equals in print. (observers, joints)

        None for a joint at rest, or with several at the floor.
        """
        # Compared as printed, so that equal texts are both bold.
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
        """J1, J2, …; a dagger where not to trust the reference."""
        return [f"J{j}{DAGGER if j in self.untrusted else ''}" for j in self.joints]


def blocks(errors: pl.DataFrame | None) -> tuple[Block, ...]:
    """One block a recording and reference, in table order."""
    return () if errors is None else tuple(map(block, logs_of(errors, "joint")))


def logs_of(errors: pl.DataFrame, place: str) -> Iterator[pl.DataFrame]:
    """Rows of each log and reference, by ``joint`` or ``axis``."""
    if place not in errors.columns:
        return
    rows = errors.filter(pl.col(place).is_not_null())
    # An observer's second row of a joint begins another log.
    again = pl.int_range(pl.len()).over("recording", "reference", "observer", place)
    groups = rows.group_by("recording", "reference", again.alias("again"), maintain_order=True)
    yield from (group for _, group in groups)


def block(rows: pl.DataFrame) -> Block:
    """The rows of one recording as a matrix."""
    joints = rows["joint"].unique().sort()
    wide = rows.pivot("joint", index="observer", values="rmse_Nm")
    floors = dict(rows.select("joint", "reference_floor_Nm").rows())
    # Joints may differ in samples with a reference.
    counts = rows["samples"].drop_nulls().to_list() or [0]
    doubtful = rows.filter(~pl.col("reference_trusted").fill_null(True))["joint"].unique().sort()
    missing = rows.group_by("observer", maintain_order=True).agg(pl.col("missing").max())
    return Block(
        recording=str(rows["recording"][0]),
        reference=str(rows["reference"][0]),
        joints=tuple(joints),
        observers=tuple(wide["observer"]),
        # Null is what polars has for unknown.
        rmse=wide.select(*map(str, joints)).cast(pl.Float64).to_numpy(),
        floor=np.array([floors[j] for j in joints], dtype=float),
        samples=(min(counts), max(counts)),
        means=joint_means(rows),
        missing={name: share for name, share in missing.rows() if share},
        untrusted=tuple(doubtful),
    )


def rmse_grid(table: Block) -> Grid:
    """One recording's RMSE by observer and joint, floor last."""
    rows: Rows = []
    beside = {
        Column(head, form=form, seldom=True): known
        for head, form, known in (
            ("L1", significant, table.means.l1),
            ("skill", ".2f", table.means.skill),
        )
        if np.isfinite([*known.values()]).any()
    }
    for name, *each in zip(table.observers, table.rmse, table.best, table.at_floor, strict=True):
        # A star where the reference is no more accurate than that.
        cells = [
            GridCell(significant(value), bool(best), "*" * bool(at_floor))
            for value, best, at_floor in zip(*each, strict=True)
        ]
        means = (known.get(name) for known in beside.values())
        rows.append((name, *cells, table.means.errors.get(name), *means))
    if table.has_floor:
        blank = [""] * len(beside)
        rows.append(("floor", *map(float, table.floor), table.means.floor, *blank))
    joints = (
        Column(head, symbol=f"$J_{{{j}}}${LATEX_DAGGER * (j in table.untrusted)}")
        for j, head in zip(table.joints, table.joint_heads, strict=True)
    )
    return Grid(
        ("observer", *joints, Column("mean"), *beside),
        rows,
        table.title,
        "RMSE",
        "N·m",
        int(table.has_floor),
        marked=True,
        notes=tuple(marks_in_words([table])),
        swatches=True,
    )


#: Titles of the tables below that of the RMSE.
DETAILS = (
    "95 % interval of the RMSE, moving-block bootstrap [N·m]",
    "delay of the estimate behind the reference, best fit [ms]",
    "samples within the estimate's 95 % band, while the joint moves",
)


def details(row: Record) -> tuple[str, ...]:
    """Texts in the tables of `DETAILS` for one row."""
    low, high, lag = (row[k] for k in ("rmse_low_Nm", "rmse_high_Nm", "lag_s"))
    share, unknown = row.get("coverage_95"), low is None or high is None
    return (
        DASH if unknown else f"{significant(low, 2)}–{significant(high, 2)}",
        DASH if lag is None else minus(f"{round(1e3 * lag)}"),
        DASH if share is None else f"{100 * share:.0f} %",
    )


def detail_grids(errors: pl.DataFrame) -> Iterator[Grid]:
    """Further tables in the RMSE table's shape, if not empty."""
    for group in logs_of(errors.filter(pl.col("samples") > 0), "joint"):
        columns = "observer", *joint_columns(group["joint"].unique().sort().to_list())
        found = {
            name: list(zip(*map(details, own.iter_rows(named=True)), strict=True))
            for (name,), own in group.group_by("observer", maintain_order=True)
        }
        for k, title in enumerate(DETAILS):
            rows = [(str(name), *texts[k]) for name, texts in found.items()]
            if any(set(texts) != {DASH} for _, *texts in rows):
                yield Grid(columns, rows, f"{group['recording'][0]}: {title}", swatches=True)


def marks_in_words(found: Sequence[Block]) -> list[str]:
    """Meaning of floor, star and dash, a line each, if present."""
    lines = []
    if any(table.has_floor for table in found):
        lines.append("floor: the reference's own error (RMSE)")
    if any(np.isfinite([*table.means.skill.values()]).any() for table in found):
        lines.append("L1: mean |error|; skill: 1 is exact, 0 no better than an estimate of zero")
    if any(np.any(table.at_floor) for table in found):
        lines.append(f"*: within {AT_FLOOR:g} × the floor: may be the reference's own error")
    if any(table.untrusted for table in found):
        lines.append(f"{DAGGER}: {RESTS}")
    lines += dict.fromkeys(f"mean:{t.means.left_out}" for t in found if t.means.without)
    lines += dict.fromkeys(
        f"{name}: no answer in up to {100.0 * share:.2g} % of its samples, each counted as 0"
        for table in found
        for name, share in table.missing.items()
    )
    if not all(np.all(np.isfinite(table.rmse)) for table in found):
        lines.append("–: no sample where the reference is known")
    return lines


def axis_grids(errors: pl.DataFrame) -> Iterator[Grid]:
    """RMSE of the wrenches, a table a log."""
    for group in logs_of(errors, "axis"):
        samples = compared_samples(group)
        if not samples:
            continue
        recording, reference = group["recording"][0], group["reference"][0]
        values = group.select("observer", "axis", rmse=pl.coalesce("rmse_N", "rmse_Nm"))
        wide = values.pivot("axis", index="observer", values="rmse")
        rows: Rows = list(wide.select("observer", *AXES).rows())
        axes = (Column(a, unit_of(a), symbol=f"${a[0].upper()}_{a[1]}$") for a in AXES)
        title = f"{recording} against {reference}, wrench, {samples} unmasked samples"
        yield Grid(("observer", *axes), rows, title, quantity="RMSE", swatches=True)


def compared_samples(rows: pl.DataFrame) -> int:
    """Most compared samples of an axis of a log's wrenches."""
    return int(max(rows["samples"].drop_nulls().to_list(), default=0))


def nothing_to_compare(errors: pl.DataFrame) -> Iterator[str]:
    """A line for each log without a common wrench sample."""
    for rows in logs_of(errors, "axis"):
        if not compared_samples(rows):
            yield (
                f"{rows['recording'][0]} against {rows['reference'][0]}, wrench: nothing to "
                "compare: no sample of the reference has a known wrench (σ_min of J is "
                f"below {LEAST_SIGMA:g} all along); the joints' torques are compared"
            )


def marked(errors: pl.DataFrame, analyses: "Sequence[Analysis]") -> pl.DataFrame:
    """The errors, with a column `overridden` where a finding makes them meaningless.

    It holds the codes of these findings, in pooled rows those of all logs.
    """
    found = {a.recording.name: refused_codes(a.examinations) for a in analyses}
    codes = {name: ", ".join(each) for name, each in found.items() if each}
    if not codes:
        return errors
    every = {POOLED: "; ".join(f"{name}: {text}" for name, text in codes.items()), **codes}
    column = pl.col("recording").replace_strict(every, default=None, return_dtype=pl.String)
    return errors.with_columns(overridden=column)


def doubts_of(errors: pl.DataFrame) -> list[str]:
    """Lines above tables of meaningless errors, one a log."""
    if OVERRIDDEN not in errors.columns:
        return []
    rows = errors.select("recording", OVERRIDDEN).unique(maintain_order=True).drop_nulls()
    return [doubt(f"{name}: {codes}") for name, codes in rows.iter_rows() if name != POOLED]


def to_terminal(errors: pl.DataFrame, *, every: bool = True) -> str:
    """The tables of the errors as text, with their marks' meaning."""
    found = blocks(errors)
    if not found:
        return "no errors to show: the estimates and the reference have no sample in common\n"
    above, marks, below = (
        "".join(f"{printable(line)}\n" for line in lines)
        for lines in (doubts_of(errors), marks_in_words(found), nothing_to_compare(errors))
    )
    joints = "\n".join(terminal(rmse_grid(table)) for table in found)
    details = detail_grids(errors) if every else ()
    grids = (*details, *axis_grids(errors), *contact_grids(errors))
    return above + "\n".join([joints + marks + below, *map(terminal, grids)])


def to_markdown(errors: pl.DataFrame) -> str:
    """All tables of the errors as GitHub Markdown."""
    found = blocks(errors)
    doubts = (f"> **{escape_markdown(line)}**\n" for line in doubts_of(errors))
    marks = map(escape_markdown, [*marks_in_words(found), *nothing_to_compare(errors)])
    tables = map(markdown, map(rmse_grid, found))
    below = map(markdown, [*detail_grids(errors), *axis_grids(errors)])
    return "\n".join([*doubts, *tables, *(f"{line}\n" for line in marks), *below])


def to_latex(errors: pl.DataFrame) -> str:
    """The RMSE as LaTeX tables; equal joint heads share one."""
    lines = [*doubts_of(errors), *nothing_to_compare(errors)]
    doubts = "".join(f"% {printable(line)}\n" for line in lines)
    alike = groupby(blocks(errors), key=lambda table: table.joint_heads)
    found = [list(map(rmse_grid, tables)) for _, tables in alike]
    if axes := list(axis_grids(errors)):
        found.append(axes)
    return doubts + "\n".join(starmap(latex, found))


#: Name of a form → the text of the errors table in it.
FORMS = {
    "csv": lambda errors: csv_rows(errors.to_dicts(), errors.columns),
    "json": lambda errors: to_json(errors.to_dicts()),
    "markdown": to_markdown,
    "latex": to_latex,
}
