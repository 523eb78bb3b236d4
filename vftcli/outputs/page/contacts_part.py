"""What touched the arm, on the page: the table of contacts and its details."""

from html import escape

import numpy as np

from vftcli.analysis import Analysis
from vftcli.contacts.contact_list import Contact, ContactList
from vftcli.outputs.answer import direction, force_size, place_words, reason
from vftcli.outputs.grid import Column, Entry, Grid, html
from vftcli.outputs.page.arm_drawing import arm_drawing
from vftcli.outputs.quantity import banded, significant, vector

#: Heads of the table.
HEADS = ("", "When", "How hard (95 %)", "Direction, base axes", "Where", "Trust")


def contact_table(analysis: Analysis, found: ContactList) -> str:
    """One row a contact, linked with the chart; "" without any."""
    if not found.contacts:
        return ""
    most = max((c.anywhere[1] for c in found.contacts if c.anywhere is not None), default=1.0)
    heads = "".join(f'<th scope="col">{head}</th>' for head in HEADS)
    rows = "".join(contact_row(analysis, contact, most) for contact in found.contacts)
    notes = (
        "Force on the robot. The bar: the size with its band, and in grey the range over every "
        "place that fits. The arm as it stood, seen from its side; orange: the places that fit; "
        "the arrow: the force as far as it lies in the drawing. Times are good to about ±0.1 s."
    )
    title = "The load" if found.contacts[0].is_load else "The contacts"
    return (
        f'<section id="contacts"><h2>{title}</h2><table class="contacts"><thead><tr>{heads}</tr>'
        f'</thead><tbody>{rows}</tbody></table><p class="cap">{notes}</p></section>'
    )


def contact_row(analysis: Analysis, contact: Contact, most: float) -> str:
    """One contact; its number leads to the chart."""
    number, lasts = contact.number, contact.stop - contact.start
    hard = (
        "unknown" if contact.peak_force is None else force_size(contact) + range_bar(contact, most)
    )
    pushed = "–" if contact.wrench is None else direction(contact.wrench[:3])
    mark = (
        f'<a class="n" href="#mark-{number}" title="show in the chart" '
        f'aria-label="contact {number}: show in the chart">{number}</a>'
    )
    cells = (
        ("num", f"{contact.start:.2f} – {contact.stop:.2f} s<small>{lasts:.2f} s</small>"),
        ("num big", hard),
        ("num", escape(pushed)),
        ("place", f"{arm_drawing(analysis, contact)}<div>{place(contact)}</div>"),
        ("", trust(contact)),
    )
    row = "".join(f'<td class="{kind}">{cell}</td>' for kind, cell in cells)
    return f'<tr id="contact-{number}"><th scope="row">{mark}</th>{row}</tr>'


def range_bar(contact: Contact, most: float) -> str:
    """The range over every place that fits, with the size and its band in it."""
    if contact.anywhere is None or contact.peak_force is None or contact.peak_band is None:
        return ""
    low, high = contact.anywhere
    share = 100.0 / most

    def stretch(kind: str, start: float, end: float, y: float, height: float) -> str:
        """A part of the bar."""
        start = max(start, 0.0)
        return (
            f'<rect class="{kind}" x="{share * start:.1f}" y="{y:g}" '
            f'width="{max(share * (end - start), 0.5):.1f}" height="{height:g}"/>'
        )

    force, half = contact.peak_force, contact.peak_band
    parts = (
        stretch("track", 0.0, most, 5, 2),
        stretch("range", low, high, 3, 6),
        stretch("band", force - half, force + half, 1, 10),
        stretch("dot", force - 0.7 / share, force + 0.7 / share, 0, 12),
    )
    return (
        '<small><svg class="bar" viewBox="0 0 100 12" preserveAspectRatio="none" '
        f'aria-hidden="true">{"".join(parts)}</svg>{low:.0f}–{high:.0f} N, range</small>'
    )


def place(contact: Contact) -> str:
    """The part of the arm, and what was said of it."""
    words = place_words(contact)
    if contact.where != "cannot tell":
        links = [f"link {link}" if link else "flange" for link in contact.places]
        return f"{escape(words)}<small>{', '.join(links)}</small>"
    return f"unknown<small>{escape(words)} fit</small>" if contact.places else "unknown"


#: A sign for each word of trust, so that it does not rest on colour.
SIGNS = {"good": "✓", "fair": "○", "weak": "△"}


def trust(contact: Contact) -> str:
    """The word, its sign and its reason."""
    word = f'<span class="trust {contact.trust}">{SIGNS[contact.trust]} {contact.trust}</span>'
    if contact.is_load:
        word = '<span class="trust">load</span>'
    return f"{word}<small>{escape(reason(contact))}</small>"


def contact_details(found: ContactList) -> str:
    """Moments, impulses, evidence and joint torques of every contact."""
    if not found.contacts:
        return ""
    forces = ("force [N]", "± sd", "moment [N·m]", "± sd", "mean force [N]", "impulse [N·s]")
    rest = ("evidence [nats]", "lead of the place [nats]", "vendor |F| [N]", "sensor |F| [N]")
    wrenches = Grid(
        title="Wrench at the peak, base axes, the moment about the flange point",
        columns=(Column("#"), *(Column(head, words=True) for head in forces), *map(Column, rest)),
        rows=tuple(wrench_row(contact) for contact in found.contacts),
    )
    n = len(found.contacts[0].joint_torque)
    torques = Grid(
        title="Joint torque at the peak in N·m, ± its standard deviation",
        columns=(Column("#"), *(Column(f"J{j}") for j in range(1, n + 1)), Column("at rest")),
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
    return html(wrenches) + html(torques)


def wrench_row(contact: Contact) -> tuple[Entry, ...]:
    """One contact's numbers."""
    wrench, sd = contact.wrench, contact.wrench_sd
    empty: tuple[None, ...] = (None,) * 4
    halves = empty if wrench is None or sd is None else (wrench[:3], sd[:3], wrench[3:], sd[3:])
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
    """What the list rests on, for the details."""
    model, prior = found.model, found.model.prior

    def each(values: np.ndarray) -> str:
        """One number a joint."""
        return ", ".join(significant(float(value)) for value in values)

    pairs = {
        "basis": found.basis,
        "free motion": f"{found.free_seconds:.1f} s",
        "false contacts in it": "–" if found.false_on_free is None else str(found.false_on_free),
        "evidence asked": "–" if found.threshold is None else f"{found.threshold:.1f} nats",
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
