"""Content of the pages of one log, of several logs and of a batch."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from itertools import groupby, repeat
from operator import itemgetter
from typing import Any

import numpy as np
import polars as pl

from vftcli.analysis import Analysis
from vftcli.contacts.contact_list import ContactList
from vftcli.observers.table import OBSERVERS
from vftcli.outputs import Record
from vftcli.outputs.believability import LOG_COLUMNS, LogSummary, grounds, headline, least_error
from vftcli.outputs.contacts import hardest_rows, otherwise
from vftcli.outputs.error_tables import axis_grids, blocks, nothing_to_compare, rmse_grid
from vftcli.outputs.examination import rate_of
from vftcli.outputs.grid import (
    DASH,
    Column,
    Grid,
    GridCell,
    Rows,
    banded,
    joint_columns,
    keyed_grid,
    ranged,
    significant,
    vector,
)
from vftcli.outputs.grids import contact_grids, drift_grid, print_grid
from vftcli.outputs.page import log_charts
from vftcli.outputs.page.shell import Box, page, part, scales_of
from vftcli.outputs.page.stage import contact_words, free_spans, stage_data, still_arm, view_of
from vftcli.outputs.run_record import observer_record, run_record
from vftcli.outputs.shapes import link_surfaces
from vftcli.signals.arrays import Z_95, Array
from vftcli.signals.parsing import printable
from vftcli.signals.remarks import fact, sentence
from vftcli.wrench.solvers import FRAMES

MOST_NAMED = 6  #: Most uncertain contacts that the lead names; more are counted.
FORCE_BOX = Box(width=1120, height=250, left=44, bottom=22, top=34, right=10)  #: That of |F|.
#: File beside the page → what it is.
FILES = {
    "recording.rrd": "3-D recording for Rerun",
    "estimates.parquet": "every sample",
    "contacts.csv": "this list",
    "errors.csv": "errors by joint",
    "run.json": "settings, versions, remarks",
}
MOST = 40  #: Most contacts in numbers.
#: Keys of vectors in a contact's record; of deviations the 95 % band is shown.
VECTORS = ("force_N", "force_sd_N", "moment_Nm", "moment_sd_Nm", "mean_force_N", "impulse_Ns")
#: Columns of the table of contacts.
WRENCHES = (
    *map(Column, ("#", "from – to [s]", "range [N]")),
    *("force [N]", "±", "moment [N·m]", "±", "mean force [N]", "impulse [N·s]"),
    *map(Column, ("log-likelihood ratio [nats]", "margin of the place [nats]")),
    *map(Column, ("vendor |F| [N]", "sensor |F| [N]")),
)


def render(analysis: Analysis, sizes: Mapping[str, int | None] = {}) -> str:
    """The report of one log.

    `sizes` are bytes of the files beside it, None for one still to be written.
    """
    found, record = analysis.contacts, analysis.run or run_record(analysis, "")
    log, camera = analysis.recording, view_of(analysis)
    torque, wrench = log_charts.torque_chart(analysis), log_charts.wrench_chart(analysis)
    charts = [torque] if wrench is None else [torque, wrench]
    view: Record = {"grounds": grounds(analysis), "record": record, "force": None}
    if found is not None:
        if (force := log_charts.force_chart(analysis, found)) is not None:
            charts.insert(0, force)
            view |= {"force": force, "scales": next(scales_of(force, FORCE_BOX))}
        view |= {
            "most": max((c.anywhere[1] for c in found.contacts if c.anywhere), default=1.0),
            "free": free_spans(analysis),
            "contact_grids": contact_details(found),
            "model": model_pairs(found),
        }
    if (sensed := analysis.virtual_sensor) is not None:
        grids = [drift_grid(sensed.drifts)] if sensed.drifts else []
        grids += contact_grids(analysis.errors)
        view |= {"wrench_axes": FRAMES[sensed.sensor.frame], "wrench_grids": grids}
    if (refined := analysis.refinement) is not None and refined.budget:
        ((name, causes),) = refined.budget.items()
        rows: Rows = [(name, cause, *values) for cause, values in causes.items()]
        view["budget"] = Grid(("observer", "cause", *joint_columns(log.joints)), rows)
    if analysis.published is not None:
        view["printed"] = print_grid(analysis.published)
    answer, (surfaces, lacking) = headline(analysis), link_surfaces(analysis.robot)
    span = f"{log.duration:.1f} s" + (f" at {rate:.0f} Hz" if (rate := rate_of(log)) else "")
    if lacking:
        view["drawing"] = fact("meshes-not-found", count=len(lacking), first=lacking[0])
    return page(
        "report.html",
        f"{answer} – {log.name}",
        charts,
        log_charts.observer_styles(analysis),
        partial(stage_data, analysis, camera, surfaces),
        f"{printable(log.name)} · sha256 {log.source.sha256 or 'unknown'} · torques and forces ON "
        "the robot · ± is the half width of the 95 % band",
        analysis=analysis,
        found=found,
        contact_words=contact_words,
        headline=answer,
        eyebrow=(log.name, analysis.robot.title or analysis.robot.name, span),
        sentences=lead_sentences(analysis),
        arm=still_arm(analysis, camera, found.hardest if found is not None else None),
        torque=torque,
        wrench=wrench,
        errors=errors_view(analysis),
        observers=observers_view(analysis),
        files=[(name, what, sizes[name]) for name, what in FILES.items() if name in sizes],
        remarks=[*record.get("warnings", ()), *record.get("repairs", ()), *record["remarks"]],
        **view,
    )


def lead_sentences(analysis: Analysis) -> list[str]:
    """Sentences on places, uncertain rows and hidden forces."""
    found = analysis.contacts
    if found is None:
        unlisted = [r for r in analysis.remarks if r.code == "contacts-not-listed"]
        return [f"What touched the arm is unknown: {sentence(r)}." for r in unlisted]
    said, rows = list[str](), [c for c in found.contacts if not c.is_load]
    places = Counter(
        "at an unknown place" if c.where == "cannot tell" else f"on the {c.where}" for c in rows
    )
    if len(places) == 1 and len(rows) > 1:
        said.append(f"All {next(iter(places))}.")
    elif len(places) > 1:
        said.append(f"{', '.join(f'{count} {place}' for place, count in places.items())}.")
    weak = [str(contact.number) for contact in rows if contact.trust == "weak"]
    if len(weak) == 1:
        said.append(f"The size of contact {weak[0]} is uncertain.")
    elif weak:
        several = f"contacts {', '.join(weak[:-1])} and {weak[-1]}"
        named = several if len(weak) <= MOST_NAMED else f"{len(weak)} contacts"
        said.append(f"The sizes of {named} are uncertain.")
    return [*said, otherwise(found)]


def errors_view(analysis: Analysis) -> Record:
    """Tables of errors, if any, and their summary."""
    table, found = analysis.errors, blocks(analysis.errors)
    if table is None or not found:
        return {"state": "none given", "first": ()}
    means, state = found[0].means, "no sample in common with the estimates"
    if means.least is not None:
        name, least = means.least
        state = f"{significant(least)} N·m ({name}) against {found[0].reference}{means.left_out}"
    return {
        "state": state,
        "first": list(map(rmse_grid, found)),
        "axes": axis_grids(table),
        "missing": nothing_to_compare(table),
    }


def contact_details(found: ContactList) -> tuple[Grid, ...]:
    """Moments, impulses, evidence and torques of `MOST` contacts."""
    if not found.contacts:
        return ()
    contacts = hardest_rows(found.contacts, MOST)
    title = "Wrench at the peak, base axes, the moment about the flange point"
    if len(contacts) < len(found.contacts):
        title += f"; the {MOST} hardest, contacts.csv has all"
    wrenches: Rows = []
    torques: Rows = []
    for c in contacts:
        vectors = (
            None if x is None else vector(np.multiply(Z_95 if "_sd_" in key else 1.0, x))
            for key, x in zip(VECTORS, map(c.record().get, VECTORS), strict=True)
        )
        ends = DASH if c.anywhere is None else ranged(*c.anywhere, unit="")
        row = str(c.number), f"{c.start:.2f} – {c.stop:.2f}", ends, *vectors, c.evidence
        wrenches.append((*row, c.lead, c.vendor_force, c.sensor_force))
        bands = Z_95 * c.joint_torque_sd
        each = map(banded, c.joint_torque, bands, repeat(".2f"), repeat(""))
        torques.append((str(c.number), *each, c.at_rest))
    columns = Column("#"), *joint_columns(len(contacts[0].joint_torque)), Column("at rest")
    below = "Joint torque at the peak in N·m"
    return Grid(WRENCHES, wrenches, title), Grid(columns, torques, below)


def model_pairs(found: ContactList) -> dict[str, str]:
    """The settings of a list."""
    model, prior = found.model, found.model.prior
    each = (model.noise_sd, model.error_sd, model.error_time)
    noise, error, time = (", ".join(map(significant, values.tolist())) for values in each)
    pairs = {
        "basis": found.basis,
        "free motion": f"{found.free_seconds:.1f} s",
        "false contacts in it": DASH if found.false_on_free is None else str(found.false_on_free),
        "evidence asked": DASH if found.threshold is None else f"{found.threshold:.1f} nats",
        "block": f"{model.block:.3g} s",
        "noise, joint by joint": f"{noise} N·m",
        "model error": f"{error} N·m",
        "its correlation time": f"{time} s",
    }
    if prior is not None:
        sizes = f"{prior.force:.3g} N and {prior.moment:.3g} N·m"
        pairs["contacts' force and moment"] = f"{sizes}, which keep for {prior.time:.3g} s"
    return pairs


def observers_view(analysis: Analysis) -> Record:
    """Each observer's parameters and their meaning."""
    rows: Rows = []
    # Parameters in JSON types, also of a wrapped observer.
    used = {o.name: observer_record(o, None)["parameters"] for o in analysis.observers}
    for name in used:
        what, meant = OBSERVERS[name].title if name in OBSERVERS else "", list[Any]([None] * 5)
        if (tuning := analysis.tunings.get(name)) is not None:
            columns = (tuning.omega_n, tuning.zeta, 1e3 * tuning.delay, tuning.bandwidth)
            meant = [GridCell("", html=joint_values(column)) for column in columns]
            meant.append(tuning.parameter_count)
        rows.append((name, what, *meant))
    heads = ("ω_n [rad/s]", "ζ", "delay [ms]", "−3 dB [Hz]", "to tune")
    title = "What the gains mean at this log's sample time; one value per joint where they differ"
    grid = Grid(("observer", "What", *map(Column, heads)), rows, title, swatches=True)
    return {"grid": grid, "names": ", ".join(used), "parameters": used}


def joint_values(values: Array) -> str:
    """One number if all joints agree, else a line a run of joints."""
    # Compared as printed: values that look equal are one.
    texts = enumerate(map(significant, values.tolist()), 1)
    runs = [(text, [j for j, _ in run]) for text, run in groupby(texts, itemgetter(1))]
    return part("parts/joint_values", runs)


def render_logs(
    lines: Sequence[LogSummary],
    failed: Mapping[str, str] = {},
    analyses: Sequence[Analysis] = (),
    below: str = "",
) -> str:
    """The page of several logs: with `analyses`, or a batch's."""
    title, lead = logs_headline(lines)
    robots = dict.fromkeys(line.robot for line in lines)
    each = zip(lines, analyses, strict=False)
    rows = [
        line.row(
            log=GridCell(line.log, html=line.page and part("parts/link", line.page, line.log)),
            health=GridCell(line.reason, html=part("parts/state", line)),
        )
        for line in sorted(lines, key=lambda line: line.rank)
    ]
    keys = [key for key in LOG_COLUMNS if any(row[key] not in (None, DASH) for row in rows)]
    return page(
        "logs.html",
        title,
        eyebrow=(f"{len(lines) + len(failed)} logs", ", ".join(robots)),
        words=lead,
        examinations=[one for analysis in analyses for one in analysis.examinations],
        overview=keyed_grid({key: LOG_COLUMNS[key] for key in keys}, rows),
        failed=failed,
        below=below,
        tables=[(x, map(rmse_grid, blocks(a.errors))) for x, a in each if a.errors is not None],
    )


def logs_headline(lines: Sequence[LogSummary]) -> tuple[str, str]:
    """Number of logs with contact, and place of the hardest."""
    listed = [line for line in lines if line.contacts is not None]
    pushed = [line for line in listed if line.contacts and not line.load]
    loads, lead = sum(line.load is True for line in listed), ""
    if not listed:
        return f"External joint torques from {len(lines)} logs.", ""
    title = f"Something pushed the arm in {len(pushed)} of {len(listed)} logs."
    if not pushed and not loads:
        title = "Nothing pushed the arm, as far as these logs can tell."
    if hard := [line for line in pushed if line.hardest_N is not None]:
        most = max(hard, key=lambda line: line.hardness)
        lead = f"Hardest in {most.log}: {most.hardest}."
    if loads:
        lead += f" {loads} more bear{'s' * (loads == 1)} a load, or a wrong payload or model."
    return title, lead.strip()


def batch_lines(table: pl.DataFrame, pages: Mapping[str, str]) -> Iterator[LogSummary]:
    """The line of every log, from a batch's table alone."""
    for (log,), rows in table.group_by("log", maintain_order=True):
        facts = {
            key: x for key, x in rows.row(0, named=True).items() if key in LogSummary._fields
        }
        yield LogSummary(**facts, error=least_error(rows), page=pages.get(str(log), ""))
