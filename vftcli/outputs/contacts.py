"""The list of contacts as JSON, CSV and a table."""

from collections.abc import Sequence
from typing import Any

from vftcli.contacts.contact_list import FIRST_COLUMNS, Contact, ContactList
from vftcli.outputs.answer import direction, free_words, place_words
from vftcli.outputs.grid import Column, Grid, csv_rows
from vftcli.outputs.quantity import banded

MOST_ROWS = 20  #: Rows on the terminal unless all are asked for.

FRAME, SIGN = "base axes, moment about the flange point", "on the robot"


def contacts_record(found: ContactList) -> dict[str, Any]:
    """A log's contacts for machines; units stand in the names."""
    model = found.model
    return {
        "recording": found.recording,
        "frame": FRAME,
        "sign": SIGN,
        "free_part": free_words(found) or None,
        "free_s": found.free_seconds,
        "smallest_force_N": found.smallest_force,
        "evidence_threshold_nats": found.threshold,
        "false_on_free": found.false_on_free,
        "basis": found.basis,
        "load": None if found.load is None else found.load.record(),
        "largest_unexplained": None if found.unexplained is None else found.unexplained._asdict(),
        "duration_s": found.duration,
        "stops_s": list(found.stops),
        "model": {
            "tau_w_s": model.prior.time if model.prior else None,
            "sigma_force_N": model.prior.force if model.prior else None,
            "sigma_moment_Nm": model.prior.moment if model.prior else None,
            "noise_sd_Nm": model.noise_sd,
            "friction_sd_Nm": model.error_sd,
            "friction_time_s": model.error_time,
            "block_s": model.block,
        },
        "remarks": list(found.remarks),
        "contacts": [contact.record() for contact in found.contacts],
        "candidates": [contact.record() for contact in found.candidates],
    }


def contacts_csv(lists: Sequence[ContactList]) -> str:
    """One row a contact of every log, vectors split."""
    rows = [
        {"recording": found.recording} | contact.row()
        for found in lists
        for contact in found.contacts
    ]
    keys = list(dict.fromkeys(key for row in rows for key in row))
    keys = keys or ["recording", *FIRST_COLUMNS]
    return csv_rows([{key: row.get(key) for key in keys} for row in rows], keys)


def hardest_rows(contacts: Sequence[Contact], most: int = MOST_ROWS) -> list[Contact]:
    """So many contacts with the largest force, else the most evidence, in time's order."""
    order = sorted(contacts, key=by_force, reverse=True)
    return sorted(order[:most], key=lambda contact: contact.start)


def by_force(contact: Contact) -> tuple[bool, float, float]:
    """By what contacts are ordered: those with a size before the others, then force, evidence."""
    return contact.size_known, contact.peak_force or 0.0, contact.evidence or 0.0


def contact_grid(contacts: Sequence[Contact]) -> Grid:
    """The table of contacts."""
    force = any(contact.peak_force is not None for contact in contacts)
    columns = [Column("#"), Column("from – to [s]", words=True)]
    if force:
        columns += [Column("|F| [N]"), Column("range"), Column("direction", words=True)]
    else:
        columns += [Column("joint torque [N·m]", words=True)]
    columns += [Column("where", words=True), Column("trust", words=True)]
    return Grid(columns=tuple(columns), rows=tuple(contact_row(c, force) for c in contacts))


def contact_row(contact: Contact, force: bool) -> list[str]:
    """One row of the table."""
    row = [str(contact.number), f"{contact.start:6.2f} – {contact.stop:6.2f}"]
    if force and contact.wrench is not None and contact.anywhere is not None:
        low, high = contact.anywhere
        size = banded(contact.peak_force, contact.peak_band, unit="")
        row += ["unknown" if contact.place_unknown else size, f"{low:.0f}–{high:.0f}"]
        row.append(direction(contact.wrench[:3]))
    else:
        row.append(" ".join(f"{torque:.1f}" for torque in contact.joint_torque))
    return [*row, place_words(contact), contact.trust]
