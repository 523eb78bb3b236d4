"""`vftcli reproduce`: a paper's experiments run again, beside what it prints."""

from pathlib import Path
from typing import Annotated

import typer

from vftcli.cli import options as opt
from vftcli.cli.bundles import flag, option, taken_apart
from vftcli.cli.help import WRITE


class ReproduceOptions(opt.FigureOptions):
    """Which tables and figures, and how thoroughly."""

    only: str | None = option(
        "--only", "NAME,…", "Only these: table1…table4, fig1…fig13, guidelines."
    )
    fast: bool = flag("--fast", "One seed a scenario rather than five.")
    force: opt.Force = False


@taken_apart
def reproduce(
    paper: Annotated[str, typer.Argument(metavar="PAPER", help="Which: huang2025.")],
    output: Annotated[
        Path,
        typer.Option(
            "-o", "--output", metavar="DIR", help="Folder to write into.", rich_help_panel=WRITE
        ),
    ],
    chosen: ReproduceOptions,
    talk: opt.TalkOptions,  # noqa: ARG001 - heard before the command runs
) -> None:
    """Run a paper's experiments again, beside what it prints.

    On simulated equivalents, with stated seeds. Writes DIR/index.html, reproduction.md and
    run.json. An experiment that fails is told in its row; the others are written, and the exit
    code is 1.

    Example: vftcli reproduce huang2025 --only table3 -o paper
    """
    from vftcli.cli.console import command_line, say, show, stages
    from vftcli.outputs.files import OutputFolder
    from vftcli.outputs.grid import terminal
    from vftcli.reproduction.jobs import gather, jobs_of, run_jobs
    from vftcli.reproduction.page import files_of, short_overview, write_reproduction
    from vftcli.reproduction.paper import paper_of
    from vftcli.signals.packages import check_installed

    check_installed("pinocchio", "vftcli reproduce")
    wanted, form = paper_of(paper), chosen.form()
    names = wanted.chosen(chosen.only)
    folder = OutputFolder(output, chosen.force, files_of(wanted, names, form))
    folder.check()
    jobs, progress = jobs_of(wanted, names, chosen.fast), stages()
    progress(f"{len(jobs)} runs", 0.0, 0.0)

    def told(done: int, of: int, what: str) -> None:
        progress(f"{done} of {of} runs done: {what}", done / of, done / of)

    found = gather(wanted, names, run_jobs(jobs, told))
    with folder:
        write_reproduction(folder, wanted, found, jobs, command_line(), form)
    show(terminal(short_overview(found)))
    say(f"wrote {output}: vftcli open {output}")
    if any(shown.failures for shown in found.values()):
        raise typer.Exit(1)
