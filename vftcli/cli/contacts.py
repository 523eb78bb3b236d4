"""`vftcli contacts` and `vftcli thresholds`: what touched the arm, and what would show."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from vftcli.cli import options as opt
from vftcli.cli.console import (
    LeftOut,
    canvas,
    echo,
    echo_data,
    say,
    say_analysis,
    say_json,
    say_recording,
    say_robots,
)
from vftcli.evaluation import ReferenceChoice
from vftcli.free_motion import FreeChoice
from vftcli.signals.option import FILE, OUTPUT, Anyway, Asked, Choice, Option

if TYPE_CHECKING:
    from vftcli.signals.recording import Recording


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


@opt.command(*opt.OF_LOG, ReferenceChoice, Anyway, opt.Talk)
def contact_thresholds(
    logs: opt.Logs,
    asked: Asked,
    check: opt.Check,
    json: opt.Json,
    rate: Annotated[
        float, Option("--rate", "PER_HOUR", "Allow this many false alarms an hour; default 1.")
    ] = 1.0,
) -> None:
    """Find contact thresholds from contact-free logs.

    Give long logs of several days: the worst one counts. Prints calls for libfranka, franka_ros,
    URScript, and TOML. True contacts of a --check log come from --reference, from the truth
    beside a simulated log, or from its force sensor; without any, its alarms are listed.

    Example: vftcli thresholds free.csv --robot ur5 --rate 1 --check pushed.csv
    """
    from vftcli.answering import free_thresholds, modelled
    from vftcli.contacts.threshold_check import check_contacts, compared_signals
    from vftcli.contacts.thresholds import check_alike
    from vftcli.evaluation.references import make_reference
    from vftcli.free_motion.free_motion import FreeMotion
    from vftcli.outputs.examination import health_record
    from vftcli.outputs.thresholds import thresholds_record, thresholds_text
    from vftcli.readers.reading import Library
    from vftcli.signals.errors import ParameterError

    choice = opt.choice_for(asked, Library([*logs, *(check or ())]))
    library, reference = choice.library, choice.reference
    if reference is not None and not check:
        raise ParameterError(
            "--reference says where a log was touched: name that with --check LOG"
        )
    free, signals, thresholds = free_thresholds(logs, choice, rate)
    checks = []
    for log in check or ():
        pushed = modelled(library.open(log, choice.read.whole), choice)
        check_alike((signals[0], compared := compared_signals(pushed)))
        named = reference or settled_reference(pushed.recording)
        truth = make_reference(FreeMotion(log=pushed), named) if named else (None, None)
        checks.append(check_contacts(compared, thresholds, *truth))
    if json:
        record = thresholds_record(thresholds, checks)
        health = health_record(choice.examiner.examinations)
        say_json(
            [run.recording for run in free], thresholds.remarks, **record, examination=health
        )
        return
    for run in free:
        say_recording(run.recording)
    say_robots(choice.examiner.robots)
    for remark in (*thresholds.remarks, *(remark for one in checks for remark in one.remarks)):
        say(f"{'warning' if remark.level == 'warning' else 'note'}: {remark}")
    echo(thresholds_text(thresholds, checks), nl=False)


def settled_reference(recording: "Recording") -> "ReferenceChoice | None":
    """Default source of contacts: truth, or sensor."""
    truth = Path(f"{recording.source.path}.truth.parquet")
    if truth.exists():
        return ReferenceChoice(name=f"{FILE}{truth}")
    frame, wrench = recording.wrench_frame, recording.wrench
    # A wrench without a frame counts as a sensor's everywhere.
    of_sensor = frame is None or frame.axes == "sensor"
    measured = of_sensor and wrench is not None and bool(wrench.any())
    return ReferenceChoice(name="sensor") if measured else None
