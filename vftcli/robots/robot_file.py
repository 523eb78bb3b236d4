"""The text of a robot file and its tables, every complaint with the line that is wrong."""

import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple, NoReturn

import numpy as np

from vftcli.robots.bounds import out_of_bounds
from vftcli.signals.arrays import Array
from vftcli.signals.errors import ParameterError, RobotError
from vftcli.signals.parsing import toml_tables
from vftcli.signals.schema import NUMBER, TABLE, TEXT, ValueKind, tables, vector, word_of

#: Endings of robot descriptions; what they are their content decides.
DESCRIPTIONS = (".urdf", ".xml", ".xacro", ".mjcf", ".sdf")
LARGEST = 16 << 20  #: Largest robot file; one with all its words has a hundredth of it. [B]


class RobotFile:
    """A parsed robot file that can point at the line a complaint is about."""

    def __init__(self, path: Path, what: str = "robot file") -> None:
        self.path = path
        self.text = robot_text(path, what)
        try:
            self.document = toml_tables(self.text)
        except ParameterError as error:
            raise RobotError(f"{path}: {error}") from None

    def line(self, table: str, index: int | None, key: str) -> int | None:
        """Line of `key` in `table`, from 1, or of the table's header.

        Args:
            table: Dotted name, "" for the keys before any table.
            index: Which ``[[joints]]`` the table belongs to, from 0, or None outside of them.
            key: The key to look for.
        """
        header = 1 if table == "" else None
        assigns = re.compile(rf"[\"']?{re.escape(key)}[\"']?\s*=")
        joint, name = -1, ""
        for number, line in enumerate(self.text.splitlines(), start=1):
            stripped = line.strip()
            if stripped.startswith("["):
                name = stripped.split("#")[0].strip().strip("[]").strip()
                joint += stripped.startswith("[[joints]]")
                if name == table and index in {None, joint}:
                    header = number
            elif name == table and index in {None, joint} and key and assigns.match(stripped):
                return number
        if header is None and "." in table:
            return self.line(table.rpartition(".")[0], index, "")
        return header

    @property
    def root(self) -> "Section":
        """The keys before any table, and the tables under theirs."""
        return Section(self, self.document)


class Section(NamedTuple):
    """A table of a robot file, whose values are checked as they are read."""

    file: RobotFile  #: The file.
    values: Mapping[str, Any]  #: The table.
    table: str = ""  #: Its dotted name, "" for the whole document.
    #: Which ``[[joints]]`` it is or belongs to, from 0, or None outside of them.
    joint: int | None = None

    def refuse(self, message: str, key: str = "") -> NoReturn:
        """Raise a RobotError that names the file, the line and the joint."""
        line = self.file.line(self.table, self.joint, key)
        where = f"{self.file.path}" + (f", line {line}" if line else "")
        whose = ""
        if self.joint is not None:
            label = joint_label(self.file.document, self.joint)
            whose = f"joint {self.joint + 1}{f' ({label})' if label else ''}: "
        raise RobotError(f"{where}: {whose}{message}")

    def value(self, key: str, kind: ValueKind, default: Any = None) -> Any:  # noqa: ANN401 - TOML's
        """The value of a key, `default` if it is absent, or a complaint about its line."""
        if key in self.values:
            if why := kind.broken(key, self.values[key]):
                self.refuse(why, key)
        elif default is None:
            self.refuse(f"{key} is missing; it must be {kind.words}", key)
        return self.values.get(key, default)

    def bounded(
        self, key: str, kind: ValueKind, default: Sequence[float] | None = None
    ) -> list[float]:
        """The numbers of a key, each of them such as robots have."""
        value = self.value(key, kind, default)
        found = [float(item) for item in (value if isinstance(value, list) else [value])]
        if why := out_of_bounds(key, found):
            self.refuse(why, key)
        return found

    def number(self, key: str, default: float | None = None) -> float:
        """A finite number, `default` if the key is absent."""
        if key not in self.values and default is not None:
            return default
        return self.bounded(key, NUMBER)[0]

    def vector(self, key: str, length: int, default: Sequence[float] | None = None) -> Array:
        """So many finite numbers, `default` if the key is absent. (length,)"""
        given = None if default is None else list(default)
        return np.array(self.bounded(key, vector(length), given))

    def text(self, key: str, default: str = "") -> str:
        """A word or a sentence, `default` if the key is absent."""
        return str(self.value(key, TEXT, default))

    def choice(self, key: str, known: Iterable[str], default: str | None = None) -> str:
        """One of the words that are known, `default` if the key is absent."""
        return str(self.value(key, word_of(known), default))

    def tables(self, key: str) -> tuple[Mapping[str, Any], ...]:
        """The ``[[key]]`` tables, none if there are none."""
        return tuple(self.value(key, tables(key), ()))

    def section(self, name: str) -> "Section":
        """The section of a name in this one, empty if there is none."""
        values = self.value(name, TABLE, {})
        table = f"{self.table}.{name}" if self.table else name
        return Section(self.file, values, table, self.joint)

    def named_sections(self, *keys: str) -> dict[str, "Section"]:
        """Each table in this one by its name, itself under "" if it has one of `keys`."""
        found = {
            name: self.section(name)
            for name, table in self.values.items()
            if isinstance(table, dict)
        }
        return {**found, "": self} if any(key in self.values for key in keys) else found


def joint_label(document: Mapping[str, Any], index: int) -> str:
    """The name that a file gives to its joint of an index, "" where it gives none."""
    tables = document.get("joints")
    if not isinstance(tables, list) or index >= len(tables) or not isinstance(tables[index], dict):
        return ""
    return str(tables[index].get("name", ""))


def robot_text(path: Path, what: str = "robot file") -> str:
    """The text of a robot file, whatever its format, or of what is kept in a part of one."""
    try:
        # The pipe of a shell's <(…) has no ending; a robot's file has one, and is read twice.
        if not (path.is_file() or (path.is_fifo() and not path.suffix)):
            raise RobotError(f"{path}: no such {what}")
        if (size := path.stat().st_size) > LARGEST:
            raise RobotError(
                f"{path}: has {size >> 20} MiB; a {what} has at most {LARGEST >> 20} MiB"
            )
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or "not text"
        raise RobotError(f"{path}: cannot be read as a {what} ({reason})") from None
