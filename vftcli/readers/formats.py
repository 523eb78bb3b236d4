"""Formats: how each is known, which file of this room reads it, and its columns: `layouts.toml`.

Of a path that none knows: what it is, and the nearest thing to do.
"""

import re
import shlex
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from importlib import import_module
from pathlib import Path
from typing import Any

from vftcli.readers.opening import HEAD_BYTES
from vftcli.readers.reader import LogFile, RawLog, ReadChoice, episode_of
from vftcli.signals.parsing import printable


@dataclass(frozen=True, kw_only=True)
class LogFormat:
    """One log format."""

    name: str  #: Name for ``log.format``.
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
    columns: str = ""  #: The columns that its program writes, in the grammar of ``--columns``.
    joints: int = 0  #: How many joints such a log has, 0 for any number.
    #: Columns of which the last values are the payload's mass and, if there, its centre of mass.
    payload: str = ""
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

#: How names of files end that may be logs; only to say so.
LOGS = (".csv", ".tsv", ".txt", ".gz", ".zst", ".npy", ".npz", ".parquet", ".bag", ".mcap", ".db3",
        ".pkl", ".log", ".bin", ".json", ".jsonl", ".mat", ".hdf5", ".h5", ".feather",
        ".arrow")  # fmt: skip

SHOWN = 4


#: How files begin that users give by mistake → what they are, and what to do.
KINDS = (
    (rb"\x89PNG|\xff\xd8\xff|GIF8|BM....\0\0\0\0", "a picture; give the log it was drawn from"),
    (rb"....ftyp|\x1aE\xdf\xa3|RIFF....AVI", "a video; give the log that was recorded with it"),
    (rb"%PDF", "a PDF; give the log it tells of"),
    (rb"RIFF....WAVE|ID3|OggS|fLaC", "a sound; give the log that was recorded with it"),
    (rb"RRF2|RRIO", "a Rerun recording, which vftcli writes and does not read; give the log"),
    (rb"\x7fELF|MZ[^\r\n]{0,60}\0", "a program; give the log that it wrote"),
    (
        rb"\s*(<\?xml[^>]*>\s*)?(<!--.*?-->\s*)*<(robot|mujoco|sdf)\b",
        "a robot's description, no log; give it with --robot, beside a log",
    ),
    (rb"\s*<(!DOCTYPE|html|svg|\?xml)", "a page or document in XML; give the log it tells of"),
    (rb"ULog\x01\x12\x35", "a PX4 ULog of a drone, which has no arm to estimate torques of"),
    (rb"PK\x03\x04", "a zip archive; unpack it and give the log inside"),
    (rb"(7z\xbc\xaf|Rar!|BZh|\xfd7zXZ)", "an archive; unpack it and give the log inside"),
    (rb".{257}ustar", "a tar archive; unpack it and give the log inside"),
    (rb"\xff\xfe|\xfe\xff", "a text in UTF-16; save it as UTF-8 (plain CSV)"),
    (
        rb"(#[^\n]*\n|\s)*(\[\[?[\w.-]+\]\]?\s*\n|[\w-]+\s*=\s*\"|schema\s*=)",
        "a TOML file; a robot file goes to --robot, one of options to --config",
    ),
    (
        rb"(#[^\n]*\n|---\s)*[A-Za-z_]\w*:( [^\n,;\t]*)?\r?\n(\s*-?\s*[A-Za-z_]\w*:|- )",
        "a text in YAML; what rostopic or ros2 topic echo printed is read with their options "
        "-p and --csv, a recorded bag as it is",
    ),
    (
        rb"\s*(%[^\n]*\n\s*)*\\(documentclass|documentstyle|begin|input|section)\b",
        "a LaTeX text; give the log that its numbers are from",
    ),
    (rb"version https://git-lfs", "a pointer of Git LFS; fetch the file itself: git lfs pull"),
    (rb"\xd0\xcf\x11\xe0", "an old Office document; save the sheet as CSV and give that"),
)
#: File inside a zip archive → what the archive is.
OFFICE = {
    b"xl/workbook": "an Excel workbook; save the sheet as CSV and give that",
    b"word/document": "a Word document; give the log it tells of",
    b"META-INF/manifest": "an OpenDocument; save the sheet as CSV and give that",
}


def description(file: LogFile) -> str:
    """What a path is and what to do, behind its name."""
    if file.is_folder:
        return of_folder(file.path, file.entries)
    if kind := known_kind(file):
        return kind
    if file.lines:
        first = file.first_line.decode("utf-8", "replace")[:60].strip()
        return (
            f"a text that is no table of numbers (it begins {printable(first)!r}); save the log as "
            "CSV: a line of names, then one row a sample"
        )
    return (
        f"a binary file of no kind that is known (it begins {file.head[:8].hex(' ')}); export the "
        "log as CSV, Parquet or MCAP, or name its format: --set log.format=NAME (help formats)"
    )


def known_kind(file: LogFile) -> str | None:
    """What a file is that begins as no log does, and what to do; None of any other."""
    # The end of a zip archive names what it holds.
    if file.head.startswith(b"PK\x03\x04"):
        end = bytes(file.content[-HEAD_BYTES:])
        for name, words in OFFICE.items():
            if name in end:
                return words
    return next((words for begins, words in KINDS if re.match(begins, file.head, re.DOTALL)), None)


def of_folder(path: Path, entries: Sequence[str]) -> str:
    """A folder that is no bag and no data set."""
    if not entries:
        return "an empty folder; give a log, or the folder of a bag"
    ours = (".truth.parquet", "estimates.parquet")
    logs = [n for n in entries if n.lower().endswith(LOGS) and not n.lower().endswith(ours)]
    if not logs:
        shown = listed(entries)
        return f"a folder without a log ({shown}); give a log, or the folder of a bag"
    endings = [name[name.rindex(".") :] for name in logs]
    ending = max(endings, key=endings.count)
    count = f"{len(logs)} files that may be logs" if len(logs) > 1 else "a file that may be a log"
    every = f"{shlex.quote(printable(str(path)))}/*{ending}"
    return (
        f"a folder of {count} ({listed(logs)}), no bag and no data set; give them by name, all at "
        f"once where the command takes several (vftcli report {every} -o OUT), or one by one: "
        f"for f in {every}; do vftcli inspect $f; done"
    )


def listed(names: Sequence[str]) -> str:
    """A few names for a message."""
    more = f" and {len(names) - SHOWN} more" if len(names) > SHOWN else ""
    return ", ".join(printable(name[:40]) for name in names[:SHOWN]) + more
