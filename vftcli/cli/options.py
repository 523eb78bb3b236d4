"""The commands' options: typer's parameters, made of the rooms' choices.

An option is an `Option` beside a field of a room's choice, or beside an argument of its one
command. A command gets the words of all options of its choices at once::

    @command(ReadChoice, Talk)
    def convert_log(log: Log, asked: Asked, force: Force) -> None: ...
"""

import inspect
import os
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from types import NoneType
from typing import TYPE_CHECKING, Annotated, Any, get_args, get_origin

import typer

from vftcli.bias import RefinementChoice
from vftcli.cli.config import READ
from vftcli.cli.console import command_line, health_of, speaking
from vftcli.free_motion import FreeChoice
from vftcli.observers import ObserverChoice
from vftcli.readers.reader import ReadChoice
from vftcli.robots import RobotChoice
from vftcli.signals.option import (
    ESTIMATE,
    FILE,
    NUMBERS,
    OUTPUT,
    WRITE,
    Anyway,
    Asked,
    Choice,
    Option,
    assignment,
    settings_as_typed,
    settings_by_name,
)
from vftcli.signals.packages import check_installed
from vftcli.wrench import AlsoWrench, WrenchChoice

if TYPE_CHECKING:
    from vftcli.pipeline import AnalysisChoice
    from vftcli.readers.reading import Library

Log = Annotated[Path, Option("", "LOG", "A log file or bag folder, recognised by content.")]
Logs = Annotated[
    list[Path], Option("", "LOG...", "Log files or bag folders, recognised by content.")
]
OUT = Option("-o/--output", "PATH", "Write here; required.", group=WRITE)
Folder = Annotated[Path, OUT]
#: A folder that `folder_of` names if it is not given.
LogFolder = Annotated[
    Path | None, OUT._replace(help="Write here; default: LOG.vft in this folder.")
]
Force = Annotated[bool, Option("--force", "", "Overwrite what exists.", group=WRITE)]
Json = Annotated[bool, Option("--json", "", "Print JSON on stdout.", group=OUTPUT)]
Open = Annotated[
    bool, Option("--open", "", "Open the page or the recording when done.", group=OUTPUT)
]
Check = Annotated[
    list[Path] | None, Option("--check", "LOG", "Try the result on this log. Repeatable.")
]


def checked_form(form: str) -> str:
    """Format of figures; refused without matplotlib."""
    check_installed("matplotlib", "--figures")
    return form


Figures = Annotated[
    str | None,
    Option(
        "--figures",
        "pdf|svg|png",
        "Also draw figures for a paper: pdf, svg or png.",
        checked_form,
        group=WRITE,
    ),
]
#: The option for every setting of a command.
SET = Option(
    "--set", "NAME=VALUE", "Change any setting (help settings). Repeatable.", group=ESTIMATE
)
LATEX = Option("--latex", "", "Print the table as LaTeX (booktabs).", group=OUTPUT)
SEED = Option("--seed", "N", "Seed everything random.", least=0)


#: Endings of a log's name; of `run_1.5` the number stays.
ENDING = re.compile(r"(?<=.)(\.[A-Za-z]\w*)?(\.(gz|zst|zstd|bz2|xz))?$")


def folder_of(output: Path | None, logs: Sequence[Path], asked: Asked) -> Path:
    """Output folder: as typed, else here, named after the log."""
    if output is not None:
        return output
    if len(logs) > 1:
        return Path("report.vft")
    name = logs[0].resolve().name
    part = (asked.words["episode"], asked.words["arm"])
    stem = name if logs[0].is_dir() else ENDING.sub("", name, count=1)
    return Path("-".join([stem, *filter(None, part)]) + ".vft")


class Talk(Choice):
    """Amount of a command's output."""

    GROUP = OUTPUT

    details: Annotated[bool, Option("-v/--details", "", "Show everything that is known.")]
    quiet: Annotated[bool, Option("-q/--quiet", "", "Print errors and results only.")]


class TableForm(Choice):
    """The form of a table; one at most."""

    GROUP = OUTPUT

    json: Json
    csv: Annotated[bool, Option("--csv", "", "Print one row per observer and joint.")]
    markdown: Annotated[bool, Option("--markdown", "", "Print a Markdown table.")]
    latex: Annotated[bool, LATEX]


def form_of(asked: Asked) -> str:
    """The one form asked for, or "terminal"."""
    forms = [name for name in ("json", "csv", "markdown", "latex") if asked.words.get(name)]
    if len(forms) > 1:
        raise typer.BadParameter(f"choose one of {', '.join(f'--{name}' for name in forms)}")
    return forms[0] if forms else "terminal"


def command(*choices: type[Choice]) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """A typer command made of a function: these choices' options are parameters.

    They replace its argument `Asked`; the function's own argument of an option's name wins. The
    command has `options` by their parameters' names, and `choices`, which have its settings.
    """

    def of(function: Callable[..., None]) -> Callable[..., None]:
        own, parts = inspect.signature(function).parameters, [*parameters_of(function, choices)]
        options = {each.name: option for each, option in parts}

        def called(**values: Any) -> None:  # noqa: ANN401
            from vftcli.outputs.files import protected

            each = (assignment(w, "--set", "NAME=VALUE") for w in values.get("set") or ())
            settings = settings_as_typed(dict(each), choices, "--set ")
            inputs = [*inputs_of(values), *filter(None, [READ.get()])]
            loud = speaking(details=bool(values.get("details")), quiet=bool(values.get("quiet")))
            with protected(inputs), loud:
                asked = Asked(values, settings, command_line())
                own_values = {n: options[n].read(values[n]) for n in own if n in values}
                function(**dict.fromkeys(own, asked) | own_values)

        called.__name__, called.__doc__ = function.__name__, function.__doc__
        # typer asks for the signature.
        vars(called)["__signature__"] = inspect.Signature([each for each, _ in parts])
        vars(called).update(options=options, choices=choices)
        called.__annotations__ = {}
        return called

    return of


def parameters_of(
    function: Callable[..., None], choices: Sequence[type[Choice]]
) -> Iterator[tuple[inspect.Parameter, Option]]:
    """Typer's parameters of a function, each with its option."""
    own = inspect.signature(function).parameters
    every = [(kind.GROUP, *each) for kind in choices for each in kind.options().items()]
    for name, argument in own.items():
        if argument.annotation is Asked:
            for group, word, (_, what, option) in every:
                if not option.is_setting and word not in own:
                    grouped = option._replace(group=option.group or group)
                    yield parameter(word, typed_as(what, option), option), grouped
        elif get_origin(argument.annotation) is Annotated:
            what, option = get_args(argument.annotation)
            yield parameter(name, what, option, argument.default), option
        else:  # typer's own context
            yield argument.replace(kind=inspect.Parameter.KEYWORD_ONLY), Option("", "", "")
    if any(option.is_setting for *_, (_, _, option) in every):
        # Every setting's name with its equals sign.
        option = SET._replace(
            completes=lambda: [
                f"{word}="
                for kind in choices
                for name, (setting, _) in settings_by_name([kind]).items()
                for word in (setting.values() if name == NUMBERS else [name])
            ]
        )
        yield parameter("set", list[str] | None, option), option


EMPTY = inspect.Parameter.empty


def parameter(name: str, what: Any, option: Option, default: object = EMPTY) -> inspect.Parameter:  # noqa: ANN401
    """An option or argument for typer."""
    if default is EMPTY and (not option.metavar or NoneType in get_args(what)):
        default = None if option.metavar else False
    how: dict[str, Any] = {"help": option.help, "min": option.least, "max": option.most}
    how |= {"metavar": option.metavar or None, "show_default": False}
    if option.completes or option.values():
        how["autocompletion"] = option.values
    info = typer.Option(*option.name.split("/"), **how) if option.name else typer.Argument(**how)
    kind = inspect.Parameter.KEYWORD_ONLY
    return inspect.Parameter(name, kind, default=default, annotation=Annotated[what, info])


def typed_as(what: Any, option: Option) -> Any:  # noqa: ANN401 - annotations
    """Typer's type of a field's typed text."""
    if not option.metavar:
        return bool
    among = (what, *get_args(what))
    one: Any = next((one for one in (int, float, Path) if one in among and not option.reads), str)
    return (list[one] if option.several else one) | None


def inputs_of(values: Mapping[str, Any]) -> Iterator[Path]:
    """Every file and folder in the options but the output."""
    for name, value in values.items():
        for word in value if isinstance(value, list | tuple) else (value,):
            path = Path(word.removeprefix(FILE)) if isinstance(word, str) else word
            # A word without an ending is a robot, unless a log is due.
            named = path is word or (isinstance(path, Path) and path.suffix) or name == "free"
            if name != "output" and isinstance(path, Path) and named:
                yield path


#: Choices of reading and arm; all but the reference.
OF_LOG = (ReadChoice, RobotChoice)
OF_ANALYSIS = (
    *OF_LOG,
    ObserverChoice,
    FreeChoice,
    RefinementChoice,
    AlsoWrench,
    WrenchChoice,
    Anyway,
    Talk,
)

#: Arrays from this size on have their own memory, returned with them. [bytes]
#:
#: Such memory is mapped and cleared anew: for the thousands of smaller arrays that took a
#: third of the time of an hour's report, and its peak was no lower.
LARGE = 1 << 24

#: The C library's numbers of the size from which memory is mapped, and of the freed memory
#: that it keeps: with less of it, arrays of a minute's log are cleared anew each time.
MMAP_THRESHOLD, TRIM_THRESHOLD = -3, -1


def give_back() -> None:
    """Have freed arrays return their memory, if the C library can.

    Otherwise it keeps the memory, and a long log's peak is the sum of all its stages.
    """
    # Read at pyarrow's import: its own allocator keeps memory.
    os.environ.setdefault("ARROW_DEFAULT_MEMORY_POOL", "system")
    import ctypes

    try:
        for number, size in ((MMAP_THRESHOLD, LARGE), (TRIM_THRESHOLD, 2 * LARGE)):
            ctypes.CDLL(None).mallopt(number, size)
    except (AttributeError, OSError, TypeError):  # another C library
        return


def choice_for(
    asked: Asked,
    library: "Library",
    *,
    on_screen: bool = False,
    observers: ObserverChoice | None = None,
) -> "AnalysisChoice":
    """The choice of a command; its examiner prints."""
    from vftcli.pipeline import choice_of

    if "observer" in asked.words:
        give_back()
    examiner = health_of(library, anyway=asked.anyway, on_screen=on_screen)
    return choice_of(asked, library, examiner, observers)
