"""Options in bundles: a command takes one object a bundle, typer sees every option of it.

A bundle is a class of `option`s and `flag`s, or of further bundles. `taken_apart` gives typer a
function with one parameter an option, and hands the command the bundles put together::

    @taken_apart
    def convert_log(log: Log, reading: ReadOptions, force: Force = False) -> None: ...
"""

import inspect
from collections.abc import Callable, Iterator, Mapping
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any, ClassVar, Generic, NamedTuple, Self, TypeVar

import typer

Choice = TypeVar("Choice")

REQUIRED = inspect.Parameter.empty  #: The default of an option that has to be given.


class DeclaredOption(NamedTuple):
    """What a bundle's class says of one option."""

    default: object  #: Its value if it is not given, `REQUIRED` if it has to be.
    typer: Any  #: How it is typed, and what `--help` says of it.
    seldom: bool = False  #: Whether only `--help-all` shows it.


def option(
    name: str,
    metavar: str,
    help: str,
    default: object = None,
    *,
    seldom: bool = False,
    **limits: float,
) -> Any:  # noqa: ANN401
    """One option of a bundle that takes a value."""
    how: Any = limits
    return DeclaredOption(default, typer.Option(name, metavar=metavar, help=help, **how), seldom)


def flag(name: str, help: str, *, seldom: bool = False) -> Any:  # noqa: ANN401
    """One option of a bundle that is given or not; ``-v/--details`` has two names."""
    return DeclaredOption(False, typer.Option(*name.split("/"), help=help), seldom)


# No dataclass: making one takes a millisecond, and --help would pay for all of them.
class Bundle:
    """Options that belong together, each an attribute."""

    GROUP: ClassVar[str] = ""  #: Heading of `--help` under which they stand.

    def __init__(self, **values: Any) -> None:  # noqa: ANN401 - options are of every kind
        vars(self).update(values)

    def words(self) -> dict[str, Any]:
        """Every option by its name."""
        return dict(vars(self))

    def changed(self, **values: Any) -> Self:  # noqa: ANN401
        """The same with other values of some options."""
        return type(self)(**{**vars(self), **values})

    @classmethod
    def declared(cls) -> dict[str, Any]:
        """Name of every option and further bundle → its type."""
        found: dict[str, Any] = {}
        for base in reversed(cls.__mro__):
            found |= inspect.get_annotations(base)
        return {name: kind for name, kind in found.items() if name not in {"HOME", "GROUP"}}


class ChoiceBundle(Bundle, Generic[Choice]):
    """Options that state a room's choice; their names are the arguments of its `parsed`."""

    #: Where the choice is, as ``room.file:Class``; it is imported when it is made, since `--help`
    #: needs none of it.
    HOME: ClassVar[str]

    def choice(self) -> Choice:
        """The choice that the options state, checked."""
        module, _, name = self.HOME.partition(":")
        made: Choice = getattr(import_module(f"vftcli.{module}"), name).parsed(**self.words())
        return made


def taken_apart(command: Callable[..., None]) -> Callable[..., None]:
    """Return the command as typer wants it: every option of its bundles a parameter of its own.

    The parameters are called ``BUNDLE_OPTION``, so that bundles need not know each other; what the
    user types is what the option says.
    """
    own = inspect.signature(command).parameters.values()

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
            command(**{p.name: put_together(p.name, p.annotation, values) for p in own})

    flat = [single for p in own for single in parameters(p.name, p.annotation, p.default)]
    called.__name__, called.__doc__ = command.__name__, command.__doc__
    # typer asks for the signature; without annotations of its own it finds nothing else.
    called.__signature__ = inspect.Signature(flat)  # type: ignore[attr-defined]
    called.__annotations__ = {}
    return called


def parameters(
    name: str,
    kind: Any,  # noqa: ANN401
    default: object,
    group: str = "",
) -> Iterator[inspect.Parameter]:
    """The parameters of one argument of a command: itself, or those of the bundle it is."""
    if is_bundle(kind):
        for own, what in kind.declared().items():
            under = kind.GROUP or group
            yield from parameters(f"{name}_{own}", what, getattr(kind, own, REQUIRED), under)
        return
    if isinstance(default, DeclaredOption):
        default.typer.rich_help_panel = heading(group, seldom=default.seldom)
        kind, default = Annotated[kind, default.typer], default.default
    yield inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=kind)


SELDOM = " …"  #: Ending of a heading whose options only `--help-all` shows.


def heading(group: str, *, seldom: bool) -> str:
    """The heading of an option, which typer keeps for us, with how often it is wanted."""
    return f"{group}{SELDOM}" if seldom else group


def put_together(name: str, kind: Any, values: Mapping[str, Any]) -> Any:  # noqa: ANN401
    """One argument of a command from the values that typer parsed: a value, or a bundle of them."""
    if not is_bundle(kind):
        return values[name]
    declared = kind.declared().items()
    return kind(**{own: put_together(f"{name}_{own}", what, values) for own, what in declared})


def inputs_of(values: Mapping[str, Any]) -> list[Path]:
    """Every file and folder that the options name, but the output: nothing may write over these."""
    found = []
    for name, value in values.items():
        for word in value if isinstance(value, list | tuple) else (value,):
            path = Path(word.removeprefix("file:")) if isinstance(word, str) else word
            if name == "output" or not isinstance(path, Path):
                continue
            # A word without an ending is a name of ours, as of a robot, where no log is asked for.
            if path is word or path.suffix or name.endswith("free"):
                found.append(path)
    return found


def is_bundle(kind: object) -> bool:
    """Whether the type of an argument is a bundle."""
    return isinstance(kind, type) and issubclass(kind, Bundle)
