"""`vftcli report`: everything about a log in one folder."""

from dataclasses import replace
from typing import TYPE_CHECKING, Annotated

import typer

from vftcli.cli import options as opt
from vftcli.cli.bundles import taken_apart

if TYPE_CHECKING:
    from vftcli.analysis import Analysis


@taken_apart
def report(
    logs: opt.Logs,
    output: opt.Folder,
    reference: opt.ReferenceOptions,
    analysis: opt.AnalysisOptions,
    also: opt.ExtraOptions,
    published: Annotated[
        str | None,
        typer.Option(
            "--published", metavar="table1", help="Set the paper's table beside the errors."
        ),
    ] = None,
    json: opt.Json = False,
    force: opt.Force = False,
    show: opt.Open = False,
) -> None:
    """Write a report page, a Rerun recording, tables and estimates of a log into one folder.

    Writes index.html (opens offline), recording.rrd, contacts.{json,csv}, estimates.parquet,
    errors.{csv,json,md,tex} and run.json; several logs get a sub-folder each and an index.

    Example: vftcli report fixtures/ur5_circle.csv --robot ur5 -o out
    """
    from vftcli.cli.console import command_line, say, say_analysis
    from vftcli.cli.opening import open_made
    from vftcli.evaluation.print_table import check_published, compare_with
    from vftcli.outputs.files import OutputFolder
    from vftcli.outputs.log.report import report_files, write_report, write_reports
    from vftcli.pipeline import analyse_logs
    from vftcli.readers.library import Library

    library = Library(logs)
    extras = also.names()
    names = report_files([library.label(log) for log in logs], extras)
    OutputFolder(output, force, names).check()
    choice = analysis.choice(library, reference)
    if published is not None:
        check_published(published, reference.reference)
        choice = replace(choice, observers=choice.observers.beside_print())
    analyses = []
    for made in analyse_logs(logs, choice):
        beside = None
        if published is not None and made.errors is not None:
            beside = compare_with(published, made.errors, made.observers, made.tunings)
        analyses.append(replace(made, published=beside))
        if not json:
            say_analysis(made)
    command = command_line()
    if len(analyses) == 1:
        record = write_report(output, analyses[0], command=command, force=force, extras=extras)
    else:
        record = write_reports(output, analyses, command=command, force=force, extras=extras)
    if json:
        typer.echo(record)
    else:
        for made in analyses:
            say_errors(made)
        say(f"wrote {output}: vftcli open {output}")
    if show:
        open_made(output)


def say_errors(made: "Analysis") -> None:
    """The errors of one log and the print beside them, where they are known."""
    from vftcli.outputs.log.tables import print_text, to_terminal
    from vftcli.outputs.log.wrench_tables import paper_bounds

    if made.errors is not None:
        typer.echo(to_terminal(made.errors, paper_bounds([made])))
    if made.published is not None:
        typer.echo(print_text(made.published))
