"""`vftcli report` and `vftcli estimate`: logs become folders."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Annotated

from vftcli.cli import options as opt
from vftcli.cli.console import LeftOut, canvas, open_made, say_analysis, say_written, show
from vftcli.evaluation import ReferenceChoice
from vftcli.outputs import OutputChoice
from vftcli.signals.option import WRITE, Asked, Choice, Option
from vftcli.signals.progress import stage

if TYPE_CHECKING:
    from vftcli.analysis import Analysis
    from vftcli.outputs.estimates import Group
    from vftcli.outputs.screen import Canvas


class PrintChoice(Choice):
    """A printed table beside the errors."""

    table: Annotated[
        str | None, Option("report.published", "table1", "The paper's table beside the errors.")
    ] = None


@opt.command(ReferenceChoice, *opt.OF_ANALYSIS, OutputChoice, PrintChoice)
def report(
    logs: opt.Logs,
    output: opt.LogFolder,
    asked: Asked,
    figures: opt.Figures,
    json: opt.Json,
    force: opt.Force,
    show: opt.Open,
) -> None:
    """Write page, recording, tables and estimates.

    Writes index.html (opens offline), recording.rrd, contacts.{json,csv}, estimates.parquet,
    errors.{csv,json,md,tex} and run.json; several logs get a sub-folder each and an index.

    Example: vftcli report fixtures/ur5_circle.csv --robot ur5
    """
    from vftcli.outputs.estimates import FILES, SUMMARY_FILES, extra_files, report_files
    from vftcli.outputs.files import OutputFolder
    from vftcli.outputs.screen import first_lines
    from vftcli.pipeline import WRITING, analyse_logs, sense
    from vftcli.readers.reading import Library

    library, written = Library(logs), asked.of(OutputChoice)
    output, details = opt.folder_of(output, logs, asked), asked.words["details"]
    published = asked.of(PrintChoice).table
    names = report_files(map(library.label, logs), written.extras, figures, several=len(logs) > 1)
    OutputFolder(output, force, names).check()
    choice = opt.choice_for(asked, library, on_screen=not json)
    if published is not None:
        from vftcli.evaluation.published import check_published, compare_with

        check_published(published, asked.words["reference"])
        choice = replace(choice, observers=choice.observers.beside_print())
    # One of several logs may lack a wrench; details need it all.
    if len(logs) == 1 and not (json or details) and choice.is_plain:
        choice = replace(choice, answered=partial(show_text, first_lines))
    left_out, analyses = LeftOut(library, logs), []
    for made in analyse_logs(logs, choice, left_out.add):
        analyses.append(made)
        if published is not None and made.errors is not None:
            table = compare_with(published, made.errors)
            analyses[-1] = replace(made, published=table)
    if not analyses:
        left_out.end(0)
    failed = left_out.reasons
    several = len(analyses) + len(failed) > 1
    if not json:  # the answer first, even if writing fails
        show_answers(analyses, failed, details=details, begun=choice.answered is not None)
    from vftcli.outputs.report import write_report

    stage("writing", WRITING, 1.0)
    record = write_report(
        output,
        [sense(made, choice) for made in analyses],
        command=asked.line,
        force=force,
        choice=written,
        form=figures,
        failed=failed,
    )
    listed = SUMMARY_FILES if several else (*FILES, *extra_files(written.extras))
    say_written(record, output, (*listed, "figures/"), json=json, several=several)
    if show:
        open_made(output)
    left_out.end(len(analyses))


def show_text(text_of: "Callable[[Analysis, Canvas], str]", made: "Analysis") -> None:
    """Print a text on an analysis."""
    show(text_of(made, canvas()))


def show_answers(
    analyses: "Sequence[Analysis]", failed: Mapping[str, str], *, details: bool, begun: bool
) -> None:
    """Print the screen, or its rest; with details every table too."""
    from vftcli.outputs.error_tables import to_terminal
    from vftcli.outputs.grid import terminal
    from vftcli.outputs.grids import print_grid
    from vftcli.outputs.screen import FILE_LINES, MOST_LINES, first_lines, log_screen, logs_screen

    if len(analyses) + len(failed) > 1:
        show(logs_screen(analyses, canvas(), failed, every=details))
    else:
        (made,) = analyses
        text = log_screen(made, canvas(), most=MOST_LINES - FILE_LINES, every=details)
        is_begun = begun and made.contacts is not None
        show(text.removeprefix(first_lines(made, canvas()) if is_begun else ""))
    for made in analyses:
        say_analysis(made)
        if details and made.errors is not None:
            show(to_terminal(made.errors))
        if details and made.published is not None:
            show(terminal(print_grid(made.published)))


@opt.command(*opt.OF_ANALYSIS, OutputChoice)
def estimate(
    log: opt.Log,
    output: opt.LogFolder,
    asked: Asked,
    rrd: Annotated[bool, Option("--rrd", "", "Also write recording.rrd.", group=WRITE)],
    json: opt.Json,
    force: opt.Force,
    show: opt.Open,
) -> None:
    """Write the external torques and wrench.

    Writes DIR/estimates.parquet (t, q/1…, tau_ext/OBSERVER/1…, wrench/best/fx…, contact) and
    DIR/run.json.

    Example: vftcli estimate fixtures/ur5_circle.csv --robot ur5
    """
    from vftcli import pipeline
    from vftcli.outputs.estimates import estimate_files, write_estimate_folder
    from vftcli.outputs.files import OutputFolder
    from vftcli.outputs.screen import short_screen
    from vftcli.readers.reading import Library
    from vftcli.readers.references import refuse_estimates
    from vftcli.signals.packages import check_installed
    from vftcli.signals.recording import EXAMINED

    output, library = opt.folder_of(output, [log], asked), Library([log])
    written = replace(asked.of(OutputChoice), rrd=rrd or show)
    names = estimate_files(written.extras)
    if "rrd" in written.extras:
        check_installed("rerun", "recording.rrd (--rrd, --open)")
    if asked.words["columns"] is None:
        refuse_estimates(log)
    OutputFolder(output, force, names).check()
    choice = opt.choice_for(asked, library)
    # Of a large log only needed columns are read; outputs show all.
    few = not (choice.lists_contacts or choice.wrench or written.extras)
    choice = pipeline.for_estimates(choice)
    recording = library.open(log, replace(choice.read, signals=EXAMINED if few else None))
    # Blocks, so that memory does not grow with the log.
    if set(written.extras) <= {"csv"} and pipeline.comes_in_blocks(recording, choice):
        found: Analysis | Iterator[Group] = pipeline.analysed_in_blocks(recording, choice)
    else:
        if not (json or asked.words["details"]) and choice.is_plain:
            choice = replace(choice, answered=partial(show_text, short_screen))
        found = pipeline.analyse(pipeline.prepared(recording, choice), choice)
        if not json:
            if choice.answered is None or found.contacts is None:
                show_text(short_screen, found)
            say_analysis(found)
        found = pipeline.sense(found, choice)
    made, record = write_estimate_folder(output, found, asked.line, written, force)
    if not json and made is not found:  # of blocks the answer comes at the end
        show_text(short_screen, made)
        say_analysis(made)
    say_written(record, output, names, json=json)
    if show:
        open_made(output)
