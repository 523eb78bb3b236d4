"""`vftcli formats`: which logs can be read, and how to record them."""

from typing import Annotated

import typer

from vftcli.cli import options as opt


def list_formats(
    name: Annotated[str | None, typer.Argument(metavar="[NAME]", help="Show one format.")] = None,
    json: opt.Json = False,
) -> None:
    """List the log formats: how to record them, what is taken from them, what to look out for.

    Example: vftcli formats
    """
    import json as json_module

    from vftcli.readers import READERS
    from vftcli.signals.errors import UnknownFormatError

    if name is not None and name not in READERS:
        raise UnknownFormatError(f"no format {name!r}; there is {', '.join(READERS)}")
    shown = [READERS[name]] if name else list(READERS.values())
    if json:
        keys = ("name", "title", "recording", "takes", "pitfalls", "columns")
        typer.echo(json_module.dumps([{k: getattr(r, k) for k in keys} for r in shown], indent=2))
        return
    for reader in shown:
        if name is None:
            typer.echo(f"{reader.name:<18} {reader.title}")
            continue
        typer.echo(f"{reader.name}: {reader.title}")
        typer.echo(f"  record:   {reader.recording}")
        typer.echo(f"  taken:    {reader.takes}")
        typer.echo(f"  pitfalls: {reader.pitfalls}")
    if name is None:
        typer.echo("\nvftcli formats NAME tells how to record one; gzip and zstd are taken off.")
