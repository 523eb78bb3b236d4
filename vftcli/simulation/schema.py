"""Tables of a scenario file turned into dataclasses, every complaint with the key that is wrong."""

import difflib
import types
from collections.abc import Iterable, Mapping
from dataclasses import MISSING, fields, is_dataclass
from typing import Any, TypeVar, Union, get_args, get_origin, get_type_hints

from vftcli.signals.errors import ParameterError
from vftcli.signals.parsing import shown

Section = TypeVar("Section")

#: Largest number of a scenario in any of its units; a clock that counts from 1970 starts below.
LARGEST = 1e10


def section_from(cls: type[Section], table: Mapping[str, Any], where: str) -> Section:
    """Make a section's dataclass from its TOML table."""
    known = [f.name for f in fields(cls)]  # type: ignore[arg-type]
    if extra := [key for key in table if key not in known]:
        raise ParameterError(
            unknown_name(f"scenario key {key_path(where, extra[0])!r}", extra[0], known)
        )
    hints = get_type_hints(cls)
    values = {}
    for field in fields(cls):  # type: ignore[arg-type]
        if field.name in table:
            where_key = key_path(where, field.name)
            values[field.name] = convert(table[field.name], hints[field.name], where_key)
        elif field.default is MISSING and field.default_factory is MISSING:
            raise ParameterError(
                f"the scenario lacks {key_path(where, field.name)}; "
                f"[{where or 'scenario'}] takes {', '.join(known)}"
            )
    return cls(**values)


def convert(value: Any, hint: Any, where: str) -> Any:  # noqa: ANN401 - TOML values
    """Return a TOML value as the type a field declares."""
    if get_origin(hint) in {Union, types.UnionType}:
        return convert_union(value, get_args(hint), where)
    if get_origin(hint) is tuple:
        return convert_tuple(value, get_args(hint), where)
    if is_dataclass(hint) and isinstance(hint, type):
        if not isinstance(value, Mapping):
            raise ParameterError(f"{where} is {shown(value)}; it must be a section")
        return section_from(hint, value, where)
    if hint is float and isinstance(value, int | float) and not isinstance(value, bool):
        if not abs(value) <= LARGEST:  # neither is what is not a number
            raise ParameterError(
                f"{where} is {shown(value)}; it must be a finite number, {LARGEST:g} at most"
            )
        return float(value)
    if (
        isinstance(hint, type)
        and isinstance(value, hint)
        and (hint is bool or not isinstance(value, bool))
    ):
        return value
    names = {float: "a number", int: "a whole number", bool: "true or false", str: "a word"}
    raise ParameterError(f"{where} is {shown(value)}; it must be {names.get(hint, str(hint))}")


def convert_union(value: Any, options: tuple[Any, ...], where: str) -> Any:  # noqa: ANN401
    """Return `value` as the first of several types that takes it."""
    if tagged := {o.KIND: o for o in options if hasattr(o, "KIND")}:
        return convert_tagged(value, tagged, where)
    complaint: ParameterError | None = None
    for option in options:
        if option is type(None):
            continue
        try:
            return convert(value, option, where)
        except ParameterError as error:
            complaint = error
    if complaint is None:
        raise ParameterError(f"{where} cannot be {shown(value)}")
    raise complaint


def convert_tagged(value: Any, options: Mapping[str, Any], where: str) -> Any:  # noqa: ANN401
    """Return a table as the section its `kind` names."""
    if not isinstance(value, Mapping):
        raise ParameterError(f"{where} is {shown(value)}; it must be a section with a kind")
    kind = str(value.get("kind", ""))
    if kind not in options:
        raise ParameterError(unknown_name(f"{where}.kind {kind!r}", kind, options))
    return section_from(options[kind], {k: v for k, v in value.items() if k != "kind"}, where)


def convert_tuple(value: Any, items: tuple[Any, ...], where: str) -> tuple[Any, ...]:  # noqa: ANN401
    """Return a TOML array as a tuple of the declared length and type."""
    if not isinstance(value, list | tuple):
        raise ParameterError(f"{where} is {shown(value)}; it must be a list")
    if items[-1] is Ellipsis:
        return tuple(convert(v, items[0], f"{where}[{i}]") for i, v in enumerate(value))
    if len(value) != len(items):
        raise ParameterError(f"{where} has {len(value)} entries; it must have {len(items)}")
    pairs = zip(value, items, strict=True)
    return tuple(convert(v, item, f"{where}[{i}]") for i, (v, item) in enumerate(pairs))


def key_path(where: str, key: str) -> str:
    """Return the name of a key as `--set` takes it."""
    return f"{where}.{key}" if where else key


def unknown_name(what: str, name: str, known: Iterable[str]) -> str:
    """Return the complaint about an unknown name: the nearest one, and all there are."""
    there = list(known)
    close = difflib.get_close_matches(name, there, n=1, cutoff=0.5)
    hint = f" Did you mean {close[0]}?" if close else ""
    return f"no {what}.{hint} There is {', '.join(there)}."
