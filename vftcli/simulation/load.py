"""Scenarios by name or file, with the user's overrides, and back to TOML."""

from collections.abc import Sequence
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

from vftcli.robots.writing import lines_of
from vftcli.signals.errors import ParameterError
from vftcli.signals.parsing import assignment, toml_tables
from vftcli.simulation.scenario import Scenario
from vftcli.simulation.schema import section_from, unknown_name

FOLDER = Path(__file__).parent / "scenarios"


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
            names = scenario_names()
            raise ParameterError(
                unknown_name(f"scenario {str(name)!r}", str(name), names) + " Or give a FILE.toml."
            )
    table = read_table(path)
    table.setdefault("name", path.stem)
    for override in overrides:
        apply_override(table, override)
    return section_from(Scenario, table, "")


def read_table(path: Path) -> dict[str, Any]:
    """The tables of a scenario file."""
    try:
        return toml_tables(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or "not text"
        raise ParameterError(f"{path}: cannot be read as a scenario ({reason})") from None
    except ParameterError as error:
        raise ParameterError(f"{path}: {error}") from None


def apply_override(table: dict[str, Any], override: str) -> None:
    """Put one `key=value` into the parsed file; contacts are addressed by name."""
    key, text = assignment(override, "--set", "key=value")
    parts = key.split(".")
    node: Any = table
    for depth, part in enumerate(parts[:-1]):
        node = section_of(node, part, ".".join(parts[: depth + 1]))
    node[parts[-1]] = parse_value(text)


def section_of(node: Any, part: str, where: str) -> Any:  # noqa: ANN401 - TOML values
    """Return the section or the named contact `part` of a parsed table, made if not there."""
    if isinstance(node, list):
        node = {str(c.get("name")): c for c in reversed(node) if isinstance(c, dict)}
        if part not in node:
            raise ParameterError(
                unknown_name(f"contact {where!r}", part, [*node][::-1] or ["none"])
            )
    found = node.setdefault(part, {})
    if not isinstance(found, dict | list):
        raise ParameterError(f"{where} is a value, not a section")
    return found


def parse_value(text: str) -> Any:  # noqa: ANN401
    """Return a TOML value; what is none is a string."""
    try:
        return toml_tables(f"x = {text}")["x"]
    except ParameterError:
        return text


def to_toml(scenario: Scenario, seed: int) -> str:
    """A scenario as a TOML file that makes the same log again."""
    return "".join(lines_of(as_table(scenario) | {"seed": seed}))


def as_table(section: Any) -> dict[str, Any]:  # noqa: ANN401
    """Return a dataclass as TOML would hold it, without what is None."""
    table: dict[str, Any] = {"kind": section.KIND} if hasattr(section, "KIND") else {}
    for field in fields(section):
        value = getattr(section, field.name)
        if value is None:
            continue
        if is_dataclass(value):
            value = as_table(value)
        elif isinstance(value, tuple) and value and is_dataclass(value[0]):
            value = [as_table(v) for v in value]
        table[field.name] = value
    return table
