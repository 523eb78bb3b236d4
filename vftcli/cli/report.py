"""`vftcli report`: everything about a log in one folder."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from vftcli.cli import options as opt
from vftcli.cli.analysis import AnalysisOptions, ExtraOptions
from vftcli.cli.progress import echo
from vftcli.evaluation.reference_choice import ReferenceChoice
from vftcli.signals.option import Choice, setting

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from vftcli.analysis import Analysis
    from vftcli.cli.console import LeftOut
    from vftcli.pipeline import AnalysisChoice


@dataclass(frozen=True, kw_only=True)
class PrintChoice(Choice):
    """A printed table beside the errors."""

    table: Annotated[
        str | None, setting("report.published", "table1", "The paper's table beside the errors.")
    ] = None


@opt.command
def report(
    logs: opt.Logs,
    output: opt.LogFolder,
    reference: opt.Typed[ReferenceChoice],
    analysis: AnalysisOptions,
    also: ExtraOptions,
    figures: opt.Figures,
    beside: opt.Typed[PrintChoice],
    json: opt.Json,
    force: opt.Force,
    show: opt.Open,
) -> None:
    """Write page, recording, tables and estimates.

    Writes index.html (opens offline), recording.rrd, contacts.{json,csv}, estimates.parquet,
    errors.{csv,json,md,tex} and run.json; several logs get a sub-folder each and an index.

    Example: vftcli report fixtures/ur5_circle.csv --robot ur5
    """
    from vftcli.cli.console import LeftOut, command_line, open_made, say_left_out
    from vftcli.cli.jacobian import write_by_jacobian
    from vftcli.evaluation.print_table import check_published
    from vftcli.outputs.files import OutputFolder
    from vftcli.outputs.log.report import FILES, report_files, write_report, write_reports
    from vftcli.pipeline import WRITING
    from vftcli.readers.library import Library
    from vftcli.readers.table import JacobianError

    library, published = Library(logs), beside.choice().table
    written = also.choice()
    output = opt.folder_of(output, logs, analysis.log.reading)
    names = report_files([library.label(log) for log in logs], written.extras, figures)
    OutputFolder(output, force, names).check()
    choice = analysis.choice(library, reference, on_screen=not json)
    if published is not None:
        check_published(published, reference.words["reference"])
        choice = replace(choice, observers=choice.observers.beside_print())
    left_out = LeftOut(library, logs)
    try:
        analyses = analysed(logs, choice, left_out, published, json=json)
    except JacobianError as found:  # of one log; among several it is left out
        write_by_jacobian(logs[0], found, choice, output, force=force, json=json)
        return
    if not analyses:
        left_out.end(0)
    choice.progress("writing", WRITING, 1.0)
    command, failed = command_line(), left_out.reasons
    if len(analyses) + len(failed) == 1:
        record = write_report(
            output, analyses[0], command=command, force=force, choice=written, form=figures
        )
    else:
        record = write_reports(
            output,
            analyses,
            command=command,
            force=force,
            choice=written,
            form=figures,
            failed=failed,
        )
    say_left_out(FILES)
    if json:
        echo(record)
    else:
        show_report(analyses, output, failed, written.extras, details=analysis.talk.details)
    if show:
        open_made(output)
    left_out.end(len(analyses))


def analysed(
    logs: "Sequence[Path]",
    choice: "AnalysisChoice",
    left_out: "LeftOut",
    published: str | None,
    *,
    json: bool,
) -> "list[Analysis]":
    """The logs that can be analysed, a printed table beside their errors where one is asked for."""
    from vftcli.cli.console import say_analysis
    from vftcli.evaluation.print_table import compare_with
    from vftcli.pipeline import analyse_logs

    analyses = []
    for made in analyse_logs(logs, choice, left_out.told):
        beside = None
        if published is not None and made.errors is not None:
            beside = compare_with(published, made.errors, made.observers, made.tunings)
        analyses.append(replace(made, published=beside))
        if not json:
            say_analysis(made)
    return analyses


def show_report(
    analyses: "Sequence[Analysis]",
    output: Path,
    failed: "Mapping[str, str]",
    extras: "Sequence[str]",
    *,
    details: bool,
) -> None:
    """Print the screen; with details every table behind it too."""
    from vftcli.cli.console import canvas, show
    from vftcli.outputs.log.estimates import extra_files
    from vftcli.outputs.log.report import FILES, SUMMARY_FILES
    from vftcli.outputs.log.rmse_tables import paper_bounds
    from vftcli.outputs.log.tables import print_text, to_terminal
    from vftcli.outputs.screen import log_screen, logs_screen, written_lines

    several = len(analyses) + len(failed) > 1
    screen, names = canvas(), SUMMARY_FILES if several else (*FILES, *extra_files(extras))
    names = (*names, "figures/")
    below = written_lines(output, names, screen, several=several)
    if several:
        show(logs_screen(analyses, screen, failed, below, every=details))
    else:
        show(log_screen(analyses[0], screen, below, every=details))
    for made in analyses if details else ():
        if made.errors is not None:
            show(to_terminal(made.errors, paper_bounds([made])))
        if made.published is not None:
            show(print_text(made.published))
