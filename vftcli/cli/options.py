"""The options of the commands: what typer is given, made of the rooms' choices.

An option is an `Option` beside a field of a room's choice, or beside an argument of the one command
that has it. A command is handed one object for all options of a choice::

    @command
    def convert_log(log: Log, reading: Typed[ReadChoice], force: Force) -> None: ...
"""

import inspect
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from types import NoneType
from typing import (
    Annotated,
    Any,
    Generic,
    NamedTuple,
    TypeVar,
    get_args,
    get_origin,
)

import typer

from vftcli.signals.errors import ParameterError
from vftcli.signals.option import LOG, OUTPUT, WRENCH, WRITE, Choice, Option
from vftcli.signals.packages import check_installed

C = TypeVar("C", bound=Choice)
EMPTY = inspect.Parameter.empty

Log = Annotated[Path, Option("", "LOG", "A log file or a bag directory; recognised by content.")]
Logs = Annotated[
    list[Path], Option("", "LOG...", "Log files or bag directories; recognised by content.")
]
Folder = Annotated[Path, Option("-o/--output", "DIR", "Folder to write into.", group=WRITE)]
Force = Annotated[bool, Option("--force", "", "Overwrite what exists.", group=WRITE)]
Json = Annotated[
    bool,
    Option(
        "--json",
        "",
        "JSON on stdout. It is what the command makes: rows, a run record, a summary.",
        group=OUTPUT,
    ),
]
Open = Annotated[
    bool,
    Option(
        "--open",
        "",
        "Open what was made. The page in the browser, else the recording (--rrd).",
        group=OUTPUT,
    ),
]
Anyway = Annotated[
    bool,
    Option(
        "--anyway",
        "",
        "Go on where a finding makes results meaningless. The outputs say so.",
        seldom=True,
        group=LOG,
    ),
]
Wrench = Annotated[
    bool, Option("--wrench", "", "Also the wrench, as force on the robot.", group=WRENCH)
]


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
        "Also figures for a paper, one and two columns wide.",
        checked_form,
        group=WRITE,
    ),
]
LATEX = Option("--latex", "", "Print a LaTeX table (booktabs).")
SEED = Option("--seed", "N", "Seed of everything drawn; the scenario's own if not given.", least=0)


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

    details: Annotated[bool, Option("-v/--details", "", "Everything that is known.")]
    quiet: Annotated[
        bool,
        Option("-q/--quiet", "", "Errors only, and the table or JSON that is asked for."),
    ]


def command(function: Callable[..., None]) -> Callable[..., None]:
    """Return a command as typer wants it: every option of its choices a parameter of its own.

    Its `options` are the option of every parameter by name.
    """
    arguments = inspect.signature(function).parameters.values()
    part = members("", {a.name: (a.annotation, a.default) for a in arguments})

    def called(**values: Any) -> None:  # noqa: ANN401
        from vftcli.cli.config import taken
        from vftcli.cli.console import speaking
        from vftcli.outputs.files import protected

        kept = taken().path
        inputs = [*inputs_of(values), *([kept] if kept is not None else [])]
        # How much it says: what its -v and -q ask, as usual where it has none.
        asked = {name.rpartition("_")[2]: value for name, value in values.items()}
        loud = speaking(details=bool(asked.get("details")), quiet=bool(asked.get("quiet")))
        with protected(inputs), loud:
            function(**part.made(values))

    called.__name__, called.__doc__ = function.__name__, function.__doc__
    # typer asks for the signature; without annotations of its own it finds nothing else.
    vars(called)["__signature__"] = inspect.Signature([each for each, _ in part.parameters])
    vars(called)["options"] = {each.name: option for each, option in part.parameters}
    called.__annotations__ = {}
    return called


class Part(NamedTuple):
    """One argument of a command, taken apart."""

    parameters: list[tuple[inspect.Parameter, Option]]  #: What typer sees.
    made: Callable[[Mapping[str, Any]], Any]  #: The argument of the values that typer parsed.


def members(prefix: str, kinds: Mapping[str, tuple[Any, object]], group: str = "") -> Part:
    """Arguments by name, each of a kind and with a default, as one that makes them all."""
    parts = {name: taken_apart(prefix + name, *what) for name, what in kinds.items()}
    flat = [
        (parameter, option._replace(group=option.group or group))
        for part in parts.values()
        for parameter, option in part.parameters
    ]
    return Part(flat, lambda values: {name: part.made(values) for name, part in parts.items()})


def taken_apart(name: str, kind: Any, default: object) -> Part:  # noqa: ANN401 - an annotation
    """One argument of a command as parameters: itself, or every option of what it is."""
    if isinstance(kind, type) and issubclass(kind, Bundle):
        each = inspect.get_annotations(kind).items()
        found = {own: (what, getattr(kind, own, EMPTY)) for own, what in each}
        part = members(f"{name}_", found, kind.GROUP)
        return Part(part.parameters, lambda values: kind(**part.made(values)))
    if (typed := get_origin(kind)) in {Typed, Needed}:
        (choice,) = get_args(kind)
        fields = choice.options().items()
        needed = typed is Needed
        found = {word: typed_as(choice, *field, needed=needed) for word, field in fields}
        part = members(f"{name}_", found, choice.GROUP)
        return Part(part.parameters, lambda values: typed(choice, part.made(values)))
    if typed is not Annotated:  # typer's own context
        plain = inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, annotation=kind)
        return Part([(plain, Option("", "", ""))], lambda values: values[name])
    what, option = get_args(kind)
    what = str | None if option.reads else what
    if default is EMPTY and (not option.metavar or NoneType in get_args(what)):
        default = None if option.metavar else False
    how: dict[str, Any] = {"help": option.help, "min": option.least, "max": option.most}
    how["metavar"] = option.metavar or None
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
) -> tuple[Any, object]:
    """What typer makes of a field's typed text, and where that is missing: the room knows."""
    among, default = (kind, *get_args(kind)), getattr(choice, field, EMPTY)
    one = next((one for one in (int, float, Path) if one in among and not option.reads), str)
    what: Any = list[one] if option.several else one if option.metavar else bool  # type: ignore[valid-type]
    if not (needed and default is EMPTY) and option.metavar:
        what = what | None
    plain = option._replace(reads=None)
    return Annotated[what, plain], default if option.shows_default else EMPTY


def inputs_of(values: Mapping[str, Any]) -> Iterator[Path]:
    """Every file and folder that the options name, but the output: nothing may write over these."""
    for name, value in values.items():
        for word in value if isinstance(value, list | tuple) else (value,):
            path = Path(word.removeprefix("file:")) if isinstance(word, str) else word
            # A word without an ending is a name of ours, as of a robot, where no log is asked for.
            named = (
                path is word or (isinstance(path, Path) and path.suffix) or name.endswith("free")
            )
            if name != "output" and isinstance(path, Path) and named:
                yield path
