"""`vftcli robots`, `vftcli observers`, `vftcli formats`: what there is, with its sources."""

from typing import Annotated

import typer

from vftcli.cli import options as opt
from vftcli.robots.choice import RobotChoice
from vftcli.signals.option import Option


@opt.command
def robots(
    tip: Annotated[str | None, RobotChoice.option("tip")],
    name: Annotated[str | None, Option("", "[NAME|FILE]", "Show one robot in full.")],
    json: opt.Json,
) -> None:
    """List the robot profiles, or show one and its sources.

    Example: vftcli robots ur5
    """
    from vftcli.cli.console import say_json
    from vftcli.outputs.grid import terminal
    from vftcli.outputs.listings import robot_row, robot_text, robots_grid
    from vftcli.robots import MAKERS, load_robot

    if name is None:
        rows = {m: [robot_row(load_robot(p)) for p in names] for m, names in MAKERS.items()}
        if json:
            say_json([{"maker": maker, **row} for maker in rows for row in rows[maker]])
            return
        for maker, each in rows.items():
            typer.echo(f"{maker}\n{terminal(robots_grid(each))}", nl=False)
        return
    robot = RobotChoice.parsed(robot=name, tip=tip).named()
    if json:
        say_json(robot.document or robot_row(robot))
    else:
        typer.echo(robot_text(robot))


@opt.command
def observers(json: opt.Json) -> None:
    """List the observers, their equations and their parameters.

    Example: vftcli observers
    """
    from vftcli.cli.console import say_json
    from vftcli.observers.table import OBSERVERS, PARAMETERS

    rows = [
        {
            "name": name,
            "title": entry.title,
            "equations": entry.equations,
            "summary": entry.summary,
            "parameters": [f"{entry.section}.{p}" for p in PARAMETERS[entry.section]],
        }
        for name, entry in OBSERVERS.items()
    ]
    if json:
        say_json(rows)
        return
    for row in rows:
        typer.echo(f"{row['name']:<8} {row['title']} {row['equations']}")
        typer.echo(f"{'':<8} {row['summary']}; --set {', '.join(row['parameters'])}")


@opt.command
def list_formats(
    name: Annotated[str | None, Option("", "[NAME]", "Show one format.")], json: opt.Json
) -> None:
    """List the log formats, or show how to record one.

    Example: vftcli formats
    """
    from vftcli.cli.console import say_json
    from vftcli.readers import FORMATS
    from vftcli.signals.errors import UnknownFormatError
    from vftcli.signals.parsing import did_you_mean

    if name is not None and name not in FORMATS:
        near = did_you_mean(name, FORMATS)
        raise UnknownFormatError(f"no format {name!r}; there is {', '.join(FORMATS)}.{near}")
    shown = [FORMATS[name]] if name else list(FORMATS.values())
    if json:
        words = ("name", "title", "recording", "takes", "pitfalls")
        say_json([{w: getattr(f, w) for w in words} | {"columns": f.takes_columns} for f in shown])
        return
    for form in shown:
        if name is None:
            typer.echo(f"{form.name:<18} {form.title}")
            continue
        typer.echo(f"{form.name}: {form.title}")
        typer.echo(f"  record:   {form.recording}")
        typer.echo(f"  taken:    {form.takes}")
        typer.echo(f"  pitfalls: {form.pitfalls}")
    if name is None:
        typer.echo("\nvftcli formats NAME tells how to record one; gzip and zstd are taken off.")
