"""The text of a robot file and its tables, every complaint with the line that is wrong."""

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple, NoReturn

import numpy as np

from vftcli.robots.bounds import out_of_bounds
from vftcli.signals.arrays import Array
from vftcli.signals.errors import ParameterError, RobotError
from vftcli.signals.parsing import shown, toml_tables

#: Endings of robot descriptions; what they are their content decides.
DESCRIPTIONS = (".urdf", ".xml", ".xacro", ".mjcf", ".sdf")
LARGEST = 16 << 20  #: Largest robot file; one with all its words has a hundredth of it. [B]


class RobotFile:
    """A parsed robot file that can point at the line a complaint is about."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.text = robot_text(path)
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

    def number(self, key: str, default: float | None = None) -> float:
        """Return a finite number, `default` if the key is absent, or complain about its line."""
        if key not in self.values:
            if default is not None:
                return default
            self.refuse(f"{key} is missing", key)
        value = self.values[key]
        if not is_finite(value):
            self.refuse(f"{key} is {shown(value)}; it must be a finite number", key)
        self.check_bounds(key, [float(value)])
        return float(value)

    def check_bounds(self, key: str, values: Sequence[float]) -> None:
        """Complain about a key's line if one of its numbers is beyond what robots have."""
        if why := out_of_bounds(key, values):
            self.refuse(why, key)

    def vector(self, key: str, length: int, default: Sequence[float] | None = None) -> Array:
        """Return `length` finite numbers, `default` if absent, or complain. (length,)"""
        if key not in self.values and default is None:
            self.refuse(f"{key} is missing; it has {length} numbers", key)
        value = self.values.get(key, default)
        if key in self.values and not (
            isinstance(value, list) and len(value) == length and all(map(is_finite, value))
        ):
            self.refuse(f"{key} is {shown(value)}; it must be {length} finite numbers", key)
        found = np.array([float(item) for item in value])
        self.check_bounds(key, found.tolist())
        return found

    def numbers(self, key: str, least: int) -> tuple[float, ...]:
        """Return a list of at least `least` finite numbers, or complain about its line."""
        value = self.values.get(key)
        if not isinstance(value, list) or len(value) < least or not all(map(is_finite, value)):
            said = f"is {shown(value)}; it" if key in self.values else "is missing; it"
            self.refuse(f"{key} {said} must be a list of at least {least} finite numbers", key)
        found = tuple(float(item) for item in value)
        self.check_bounds(key, found)
        return found

    def switch(self, key: str) -> bool:
        """Return true or false, false if the key is absent, or complain."""
        value = self.values.get(key, False)
        if not isinstance(value, bool):
            self.refuse(f"{key} is {shown(value)}; it must be true or false", key)
        return value

    def text(self, key: str, default: str = "") -> str:
        """Return a word or a sentence, `default` if the key is absent, or complain."""
        value = self.values.get(key, default)
        if not isinstance(value, str):
            self.refuse(f"{key} is {shown(value)}; it must be text in quotes", key)
        return value

    def texts(self, key: str) -> tuple[str, ...]:
        """Return the sentences of a list, or of one sentence without it; empty ones left out."""
        value = self.values.get(key, ())
        sentences = [value] if isinstance(value, str) else value
        if not isinstance(sentences, list | tuple) or not all(
            isinstance(sentence, str) for sentence in sentences
        ):
            self.refuse(f"{key} is {shown(value)}; it must be text in quotes, or a list of it", key)
        return tuple(sentence for sentence in sentences if sentence)

    def choice(self, key: str, known: Iterable[str], default: str | None = None) -> str:
        """Return one of the words that are known, or complain and list them."""
        value, there = self.values.get(key, default), list(known)
        if not isinstance(value, str) or value not in there:
            said = f"is {shown(value)}; it is" if key in self.values else "is missing; it is"
            self.refuse(f"{key} {said} one of {', '.join(there)}", key)
        return value

    def tables(self, key: str) -> tuple[Mapping[str, Any], ...]:
        """Return the ``[[key]]`` tables, none if there are none, or complain about their line."""
        value = self.values.get(key, [])
        if not isinstance(value, list) or not all(isinstance(table, dict) for table in value):
            self.refuse(f"{key} is {shown(value)}; it must be tables, each headed [[{key}]]", key)
        return tuple(value)

    def section(self, name: str) -> "Section":
        """Return the section of a name, empty if there is none, or complain about its line."""
        values = self.values.get(name, {})
        if not isinstance(values, dict):
            self.refuse(f"{name} must be a section [{name}]", name)
        return Section(self.file, values, name)

    def named_sections(self, *keys: str) -> dict[str, "Section"]:
        """Return each table in this one by its name, itself under "" if it has one of `keys`."""
        found = {
            name: Section(self.file, table, f"{self.table}.{name}")
            for name, table in self.values.items()
            if isinstance(table, dict)
        }
        return {**found, "": self} if any(key in self.values for key in keys) else found


def is_finite(value: object) -> bool:
    """Whether a value of TOML is a finite number; true and false are none."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    try:
        return math.isfinite(value)
    except OverflowError:  # an integer beyond the largest float
        return False


def joint_label(document: Mapping[str, Any], index: int) -> str:
    """The name that a file gives to its joint of an index, "" where it gives none."""
    tables = document.get("joints")
    if not isinstance(tables, list) or index >= len(tables) or not isinstance(tables[index], dict):
        return ""
    return str(tables[index].get("name", ""))


def robot_text(path: Path) -> str:
    """The text of a robot file, whatever its format."""
    try:
        if not path.is_file():
            raise RobotError(f"{path}: no such robot file")
        if (size := path.stat().st_size) > LARGEST:
            raise RobotError(
                f"{path}: has {size >> 20} MiB; a robot file has at most {LARGEST >> 20} MiB"
            )
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or "not text"
        raise RobotError(f"{path}: cannot be read as a robot file ({reason})") from None
