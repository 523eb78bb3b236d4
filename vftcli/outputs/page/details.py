"""Tables in the details of the page of one log: contacts, observers, budget, print."""

from collections.abc import Sequence
from itertools import groupby, repeat
from operator import itemgetter
from typing import Any

import numpy as np

from vftcli.analysis import Analysis
from vftcli.bias.refine import Budget
from vftcli.contacts.contact_list import ContactList
from vftcli.evaluation.published import Comparison
from vftcli.observers.table import OBSERVERS
from vftcli.outputs import Record
from vftcli.outputs.contacts import hardest_rows
from vftcli.outputs.grid import Column, Grid, GridCell, Rows, joint_columns, words
from vftcli.outputs.page.shell import part
from vftcli.outputs.quantity import DASH, banded, ranged, significant, vector
from vftcli.outputs.run_record import observer_record
from vftcli.signals.arrays import Array

MOST = 40  #: Contacts in numbers at most.
#: Keys of what has three numbers in a contact's record.
VECTORS = ("force_N", "force_sd_N", "moment_Nm", "moment_sd_Nm", "mean_force_N", "impulse_Ns")
#: Columns of the table of contacts.
WRENCHES = (
    *map(Column, ("#", "from – to [s]", "range [N]")),
    *words("force [N]", "± sd", "moment [N·m]", "± sd", "mean force [N]", "impulse [N·s]"),
    *map(Column, ("log-likelihood ratio [nats]", "margin of the place [nats]")),
    *map(Column, ("vendor |F| [N]", "sensor |F| [N]")),
)


def contact_details(found: ContactList) -> tuple[Grid, ...]:
    """Moments, impulses, evidence and joint torques of the contacts, `MOST` at most."""
    if not found.contacts:
        return ()
    contacts = hardest_rows(found.contacts, MOST)
    title = "Wrench at the peak, base axes, the moment about the flange point"
    if len(contacts) < len(found.contacts):
        title += f"; the {MOST} hardest, contacts.csv has all"
    wrenches: Rows = []
    torques: Rows = []
    for c in contacts:
        record = c.record()
        vectors = (None if record[key] is None else vector(record[key]) for key in VECTORS)
        rest = (c.evidence, c.lead, c.vendor_force, c.sensor_force)
        ends = DASH if c.anywhere is None else ranged(*c.anywhere, unit="")
        wrenches.append((str(c.number), f"{c.start:.2f} – {c.stop:.2f}", ends, *vectors, *rest))
        each = map(banded, c.joint_torque, c.joint_torque_sd, repeat(".2f"), repeat(""))
        torques.append((str(c.number), *each, c.at_rest))
    columns = Column("#"), *joint_columns(len(contacts[0].joint_torque)), Column("at rest")
    below = "Joint torque at the peak in N·m, ± its standard deviation"
    return Grid(WRENCHES, wrenches, title), Grid(columns, torques, below)


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
        sizes = f"{prior.force:.3g} N and {prior.moment:.3g} N·m"
        pairs["contacts' force and moment"] = f"{sizes}, which keep for {prior.time:.3g} s"
    return pairs


def observers_view(analysis: Analysis) -> Record:
    """What each observer's parameters are and mean."""
    rows: Rows = []
    for name in (observer.name for observer in analysis.observers):
        what, meant = OBSERVERS[name].title if name in OBSERVERS else "", list[Any]([None] * 5)
        if (tuning := analysis.tunings.get(name)) is not None:
            columns = (tuning.omega_n, tuning.zeta, 1e3 * tuning.delay, tuning.bandwidth)
            meant = [GridCell("", html=joint_values(column)) for column in columns]
            meant.append(tuning.parameter_count)
        rows.append((name, what, *meant))
    heads = ("ω_n [rad/s]", "ζ", "delay [ms]", "−3 dB [Hz]", "to tune")
    title = "What the parameters mean at this log's sample time; one value a joint where they "
    title += "differ"
    # Parameters as JSON can hold them, also those of a wrapped observer.
    used = {o.name: observer_record(o, None)["parameters"] for o in analysis.observers}
    grid = Grid((*words("observer", "What"), *map(Column, heads)), rows, title, swatches=True)
    return {"grid": grid, "names": ", ".join(used), "parameters": used}


def joint_values(values: Array) -> str:
    """One number where all joints agree to three digits, else one line a run of equal joints."""
    # Compared as printed: values that look equal are one.
    texts = enumerate(map(significant, values.tolist()), 1)
    runs = [(text, [j for j, _ in run]) for text, run in groupby(texts, itemgetter(1))]
    return part("parts/joint_values", runs)


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
