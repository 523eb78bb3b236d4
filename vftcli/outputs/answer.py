"""The answer: contacts in the words of screen, page, index and batch."""

import numpy as np

from vftcli.contacts.contact_list import SURE_NATS, TIGHT, Contact, ContactList
from vftcli.outputs.quantity import DASH, at_least_shown, banded, counted, ranged
from vftcli.signals.arrays import Array
from vftcli.signals.remarks import sentence

PART = 0.35  #: An axis that holds more than this share of a force is named in its direction.
AXIS_WORDS = ("−x", "+x"), ("−y", "+y"), ("down", "up")  #: An axis' two directions, base axes.


def otherwise(found: ContactList) -> str:
    """A sentence on the rest of the log without contacts; "" for nothing.

    A load leaves no rest, and an arm of few joints tells no force.
    """
    least = found.detectable_force
    if found.smallest_force is None or any(c.is_load for c in found.contacts):
        return ""
    if least is None and np.isnan(found.smallest_force):
        return ""
    if least is None:
        return "A push along one axis may go unseen: the pose hardly shows it."
    if found.basis != "free motion":
        more = f" {counted(len(found.candidates), 'candidate')} more: --all."
        return (
            f"Pushes below {at_least_shown(least)} do not show.{more if found.candidates else ''}"
        )
    rest = f"{'Nothing else' if found.contacts else 'Nothing'} above {at_least_shown(least)}"
    if any(c.peak_force is not None and c.peak_force < least for c in found.contacts):
        # Along the axes that are felt best less shows than along all.
        return f"{rest} (less at good poses)."
    return f"{rest}. Weaker pushes would not show."


def answer(found: ContactList) -> str:
    """The arm's load and contacts in a few sentences."""
    if (load := found.load) is None:
        return list_words(found)
    mass, (start, stop) = banded(load.mass, load.sd, ".2f", " kg"), load.span
    hint = f": {load.payload}? Add --payload {load.payload}" if load.payload else ""
    return (
        f"The arm carries {mass} that {load.robot} does not know of "
        f"({start:.1f}–{stop:.1f} s){hint}. {list_words(found)}"
    )


def list_words(found: ContactList) -> str:
    """The contacts in one or two sentences."""
    if found.unexplained is not None:
        torque, joint, at = found.unexplained
        return (
            f"Largest unexplained torque: {torque:.2g} N·m on J{joint} at {at:.1f} s: a contact or "
            "a model error. To list contacts name free motion (--free) or give a robot with "
            "friction (vftcli identify)."
        )
    if not found.contacts:
        return none_words(found)
    first, hardest = found.contacts[0], found.hardest
    if first.is_load and first.peak_force is not None and first.mean_force is not None:
        size = f"below {most_force(first)} on average"
        if first.size_known:
            size = f"{force_size(first)} on average, {direction(first.mean_force)}"
        return f"A load, or a wrong payload, or a wrong model: {size}."
    what = f"{counted(len(found.contacts), 'contact')}."
    if hardest is None:
        return what
    if not hardest.size_known:
        how = f"How hard is unknown: below {most_force(hardest)}."
        if hardest.place_unknown and hardest.anywhere is not None:
            how = f"Its size depends on where it touched, unknown: {force_size(hardest)}."
        return f"{what} {how}"
    where = "" if hardest.where == "cannot tell" else f" on the {hardest.where}"
    weak = " (weak)" if hardest.trust == "weak" else ""
    # One of unknown size may be harder.
    most = max(c.peak_force or 0.0 for c in found.contacts)
    sure = (hardest.peak_force or 0.0) >= most and not any(c.place_unknown for c in found.contacts)
    name = "The hardest" if sure else "The hardest of known size"
    return f"{what} {name}, at {hardest.peak:.1f} s: {force_size(hardest)}{where}{weak}."


def none_words(found: ContactList) -> str:
    """Sentences on a log without contacts."""
    if found.false_on_free:
        return (
            "No contact stands out from the free part, which itself shows "
            f"{found.false_on_free}: was nobody there?"
        )
    if found.basis == "free motion":
        return "Nothing touched the arm, as far as this log shows."
    felt = [c for c in found.candidates if c.peak_force is not None]
    if not felt:
        return "No contact stands out."
    hardest = max(felt, key=lambda c: c.peak_force or 0.0)
    most = (hardest.peak_force or 0.0) + (hardest.place_band or 0.0)
    return (
        f"No contact stands out. Up to {most:.0f} N near {hardest.peak:.1f} s this model cannot "
        "explain: name free motion (--free) or measure your friction (vftcli identify)."
    )


def most_force(contact: Contact) -> str:
    """The upper end of a force's band."""
    return f"{(contact.peak_force or 0.0) + (contact.peak_band or 0.0):.0f} N"


def force_size(contact: Contact) -> str:
    """|F| with its band, or its range where the place is unknown."""
    if contact.place_unknown and contact.anywhere is not None:
        return ranged(*contact.anywhere)
    return banded(contact.peak_force, contact.peak_band)


def hardest_words(found: ContactList) -> str:
    """The hardest contact of a log in a few words."""
    contact = found.hardest
    if contact is None or contact.peak_force is None:
        return DASH
    size = f"{force_size(contact)} at {contact.peak:.1f} s"
    return size if contact.size_known else f"unknown ({size})"


def direction(force: Array) -> str:
    """A force's direction in words: every axis that holds much of it, the most first."""
    size = float(np.linalg.norm(force))
    if size == 0.0:
        return DASH
    u = force / size
    axes = [k for k in np.argsort(-np.abs(u), kind="stable").tolist() if abs(u[k]) > PART]
    return ", ".join(AXIS_WORDS[k][int(u[k] > 0)] for k in axes)


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
    if contact.evidence is None or contact.evidence < SURE_NATS:
        return "little evidence: friction explains nearly as much"
    if contact.peak_force is None or contact.peak_band is None:
        return "too few joints to know the force"
    share = contact.peak_band / max(contact.peak_force, 1e-9)
    text = f"the band is {share:.0%} of the force"
    if contact.trust == "good" and share <= TIGHT and contact.anywhere is not None:
        low, high = contact.anywhere
        if high > 2.0 * max(low, 1.0):
            text += "; the size depends on the place"
    return text


def free_words(found: ContactList) -> str:
    """Known free motion in words; "" without any."""
    return "; ".join(map(sentence, found.free))


def beginning(contact: Contact) -> str:
    """Text at a contact's begin: time, duration, force, direction, place.

    As ``4.70 s: contact 1 begins, for 0.89 s: 86 ± 10 N, +x, up, wrist (good)``.
    """
    if contact.peak_force is None or contact.wrench is None:
        torque = ", ".join(f"{value:.1f}" for value in contact.joint_torque)
        size = f"joint torques {torque} N·m"
    else:
        size = f"{force_size(contact)}, {direction(contact.wrench[:3])}"
    where = f"{place_words(contact)} ({contact.trust})"
    span = f"for {contact.stop - contact.start:.2f} s"
    return f"{contact.start:.2f} s: {contact_name(contact)} begins, {span}: {size}, {where}"


def contact_name(contact: Contact) -> str:
    """Name of a row of the list."""
    return f"{'load' if contact.is_load else 'contact'} {contact.number}"
