"""The report of one log as one HTML page: the answer first, then what it rests on."""

from collections.abc import Sequence
from html import escape

import numpy as np

from vftcli.analysis import Analysis
from vftcli.outputs.answer import headline, otherwise
from vftcli.outputs.believability import Ground, grounds
from vftcli.outputs.log.run_record import run_record
from vftcli.outputs.page import comparisons, contacts_part, sections
from vftcli.outputs.page.charts import Chart, observer_lines
from vftcli.outputs.page.hero import hero
from vftcli.outputs.page.refinement_part import refinement_section
from vftcli.outputs.page.shell import (
    alarms,
    all_remarks,
    document,
    health,
    lead,
    pairs,
    provenance,
    section,
    top,
)
from vftcli.outputs.page.torque_part import torque_chart, torque_section
from vftcli.outputs.page.wrench_part import wrench_chart, wrench_section
from vftcli.signals.remarks import sentence


def render(analysis: Analysis) -> str:
    """The report of one log: self-contained, nothing is loaded from anywhere."""
    record = analysis.run or run_record(analysis, "")
    torques, wrench = torque_chart(analysis), wrench_chart(analysis)
    parts = (
        alarms(analysis.examinations),
        answer_part(analysis, torques),
        believability_section(grounds(analysis)),
        "<h2>Details</h2>",
        torque_section(torques) if analysis.contacts is not None else "",
        sections.errors_section(analysis),
        comparisons.beside_print(analysis.published),
        wrench_section(analysis, wrench),
        contact_section(analysis),
        sections.observers_section(analysis),
        refinement_section(analysis),
        health(analysis.examinations),
        all_remarks([*record.get("warnings", ()), *record.get("repairs", ()), *record["notes"]]),
        provenance(record),
    )
    title = f"{headline(analysis)} – {analysis.recording.name}"
    styles = observer_lines(analysis.estimates)
    charts = [chart for chart in (torques, wrench) if chart is not None]
    return document(title, "".join(parts), charts, styles)


def answer_part(analysis: Analysis, torques: Chart) -> str:
    """The first screen: what touched the arm, or the torques where no contacts are listed."""
    found = analysis.contacts
    if found is None:
        reasons = [r for r in analysis.remarks if r.code == "contacts-not-told"]
        words = [f"What touched the arm is unknown: {sentence(r)}." for r in reasons]
        first = top(eyebrow(analysis), headline(analysis), lead(*words))
        return first + torque_section(torques, opened=True)
    return "".join(
        (
            top(eyebrow(analysis), headline(analysis), lead(otherwise(found))),
            hero(analysis, found),
            contacts_part.contact_table(analysis, found),
        )
    )


def eyebrow(analysis: Analysis) -> tuple[str, ...]:
    """The log, the robot, the span at its rate, and what measured the force."""
    recording, robot, reference = analysis.recording, analysis.robot, analysis.reference
    measured = "nothing else measured the force"
    if reference is not None:
        measured = f"compared with {reference.name}"
    elif recording.wrench is not None:
        measured = "beside a sensor's own wrench"
    elif recording.tau_ext is not None:
        measured = "beside the controller's own estimate"
    rate = 1.0 / recording.median_step if recording.samples > 1 else float("nan")
    span = f"{recording.duration:.1f} s"
    return (
        recording.name,
        robot.title or robot.name,
        f"{span} at {rate:.0f} Hz" if np.isfinite(rate) else span,
        measured,
    )


def contact_section(analysis: Analysis) -> str:
    """Every contact's numbers and what the list rests on."""
    found = analysis.contacts
    if found is None:
        return ""
    details = contacts_part.contact_details(found)
    model = f"<h3>What the list rests on</h3>{pairs(contacts_part.model_pairs(found))}"
    return section("Contacts in numbers", details + model, f"{len(found.contacts)}", name="numbers")


def believability_section(shown: Sequence[Ground]) -> str:
    """The grounds side by side; the worst first, as they come."""
    items = "".join(map(ground_item, shown))
    return (
        '<section id="believed"><h2>Can it be believed?</h2>'
        f'<ul class="grounds">{items}</ul></section>'
    )


def ground_item(ground: Ground) -> str:
    """One ground: its sign, what it is about, what is known of it, and what would mend it."""
    subject = ground.subject[:1].upper() + ground.subject[1:]
    remedy = ""
    if ground.remedy:
        remedy = f'<code class="remedy">{escape(ground.remedy)}</code>'
    return (
        f'<li><b class="sign {ground.standing}">{ground.mark}</b><span>'
        f"{escape(subject)}<small>{escape(ground.sentence)}{remedy}</small></span></li>"
    )
