"""Scenarios by name or file, with the user's overrides, and back to TOML."""

import types
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import MISSING, fields, is_dataclass
from pathlib import Path
from typing import Any, TypeVar, Union, get_args, get_origin, get_type_hints

from vftcli.robots.writing import lines_of
from vftcli.signals.errors import ParameterError
from vftcli.signals.parsing import (
    LIST,
    SWITCH,
    TABLE,
    TEXT,
    WHOLE,
    ValueKind,
    assignment,
    check_known,
    is_finite,
    toml_tables,
)
from vftcli.simulation.scenario import Scenario

FOLDER = Path(__file__).parent / "scenarios"
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


def scenario_names() -> tuple[str, ...]:
    """Names of the built-in scenarios, in alphabetical order."""
    return tuple(sorted(path.stem for path in FOLDER.glob("*.toml")))


def listing() -> list[tuple[str, str]]:
    """Name and one-line title of each built-in scenario."""
    return [(name, load_scenario(name).title) for name in scenario_names()]


def load_scenario(name: str | Path, overrides: Sequence[str] = ()) -> Scenario:
    """Read a built-in scenario or a user's TOML file and apply `key=value` overrides.

    Args:
        name: Name of a built-in scenario, or a file.
        overrides: As ``servo.stiffness=soft`` or ``contacts.hand.style=taps``; values are TOML, a
            bare word is a string.

    Raises:
        ParameterError: If there is no such scenario, key or kind, or a value has the wrong type.
    """
    path = FOLDER / f"{name}.toml"
    if not path.is_file():
        path = Path(name)
        if path.suffix.lower() != ".toml":
            check_known(str(name), scenario_names(), f"no FILE.toml and no scenario {str(name)!r}")
    try:
        table = toml_tables(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or "not text"
        raise ParameterError(f"{path}: cannot be read as a scenario ({reason})") from None
    except ParameterError as error:
        raise ParameterError(f"{path}: {error}") from None
    table.setdefault("name", path.stem)
    for override in overrides:
        apply_override(table, override)
    return section_from(Scenario, table, "")


def apply_override(table: dict[str, Any], override: str) -> None:
    """Put one `key=value` into the parsed file; contacts are addressed by name."""
    key, text = assignment(override, "--set", "key=value")
    parts = key.split(".")
    node: Any = {"": table}
    for depth, part in enumerate(["", *parts[:-1]]):
        where = ".".join(parts[:depth])
        if isinstance(node, list):
            node = {str(c.get("name")): c for c in reversed(node) if isinstance(c, dict)}
            check_known(part, [*node][::-1] or ["no contact"], f"no contact {where!r}")
        node = node.setdefault(part, {})
        if not isinstance(node, dict if depth == len(parts) - 1 else dict | list):
            raise ParameterError(f"{where} is a value, not a section")
    try:
        node[parts[-1]] = toml_tables(f"x = {text}")["x"]
    except ParameterError:
        node[parts[-1]] = text


def section_from(cls: type[Section], table: Mapping[str, Any], where: str) -> Section:
    """A section's dataclass of its TOML table; complaints name the key that is wrong."""
    paths = {f.name: f"{where}.{f.name}".lstrip(".") for f in fields(cls)}  # type: ignore[arg-type]
    for key in table:
        check_known(key, paths, f"no scenario key {f'{where}.{key}'.lstrip('.')!r}")
    for field in fields(cls):  # type: ignore[arg-type]
        if field.name not in table and field.default is field.default_factory is MISSING:
            raise ParameterError(
                f"the scenario lacks {paths[field.name]}; [{where or 'scenario'}] takes "
                f"{', '.join(paths)}"
            )
    hints = get_type_hints(cls)
    return cls(**{key: convert(value, hints[key], paths[key]) for key, value in table.items()})


def convert(value: Any, hint: Any, where: str) -> Any:  # noqa: ANN401 - TOML values
    """A TOML value as the type that a field declares."""
    items = get_args(hint)
    if get_origin(hint) in {Union, types.UnionType}:
        return convert_union(value, items, where)
    if get_origin(hint) is tuple:
        LIST.check(where, value)
        items = items[:1] * len(value) if items[-1] is Ellipsis else items
        if len(value) != len(items):
            raise ParameterError(f"{where} has {len(value)} entries; it must have {len(items)}")
        pairs = enumerate(zip(value, items, strict=True))
        return tuple(convert(v, item, f"{where}[{i}]") for i, (v, item) in pairs)
    KINDS.get(hint, TABLE).check(where, value)
    if hint in KINDS:
        return float(value) if hint is float else value
    return section_from(hint, value, where)


def convert_union(value: Any, options: tuple[Any, ...], where: str) -> Any:  # noqa: ANN401
    """A value as the first type that accepts it, a table as the section its `kind` names."""
    if tagged := {o.KIND: o for o in options if hasattr(o, "KIND")}:
        TABLE.check(where, value)
        kind = str(value.get("kind", ""))
        check_known(kind, tagged, f"no {where}.kind {kind!r}")
        return section_from(tagged[kind], {k: v for k, v in value.items() if k != "kind"}, where)
    *others, last = (option for option in options if option is not type(None))
    for option in others:
        with suppress(ParameterError):
            return convert(value, option, where)
    return convert(value, last, where)


def to_toml(scenario: Scenario, seed: int) -> str:
    """A scenario as a TOML file that makes the same log again."""
    return "".join(lines_of(as_table(scenario) | {"seed": seed}))


def as_table(section: Any) -> dict[str, Any]:  # noqa: ANN401
    """A dataclass as TOML would hold it, without what is None."""
    table: dict[str, Any] = {"kind": section.KIND} if hasattr(section, "KIND") else {}
    for field in fields(section):
        value = getattr(section, field.name)
        if is_dataclass(value):
            value = as_table(value)
        elif isinstance(value, tuple) and value and is_dataclass(value[0]):
            value = [as_table(v) for v in value]
        if value is not None:
            table[field.name] = value
    return table
