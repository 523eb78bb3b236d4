"""A benchmark's manifest: logs with truth, their scoring, and training data.

One entry is one log. It may have options of `vftcli estimate`, in the same words. No log
comes with the package and none is downloaded.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from importlib.resources import files
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple, cast

import numpy as np

from vftcli.batch.log_work import content_digest, digest_of, with_files
from vftcli.doctor.examination import Examiner
from vftcli.evaluation.scores import ListedRow
from vftcli.notebook import OF_ESTIMATE
from vftcli.pipeline import AnalysisChoice, choice_of
from vftcli.readers.reading import Library, absolute
from vftcli.readers.table import listed
from vftcli.signals.arrays import Array
from vftcli.signals.errors import LogError, ParameterError
from vftcli.signals.option import Asked, interval
from vftcli.signals.parsing import check_known, toml_file
from vftcli.simulation.scenario import Vector, section_from

BUILT_IN = ("sim", "field")  #: Manifests that come with the package.
TRUTHS = ("free", "sensor", "torque", "weight", "contacts", "simulated")
PROTOCOLS = ("alone", "free", "identified")
PUSHED = "-pushed"  #: Ending of the name of a log with pushes planted.
APART = 1.0  #: Least time between trained and scored spans of one log. [s]
SETTLED = 1.0  #: Scored from here on by default: causal filters settle. [s]
#: Options of an entry: those of `vftcli estimate`, without its arm and free motion.
OPTIONS = {
    word: option
    for kind in OF_ESTIMATE
    for word, (*_, option) in kind.options().items()
    if not option.is_setting and word not in {"arm", "free"}
}
Spans = tuple[tuple[float, float], ...]
ALWAYS: Spans = ((0.0, 1e9),)  #: All of a log. [s]


@dataclass(frozen=True, kw_only=True)
class TruthError:
    """Error of the truth itself."""

    tau_Nm: float = 0.0
    note: str = ""


@dataclass(frozen=True, kw_only=True)
class BenchmarkLog:
    """One log with truth: an entry ``[[log]]``."""

    name: str  #: Its name, also for outside estimates.
    arm: str  #: Logs of one arm are pooled.
    truth: str  #: One of `TRUTHS`.
    day: str = ""  #: No log of this day may train for it.
    file: str = ""  #: Below the folder of the data.
    parts: tuple[str, ...] = ()  #: Files of numbers that are one log, as ``q=positions.txt``.
    scenario: str = ""  #: Name of a simulated log's scenario.
    seed: int = 1
    changes: tuple[str, ...] = ()  #: Keys of the scenario, as ``duration=12``.
    sha256: str = ""
    source: str = ""  #: Where it is had.
    licence: str = ""
    truth_file: str = ""  #: Where the truth is, "" for the log's own file.
    truth_columns: str = ""  #: Its columns, as of ``--reference-columns``.
    vendor: str = ""  #: Columns of the controller's own estimate, "" for none.
    score: Spans = ((SETTLED, 1e9),)  #: Scored spans, from the first sample. [s]
    vouched: Spans = ALWAYS  #: Untouched rows are false here; `score` if given. [s]
    #: True contacts: start, end [s], peak [N] if known; by hand.
    contacts: tuple[tuple[float, ...], ...] = ()
    contact_N: float = 1.0  #: Force from which the truth is a contact. [N]
    #: Planted: start [s], length [s], peak force on the flange in base axes [N].
    pushes: tuple[tuple[float, float, Vector], ...] = ()
    weight_N: float = 0.0  #: Weight carried over `score`. [N]
    #: Protocols it is scored by, none of what only trains.
    protocols: tuple[str, ...] = ("alone",)
    free: tuple[str, ...] = ()  #: Motion that nobody touched: names of logs, or A:B.
    identified: str = ""  #: Name of the ``[[robot]]`` of protocol 3.
    truth_error: TruthError = field(default_factory=TruthError)
    exact_model: bool = False  #: Simulated, or torque made from the model: in no headline.
    options: tuple[tuple[str, Any], ...] = ()  #: Options of `vftcli estimate`, as typed.

    def __post_init__(self) -> None:
        check_known(self.truth, TRUTHS, f"log {self.name}: truth {self.truth!r}")
        for protocol in self.protocols:
            check_known(protocol, PROTOCOLS, f"log {self.name}: protocol {protocol!r}")
        needs = {"weight": ["weight_N"], "contacts": ["contacts"], "simulated": ["scenario"]}
        wanted = [*needs.get(self.truth, ()), *(p for p in self.protocols if p != "alone")]
        rules = {
            "a name has letters, digits, . + - and _": re.fullmatch(r"[\w.+-]+", self.name),
            "give one of file, parts, scenario": (
                bool(self.file) + bool(self.parts) + bool(self.scenario) == 1
            ),
            **{f"{key} is missing": getattr(self, key) for key in wanted},
            "spans end after their start": all(a < b for a, b in (*self.score, *self.vouched)),
            "a contact is [start, end] or [start, end, peak]": all(
                len(each) in {2, 3} and each[0] < each[1] for each in self.contacts
            ),
            "a push lasts longer than 0 s": all(length > 0.0 for _, length, _ in self.pushes),
            "parts are as t=time.txt, q=positions.txt": all("=" in each for each in self.parts),
        }
        if broken := [rule for rule, holds in rules.items() if not holds]:
            raise ParameterError(f"log {self.name!r}: {broken[0]}")


@dataclass(frozen=True, kw_only=True)
class TrainedRobot:
    """A robot file of `vftcli identify` from other logs: an entry ``[[robot]]``."""

    name: str
    train: tuple[str, ...]  #: Names of logs.
    interval: str = ""  #: Span of them in use, as A:B; "" for all. [s]
    method: str = ""  #: Of `vftcli identify`, "" for its default.
    robot: str = ""  #: The arm to begin with.


@dataclass(frozen=True, kw_only=True)
class Declaration:
    """Declaration of outside estimates by their maker: ``rival.toml``."""

    protocol: str = "alone"
    training: tuple[str, ...] = ()  #: sha256 of every file that was trained on.
    causal: bool = False  #: Whether it could run online.
    inputs: str = ""  #: Signals that it reads.


class Rival(NamedTuple):
    """Outside estimates: a row of their own."""

    name: str
    folder: Path
    declared: Declaration

    def file(self, log: BenchmarkLog, *endings: str) -> Path | None:
        """A log's file with one of these endings, or None; its estimates."""
        tries = (self.folder / f"{log.name}.{end}" for end in endings or ("parquet", "csv"))
        return next(filter(Path.is_file, tries), None)


@dataclass(frozen=True, kw_only=True)
class Manifest:
    """Logs, trained robots, and the folder of the logs."""

    path: Path
    data: Path
    logs: tuple[BenchmarkLog, ...]
    robots: tuple[TrainedRobot, ...]

    @cached_property
    def by_name(self) -> dict[str, BenchmarkLog]:
        """Name → log."""
        return {log.name: log for log in self.logs}

    def paths(self, log: BenchmarkLog) -> list[Path]:
        """The files of a log, there or not; a simulated one has none."""
        names = [part.partition("=")[2] for part in log.parts] if log.parts else [log.file]
        return [self.data / name for name in names if name]

    def robot(self, log: BenchmarkLog) -> str | None:
        """A log's arm: a profile, a file below `data`, or None."""
        name: str | None = dict(log.options).get("robot")
        return str(self.data / name) if name and Path(name).suffix else name

    def missing(self, log: BenchmarkLog) -> list[Path]:
        """The missing files of its entry."""
        robot = self.robot(log) or ""
        also = [log.truth_file] * bool(log.truth_file) + [robot] * ("." in robot)
        paths = (*self.paths(log), *(self.data / name for name in also))
        return [path for path in paths if not path.exists()]

    def choice(
        self,
        log: BenchmarkLog,
        protocol: str,
        file: Path,
        robot: Path | None = None,
        logs: Mapping[str, Path] = MappingProxyType({}),
    ) -> AnalysisChoice:
        """Choices of a protocol for a log in `file`; `robot` is of protocol 3.

        `logs` is name → file of each log, for free motion.
        """
        words = {w: OPTIONS[w].keyword(v) for w, v in log.options if w != "robot"}
        if file not in self.paths(log):
            words.pop("columns", None)  # those of a file that this one is made of
        if protocol == "free":
            words["free"] = [str(logs.get(word, word)) for word in log.free]
        arm = str(robot) if robot is not None else self.robot(log)
        asked = Asked({"frame": "base", "wrench": True, **words, "robot": arm}, {}, "")
        made = choice_of(asked, Library(), Examiner())
        return cast("AnalysisChoice", with_files(made, absolute))

    def leaks(self, log: BenchmarkLog, protocol: str) -> Iterator[str]:
        """Reasons for unfair rows of a protocol: a line per training log."""
        name, own = log.name.removesuffix(PUSHED), list(map(digest_of, self.paths(log)))
        training: list[tuple[BenchmarkLog, Spans]] = []
        if protocol == "free":
            by_name = self.by_name
            each = ((w, ALWAYS if w in by_name else (interval(w),)) for w in log.free)
            training = [(by_name.get(word, log), spans) for word, spans in each]
        if protocol == "identified":
            robot = next(r for r in self.robots if r.name == log.identified)
            whole = (interval(robot.interval),) if robot.interval else ALWAYS
            training = [(self.by_name[other], whole) for other in robot.train]
        for other, spans in training:
            what = f"{name}, {protocol}: {other.name}"
            if other.name.removesuffix(PUSHED) == name:
                near = (a < d + APART and b > c - APART for a, b in spans for c, d in log.score)
                if any(near):
                    fit = f"interval of [[robot]] {log.identified}"
                    key = "free" if protocol == "free" else fit
                    yield (
                        f"{name}: {key} ({in_words(spans)}) must stay {APART:g} s away from score "
                        f"({in_words(log.score)}); change one of them"
                    )
            elif self.missing(other):
                continue
            elif own and own == list(map(digest_of, self.paths(other))):
                yield f"{what} is the scored file under another name"
            elif protocol == "identified" and other.day and other.day == log.day:
                yield f"{what} is of the same day, {log.day}"

    def complaints(self, rivals: Sequence[Rival]) -> dict[str, list[str]]:
        """Name of a log → lines on unfair rows or another file."""
        found: dict[str, list[str]] = {}
        for log in self.logs:
            if self.missing(log):
                continue
            paths = self.paths(log)
            sha = content_digest(paths) if paths else ""
            lines = [line for protocol in log.protocols for line in self.leaks(log, protocol)]
            if log.sha256 and sha != log.sha256 and not log.pushes:
                lines.append(
                    f"{log.name}: {paths[0]} has sha256 {sha[:12]}…, not {log.sha256[:12]}…"
                )
            lines += [
                f"{log.name}: {rival.name} was trained on it (sha256 {sha[:9]}…)"
                for rival in rivals
                if sha in rival.declared.training and rival.file(log)
            ]
            if lines:
                own = found.setdefault(log.name.removesuffix(PUSHED), [])
                own += [line for line in lines if line not in own]
        return found

    def absent(self) -> list[str]:
        """A line on each absent log: its source."""
        return [
            f"{log.name}: no {lacking[0]}" + (f"; source: {log.source}" if log.source else "")
            for log in self.logs
            if not log.pushes and (lacking := self.missing(log))
        ]


def load_manifest(name: str, data: Path | None) -> Manifest:
    """A built-in manifest or a user's; logs are beside it or in `data`."""
    path = Path(name)
    if name in BUILT_IN:
        path = Path(str(files("vftcli.reproduction") / f"{name}.toml"))
    elif path.suffix != ".toml":
        check_known(name, (*BUILT_IN, "speed"), f"no FILE.toml and no benchmark {name!r}")
    tables = toml_file(path, "a manifest")
    for key in tables:
        check_known(key, ("log", "robot"), f"{path}: no table {key!r}")
    logs = tuple(each for table in tables.get("log", ()) for each in logs_of(table))
    robots = [section_from(TrainedRobot, table, "robot") for table in tables.get("robot", ())]
    default = Path() if name in BUILT_IN else path.parent
    found = Manifest(path=path, data=data or default, logs=logs, robots=tuple(robots))
    check_names(found)
    return found


def check_names(manifest: Manifest) -> None:
    """Raise unless log names are unique and all names in use are known."""
    names = [log.name for log in manifest.logs]
    if twice := sorted({name for name in names if names.count(name) > 1}):
        raise ParameterError(f"{manifest.path}: two logs are called {twice[0]}")
    if not names:
        raise ParameterError(f"{manifest.path}: no [[log]]; docs/benchmark.md shows an entry")
    for robot in manifest.robots:
        for name in robot.train:
            check_known(name, names, f"robot {robot.name}: no log {name!r} to train on")
    for log in manifest.logs:
        if log.identified:
            there = [robot.name for robot in manifest.robots]
            check_known(log.identified, there, f"log {log.name}: no [[robot]] {log.identified!r}")
        for word in log.free:
            if ":" not in word:
                check_known(word, names, f"log {log.name}: no free log {word!r}")


def logs_of(table: Mapping[str, Any]) -> Iterator[BenchmarkLog]:
    """The log of an entry; with pushes two: without and with them."""
    words = {key: value for key, value in table.items() if key in OPTIONS}
    rest = {key: value for key, value in table.items() if key not in OPTIONS}
    for word, value in words.items():
        OPTIONS[word].keyword(value)  # refused now rather than in a worker
    if "score" in table:
        rest.setdefault("vouched", table["score"])
    rest.setdefault("protocols", [p for p in PROTOCOLS if p == "alone" or table.get(p)])
    log = section_from(BenchmarkLog, rest, f"log {table.get('name', '')}".strip())
    log = replace(log, options=tuple(words.items()))
    if not log.pushes:
        yield log
        return
    if log.truth != "free":
        raise ParameterError(f"log {log.name}: pushes are planted where truth is free")
    yield replace(log, pushes=())
    yield replace(log, name=f"{log.name}{PUSHED}", arm=f"{log.arm} (planted)")


def in_words(spans: Spans) -> str:
    """Spans as a complaint names them. [s]"""
    ends = (
        (start, "the end" if stop >= ALWAYS[0][1] else f"{stop:g} s") for start, stop in spans
    )
    return ", ".join(f"{start:g} s to {end}" for start, end in ends)


def rival_of(text: str, ours: Sequence[str], logs: Sequence[BenchmarkLog]) -> Rival:
    """The outside estimates of ``NAME=DIR`` for some logs."""
    name, _, place = text.partition("=")
    if not re.fullmatch(r"[\w.+-]+", name) or not place:
        raise ParameterError(f"--outside {text!r} is not NAME=DIR")
    if name in ours:
        raise ParameterError(f"--outside {text}: {name} is one of our rows; give another name")
    folder = Path(place)
    if not folder.is_dir():
        raise ParameterError(f"--outside {text}: there is no folder {folder}")
    file = folder / "rival.toml"
    table = toml_file(file, "a declaration") if file.is_file() else {}
    declared = section_from(Declaration, table, "rival.toml")
    check_known(declared.protocol, PROTOCOLS, f"{file}: protocol {declared.protocol!r}")
    rival = Rival(name, folder, declared)
    if not any(map(rival.file, logs)):
        there = sorted(path.name for path in folder.iterdir())
        raise ParameterError(
            f"--outside {text}: {folder} has {listed(there) or 'no file'}; LOG.csv or LOG.parquet "
            f"is looked for, LOG one of {', '.join(log.name for log in logs)}"
        )
    return rival


def read_list(path: Path) -> list[ListedRow]:
    """A list of contacts from CSV."""
    import polars as pl

    try:
        rows = pl.read_csv(path, infer_schema_length=None).to_dicts()
        return [
            ListedRow(
                start=float(row["start_s"]),
                stop=float(row["stop_s"]),
                peak=float(row.get("peak_force_N") or 0.0),
                band=float(row.get("peak_force_band_N") or 0.0),
                is_load=row.get("kind") == "load",
            )
            for row in rows
        ]
    except (OSError, KeyError, TypeError, ValueError, pl.exceptions.PolarsError):
        raise LogError(f"{path}: a list has columns start_s, stop_s, peak_force_N") from None


def read_parts(files: Mapping[str, Path]) -> dict[str, Array]:
    """Columns t, q1… of text files, one a signal, t first."""
    columns: dict[str, Array] = {}
    samples = 0
    for signal, path in files.items():
        try:
            values = np.loadtxt(path, ndmin=1).ravel()
            rows = values.reshape(samples or len(values), -1)
        except (OSError, UnicodeDecodeError, ValueError):
            raise LogError(
                f"{path}: not numbers, as many for each of {samples or 'its'} samples"
            ) from None
        samples = len(rows)
        names = ["t"] if signal == "t" else [f"{signal}{j + 1}" for j in range(rows.shape[1])]
        columns |= dict(zip(names, rows.T, strict=True))
    return columns
