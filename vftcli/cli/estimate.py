"""`vftcli estimate`: a log becomes external torques."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from vftcli.cli import options as opt
from vftcli.cli.analysis import AnalysisOptions, ExtraOptions
from vftcli.cli.progress import echo
from vftcli.signals.option import WRITE, Option

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from vftcli.analysis import Analysis
    from vftcli.outputs.log.estimates import Group


@opt.command
def estimate(
    log: opt.Log,
    output: opt.LogFolder,
    analysis: AnalysisOptions,
    also: ExtraOptions,
    csv: Annotated[bool, Option("--csv", "", "Also write estimates.csv.", group=WRITE)],
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
    from vftcli.batch.log_work import for_estimates
    from vftcli.cli.console import command_line, say_left_out
    from vftcli.outputs.files import OutputFolder
    from vftcli.outputs.log.estimates import estimate_files, write_estimate_folder
    from vftcli.pipeline import analyse, prepared
    from vftcli.readers.estimates import refuse_estimates
    from vftcli.readers.library import Library
    from vftcli.readers.table import JacobianError
    from vftcli.signals.packages import check_installed
    from vftcli.signals.recording import EXAMINED
    from vftcli.streaming import analysed_in_blocks, comes_in_blocks

    output = opt.folder_of(output, [log], analysis.log.reading)
    library, written = Library([log]), also.choice(csv=csv, rrd=rrd or show)
    if "rrd" in written.extras:
        check_installed("rerun", "recording.rrd (--rrd, --open)")
    # Of a large log only the columns that are looked at are read; outputs show the others too.
    causal = analysis.observers.words["causal"] or not analysis.listing.choice().contacts
    signals = EXAMINED if causal and not (analysis.asks_wrench or written.extras) else None
    if analysis.log.reading.words["columns"] is None:
        refuse_estimates(log)
    OutputFolder(output, force, estimate_files(written.extras)).check()
    choice = for_estimates(analysis.choice(library))
    try:
        recording = library.open(log, replace(choice.read, signals=signals))
        # What needs no complete log comes in blocks, so that memory does not grow with it.
        if set(written.extras) <= {"csv"} and comes_in_blocks(recording, choice):
            found: Analysis | Iterator[Group] = analysed_in_blocks(recording, choice)
        else:
            found = analyse(*prepared(recording, choice), choice)
        made, record = write_estimate_folder(output, found, command_line(), written, force)
    except JacobianError as found:
        from vftcli.cli.jacobian import write_by_jacobian

        write_by_jacobian(log, found, choice, output, force=force, json=json)
        return
    say_left_out(estimate_files(written.extras))
    if json:
        echo(record)
    else:
        show_estimates(made, output, estimate_files(written.extras))
    if show:
        from vftcli.cli.console import open_made

        open_made(output)


def show_estimates(made: "Analysis", output: Path, files: "Sequence[str]") -> None:
    """Print what was found in short, and what was written."""
    from vftcli.cli.console import canvas, say_analysis, show
    from vftcli.outputs.screen import short_screen, written_lines

    say_analysis(made)
    screen = canvas()
    show(short_screen(made, written_lines(output, files, screen), screen))
