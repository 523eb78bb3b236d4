"""Tables below the answer on the page of one log: contacts, errors, observers, budget, print."""

from collections.abc import Sequence
from itertools import groupby
from operator import itemgetter
from typing import Any

import numpy as np
import polars as pl

from vftcli.analysis import Analysis
from vftcli.contacts.contact_list import Contact, ContactList
from vftcli.evaluation.published import Comparison, Facts, advice, facts
from vftcli.observers.table import OBSERVERS
from vftcli.outputs.grid import Column, Entry, Grid, GridCell, joint_columns
from vftcli.outputs.log.run_record import observer_record
from vftcli.outputs.page.shell import part
from vftcli.outputs.quantity import DASH, banded, signed, significant, vector
from vftcli.refinement.refine import Budget
from vftcli.signals.arrays import Array

#: Headings of the table of what was computed on the log.
COMPUTED = (
    "90 % of a step [ms]",
    "delay [ms]",
    "noise [N·m]",
    "noise > 5 Hz passed",
    "mean RMSE [N·m]",
    "to tune",
)


def words(*heads: str) -> tuple[Column, ...]:
    """Columns of words."""
    return tuple(Column(head, words=True) for head in heads)


def contact_details(found: ContactList) -> tuple[Grid, ...]:
    """Moments, impulses, evidence and joint torques of every contact."""
    if not found.contacts:
        return ()
    forces = ("force [N]", "± sd", "moment [N·m]", "± sd", "mean force [N]", "impulse [N·s]")
    rest = (
        "log-likelihood ratio [nats]",
        "margin of the place [nats]",
        "vendor |F| [N]",
        "sensor |F| [N]",
    )
    wrenches = Grid(
        title="Wrench at the peak, base axes, the moment about the flange point",
        columns=(Column("#"), *words(*forces), *map(Column, rest)),
        rows=tuple(map(wrench_row, found.contacts)),
    )
    torques = Grid(
        title="Joint torque at the peak in N·m, ± its standard deviation",
        columns=(
            Column("#"),
            *joint_columns(len(found.contacts[0].joint_torque)),
            Column("at rest"),
        ),
        rows=tuple(
            (
                str(c.number),
                *(
                    banded(tau, sd, ".2f", "")
                    for tau, sd in zip(c.joint_torque, c.joint_torque_sd, strict=True)
                ),
                "yes" if c.at_rest else "no",
            )
            for c in found.contacts
        ),
    )
    return wrenches, torques


def wrench_row(contact: Contact) -> tuple[Entry, ...]:
    """One contact's numbers."""
    wrench, sd = contact.wrench, contact.wrench_sd
    halves: Sequence[Array | None] = (None,) * 4
    if wrench is not None and sd is not None:
        halves = wrench[:3], sd[:3], wrench[3:], sd[3:]
    vectors = (*halves, contact.mean_force, contact.impulse)
    return (
        str(contact.number),
        *(None if v is None else vector(v) for v in vectors),
        contact.evidence,
        contact.lead,
        contact.vendor_force,
        contact.sensor_force,
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
    heads = ("bias [N·m]", "largest error [N·m]", "correlation")
    keys = ("bias_Nm", "max_Nm", "correlation")
    rows = table.filter(pl.col("joint").is_not_null()).iter_rows(named=True)
    numbers = (Column(head, form=signed) for head in heads)
    return Grid(
        title="Estimate − reference",
        columns=(*words("observer"), Column("joint"), *numbers, Column("samples")),
        rows=tuple(
            (r["observer"], f"J{r['joint']}", *(r[key] for key in keys), r["samples"]) for r in rows
        ),
    )


def observers_view(analysis: Analysis) -> dict[str, Any]:
    """What each observer's parameters are and mean."""
    heads = ("ω_n [rad/s]", "ζ", "delay [ms]", "−3 dB [Hz]", "to tune")
    names = [observer.name for observer in analysis.observers]
    grid = Grid(
        title="What the parameters mean at this log's sample time; one value a joint where they "
        "differ",
        columns=(*words("observer", "What"), *map(Column, heads)),
        rows=tuple(observer_row(analysis, name) for name in names),
        swatches=True,
    )
    # The record has parameters as JSON can hold them, also those of a wrapped observer.
    used = [observer_record(observer, None)["parameters"] for observer in analysis.observers]
    return {
        "grid": grid,
        "names": ", ".join(names),
        "parameters": dict(zip(names, used, strict=True)),
    }


def observer_row(analysis: Analysis, name: str) -> tuple[Entry, ...]:
    """One observer: what it is, and its tuning where that is known."""
    what = OBSERVERS[name].title if name in OBSERVERS else ""
    tuning = analysis.tunings.get(name)
    if tuning is None:
        return (name, what, *[None] * 5)
    columns = (tuning.omega_n, tuning.zeta, 1e3 * tuning.delay, tuning.bandwidth)
    shown = (GridCell("", html=joint_values(column)) for column in columns)
    return (name, what, *shown, tuning.parameter_count)


def joint_values(values: Array) -> str:
    """One number where all joints agree to three digits, else one line a run of equal joints."""
    texts = [significant(float(value)) for value in values]
    # Compared as printed: values that look equal are one.
    runs = [
        (text, [j for j, _ in run]) for text, run in groupby(enumerate(texts, 1), itemgetter(1))
    ]
    return part("parts/joint_values", runs)


def selection_guide(analysis: Analysis) -> tuple[Grid, ...]:
    """Which observer for what, by what was computed on this log."""
    found = facts(analysis.observers, analysis.tunings, analysis.motion.log, analysis.errors)
    if not found:
        return ()
    guide = Grid(
        title="Which observer for what (Sec. IV-A)",
        columns=words("For", "what decides", "best here", "the paper advises"),
        rows=tuple(
            (a.purpose, a.criterion, ", ".join(a.best) or DASH, a.paper) for a in advice(found)
        ),
    )
    computed = Grid(
        title="Computed on this log",
        columns=(*words("observer"), *map(Column, COMPUTED)),
        rows=tuple(map(facts_row, found)),
        swatches=True,
    )
    return guide, computed


def facts_row(found: Facts) -> tuple[Entry, ...]:
    """One observer's facts in the order and the units of the headings."""
    numbers = 1e3 * found.response, 1e3 * found.delay, found.noise, found.passed, found.rmse
    return (found.name, *map(float, numbers), found.parameter_count)


def beside_print(comparison: Comparison) -> Grid:
    """Printed and computed errors side by side."""
    columns = words("observer")
    # Print and computation stand side by side, joint by joint, or nobody compares them.
    for j in range(1, len(comparison.floor) + 1):
        columns += (Column(f"J{j} print", form=".2f"), Column("here"))
    both = [
        (name, np.column_stack([comparison.printed(name), comparison.ours[name]]).ravel())
        for name in comparison.names
    ]
    return Grid(
        title=f"RMSE in N·m: {comparison.published.title}",
        columns=columns,
        rows=tuple((name, *values.tolist()) for name, values in both),
        swatches=True,
    )


def budget_grid(budgets: Sequence[Budget]) -> Grid:
    """Where every observer's error comes from, cause by cause. [N·m]"""
    rows: list[tuple[Entry, ...]] = [
        (budget.name, cause, *map(float, values))
        for budget in budgets
        # Stiction at rest is a bound, not a cause that adds up: the sum leaves it out.
        for cause, values in (*budget.parts.items(), ("all but stiction at rest", budget.total))
    ]
    joints = joint_columns(len(budgets[0].total))
    return Grid(columns=(*words("observer", "cause"), *joints), rows=tuple(rows))
