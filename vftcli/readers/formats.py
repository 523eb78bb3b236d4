"""Formats: how each is known, which file of this room reads it, and its columns: `layouts.toml`."""

import re
import tomllib
from dataclasses import dataclass, replace
from importlib import import_module
from pathlib import Path
from typing import Any

from vftcli.readers.reader import LogFile, RawLog, ReadChoice, episode_of


@dataclass(frozen=True, kw_only=True)
class LogFormat:
    """One log format."""

    name: str  #: Name for ``--format``.
    title: str  #: What it is.
    recording: str  #: How a user records one.
    takes: str  #: Which signals are taken from it.
    pitfalls: str  #: What to look out for.
    #: Module of this room that reads it, imported when it is needed: by its `read`, or by its
    #: `episodes`, which gives each one's number and the function that reads it.
    module: str
    begins: str = ""  #: Pattern of the content's first bytes, "" for any.
    line: str = ""  #: Pattern of a text's first line, "" for any.
    folder: bool = False  #: Whether it is a folder.
    #: Whether it takes any table, and is asked only if no other format fits.
    general: bool = False
    takes_columns: bool = True  #: Whether the columns may be described by ``--columns``.
    describes: bool = False  #: Whether it reads ``--columns`` itself where its files are text.
    episodes: bool = False  #: Whether a file may hold several recordings.
    arms: bool = False  #: Whether a log may be of two arms.
    columns: str = ""  #: The columns that its program writes, in the grammar of ``--columns``.
    joints: int = 0  #: How many joints such a log has, 0 for any number.
    clock: str = ""  #: Which clock its stamps are from, in words; "" for the column's name.
    remedy: str = ""  #: What to do where clock or positions are missing.

    @property
    def _module(self) -> Any:  # noqa: ANN401 - a module with `read`, and what else it needs
        return import_module(f"vftcli.readers.{self.module}")

    def recognises(self, file: LogFile) -> bool:
        """Whether a file's content is of this format."""
        if file.is_folder != self.folder:
            return False
        if not self.begins and not self.line:
            return bool(self._module.recognises(file, self))
        each = ((self.begins, file.head), (self.line, file.first_line))
        return all(re.match(pattern.encode("latin-1"), text) for pattern, text in each if pattern)

    def read(self, file: LogFile, request: ReadChoice) -> RawLog:
        """Read a file of this format."""
        if not self.episodes:
            found: RawLog = self._module.read(file, request, self)
            return found
        with self._module.episodes(file) as each:
            number, part, remarks = episode_of(file.path, request, tuple(each))
            raw: RawLog = each[number](request)
        part = " ".join(word for word in (part, raw.part) if word)
        return replace(raw, part=part, remarks=(*remarks, *raw.remarks))

    def numbers(self, file: LogFile) -> tuple[int, ...]:
        """The numbers of a file's episodes; of a format that holds one recording none."""
        if not self.episodes:
            return ()
        with self._module.episodes(file) as each:
            return tuple(each)


#: Every format by its name.
FORMATS = {
    name: LogFormat(name=name, **entry.pop("reader"), **entry)
    for name, entry in tomllib.loads(
        (Path(__file__).parent / "layouts.toml").read_text(encoding="utf-8")
    ).items()
}
