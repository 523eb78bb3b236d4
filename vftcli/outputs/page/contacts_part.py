"""What touched the arm, on the page: headline, lead, the table of contacts and its details."""

from collections.abc import Sequence
from html import escape

import numpy as np

from vftcli.analysis import Analysis
from vftcli.contacts.contact_list import SURE_NATS, TIGHT, Contact, ContactList
from vftcli.outputs.contacts import answer, direction, force_size, place_words, unknown_size
from vftcli.outputs.grid import Column, Entry, Grid, html, significant
from vftcli.outputs.page.arm_drawing import arm_drawing
from vftcli.outputs.page.hero import told
from vftcli.signals.remarks import sentence

#: How often, in words.
TIMES = ("once", "twice", "three", "four", "five", "six", "seven", "eight", "nine", "ten")
#: How far a contact's begin may be off: nine in ten of simulated contacts are nearer. [s]
ONSET = 0.1
FEW = 6  #: Of more contacts the lead tells how many were where, not which.
#: Heads of the table.
HEADS = ("", "When", "How hard (95 %)", "Direction, base axes", "Where", "Trust")


def headline(found: ContactList) -> str:
    """The answer as a headline. Plain text."""
    contacts = found.contacts
    if not contacts:
        return answer(found)
    hardest = found.hardest
    if contacts[0].is_load and hardest is not None:
        how = f"of {size(hardest)}"
        if not hardest.size_known:
            how = f"below {(hardest.peak_force or 0.0) + (hardest.peak_band or 0.0):.0f} N"
        return f"The arm bears a load {how}, or its payload or its model is wrong."
    count = len(contacts)
    often = TIMES[count - 1] if count <= len(TIMES) else str(count)
    often += "" if count < 3 else " times"
    pushed = "Something pushed"
    if hardest is not None and all(contact.trust == "weak" for contact in contacts):
        pushed = "Something may have pushed"
    if hardest is None:
        return f"{pushed} the arm {often}."
    if not hardest.size_known:
        return f"{pushed} the arm {often}. {unknown_size(hardest)}"
    weak = " (weak)" if hardest.trust == "weak" else ""
    return f"{pushed} the arm {often}, {'hardest ' * (count > 1)}with {size(hardest)}{weak}."


def size(contact: Contact) -> str:
    """|F| with its band or its range; "" where no force is known."""
    return "" if contact.peak_force is None else force_size(contact)


def lead(found: ContactList) -> str:
    """Where it was and what else, then how far it may be believed."""
    paragraphs = [where_words(found.contacts), belief_words(found)]
    return "".join(f'<p class="lead">{text}</p>' for text in paragraphs if text)


def where_words(contacts: Sequence[Contact]) -> str:
    """Where the contacts were, the contacts of each part of the arm together. HTML."""
    if not contacts:
        return ""
    first = contacts[0]
    if first.is_load and first.mean_force is not None:
        # Adding a nought takes the minus from one.
        x, y, z = (f"{value + 0.0:.0f}".replace("-", "−") for value in np.round(first.mean_force))
        return (
            f"What is read lasts from {first.start:.1f} to {first.stop:.1f} s, with a mean of "
            f"<b>({x}, {y}, {z}) N</b> in base axes. A push would not last so long; what touched "
            "the arm beside it cannot be told."
        )
    by_part: dict[str, list[int]] = {}
    for contact in contacts:
        by_part.setdefault(contact.where, []).append(contact.number)
    untold = by_part.pop("cannot tell", [])
    said = [f"{which(n, len(contacts))} the <b>{escape(part)}</b>" for part, n in by_part.items()]
    text = "; ".join(said)
    if untold:
        text += f"{'; ' if text else ''}{touched(untold, len(contacts))}"
    return f"{text[:1].upper()}{text[1:]}."


def which(numbers: list[int], count: int) -> str:
    """Which contacts were at a place, up to its name."""
    if len(numbers) == count:
        return "it touched" if count == 1 else "all touched"
    if count > FEW:
        return f"{len(numbers)} of {count} touched"
    return f"{'contact' if len(numbers) == 1 else 'contacts'} {listed(numbers)} touched"


def touched(numbers: list[int], count: int) -> str:
    """Which contacts' places are unknown."""
    if len(numbers) == count:
        subject = "it" if count == 1 else "they"
    elif count > FEW:
        subject = f"the other {len(numbers) if len(numbers) > 1 else 'one'}"
    else:
        subject = f"{'contact' if len(numbers) == 1 else 'contacts'} {listed(numbers)}"
    return f"where {subject} touched is unknown, since several places fit"


def listed(numbers: Sequence[int]) -> str:
    """Numbers in bold with commas and a last "and"."""
    words = [f"<b>{number}</b>" for number in numbers]
    return " and ".join(filter(None, [", ".join(words[:-1]), words[-1]]))


def belief_words(found: ContactList) -> str:
    """How far times and sizes may be believed, and what would not be seen. HTML."""
    parts = []
    bands = [c.peak_band or 0.0 for c in found.contacts if c.size_known and not c.is_load]
    if bands:
        parts.append(
            f"Believe times to about ±{ONSET:g} s and sizes to about "
            f"±{float(np.median(bands)):.0f} N."
        )
    if (least := told(found)) is not None and not any(c.is_load for c in found.contacts):
        fainter = any(c.peak_force is not None and c.peak_force < least for c in found.contacts)
        seen = "is seen only where the arm feels it best" if fainter else "would not be seen"
        parts.append(f"A touch below <b>{least:.0f} N</b> {seen}.")
    weak = [c.number for c in found.contacts if c.trust == "weak" and not c.is_load]
    if weak and len(weak) < len(found.contacts) <= FEW:
        verb = "Contact {} is weak" if len(weak) == 1 else "Contacts {} are weak"
        parts.append(f"{verb.format(listed(weak))}.")
    return " ".join(filter(None, parts))


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
        "the arrow: the force as far as it lies in the drawing."
    )
    title = "The load" if found.contacts[0].is_load else "The contacts"
    return (
        f'<section id="contacts"><h2>{title}</h2><table class="contacts"><thead><tr>{heads}</tr>'
        f'</thead><tbody>{rows}</tbody></table><p class="cap">{notes}</p></section>'
    )


def contact_row(analysis: Analysis, contact: Contact, most: float) -> str:
    """One contact; its number leads to the chart."""
    number, lasts = contact.number, contact.stop - contact.start
    hard = "unknown" if contact.peak_force is None else size(contact) + range_bar(contact, most)
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
    if contact.is_load:
        return '<span class="trust">load</span><small>lasts for most of the log</small>'
    return (
        f'<span class="trust {contact.trust}">{SIGNS[contact.trust]} {contact.trust}</span>'
        f"<small>{escape(reason(contact))}</small>"
    )


def reason(contact: Contact) -> str:
    """What a contact's trust rests on, the worst first."""
    if contact.remarks:
        return sentence(next(iter(contact.remarks)))
    if contact.evidence is None or contact.evidence < SURE_NATS:
        return "little evidence: friction explains nearly as much"
    if contact.peak_force is None or contact.peak_band is None:
        return "no force can be told with so few joints"
    share = contact.peak_band / max(contact.peak_force, 1e-9)
    text = f"the band is {share:.0%} of the force"
    if contact.trust == "good" and share <= TIGHT and contact.anywhere is not None:
        low, high = contact.anywhere
        if high > 2.0 * max(low, 1.0):
            text += "; the size depends on the place"
    return text


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
                    f"{tau:.2f} ± {sd:.2f}".replace("-", "−")
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


def vector(values: np.ndarray) -> str:
    """Three numbers."""
    return ", ".join(f"{x + 0.0:.1f}" for x in np.round(values, 1)).replace("-", "−")


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
