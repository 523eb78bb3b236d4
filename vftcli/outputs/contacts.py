"""Contacts of a log in words, as a table, JSON, CSV."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from vftcli.contacts.contact_list import (
    FIRST_COLUMNS,
    SURE_NATS,
    TIGHT,
    WIDE,
    Contact,
    ContactList,
)
from vftcli.outputs import Record
from vftcli.outputs.grid import (
    DASH,
    Column,
    Grid,
    at_least_shown,
    banded,
    csv_rows,
    latex,
    ranged,
)
from vftcli.signals.arrays import Z_95, Array
from vftcli.signals.parsing import counted
from vftcli.signals.remarks import sentence

PART = 0.35  #: A direction names the axes with more than this share of the force.
AXIS_WORDS = ("−x", "+x"), ("−y", "+y"), ("down", "up")  #: An axis' two directions, base axes.
MOST_ROWS = 20  #: Rows on the terminal unless all are asked for.

#: Meaning of a table's numbers.
LEGEND = (
    "± 95 %; force ON the robot, base axes; range: over all possible places; "
    f"trust: good within {100 * TIGHT:.0f} % of |F|, weak beyond {100 * WIDE:.0f} % "
    "or by little evidence"
)
FRAME, SIGN = "base axes, moment about the flange point", "on the robot"


def otherwise(found: ContactList, every: bool = False) -> str:
    """A sentence on the rest of the log, or ""; no hint where `every` row is shown."""
    least = found.detectable_force
    if found.smallest_force is None or any(c.is_load for c in found.contacts):
        return ""
    if least is None:
        return "A push along one axis may go unseen: the pose hardly shows it."
    if not found.tells_untouched:
        count = 0 if every else len(found.candidates)
        more = f" {counted(count, 'candidate')}: contacts --all." if count else ""
        long = "" if found.basis == "free motion" else ", and some harder or lasting ones,"
        return f"Flange pushes below {at_least_shown(least)}{long} may not show.{more}"
    rest = f"Nothing{' else' * bool(found.contacts)} above {at_least_shown(least)} at the flange"
    if any((c.peak_force or least) < least for c in found.contacts):
        # Along the best axes smaller forces show.
        return f"{rest} (less at good poses)."
    return f"{rest}. Weaker pushes may not show."


def answer(found: ContactList) -> str:
    """The arm's load and contacts in a few sentences."""
    if (load := found.load) is None:
        return list_words(found)
    mass, (start, stop) = banded(load.mass, Z_95 * load.sd, ".2f", " kg"), load.span
    hint = f": {load.payload}? Add --payload {load.payload}" if load.payload else ""
    return (
        f"The arm carries {mass} that {load.robot} does not know of "
        f"({start:.1f}–{stop:.1f} s){hint}. {list_words(found)}"
    )


def list_words(found: ContactList) -> str:
    """The contacts in one or two sentences."""
    if found.unexplained:
        torque, joint, at = found.unexplained
        return (
            f"Largest unexplained torque: {torque:.2g} N·m on J{joint} at {at:.1f} s: a contact or "
            "a model error. To list contacts name free motion (--free) or give a robot with "
            "friction (vftcli identify)."
        )
    if not found.contacts:
        return none_words(found)
    first, hardest = found.contacts[0], found.hardest
    if first.is_load and first.mean_force is not None:
        size = f"below {most_force(first)} on average"
        if first.size_known:
            size = f"{first.size} on average, {direction(first.mean_force)}"
        return f"A load, or a wrong payload, or a wrong model: {size}."
    what = f"{counted(len(found.contacts), 'contact')}."
    if hardest is None:
        return what
    if not hardest.size_known:
        how = f"How hard is unknown: below {most_force(hardest)}."
        if hardest.place_unknown and hardest.anywhere:
            how = f"Its size depends on where it touched, unknown: {hardest.size}."
        return f"{what} {how}"
    where = "" if hardest.where == "cannot tell" else f" on the {hardest.where}"
    weak = " (weak)" if hardest.trust == "weak" else ""
    # One of unknown size may be harder.
    force = hardest.peak_force or 0.0
    sure = not any(c.place_unknown or (c.peak_force or 0.0) > force for c in found.contacts)
    name = "The hardest" if sure else "The hardest of known size"
    return f"{what} {name}, at {hardest.peak:.1f} s: {hardest.size}{where}{weak}."


def none_words(found: ContactList) -> str:
    """Sentences on a log without contacts."""
    if found.false_on_free:
        return (
            "No contact stands out from the free part, which itself shows "
            f"{found.false_on_free}: was nobody there?"
        )
    if found.tells_untouched:
        return "Nothing touched the arm, as far as this log shows."
    felt = [c for c in found.candidates if c.peak_force is not None]
    if not felt:
        return "No contact stands out."
    hardest = max(felt, key=lambda c: c.peak_force or 0.0)
    most = (hardest.peak_force or 0.0) + (hardest.place_band or 0.0)
    return (
        f"No contact stands out. Up to {most:.0f} N near {hardest.peak:.1f} s this model cannot "
        f"explain: {'' if found.basis == 'free motion' else 'name free motion (--free) or '}"
        "measure your friction (vftcli identify)."
    )


def most_force(contact: Contact) -> str:
    """The upper end of a force's band."""
    return f"{(contact.peak_force or 0.0) + (contact.peak_band or 0.0):.0f} N"


def direction(force: Array) -> str:
    """A force's main axes in words, the largest first."""
    u = force / max(float(np.linalg.norm(force)), 1e-12)
    axes = [k for k in np.argsort(-np.abs(u), kind="stable").tolist() if abs(u[k]) > PART]
    return ", ".join(AXIS_WORDS[k][int(u[k] > 0)] for k in axes) or DASH


def place_words(contact: Contact) -> str:
    """The part of the arm, and the links where it is unknown."""
    links = [link for link in contact.places if link]
    if contact.where != "cannot tell" or not links:
        return contact.where
    first = f"link {links[0]}"
    last = "flange" if 0 in contact.places else f"link {links[-1]}"
    return first if first == last else f"{first} … {last}"


def reason(contact: Contact) -> str:
    """Grounds of a contact's trust, the worst first."""
    if contact.is_load:
        return "lasts for most of the log"
    if contact.remarks:
        return sentence(next(iter(contact.remarks)))
    if (contact.evidence or 0.0) < SURE_NATS:
        return "little evidence: friction explains nearly as much"
    if contact.peak_force is None or contact.peak_band is None:
        return "too few joints to know the force"
    share = contact.peak_band / max(contact.peak_force, 1e-9)
    by_place = "; the size depends on the place" * contact.goes_with_place
    return f"the band is {share:.0%} of the force{by_place}"


def beginning(contact: Contact) -> str:
    """Text at a contact's begin: time, duration, force, direction, place.

    As ``4.70 s: contact 1 begins, for 0.89 s: 86 ± 10 N, +x, up, wrist (good)``.
    """
    if contact.peak_force is None or contact.wrench is None:
        torque = ", ".join(f"{value:.1f}" for value in contact.joint_torque)
        size = f"joint torques {torque} N·m"
    else:
        size = f"{contact.size}, {direction(contact.wrench[:3])}"
    where = f"{place_words(contact)} ({contact.trust})"
    span = f"for {contact.stop - contact.start:.2f} s"
    return f"{contact.start:.2f} s: {contact_name(contact)} begins, {span}: {size}, {where}"


def contact_name(contact: Contact) -> str:
    """Name of a row of the list."""
    return f"{'load' if contact.is_load else 'contact'} {contact.number}"


def forces_along(contacts: Sequence[Contact], t: Array) -> tuple[Array, Array]:
    """|F| of contacts, and its 95 % band, else NaN. 2 × (T,) [N]"""
    force, half = np.full((2, len(t)), np.nan)
    for contact in contacts:
        if course := contact.course:
            inside = (t >= course.t[0]) & (t <= course.t[-1])
            force[inside] = np.interp(t[inside], course.t, course.force)
            half[inside] = np.interp(t[inside], course.t, course.band)
            # The nearest sample shows a peak between two.
            force[np.argmin(np.abs(t - contact.peak))] = contact.peak_force
    return force, half


def contacts_record(found: ContactList) -> Record:
    """A log's contacts for machines, units in the names."""
    model, prior = found.model, found.model.prior
    return {
        "recording": found.recording,
        "duration_s": found.duration,
        "basis": found.basis,
        "free_s": found.free_seconds,
        "false_on_free": found.false_on_free,
        "evidence_threshold_nats": found.threshold,
        "smallest_force_N": found.smallest_force,
        "frame": FRAME,
        "sign": SIGN,
        "free_part": "; ".join(map(sentence, found.free)) or None,
        "load": found.load and found.load.record(),
        "largest_unexplained": found.unexplained and found.unexplained._asdict(),
        "stops_s": found.stops,
        "model": {
            "tau_w_s": prior and prior.time,
            "sigma_force_N": prior and prior.force,
            "sigma_moment_Nm": prior and prior.moment,
            "noise_sd_Nm": model.noise_sd,
            "friction_sd_Nm": model.error_sd,
            "friction_time_s": model.error_time,
            "block_s": model.block,
        },
        "remarks": found.remarks,
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
    keys = dict.fromkeys(key for row in rows for key in row) or ("recording", *FIRST_COLUMNS)
    return csv_rows([{key: row.get(key) for key in keys} for row in rows], keys)


def hardest_rows(contacts: Sequence[Contact], most: int = MOST_ROWS) -> list[Contact]:
    """So many contacts, the hardest of known size, in time order."""
    order = sorted(
        contacts,
        key=lambda c: (c.size_known, c.peak_force or 0.0, c.evidence or 0.0),
        reverse=True,
    )
    return sorted(order[:most], key=lambda contact: contact.start)


def contact_grid(contacts: Sequence[Contact]) -> Grid:
    """The table of contacts; joint torques without forces."""
    known = any(contact.peak_force is not None for contact in contacts)
    size = (Column("|F|", "N", symbol="$|F|$"), Column("range", "N"), "direction")
    columns = (
        Column("#"),
        Column("from – to", "s", words=True),
        *(size if known else (Column("joint torque", "N·m", words=True),)),
        "where",
        "trust",
    )
    rows = []
    for contact in contacts:
        row = [str(contact.number), f"{contact.start:6.2f} – {contact.stop:6.2f}"]
        if contact.wrench is not None and contact.anywhere:
            force = banded(contact.peak_force, contact.peak_band, unit="")
            row.append(force if contact.size_known else "unknown")
            row += [ranged(*contact.anywhere, unit=""), direction(contact.wrench[:3])]
        else:
            row.append(" ".join(f"{torque:.1f}" for torque in contact.joint_torque))
        rows.append([*row, place_words(contact), contact.trust])
    return Grid(columns, rows)


def contacts_latex(found: ContactList) -> str:
    """A log's contacts as a table for a paper."""
    title = f"Contacts in {found.recording}"
    return latex(replace(contact_grid(found.contacts), title=title, notes=(LEGEND,)))
