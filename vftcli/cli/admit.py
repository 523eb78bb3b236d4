"""`vftcli admit`: what admittance control would have made of a log's forces."""

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from vftcli.admittance import ControlChoice
from vftcli.cli import options as opt
from vftcli.cli.console import detail, echo_data, echo_top, open_made, say
from vftcli.signals.option import WRITE, Asked, Option

if TYPE_CHECKING:
    from vftcli.admittance.closed_loop import Replayed


@opt.command(ControlChoice, *opt.OF_ANALYSIS)
def admit(
    asked: Asked,
    release: Annotated[
        list[str] | None,
        Option("--release", "AXIS=VALUE", "Release from rest, without a log: x=0.3, rz=0.5."),
    ],
    seed: Annotated[int | None, opt.SEED],
    figures: opt.Figures,
    json: opt.Json,
    latex: Annotated[bool, opt.LATEX],
    log: Annotated[
        Path | None,
        Option("", "[LOG|SCENARIO]", "A log, an estimates.parquet, or a scenario to simulate."),
    ],
    output: Annotated[
        Path | None,
        Option("-o/--output", "DIR", "Folder to write into; none: table only.", group=WRITE),
    ],
    force: opt.Force,
    show_made: opt.Open,
) -> None:
    """Replay a force through admittance controllers.

    The force is that of kfo-fe; a scenario runs with the controller in the loop.

    Example: vftcli admit --release x=0.3 --robot ur5 --alpha 1,1.3,1.6,1.9
    """
    from vftcli.answering import replayed
    from vftcli.outputs.admittance import files_of_replay, write_admittance
    from vftcli.outputs.files import OutputFolder
    from vftcli.readers.reading import Library

    if (log is None) != bool(release):
        raise typer.BadParameter("give one of LOG, SCENARIO, --release AXIS=VALUE")
    if output is None and (show_made or figures):
        raise typer.BadParameter("--open and --figures are of what -o DIR writes; give -o too")
    opt.form_of(asked)
    if output is not None:
        OutputFolder(output, force, files_of_replay(figures)).check()
    choice_of = partial(opt.choice_for, library=Library([log] if log else []))
    found = replayed(log, asked, choice_of, release or (), seed)
    show(found, asked.line, json=json, latex=latex)
    if output is not None:
        write_admittance(output, found, asked.line, force, figures)
        if not (json or latex):
            say(f"wrote {output}: open {output / 'index.html'}")
        if show_made:
            open_made(output)


def show(found: "Replayed", command: str, *, json: bool, latex: bool) -> None:
    """The comparison on stdout, remarks on stderr."""
    from vftcli.outputs.admittance import (
        LEGEND,
        admittance_record,
        comparison_grid,
        latency_grid,
        latex_text,
        parameter_grid,
    )
    from vftcli.outputs.grid import terminal
    from vftcli.outputs.run_record import to_json

    result, run = found.replay, found.run
    if json:
        echo_data(to_json(admittance_record(found, command)))
        return
    if latex:
        echo_data(latex_text(result))
        return
    say(f"{result.robot.title or result.robot.name}: {result.source}")
    detail(terminal(parameter_grid(result)).rstrip())
    for note in result.remarks:
        detail(f"note: {note}")
    none = "no force passes its threshold: no axis moves (--details)"
    shown = terminal(comparison_grid(result.rows)) if result.rows else none
    if run is not None:
        grid, words = latency_grid(run), "no force passes its threshold"
        words = words if run.stable else f"the arm ran away at {run.t[-1]:.2f} s"
        timed = run.stable and grid.rows
        first = terminal(grid) if timed else f"closed loop: {words}\n"
        shown = f"{first}\n{shown}"
    echo_top(shown)
    say(LEGEND * bool(result.rows))
