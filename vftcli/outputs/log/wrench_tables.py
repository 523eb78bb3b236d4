"""Tables of wrenches: errors along six axes, newtons and newton-metres, and contacts found."""

from collections.abc import Iterable, Iterator, Mapping
from typing import TYPE_CHECKING

import polars as pl

from vftcli.outputs.grid import Column, Grid
from vftcli.outputs.log.rmse_tables import logs_of
from vftcli.signals.wrench import AXES, unit_of
from vftcli.virtual_sensor.solvers import LEAST_SIGMA

if TYPE_CHECKING:
    from vftcli.analysis import Analysis
    from vftcli.virtual_sensor.zero import Drift

#: Label of a log → bounds [N, N·m] that the paper gives for the RMSE of this log's arm.
PaperBounds = Mapping[str, tuple[float, float]]


def paper_bounds(analyses: "Iterable[Analysis]") -> PaperBounds:
    """What the paper reports of the arms of these logs, from the arms' own profiles."""
    found = {a.recording.name: a.robot.published for a in analyses}
    return {
        label: (published["wrench_rmse_N"], published["wrench_rmse_Nm"])
        for label, published in found.items()
        if published
    }


def axis_grids(errors: pl.DataFrame, bounds: PaperBounds | None = None) -> Iterator[Grid]:
    """RMSE of the wrenches, one table for each recording and reference that has any."""
    for group in logs_of(errors, "axis"):
        recording, reference = str(group["recording"][0]), str(group["reference"][0])
        found: dict[str, dict[str, float | None]] = {}
        for row in group.iter_rows(named=True):
            # A force axis has its number in newtons, a moment axis in newton-metres; never both.
            value = row["rmse_N"] if row["rmse_N"] is not None else row["rmse_Nm"]
            found.setdefault(str(row["observer"]), {})[str(row["axis"])] = value
        rows: list[tuple[str | float | None, ...]] = [
            (name, *(values.get(axis) for axis in AXES)) for name, values in found.items()
        ]
        # The paper compares with a sensor; beside a simulated truth its bounds mean nothing.
        if reference == "sensor" and (limits := (bounds or {}).get(recording)):
            force, moment = limits
            rows.append(("paper, UR5", *[f"< {force:g}"] * 3, *[f"< {moment:g}"] * 3))
        samples = compared_samples(group)
        if not samples:
            continue
        yield Grid(
            title=f"{recording} against {reference}, wrench, {samples} unmasked samples",
            quantity="RMSE",
            columns=(
                Column("observer", words=True),
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
        yield Grid(
            title="contacts against the reference",
            columns=tuple(Column(head, words=True) for head in CONTACTS.values()),
            rows=tuple(tuple(row[key] for key in CONTACTS) for row in rows.iter_rows(named=True)),
        )


def drift_grid(drifts: "Iterable[Drift]", spans: bool = False) -> Grid:
    """Zero drift per observer and axis, with five decimals as the paper prints it."""
    span = (Column("span [s]"),) if spans else ()
    axes = (
        Column(axis, unit_of(axis) if spans else "", ".5f", width=0 if spans else 9)
        for axis in AXES
    )
    return Grid(
        columns=(Column("observer", words=True), *span, *axes),
        rows=tuple(
            (d.name, *((f"{d.span[0]:g}–{d.span[1]:g}",) if spans else ()), *map(float, d.mean))
            for d in drifts
        ),
        title="Zero drift; the first span's is removed" if spans else "",
        swatches=True,
    )
