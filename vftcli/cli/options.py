"""The options of the commands: what typer is given, made of the rooms' choices.

An option is an `Option` beside a field of a room's choice, or beside an argument of the one command
that has it. A command is handed one object for all options of a choice::

    @command
    def convert_log(log: Log, reading: Typed[ReadChoice], force: Force) -> None: ...
"""

import inspect
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from types import NoneType
from typing import Annotated, Any, Generic, NamedTuple, TypeVar, get_args, get_origin

import typer

from vftcli.cli.config import READ
from vftcli.cli.console import speaking
from vftcli.signals.errors import ParameterError
from vftcli.signals.option import (
    ESTIMATE,
    LOG,
    NUMBERS,
    OUTPUT,
    WRENCH,
    WRITE,
    Choice,
    Option,
    assignment,
    settings_as_typed,
    settings_by_name,
)
from vftcli.signals.packages import check_installed

C = TypeVar("C", bound=Choice)
EMPTY = inspect.Parameter.empty

Log = Annotated[Path, Option("", "LOG", "A log file or bag folder, recognised by content.")]
Logs = Annotated[
    list[Path], Option("", "LOG...", "Log files or bag folders, recognised by content.")
]
OUT = Option("-o/--output", "PATH", "Write here; required.", group=WRITE)
Folder = Annotated[Path, OUT]
#: A folder that `folder_of` names where it is not given.
LogFolder = Annotated[
    Path | None, OUT._replace(help="Write here; default: LOG.vft in this folder.")
]
Force = Annotated[bool, Option("--force", "", "Overwrite what exists.", group=WRITE)]
Json = Annotated[
    bool,
    Option(
        "--json",
        "",
        "Print JSON on stdout.",
        group=OUTPUT,
    ),
]
Open = Annotated[
    bool,
    Option(
        "--open",
        "",
        "Open the page or the recording when done.",
        group=OUTPUT,
    ),
]
Anyway = Annotated[
    bool,
    Option(
        "--anyway",
        "",
        "Continue despite errors; the outputs are marked.",
        group=LOG,
    ),
]
Check = Annotated[
    list[Path] | None, Option("--check", "LOG", "Try the result on this log. Repeatable.")
]
Wrench = Annotated[bool, Option("--wrench", "", "Add the wrench of every observer.", group=WRENCH)]


FORMS = ("pdf", "svg", "png")  #: What figures may be written as.


def checked_form(form: str) -> str:
    """What figures are written as; refused where what draws them is missing."""
    if form not in FORMS:
        raise ParameterError(f"--figures {form!r} is not {', '.join(FORMS[:-1])} or {FORMS[-1]}")
    check_installed("matplotlib", "--figures")
    return form


Figures = Annotated[
    str | None,
    Option(
        "--figures",
        "|".join(FORMS),
        "Also draw figures for a paper: pdf, svg or png.",
        checked_form,
        group=WRITE,
    ),
]
#: The option for every setting of a command.
SET = Option(
    "--set", "NAME=VALUE", "Change any setting (help settings). Repeatable.", group=ESTIMATE
)
LATEX = Option("--latex", "", "Print the table as LaTeX (booktabs).")
SEED = Option("--seed", "N", "Seed everything random.", least=0)


#: What a log's name ends with and its folder's does not; of `run_1.5` the number belongs
#: to it.
ENDING = re.compile(r"(?<=.)(\.[A-Za-z]\w*)?(\.(gz|zst|zstd|bz2|xz))?$")


def folder_of(output: Path | None, logs: Sequence[Path], reading: "Typed[Any]") -> Path:
    """Where a command writes: as typed, else into a folder here that is named after the log."""
    if output is not None:
        return output
    if len(logs) > 1:
        return Path("report.vft")
    name = logs[0].resolve().name
    part = (reading.words["episode"], reading.words["arm"])
    stem = name if logs[0].is_dir() else ENDING.sub("", name, count=1)
    return Path("-".join([stem, *filter(None, part)]) + ".vft")


class Typed(Generic[C]):
    """The words that a user typed of the options of a choice."""

    def __init__(self, kind: type[C], words: dict[str, Any]) -> None:
        self._kind, self.words = kind, words

    def choice(self, **others: Any) -> C:  # noqa: ANN401 - words are texts, numbers and lists
        """The choice that they state, checked, with other words for some of them."""
        return self._kind.parsed(**{**self.words, **others})

    @property
    def is_asked(self) -> bool:
        """Whether any of them is given."""
        return any(self.words.values())


class Needed(Typed[C]):
    """The same where the fields without a default have to be given."""


class Bundle:
    """Options that belong together, each an attribute."""

    GROUP = ""  #: Heading of those that have none of their own.

    def __init__(self, **values: Any) -> None:  # noqa: ANN401 - options are of every kind
        vars(self).update(values)


class MadeOptions(Bundle):
    """What is made: figures too, JSON in place of words, over what is there."""

    figures: Figures
    json: Json
    force: Force


class TalkOptions(Bundle):
    """How much a command says; heard before it runs."""

    GROUP = OUTPUT

    details: Annotated[bool, Option("-v/--details", "", "Show everything that is known.")]
    quiet: Annotated[
        bool,
        Option("-q/--quiet", "", "Print errors and results only."),
    ]


def command(function: Callable[..., None]) -> Callable[..., None]:
    """Return a command as typer wants it: every option of its choices a parameter of its own.

    Its `options` are the option of every parameter by name, its `choices` what has its settings.
    """
    arguments = inspect.signature(function).parameters.values()
    part = members("", {a.name: (a.annotation, a.default) for a in arguments})
    if any(option.is_setting for kind in part.choices for _, _, option in kind.options().values()):
        own = SET._replace(completes=lambda: set_words(part.choices))
        part.parameters.extend(
            taken_apart("set", Annotated[list[str] | None, own], None).parameters
        )

    def called(**values: Any) -> None:  # noqa: ANN401
        from vftcli.outputs.files import protected

        if part.choices:
            values["settings"] = settings_of(values.get("set") or (), part.choices)
        inputs = [*inputs_of(values), *filter(None, [READ.get()])]
        # How much it says: what its -v and -q ask, as usual where it has none.
        asked = {name.rpartition("_")[2]: value for name, value in values.items()}
        loud = speaking(details=bool(asked.get("details")), quiet=bool(asked.get("quiet")))
        with protected(inputs), loud:
            function(**part.made(values))

    called.__name__, called.__doc__ = function.__name__, function.__doc__
    # typer asks for the signature; without annotations of its own it finds nothing else.
    vars(called)["__signature__"] = inspect.Signature([each for each, _ in part.parameters])
    vars(called)["options"] = {each.name: option for each, option in part.parameters}
    vars(called)["choices"] = part.choices
    called.__annotations__ = {}
    return called


def settings_of(words: Iterable[str], choices: Sequence[type[Choice]]) -> dict[str, str]:
    """Name → value of ``NAME=VALUE`` words, each a setting of one of the choices.

    Raises:
        ParameterError: If a word is malformed or there is no such setting.
    """
    given = dict(assignment(word, "--set", "NAME=VALUE") for word in words)
    return settings_as_typed(given, choices, "--set ")


def set_words(choices: Iterable[type[Choice]]) -> Iterator[str]:
    """What may stand behind ``--set``, each name with its equals sign."""
    for kind in choices:
        for name, (option, _) in settings_by_name([kind]).items():
            yield from (f"{each}=" for each in (option.values() if name == NUMBERS else [name]))


class Part(NamedTuple):
    """One argument of a command in its parts."""

    parameters: list[tuple[inspect.Parameter, Option]]  #: What typer sees.
    made: Callable[[Mapping[str, Any]], Any]  #: The argument of the values that typer parsed.
    choices: tuple[type[Choice], ...] = ()  #: The rooms' choices in it.


def members(prefix: str, kinds: Mapping[str, tuple[Any, object]], group: str = "") -> Part:
    """Arguments by name, each of a kind and with a default, as one that makes them all."""
    parts = {name: taken_apart(prefix + name, *what) for name, what in kinds.items()}
    flat = [
        (parameter, option._replace(group=option.group or group))
        for part in parts.values()
        for parameter, option in part.parameters
    ]
    choices = tuple(kind for part in parts.values() for kind in part.choices)
    return Part(
        flat, lambda values: {name: part.made(values) for name, part in parts.items()}, choices
    )


def taken_apart(name: str, kind: Any, default: object) -> Part:  # noqa: ANN401 - an annotation
    """One argument of a command as parameters: itself, or every option of what it is."""
    if isinstance(kind, type) and issubclass(kind, Bundle):
        each = inspect.get_annotations(kind).items()
        found = {own: (what, getattr(kind, own, EMPTY)) for own, what in each}
        part = members(f"{name}_", found, kind.GROUP)
        return Part(part.parameters, lambda values: kind(**part.made(values)), part.choices)
    if (typed := get_origin(kind)) in {Typed, Needed}:
        (choice,) = get_args(kind)
        found = {
            word: (typed_as(choice, *field, needed=typed is Needed), EMPTY)
            for word, field in choice.options().items()
            if not field[2].is_setting
        }
        part = members(f"{name}_", found, choice.GROUP)
        nothing = dict.fromkeys(word for word in choice.options() if word not in found)

        def made(values: Mapping[str, Any]) -> Any:  # noqa: ANN401 - `Typed` of this choice
            return typed(choice, part.made(values) | nothing | choice.words_of(values["settings"]))

        return Part(part.parameters, made, (choice,))
    if typed is not Annotated:  # typer's own context
        plain = inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, annotation=kind)
        return Part([(plain, Option("", "", ""))], lambda values: values[name])
    what, option = get_args(kind)
    what = str | None if option.reads else what
    if default is EMPTY and (not option.metavar or NoneType in get_args(what)):
        default = None if option.metavar else False
    how: dict[str, Any] = {"help": option.help, "min": option.least, "max": option.most}
    how |= {"metavar": option.metavar or None, "show_default": False}
    if option.completes or option.values():
        how["autocompletion"] = option.values
    info = typer.Option(*option.name.split("/"), **how) if option.name else typer.Argument(**how)
    single = inspect.Parameter(
        name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=Annotated[what, info]
    )
    return Part([(single, option)], lambda values: option.read(values[name]))


def typed_as(
    choice: type[Choice],
    field: str,
    kind: Any,  # noqa: ANN401 - an annotation
    option: Option,
    *,
    needed: bool,
) -> object:
    """What typer makes of a field's typed text; where that is missing the room knows."""
    among, default = (kind, *get_args(kind)), getattr(choice, field, EMPTY)
    one = next((one for one in (int, float, Path) if one in among and not option.reads), str)
    what: Any = list[one] if option.several else one if option.metavar else bool  # type: ignore[valid-type]
    if not (needed and default is EMPTY) and option.metavar:
        what = what | None
    return Annotated[what, option._replace(reads=None)]


def inputs_of(values: Mapping[str, Any]) -> Iterator[Path]:
    """Every file and folder that the options name, but the output: nothing may write over these."""
    for name, value in values.items():
        for word in value if isinstance(value, list | tuple) else (value,):
            path = Path(word.removeprefix("file:")) if isinstance(word, str) else word
            # A word without an ending is a name of ours, as of a robot, where no log is
            # asked for.
            named = (
                path is word or (isinstance(path, Path) and path.suffix) or name.endswith("free")
            )
            if name != "output" and isinstance(path, Path) and named:
                yield path
