"""The options of the commands: what typer is given, made of the rooms' choices.

An option is an `Option` beside a field of a room's choice, or beside an argument of the one command
that has it. A command is handed one object for all options of a choice::

    @command
    def convert_log(log: Log, reading: Typed[ReadChoice], force: Force) -> None: ...
"""

import inspect
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from types import NoneType
from typing import (
    TYPE_CHECKING,
    Annotated,
    Any,
    Generic,
    NamedTuple,
    TypeVar,
    get_args,
    get_origin,
)

import typer

from vftcli.evaluation.reference_choice import ReferenceChoice
from vftcli.observers.choice import ObserverChoice
from vftcli.outputs.log.choice import OutputChoice
from vftcli.readers.reader import ReadChoice
from vftcli.refinement.choice import RefinementChoice
from vftcli.repetition.choice import FreeChoice
from vftcli.robots.choice import RobotChoice
from vftcli.signals.option import LOG, OUTPUT, WRENCH, WRITE, Choice, Option
from vftcli.virtual_sensor.choice import WrenchChoice

if TYPE_CHECKING:
    from vftcli.pipeline import AnalysisChoice
    from vftcli.readers.library import Library

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
Figures = Annotated[
    str | None,
    Option(
        "--figures",
        "pdf|svg|png",
        "Also figures for a paper, one and two columns wide.",
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
    """Options that several commands share, each an attribute."""

    def __init__(self, **values: Any) -> None:  # noqa: ANN401 - options are of every kind
        vars(self).update(values)


class MadeOptions(Bundle):
    """What is made: figures too, JSON in place of words, over what is there."""

    figures: Figures
    json: Json
    force: Force

    def form(self) -> str | None:
        """What figures are written as, checked; None where none are asked for."""
        from vftcli.outputs.figures.paper import checked_form

        return checked_form(self.figures)


class ExtraOptions(Bundle):
    """What else is written for other programs."""

    mcap: Annotated[
        bool,
        Option(
            "--mcap",
            "",
            "Also write estimates.mcap. For ROS 2, Foxglove and PlotJuggler.",
            group=WRITE,
        ),
    ]
    written: Typed[OutputChoice]

    def choice(self, **others: bool) -> OutputChoice:
        """What is written, with what the command's own options ask for."""
        extras = tuple(name for name, asked in {**others, "mcap": self.mcap}.items() if asked)
        return replace(self.written.choice(), extras=extras)


class TalkOptions(Bundle):
    """How much a command says; heard before it runs."""

    details: Annotated[bool, Option("-v/--details", "", "Everything that is known.", group=OUTPUT)]
    quiet: Annotated[
        bool,
        Option(
            "-q/--quiet",
            "",
            "Errors only, and the table or JSON that is asked for.",
            group=OUTPUT,
        ),
    ]


class AnalysisOptions(Bundle):
    """All that can be asked of a log but what it is compared with."""

    reading: Typed[ReadChoice]
    robot: Typed[RobotChoice]
    observers: Typed[ObserverChoice]
    free: Typed[FreeChoice]
    refinement: Typed[RefinementChoice]
    also_wrench: Wrench
    wrench: Typed[WrenchChoice]
    no_contacts: Annotated[
        bool, Option("--no-contacts", "", "Leave the list of contacts out.", group=WRITE)
    ]
    anyway: Anyway
    talk: TalkOptions

    @property
    def asks_wrench(self) -> bool:
        """Whether an option asks for a wrench."""
        return self.also_wrench or self.wrench.is_asked

    def choice(
        self,
        library: "Library",
        reference: Typed[ReferenceChoice] | None = None,
        *,
        on_screen: bool = False,
        **observers: Any,  # noqa: ANN401 - words in place of those that are typed
    ) -> "AnalysisChoice":
        """The choice that the options state, a reference's with it where there is one."""
        from vftcli.cli.console import health_of, stages
        from vftcli.cli.memory import give_back
        from vftcli.pipeline import AnalysisChoice

        give_back()
        compared = reference is not None and reference.words["reference"]
        return AnalysisChoice(
            read=self.reading.choice(),
            robot=self.robot.choice(),
            observers=self.observers.choice(**observers),
            free=self.free.choice(),
            refinement=self.refinement.choice(),
            wrench=self.wrench.choice() if self.asks_wrench else None,
            reference=reference.choice() if reference is not None and compared else None,
            contacts=not self.no_contacts,
            library=library,
            progress=stages(),
            examiner=health_of(library, anyway=self.anyway, on_screen=on_screen),
        )


def command(function: Callable[..., None]) -> Callable[..., None]:
    """Return a command as typer wants it: every option of its choices a parameter of its own.

    Its `options` are the option of every parameter by name.
    """
    arguments = inspect.signature(function).parameters.values()
    parts = {a.name: taken_apart(a.name, a.annotation, a.default) for a in arguments}

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
            function(**{name: part.made(values) for name, part in parts.items()})

    flat = [one for part in parts.values() for one in part.parameters]
    called.__name__, called.__doc__ = function.__name__, function.__doc__
    # typer asks for the signature; without annotations of its own it finds nothing else.
    vars(called)["__signature__"] = inspect.Signature([parameter for parameter, _ in flat])
    vars(called)["options"] = {parameter.name: option for parameter, option in flat}
    called.__annotations__ = {}
    return called


class Part(NamedTuple):
    """One argument of a command, taken apart."""

    parameters: list[tuple[inspect.Parameter, Option]]  #: What typer sees.
    made: Callable[[Mapping[str, Any]], Any]  #: The argument of the values that typer parsed.


def taken_apart(name: str, kind: Any, default: object) -> Part:  # noqa: ANN401 - an annotation
    """One argument of a command as parameters: itself, or every option of what it is."""
    if isinstance(kind, type) and issubclass(kind, Bundle):
        parts = {
            own: taken_apart(f"{name}_{own}", what, getattr(kind, own, EMPTY))
            for own, what in inspect.get_annotations(kind).items()
        }
        flat = [one for part in parts.values() for one in part.parameters]
        return Part(flat, lambda values: kind(**{n: p.made(values) for n, p in parts.items()}))
    if (typed := get_origin(kind)) in {Typed, Needed}:
        (choice,) = get_args(kind)
        found = choice.options().items()
        flat = [
            parameter_of(
                f"{name}_{word}",
                typed_kind(what, option),
                default_of(getattr(choice, field, EMPTY), option, needed=typed is Needed),
                option._replace(group=choice.GROUP),
            )
            for word, (field, what, option) in found
        ]
        return Part(flat, lambda v: typed(choice, {word: v[f"{name}_{word}"] for word, _ in found}))
    if get_origin(kind) is not Annotated:  # typer's own context
        plain = inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, annotation=kind)
        return Part([(plain, Option("", "", ""))], lambda values: values[name])
    what, option = get_args(kind)
    if default is EMPTY and (not option.metavar or NoneType in get_args(what)):
        default = None if option.metavar else False
    return Part([parameter_of(name, what, default, option)], lambda values: values[name])


def typed_kind(kind: Any, option: Option) -> Any:  # noqa: ANN401 - annotations
    """What typer makes of the typed text of a field of a kind."""
    if not option.metavar:
        return bool
    among = (kind, *get_args(kind))
    one = next((one for one in (int, float, Path) if one in among and not option.reads), str)
    return list[one] | None if option.several else one | None  # type: ignore[valid-type]


def default_of(default: object, option: Option, *, needed: bool) -> object:
    """What typer gives where an option of a choice is not typed: mostly nothing, the room knows."""
    if default is EMPTY and needed:
        return EMPTY
    return (default if option.shows_default else None) if option.metavar else False


def parameter_of(
    name: str,
    kind: Any,  # noqa: ANN401 - an annotation
    default: object,
    option: Option,
) -> tuple[inspect.Parameter, Option]:
    """A parameter as typer reads it, beside its option."""
    how: dict[str, Any] = {"help": option.help, "min": option.least, "max": option.most}
    how["metavar"] = option.metavar or None
    info = typer.Option(*option.name.split("/"), **how) if option.name else typer.Argument(**how)
    annotation = Annotated[kind, info]
    where = inspect.Parameter.KEYWORD_ONLY
    return inspect.Parameter(name, where, default=default, annotation=annotation), option


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
