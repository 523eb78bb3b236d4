"""Tables of a scenario file turned into dataclasses, every complaint with the key that is wrong."""

import types
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import MISSING, fields
from typing import Any, TypeVar, Union, get_args, get_origin, get_type_hints

from vftcli.signals.errors import ParameterError
from vftcli.signals.parsing import did_you_mean
from vftcli.signals.schema import LIST, SWITCH, TABLE, TEXT, WHOLE, ValueKind, is_finite

Section = TypeVar("Section")

#: Largest number of a scenario in any unit; a clock that counts from 1970 begins below it.
LARGEST = 1e10
#: Type of a field → its kind.
KINDS = {
    bool: SWITCH,
    float: ValueKind(
        f"a finite number, {LARGEST:g} at most", lambda v: is_finite(v) and abs(v) <= LARGEST
    ),
    int: WHOLE,
    str: TEXT,
}


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
    KINDS.get(hint, TABLE).check(where, value)
    if hint in KINDS:
        return float(value) if hint is float else value
    return section_from(hint, value, where)


def convert_union(value: Any, options: tuple[Any, ...], where: str) -> Any:  # noqa: ANN401
    """Return `value` as the first type that takes it, a table as the section its `kind` names."""
    if tagged := {o.KIND: o for o in options if hasattr(o, "KIND")}:
        TABLE.check(where, value)
        kind = str(value.get("kind", ""))
        if kind not in tagged:
            raise ParameterError(unknown_name(f"{where}.kind {kind!r}", kind, tagged))
        return section_from(tagged[kind], {k: v for k, v in value.items() if k != "kind"}, where)
    *others, last = (option for option in options if option is not type(None))
    for option in others:
        with suppress(ParameterError):
            return convert(value, option, where)
    return convert(value, last, where)


def convert_tuple(value: Any, items: tuple[Any, ...], where: str) -> tuple[Any, ...]:  # noqa: ANN401
    """Return a TOML array as a tuple of the declared length and type."""
    LIST.check(where, value)
    items = items[:1] * len(value) if items[-1] is Ellipsis else items
    if len(value) != len(items):
        raise ParameterError(f"{where} has {len(value)} entries; it must have {len(items)}")
    pairs = enumerate(zip(value, items, strict=True))
    return tuple(convert(v, item, f"{where}[{i}]") for i, (v, item) in pairs)


def key_path(where: str, key: str) -> str:
    """Return the name of a key as `--set` takes it."""
    return f"{where}.{key}" if where else key


def unknown_name(what: str, name: str, known: Iterable[str]) -> str:
    """Return the complaint about an unknown name: the nearest one, and all there are."""
    there = list(known)
    return f"no {what}.{did_you_mean(name, there)} There is {', '.join(there)}."
