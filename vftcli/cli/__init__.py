"""The command line: one file a command; parse, call, print. Nothing else prints or exits."""

import gc
import os
import sys
from typing import Annotated

import typer

from vftcli.cli import (
    admit,
    bench,
    compare,
    convert,
    estimate,
    formats,
    identify,
    inspect,
    listings,
    report,
    simulate,
    tune,
)
from vftcli.errors import VftError

app = typer.Typer(
    help="External forces from recorded robot logs: disturbance observers, ground truth, errors.",
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    add_completion=False,
)
app.command("estimate")(estimate.estimate)
app.command("compare")(compare.compare)
app.command("report")(report.report)
app.command("inspect")(inspect.inspect_log)
app.command("convert")(convert.convert_log)
app.command("admit")(admit.admit)
app.command("identify")(identify.identify_robot)
app.command("tune")(tune.tune_gains)
app.command("simulate")(simulate.simulate_log)
app.command("bench")(bench.bench)
app.command("robots")(listings.robots)
app.command("observers")(listings.observers)
app.command("formats")(formats.list_formats)


def show_version(asked: bool) -> None:
    """Print the version and stop."""
    if asked:
        from vftcli import __version__

        typer.echo(f"vftcli {__version__}")
        raise typer.Exit


@app.callback()
def vftcli(
    _version: Annotated[
        bool,
        typer.Option("--version", callback=show_version, is_eager=True, help="Show the version."),
    ] = False,
) -> None:
    """External forces from recorded robot logs: disturbance observers, ground truth, errors."""


def main() -> None:
    """Run the app; turn what a user can mend into one line on stderr and exit code 1."""
    for library in ("OPENBLAS", "OMP", "MKL"):
        # The matrices here are small: threads of a linear algebra library only wait for each other.
        os.environ.setdefault(f"{library}_NUM_THREADS", "1")
    gc.set_threshold(200_000)  # a command is short: collecting while it imports is a tenth of it
    try:
        app()
    except VftError as error:
        stop(str(error))
    except MemoryError:
        stop("out of memory; use --interval to take a part of the log")
    except OSError as error:
        if isinstance(error, BrokenPipeError):
            sys.stderr.close()
            raise SystemExit(1) from None
        where = f": {error.filename}" if error.filename else ""
        stop(f"{error.strerror or error}{where}")


def stop(message: str) -> None:
    """Print one line to stderr and exit with code 1."""
    typer.echo(f"error: {' '.join(message.split())}", err=True)
    raise SystemExit(1)
