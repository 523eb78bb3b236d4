"""`vftcli reproduce`: a paper's experiments beside its numbers."""

from pathlib import Path
from typing import Annotated

import typer

from vftcli.cli import options as opt
from vftcli.cli.console import echo_data, say, show
from vftcli.signals.option import Asked, Option

#: Line below the table.
ABOUT = "ours / print: our number over the paper's, median of an item's lines (least … most)"


@opt.command(opt.Talk)
def reproduce(
    paper: Annotated[str, Option("", "huang2025", "Which paper.")],
    output: Annotated[Path | None, opt.OUT._replace(help="Write here; default: huang2025.vft.")],
    figures: opt.Figures,
    only: Annotated[
        str | None, Option("--only", "NAME,...", "Run only these: table1...table4, fig1...fig13.")
    ],
    fast: Annotated[bool, Option("--fast", "", "Use one seed a scenario instead of five.")],
    force: opt.Force,
    json: opt.Json,
    asked: Asked,
) -> None:
    """Run the paper's experiments beside its numbers.

    On simulated equivalents, with stated seeds. Writes PATH/index.html, its tables as
    reproduction.md, and run.json. An experiment that fails says so in its row; the others are
    written, and the exit code is 1.

    Example: vftcli reproduce huang2025 --only table3
    """
    from vftcli.outputs.files import OutputFolder
    from vftcli.outputs.grid import terminal
    from vftcli.reproduction.experiments import (
        experiments_of,
        files_of,
        gather,
        overview,
        run_jobs,
        write_reproduction,
    )
    from vftcli.reproduction.paper import paper_of
    from vftcli.signals.packages import check_installed

    check_installed("pinocchio", "vftcli reproduce")
    wanted = paper_of(paper)
    names = wanted.chosen(only)
    output = output or Path(f"{paper}.vft")
    folder = OutputFolder(output, force, files_of(wanted, names, figures))
    folder.check()
    chosen = experiments_of(wanted, names, fast=fast)
    found = gather(wanted, names, run_jobs(chosen))
    with folder:
        write_reproduction(folder, wanted, found, chosen, asked.line, figures)
    if json:
        echo_data((output / "run.json").read_text("utf-8"))
    else:
        show(terminal(overview(found)) + ABOUT)
    say(f"wrote {output}: open {output / 'index.html'}")
    if any(item.failures for item in found.values()):
        raise typer.Exit(1)
