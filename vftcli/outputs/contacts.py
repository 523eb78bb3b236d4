"""The list of contacts as JSON, CSV, a table and a sentence."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from vftcli.contacts.contact_list import FIRST_COLUMNS, Contact, ContactList
from vftcli.outputs.grid import Column, Grid, csv_rows
from vftcli.signals.arrays import Array
from vftcli.signals.remarks import sentence

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
    """One row a contact of every log, vectors taken apart."""
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


def answer(found: ContactList) -> str:
    """What the arm carries and what touched it, in a few sentences."""
    if (load := found.load) is None:
        return list_words(found)
    mass, (start, stop) = f"{load.mass:.2f} ± {load.sd:.2f} kg", load.span
    hint = f": {load.payload}? Add --payload {load.payload}" if load.payload else ""
    return (
        f"The arm carries {mass} that {load.robot} does not know of "
        f"({start:.1f}–{stop:.1f} s){hint}. {list_words(found)}"
    )


def list_words(found: ContactList) -> str:
    """What touched the arm, in one or two sentences."""
    count = len(found.contacts)
    if found.unexplained is not None:
        torque, joint, at = found.unexplained
        return (
            f"Largest unexplained torque: {torque:.2g} N·m on J{joint} at {at:.1f} s: a contact or "
            "a model error. To list contacts name free motion (--free) or give a robot with "
            "friction (vftcli identify)."
        )
    if not count:
        return none_words(found)
    first = found.contacts[0]
    if first.is_load and first.peak_force is not None and first.mean_force is not None:
        size = f"{first.peak_force:.0f} ± {first.peak_band:.0f} N"
        if not first.size_known:
            most = first.peak_force + (first.peak_band or 0.0)
            return f"A load, or a wrong payload, or a wrong model: below {most:.0f} N on average."
        return (
            f"A load, or a wrong payload, or a wrong model: {size} on average, "
            f"{direction(first.mean_force)}."
        )
    what = f"{count} contact{'s' if count > 1 else ''}."
    hardest = found.hardest
    if hardest is None:
        return what
    if not hardest.size_known:
        return f"{what} {unknown_size(hardest)}"
    where = "" if hardest.where == "cannot tell" else f" on the {hardest.where}"
    size = f"{hardest.peak_force:.0f} ± {hardest.peak_band:.0f} N"
    weak = " (weak)" if hardest.trust == "weak" else ""
    return f"{what} {hardest_name(found)}, at {hardest.peak:.1f} s: {size}{where}{weak}."


def none_words(found: ContactList) -> str:
    """What is said of a log in which no contact is listed."""
    if found.false_on_free:
        return (
            "No contact stands out from the free part, which itself shows "
            f"{found.false_on_free}: was nobody there?"
        )
    if found.basis == "free motion":
        return "Nothing touched the arm, as far as this log shows."
    return f"No contact stands out. {candidate_words(found)}".rstrip()


def unknown_size(contact: Contact) -> str:
    """Why a contact has no known size, and between which bounds it lies."""
    if contact.place_unknown and contact.anywhere is not None:
        low, high = contact.anywhere
        return f"Its size depends on where it touched, unknown: {low:.0f}–{high:.0f} N."
    return (
        f"How hard is unknown: below {(contact.peak_force or 0) + (contact.peak_band or 0):.0f} N."
    )


def candidate_words(found: ContactList) -> str:
    """The hardest candidate, and what would tell it from a model error; "" without one."""
    felt = [c for c in found.candidates if c.peak_force is not None]
    if not felt:
        return ""
    hardest = max(felt, key=lambda c: c.peak_force or 0.0)
    return (
        f"Up to {(hardest.peak_force or 0.0) + (hardest.place_band or 0.0):.0f} N near "
        f"{hardest.peak:.1f} s this model cannot explain: name free motion (--free) or measure "
        "your friction (vftcli identify)."
    )


def hardest_name(found: ContactList) -> str:
    """What the hardest contact is called: one of unknown size may be harder."""
    hardest = found.hardest
    most = max((c.peak_force or 0.0 for c in found.contacts), default=0.0)
    unknown = any(c.place_unknown for c in found.contacts)
    if hardest is None or ((hardest.peak_force or 0.0) >= most and not unknown):
        return "The hardest"
    return "The hardest of known size"


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
        size = f"{contact.peak_force:.0f} ± {contact.peak_band:.0f}"
        row += ["unknown" if contact.place_unknown else size, f"{low:.0f}–{high:.0f}"]
        row.append(direction(contact.wrench[:3]))
    else:
        row.append(" ".join(f"{torque:.1f}" for torque in contact.joint_torque))
    return [*row, place_words(contact), contact.trust]


PART = 0.35  #: An axis that holds more than this share of a force is named in its direction.
AXIS_WORDS = ("−x", "+x"), ("−y", "+y"), ("down", "up")  #: An axis' two directions, base axes.


def direction(force: Array) -> str:
    """A force's direction in words: every axis that holds much of it, the most first."""
    size = float(np.linalg.norm(force))
    if size == 0.0:
        return "–"
    u = force / size
    axes = [k for k in np.argsort(-np.abs(u), kind="stable").tolist() if abs(u[k]) > PART]
    return ", ".join(AXIS_WORDS[k][int(u[k] > 0)] for k in axes)


def place_words(contact: Contact) -> str:
    """The part of the arm, and the links where it cannot be told."""
    if contact.where != "cannot tell":
        return contact.where
    links = [link for link in contact.places if link]
    if not links:
        return contact.where
    first = f"link {links[0]}"
    last = "flange" if 0 in contact.places else f"link {links[-1]}"
    return first if first == last else f"{first} … {last}"


def free_words(found: ContactList) -> str:
    """What is known of free motion, in words; "" where nothing is."""
    return "; ".join(sentence(remark) for remark in found.free)


def hardest_words(found: ContactList) -> str:
    """The hardest contact of a log in a few words."""
    contact = found.hardest
    if contact is None or contact.peak_force is None:
        return "–"
    size = f"{contact.peak_force:.0f} ± {contact.peak_band:.0f} N at {contact.peak:.1f} s"
    if contact.place_unknown and contact.anywhere is not None:
        low, high = contact.anywhere
        size = f"{low:.0f}–{high:.0f} N at {contact.peak:.1f} s"
    return size if contact.size_known else f"unknown ({size})"


def beginning(contact: Contact) -> str:
    """What is said where a contact begins: when, for how long, how hard, in which direction, where.

    As ``4.70 s: contact 1 begins, for 0.89 s: 86 ± 10 N, +x, up, wrist (good)``.
    """
    if contact.peak_force is None or contact.wrench is None:
        torque = ", ".join(f"{value:.1f}" for value in contact.joint_torque)
        size = f"joint torques {torque} N·m"
    else:
        size = force_size(contact)
        size += f", {direction(contact.wrench[:3])}"
    where = f"{place_words(contact)} ({contact.trust})"
    span = f"for {contact.stop - contact.start:.2f} s"
    return f"{contact.start:.2f} s: {contact_name(contact)} begins, {span}: {size}, {where}"


def force_size(contact: Contact) -> str:
    """|F| with its band, or its range where the place is unknown."""
    if contact.place_unknown and contact.anywhere is not None:
        return f"{contact.anywhere[0]:.0f}–{contact.anywhere[1]:.0f} N"
    return f"{contact.peak_force:.0f} ± {contact.peak_band:.0f} N"


def contact_name(contact: Contact) -> str:
    """What a row of the list is called."""
    return f"{'load' if contact.is_load else 'contact'} {contact.number}"
