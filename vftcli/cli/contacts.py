"""`vftcli contacts`: what touched the arm, when, how hard, where."""

from typing import Annotated

from vftcli.cli import options as opt
from vftcli.cli.console import LeftOut, canvas, echo, echo_data, say_analysis
from vftcli.evaluation import ReferenceChoice
from vftcli.free_motion import FreeChoice
from vftcli.signals.option import OUTPUT, Anyway, Asked, Choice, Option


class ListForm(Choice):
    """The form of the list."""

    GROUP = OUTPUT

    json: opt.Json
    csv: Annotated[bool, Option("--csv", "", "Print one row per contact.")]
    all: Annotated[bool, Option("--all", "", "Every row, not only the 20 hardest.")]


@opt.command(ReferenceChoice, *opt.OF_LOG, FreeChoice, ListForm, Anyway, opt.Talk)
def list_contacts(logs: opt.Logs, asked: Asked) -> None:
    """List what touched the arm. The default command.

    Name contact-free motion (--free LOG or A:B) to find weaker contacts.

    Example: vftcli contacts fixtures/ur5_circle.csv --robot ur5 --free 0.3:4
    """
    from vftcli.outputs.contacts import contacts_csv
    from vftcli.outputs.screen import log_screen, logs_screen
    from vftcli.pipeline import analyse, analyse_logs, list_touches
    from vftcli.readers.reading import Library

    library, form = Library(logs), opt.form_of(asked)
    choice = opt.choice_for(asked, library, on_screen=form == "terminal")
    left_out, found = LeftOut(library, logs), []
    work = analyse if choice.reference else list_touches
    for made in analyse_logs(logs, choice, left_out.add, work):
        say_analysis(made)
        found.append(made)
    if not found:
        left_out.end(0)
    failed = left_out.reasons
    if form == "json":
        from vftcli.outputs.report import contacts_envelope
        from vftcli.outputs.run_record import to_json

        echo_data(to_json(contacts_envelope(found, asked.line, failed)))
    elif form == "csv":
        echo_data(contacts_csv([made.contacts for made in found if made.contacts is not None]))
    else:
        screen, every = canvas(), asked.words["all"] or asked.words["details"]
        several, texts = len(found) + len(failed) > 1, list[str]()
        if several:
            texts.append(logs_screen(found, screen, failed, every=every))
        if not several or asked.words["all"]:
            texts += [log_screen(made, screen, every=every) for made in found]
        echo("\n".join(texts), nl=False, colour=screen.colour)
    left_out.end(len(found))
