"""Options in bundles: a command takes one object a bundle, typer sees every option of it.

A bundle is a frozen dataclass whose fields are annotated as typer wants a parameter, or are
bundles themselves. `taken_apart` gives typer a function with one parameter a field, and hands the
command the bundles put together again::

    @taken_apart
    def convert_log(log: Log, reading: ReadOptions, force: Force = False) -> None: ...
"""

import dataclasses
import inspect
from collections.abc import Callable, Iterator, Mapping
from typing import Any


def taken_apart(command: Callable[..., None]) -> Callable[..., None]:
    """Return the command as typer wants it: every field of its bundles a parameter of its own.

    The parameters are called ``BUNDLE_FIELD``, so that bundles need not know each other; what the
    user types is what the field's annotation names.
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
        yield from parameters(f"{name}_{field.name}", field.type, default)


def put_together(name: str, kind: Any, values: Mapping[str, Any]) -> Any:  # noqa: ANN401
    """One argument of a command from the values that typer parsed: a value, or a bundle of them."""
    if not (isinstance(kind, type) and dataclasses.is_dataclass(kind)):
        return values[name]
    found = {
        field.name: put_together(f"{name}_{field.name}", field.type, values)
        for field in dataclasses.fields(kind)
    }
    return kind(**found)
