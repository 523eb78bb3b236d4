"""The command line: one file a command; parse, call, print. Nothing else prints or exits."""

import gc
import os
import sys
from collections.abc import Iterable
from importlib import import_module
from typing import Annotated, Any

import typer

from vftcli.errors import VftError

COMMANDS = {
    "estimate": "estimate:estimate",
    "compare": "compare:compare",
    "report": "report:report",
    "inspect": "inspect:inspect_log",
    "convert": "convert:convert_log",
    "admit": "admit:admit",
    "identify": "identify:identify_robot",
    "tune": "tune:tune_gains",
    "simulate": "simulate:simulate_log",
    "bench": "bench:bench",
    "robots": "listings:robots",
    "observers": "listings:observers",
    "formats": "formats:list_formats",
}
"""Command → the module of this package, and the function in it."""


def make_app(names: Iterable[str] = tuple(COMMANDS)) -> typer.Typer:
    """Make the command line with all commands, or with those that a call can need."""
    app = typer.Typer(
        help=vftcli.__doc__,
        no_args_is_help=True,
        rich_markup_mode=None,
        pretty_exceptions_enable=False,
        add_completion=False,
    )
    app.callback()(vftcli)
    for name in names:
        module, function = COMMANDS[name].split(":")
        app.command(name)(getattr(import_module(f"vftcli.cli.{module}"), function))
    return app


def __getattr__(name: str) -> Any:  # noqa: ANN401 - a module's attributes are of every kind
    if name == "app":
        return make_app()
    raise AttributeError(f"module 'vftcli.cli' has no attribute {name!r}")


def show_version(asked: bool) -> None:
    """Print the version and stop."""
    if asked:
        from vftcli import __version__

        typer.echo(f"vftcli {__version__}")
        raise typer.Exit


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
    asked = sys.argv[1] if len(sys.argv) > 1 else ""
    try:
        make_app([asked] if asked in COMMANDS else COMMANDS)()
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
