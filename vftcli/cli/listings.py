"""`vftcli robots` and `vftcli observers`: what there is, with its sources."""

from typing import Annotated, Any

import typer

from vftcli.cli import options as opt


def robots(
    name: Annotated[
        str | None, typer.Argument(metavar="[NAME|FILE]", help="Show one robot in full.")
    ] = None,
    json: opt.Json = False,
) -> None:
    """List the robot profiles, or show one with its numbers and their sources.

    Example: vftcli robots ur5
    """
    import json as json_module

    from vftcli.outputs.grid import terminal
    from vftcli.outputs.listings import robots_grid
    from vftcli.robots import PROFILES, load_robot

    if name is None:
        rows = [robot_row(load_robot(profile)) for profile in PROFILES]
        if json:
            typer.echo(json_module.dumps(rows, indent=2))
            return
        typer.echo(terminal(robots_grid(rows)).rstrip("\n"))
        return
    robot = load_robot(name)
    if json:
        typer.echo(json_module.dumps(robot.document or robot_row(robot), indent=2))
        return
    for line in robot_lines(robot):
        typer.echo(line)


def robot_row(robot: Any) -> dict[str, Any]:  # noqa: ANN401 - avoids importing Robot for --help
    """One robot in a few words."""
    models = sorted({f.model for f in robot.friction}) or ["no friction model"]
    return {
        "name": robot.name,
        "title": robot.title,
        "joints": robot.joints,
        "torque_source": robot.torque_source,
        "friction": ", ".join(models),
        "observers": sorted(robot.gains),
        "payloads": sorted(robot.payloads),
    }


def robot_lines(robot: Any) -> list[str]:  # noqa: ANN401
    """One robot in full: joints, drives, friction, gains, sources."""
    from vftcli.outputs.grid import terminal
    from vftcli.outputs.listings import joints_grid

    lines = [
        f"{robot.title} ({robot.name}): {robot.joints} joints, torque from {robot.torque_source}",
        "",
        *terminal(joints_grid(robot)).splitlines(),
    ]
    for observer, gains in robot.gains.items():
        lines.append("")
        lines.extend(f"{observer}.{key} = {value}" for key, value in gains.items())
    lines += ["", *(f"note: {note}" for note in robot.remarks)]
    for source in robot.sources:
        lines.append(
            f"source {source.get('id', '?')}: {source.get('what', '')}: {source.get('ref', '')}"
        )
    if robot.payloads:
        lines.append(f"payloads: {', '.join(robot.payloads)} (--payload NAME)")
    return lines


def observers(json: opt.Json = False) -> None:
    """List the observers, their equations and their parameters.

    Example: vftcli observers
    """
    import json as json_module

    from vftcli.observers import OBSERVERS
    from vftcli.observers.settings import PARAMETERS

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
        typer.echo(json_module.dumps(rows, indent=2, ensure_ascii=False))
        return
    for row in rows:
        typer.echo(f"{row['name']:<8} {row['title']} {row['equations']}")
        typer.echo(f"{'':<8} {row['summary']}; --set {', '.join(row['parameters'])}")
