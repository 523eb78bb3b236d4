"""`vftcli admit`: what admittance control would have made of a log's forces."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from vftcli.admittance.choice import ControlChoice
from vftcli.cli import options as opt
from vftcli.cli.analysis import AnalysisOptions
from vftcli.cli.console import (
    command_line,
    detail,
    echo,
    echo_data,
    open_made,
    say,
    say_json,
    say_left_out,
    steps_of,
)
from vftcli.signals.option import OUTPUT, WRITE, Option

if TYPE_CHECKING:
    from vftcli.answering import Replayed
    from vftcli.pipeline import AnalysisChoice


class ShownOptions(opt.Bundle):
    """What is shown and drawn of the comparison."""

    figures: opt.Figures
    json: opt.Json
    latex: Annotated[bool, opt.LATEX._replace(group=OUTPUT)]


@opt.command
def admit(
    controllers: opt.Typed[ControlChoice],
    release: Annotated[
        list[str] | None,
        Option("--release", "AXIS=VALUE", "Release from rest, without a log: x=0.3, rz=0.5."),
    ],
    seed: Annotated[int | None, opt.SEED],
    analysis: AnalysisOptions,
    shown: ShownOptions,
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
    """Replay a log's external force through admittance controllers.

    The force is that of kfo-fe; a scenario runs with the controller in the loop.

    Example: vftcli admit --release x=0.3 --robot ur5 --alpha 1,1.3,1.6,1.9
    """
    from vftcli.answering import replayed
    from vftcli.outputs.admittance import files_of_replay, write_admittance
    from vftcli.outputs.files import OutputFolder
    from vftcli.readers.library import Library

    if (log is None) != bool(release):
        raise typer.BadParameter("give one of LOG, SCENARIO, --release AXIS=VALUE")
    if output is None and (show_made or shown.figures):
        raise typer.BadParameter("--open and --figures are of what -o DIR writes; give -o too")
    if shown.json and shown.latex:
        raise typer.BadParameter("choose one of --json and --latex")
    names = files_of_replay(shown.figures)
    if output is not None:
        OutputFolder(output, force, names).check()
    typed = {**analysis.log.reading.words, **analysis.observers.words, **analysis.wrench.words}

    def asked(observer: str, **reading: str) -> "AnalysisChoice":
        analysis.log.reading.words.update(reading)
        return analysis.choice(Library([log] if log else []), observer=[observer])

    found = replayed(
        log,
        typed,
        asked,
        controllers.choice(),
        release or (),
        seed,
        anyway=analysis.anyway,
        progress=steps_of("simulating"),
    )
    show(found, shown)
    if output is not None:
        write_admittance(
            output,
            found.replay,
            found.recording,
            found.run,
            command=command_line(),
            force=force,
            examinations=found.examinations,
            form=shown.figures,
        )
        if not (shown.json or shown.latex):
            say(f"wrote {output}: open {output / 'index.html'}")
        say_left_out(names)
        if show_made:
            open_made(output)


def show(found: "Replayed", shown: ShownOptions) -> None:
    """The comparison on stdout, remarks on stderr."""
    from vftcli.outputs.admittance_tables import (
        comparison_text,
        latency_text,
        latex_text,
        parameter_text,
    )

    result = found.replay
    if shown.json:
        logs = [found.recording] if found.recording is not None else []
        say_json(logs, result.remarks, rows=result.rows)
        return
    if shown.latex:
        echo_data(latex_text(result))
        return
    say(f"{result.robot.title or result.robot.name}: {result.source}")
    say(parameter_text(result))
    for note in result.remarks:
        detail(f"note: {note}")
    if found.run is not None:
        say(latency_text(found.run))
    echo(comparison_text(result.rows))
