"""Options in bundles: a command takes one object a bundle, typer sees every option of it.

A bundle is a frozen dataclass of `option`s and `flag`s, or of further bundles. `taken_apart` gives
typer a function with one parameter an option, and hands the command the bundles put together::

    @taken_apart
    def convert_log(log: Log, reading: ReadOptions, force: Force = False) -> None: ...
"""

import dataclasses
import inspect
from collections.abc import Callable, Iterator, Mapping
from importlib import import_module
from typing import Annotated, Any, ClassVar, Generic, TypeVar

import typer

Choice = TypeVar("Choice")

HOW = "typer"
"""Key of a field's metadata under which stands how it is typed."""


def option(name: str, metavar: str, help: str, default: object = None) -> Any:  # noqa: ANN401
    """One field of a bundle that takes a value.

    Args:
        name: As it is typed, with its dashes.
        metavar: What its value looks like.
        help: What `--help` says of it.
        default: Its value if it is not given; ``dataclasses.MISSING`` if it has to be.
    """
    how = {HOW: typer.Option(name, metavar=metavar, help=help)}
    if default is dataclasses.MISSING:
        return dataclasses.field(metadata=how)
    return dataclasses.field(default=default, metadata=how)


def flag(name: str, help: str) -> Any:  # noqa: ANN401
    """One field of a bundle that is given or not."""
    return dataclasses.field(default=False, metadata={HOW: typer.Option(name, help=help)})


class Bundle:
    """Options that belong together."""

    def words(self) -> dict[str, Any]:
        """Every option by the name of its field."""
        own: Any = self
        return {field.name: getattr(self, field.name) for field in dataclasses.fields(own)}


class ChoiceBundle(Bundle, Generic[Choice]):
    """Options that state a room's choice; their names are the arguments of its `parsed`.

    Attributes:
        HOME: Where the choice is, as ``room.file:Class``; it is imported when it is made, since
            `--help` needs none of it.
    """

    HOME: ClassVar[str]

    def choice(self) -> Choice:
        """The choice that the options state, checked.

        Raises:
            VftError: If a word is not what the room takes.
        """
        module, _, name = self.HOME.partition(":")
        made: Choice = getattr(import_module(f"vftcli.{module}"), name).parsed(**self.words())
        return made


def taken_apart(command: Callable[..., None]) -> Callable[..., None]:
    """Return the command as typer wants it: every field of its bundles a parameter of its own.

    The parameters are called ``BUNDLE_FIELD``, so that bundles need not know each other; what the
    user types is what the field says.
    """
    own = inspect.signature(command).parameters.values()

    def called(**values: Any) -> None:  # noqa: ANN401 - options are of every kind
        command(**{p.name: put_together(p.name, p.annotation, values) for p in own})

    flat = [field for p in own for field in parameters(p.name, p.annotation, p.default)]
    called.__name__, called.__doc__ = command.__name__, command.__doc__
    # typer asks for the signature; without annotations of its own it finds nothing else.
    called.__signature__ = inspect.Signature(flat)  # type: ignore[attr-defined]
    called.__annotations__ = {}
    return called


def parameters(name: str, kind: Any, default: Any) -> Iterator[inspect.Parameter]:  # noqa: ANN401
    """The parameters of one argument of a command: itself, or those of the bundle it is.

    Args:
        name: Its name.
        kind: Its annotation, or the bundle.
        default: Its default, or ``inspect.Parameter.empty``.
    """
    if not dataclasses.is_dataclass(kind):
        keyword = inspect.Parameter.KEYWORD_ONLY
        yield inspect.Parameter(name, keyword, default=default, annotation=kind)
        return
    for field in dataclasses.fields(kind):
        missing = field.default is dataclasses.MISSING
        default = inspect.Parameter.empty if missing else field.default
        how = field.metadata.get(HOW)
        annotation = field.type if how is None else Annotated[field.type, how]
        yield from parameters(f"{name}_{field.name}", annotation, default)


def put_together(name: str, kind: Any, values: Mapping[str, Any]) -> Any:  # noqa: ANN401
    """One argument of a command from the values that typer parsed: a value, or a bundle of them."""
    if not (isinstance(kind, type) and dataclasses.is_dataclass(kind)):
        return values[name]
    found = {
        field.name: put_together(f"{name}_{field.name}", field.type, values)
        for field in dataclasses.fields(kind)
    }
    return kind(**found)
