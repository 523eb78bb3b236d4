"""The command line: parse, call, print, exit."""

import atexit
import errno
import gc
import io
import os
import signal
import sys
from collections.abc import Collection
from contextlib import suppress
from importlib import import_module
from importlib.abc import MetaPathFinder
from types import FrameType
from typing import Annotated, Any

import typer

from vftcli.cli.commands import COMMANDS, with_command
from vftcli.cli.config import WORDS
from vftcli.cli.help import GroupedCommand, JourneyGroup
from vftcli.cli.progress import STAGES, echo
from vftcli.signals.errors import UnsettledRobotError, VftError
from vftcli.signals.parsing import printable


def make_app(load: Collection[str] = COMMANDS) -> typer.Typer:
    """The command line; of a command not to be loaded the summary only."""
    app = typer.Typer(
        cls=JourneyGroup,
        help=vftcli.__doc__,
        no_args_is_help=True,
        rich_markup_mode=None,
        pretty_exceptions_enable=False,
        context_settings=HELP,
    )
    app.callback()(vftcli)
    for name, command in COMMANDS.items():
        how: Any = {"cls": GroupedCommand, "context_settings": HELP}
        if name in load:
            module = import_module(f"vftcli.cli.{command.file}")
            app.command(name, **how)(getattr(module, command.function))
        else:
            app.command(name, help=command.summary, **how)(lambda: None)
    return app


HELP = {"help_option_names": ["-h", "--help"]}
#: Options that make the output one for programs.
FOR_PROGRAMS = frozenset({"--json", "--csv", "--markdown", "--latex"})


def show_version(asked: bool) -> None:
    """Print the version and stop."""
    if asked:
        from vftcli import __version__

        echo(f"vftcli {__version__}")
        raise typer.Exit


def vftcli(
    _version: Annotated[
        bool,
        typer.Option("--version", callback=show_version, is_eager=True, help="Show the version."),
    ] = False,
) -> None:
    """Forces on a robot arm from its recorded log. Begin with: vftcli LOG --robot NAME."""


def main() -> None:
    """Run the app; a user's error is one line and exit code 1."""
    for library in ("OPENBLAS", "OMP", "MKL"):
        # Matrices are small: threads only wait, and change last digits.
        os.environ[f"{library}_NUM_THREADS"] = "1"
    gc.set_threshold(200_000)  # collecting costs a tenth of a short command
    try:
        # A shell completes any command; `help` shows one other.
        words = with_command(sys.argv[1:])[:2]
        make_app(COMMANDS if "_VFTCLI_COMPLETE" in os.environ else words)(prog_name="vftcli")
    except VftError as error:
        # Those of a file of options too.
        if isinstance(error, UnsettledRobotError) and not FOR_PROGRAMS & set(WORDS.get()):
            from vftcli.outputs.examination import holdings

            echo("\n".join(holdings(error.recording)))
        fail(str(error))
    except MemoryError:
        fail("out of memory; use --interval to take a part of the log")
    except BrokenPipeError:
        raise SystemExit(1) from None
    except OSError as error:
        where = f": {error.filename}" if error.filename else ""
        fail(f"{error.strerror or error}{where}")


def launch() -> None:
    """Run `main` as a program and leave at once; this is `vftcli` in a shell.

    Taking the interpreter apart costs as much as reading a large log.
    """
    sys.meta_path.insert(0, NoPandas())
    try:
        for number in (signal.SIGINT, signal.SIGTERM):
            # A signal ignored by the caller, as by nohup, stays ignored.
            if signal.getsignal(number) is not signal.SIG_IGN:
                signal.signal(number, stop)
        open_streams()
        with suppress(ImportError):  # Windows has no such limit
            import resource

            # Under it libraries would end the process.
            limit = resource.getrlimit(resource.RLIMIT_AS)[0]
            if limit != resource.RLIM_INFINITY and limit < ROOM:
                fail(
                    f"the memory limit of {limit / 1e9:.1f} GB (ulimit -v) is less than the "
                    f"{ROOM / 1e9:.0f} GB that the libraries reserve; raise it"
                )
        main()
        code: object = 0
    except SystemExit as end:
        code = end.code
    except Stopped as stopped:
        echo("error: interrupted; run the command again", err=True)
        code = 128 + stopped.args[0]
    with suppress(Stopped):
        atexit._run_exitfuncs()
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError, ValueError, AttributeError):
            stream.flush()
    os._exit(code if isinstance(code, int) else int(code is not None))


class NoPandas(MetaPathFinder):
    """Finds no pandas, which pyarrow imports for .3 s wherever it is."""

    def find_spec(self, fullname: str, *_: object) -> None:
        """Raise for it, as if it were not installed."""
        if fullname == "pandas":
            raise ModuleNotFoundError


#: Address space that the libraries reserve [B]: with two processors the report of 10 s at
#: 1 kHz needs 3.0e9, of 20 s at 125 Hz 1.9e9.
ROOM = 3e9


class Stopped(BaseException):
    """A signal ends the command; half-written files are removed."""


def stop(number: int, _frame: FrameType | None) -> None:
    """Unwind the command, once."""
    for each in (signal.SIGINT, signal.SIGTERM):
        signal.signal(each, signal.SIG_IGN)
    STAGES.stopped = Stopped(number)
    raise STAGES.stopped


class ClosedOutput(io.TextIOBase):
    """Standard output that the caller closed: writing raises."""

    def write(self, _text: str) -> int:
        """Raise, whatever is written."""
        raise OSError(errno.EBADF, "standard output is closed")


def open_streams() -> None:
    """Mend standard streams that are closed, or lack letters."""
    for number in (0, 1, 2):
        try:
            os.fstat(number)
        except OSError:
            # Else the next file gets its number, and libraries write there.
            os.open(os.devnull, os.O_RDWR)
    if sys.stdout is None:
        sys.stdout = ClosedOutput()
    elif isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")


def fail(message: str) -> None:
    """Print one line to stderr and exit with code 1."""
    STAGES.waiting.clear()
    echo(f"error: {printable(' '.join(message.split()))}", err=True)
    raise SystemExit(1)
