"""A benchmark's manifest: logs with truth, their scoring, and training data.

One entry is one log, and may leave to its arm what the arm's logs share. It may have options
of `vftcli estimate`, in the same words. No log comes with the package and none is downloaded.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, cast

import numpy as np

from vftcli.batch.log_work import content_digest, with_files
from vftcli.doctor.examination import Examiner
from vftcli.notebook import OF_ESTIMATE
from vftcli.observers.table import DEFAULT
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
OURS = ("zero", "vendor", *DEFAULT)  #: Names of the tool's own rows.
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
#: What a truth needs in its entry.
NEEDS = {"weight": ("weight_N",), "contacts": ("contacts",), "simulated": ("scenario",)}
is_name = re.compile(r"[\w.+-]+").fullmatch

Spans = tuple[tuple[float, float], ...]
#: Planted: start [s], length [s], peak force on the flange in base axes [N].
Pushes = tuple[tuple[float, float, Vector], ...]
ALWAYS: Spans = ((0.0, np.inf),)  #: All of a log. [s]


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
    data: str = field(default="", compare=False)  #: Folder of its files.
    file: str = ""  #: Below that folder.
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
    score: Spans = ((SETTLED, np.inf),)  #: Scored spans, from the first sample. [s]
    vouched: Spans = ALWAYS  #: Untouched rows are false here; `score` if given. [s]
    #: True contacts: start, end [s], peak [N] if known; by hand.
    contacts: tuple[tuple[float, float] | tuple[float, float, float], ...] = ()
    contact_N: float = 1.0  #: Force from which the truth is a contact. [N]
    pushes: Pushes = ()
    weight_N: float = 0.0  #: Weight carried over `score`. [N]
    #: Protocols it is scored by, none of what only trains.
    protocols: tuple[str, ...] = ("alone",)
    free: tuple[str, ...] = ()  #: Motion that nobody touched: names of logs, or A:B.
    identified: str = ""  #: Name of the ``[[robot]]`` of protocol 3.
    truth_error: TruthError = field(default_factory=TruthError)
    exact_model: bool = False  #: Torque made from the model: in no headline.
    options: tuple[tuple[str, Any], ...] = ()  #: Options of `vftcli estimate`, as typed.

    def __post_init__(self) -> None:
        check_known(self.truth, TRUTHS, f"log {self.name}: truth {self.truth!r}")
        for protocol in self.protocols:
            check_known(protocol, PROTOCOLS, f"log {self.name}: protocol {protocol!r}")
        wanted = (*NEEDS.get(self.truth, ()), *(p for p in self.protocols if p != "alone"))
        sources = [self.file, self.parts, self.scenario]
        spans = [*self.score, *self.vouched, *(each[:2] for each in self.contacts)]
        lasts = [end - start for start, end in spans] + [length for _, length, _ in self.pushes]
        rules = {
            "a name has letters, digits, . + - and _": is_name(self.name),
            "give one of file, parts, scenario": sum(map(bool, sources)) == 1,
            **{f"{key} is missing": getattr(self, key) for key in wanted},
            "spans, contacts and pushes last longer than 0 s": min(lasts, default=1.0) > 0.0,
            "parts are as t=time.txt, q=positions.txt": all("=" in each for each in self.parts),
        }
        for rule, holds in rules.items():
            if not holds:
                raise ParameterError(f"log {self.name!r}: {rule}")

    @property
    def base(self) -> str:
        """The name of the entry, without pushes."""
        return self.name.removesuffix(PUSHED)

    @property
    def paths(self) -> list[Path]:
        """Its files, there or not; a simulated one has none."""
        names = [part.partition("=")[2] for part in self.parts] or [self.file]
        return [Path(self.data, name) for name in names if name]

    @property
    def truth_path(self) -> Path | None:
        """The file of its truth, None where the entry says it."""
        in_file = self.truth in {"sensor", "torque"}
        return Path(self.data, self.truth_file or self.file) if in_file else None

    @property
    def missing(self) -> list[Path]:
        """The missing files of its entry."""
        robot = Path(dict(self.options).get("robot", ""))
        # A name that is not given is a folder that is there.
        beside = (Path(self.data, self.truth_file), robot if robot.suffix else Path())
        return [path for path in (*self.paths, *beside) if not path.exists()]

    def choice(self, **words: object) -> AnalysisChoice:
        """Choices of its analysis: its options, then these words."""
        own = {"frame": "base", "wrench": True, **dict(self.options), **words}
        made = choice_of(Asked(own, {}, ""), Library(), Examiner())
        return cast("AnalysisChoice", with_files(made, absolute))


@dataclass(frozen=True, kw_only=True)
class TrainedRobot:
    """A robot file from other logs: an entry ``[[robot]]``."""

    name: str
    train: tuple[str, ...]  #: Names of logs.
    interval: str = ""  #: Span of them in use, as A:B; "" for all. [s]
    method: str = ""  #: Of `vftcli identify`, "" for its default.
    robot: str = ""  #: The arm to begin with.


@dataclass(frozen=True, kw_only=True)
class Rival:
    """Outside estimates, as ``rival.toml`` beside them declares."""

    name: str
    folder: str
    protocol: str = "alone"
    training: tuple[str, ...] = ()  #: sha256 of every file that was trained on.
    causal: bool = False  #: Whether it could run online.
    inputs: str = ""  #: Signals that it reads.

    def file(self, log: BenchmarkLog, *endings: str) -> Path | None:
        """A log's file of these endings, else of estimates, or None."""
        names = (f"{log.name}.{end}" for end in endings or ("parquet", "csv"))
        tries = (Path(self.folder, name) for name in names)
        return next(filter(Path.is_file, tries), None)


@dataclass(frozen=True, kw_only=True)
class Manifest:
    """Logs, trained robots, and the folder of the logs."""

    path: Path
    data: Path
    logs: Mapping[str, BenchmarkLog]  #: Name → log.
    robots: Mapping[str, TrainedRobot]  #: Name → robot.

    def __post_init__(self) -> None:
        names = self.logs
        if not names:
            raise ParameterError(f"{self.path}: no [[log]]; docs/benchmark.md shows an entry")
        for robot in self.robots.values():
            for name in robot.train:
                check_known(name, names, f"robot {robot.name}: no log {name!r} to train on")
        for log in names.values():
            if word := log.identified:
                check_known(word, self.robots, f"log {log.name}: no [[robot]] {word!r}")
            for word in log.free:  # a log by name, or A:B
                if ":" not in word:
                    check_known(word, names, f"log {log.name}: no free log {word!r}")

    def leaks(self, log: BenchmarkLog, protocol: str) -> Iterator[str]:
        """Reasons for unfair rows: a line a training log."""
        # The log itself by its spans, others whole.
        words = [(log.base, word) if ":" in word else (word, "0:") for word in log.free]
        key, used = protocol, words if protocol == "free" else []
        if protocol == "identified":
            robot = self.robots[log.identified]
            used = [(name, robot.interval or "0:") for name in robot.train]
            key = f"interval of [[robot]] {robot.name}"
        for name, word in used:
            other, (start, stop) = self.logs[name], interval(word)
            what = f"{log.base}, {protocol}: {name}"
            if name == log.base:
                if any(start < b + APART and stop > a - APART for a, b in log.score):
                    yield (
                        f"{log.base}: {key} ({in_words([(start, stop)])}) must stay {APART:g} s "
                        f"away from score ({in_words(log.score)}); change one of them"
                    )
            elif other.missing:
                continue
            elif log.paths and content_digest(log.paths) == content_digest(other.paths):
                yield f"{what} is the scored file under another name"
            elif protocol == "identified" and other.day and other.day == log.day:
                yield f"{what} is of the same day, {log.day}"

    def complaints(self, rivals: Sequence[Rival]) -> list[tuple[str, str]]:
        """Entry and line of what is unfair or another file."""
        found: dict[tuple[str, str], None] = {}  # an entry with pushes has every line once
        for log in self.logs.values():
            if log.missing:
                continue
            sha = content_digest(log.paths)
            lines = [line for protocol in log.protocols for line in self.leaks(log, protocol)]
            if log.sha256 and sha != log.sha256:
                what = f"{log.paths[0]} has sha256 {sha[:12]}…, not {log.sha256[:12]}…"
                lines.append(f"{log.base}: {what}")
            lines += [
                f"{log.name}: {rival.name} was trained on it (sha256 {sha[:9]}…)"
                for rival in rivals
                if sha in rival.training and rival.file(log)
            ]
            found |= dict.fromkeys((log.base, line) for line in lines)
        return list(found)

    def absent(self) -> list[str]:
        """A line on each absent log: its source."""
        return [
            f"{log.name}: no {lacking[0]}" + (f"; source: {log.source}" if log.source else "")
            for log in self.logs.values()
            if not log.pushes and (lacking := log.missing)
        ]


def load_manifest(name: str, data: Path | None) -> Manifest:
    """A built-in manifest or a user's; logs beside it or in `data`."""
    path = Path(name)
    if name in BUILT_IN:
        path = Path(__file__).with_name(f"{name}.toml")
        data = data or Path()
    elif path.suffix != ".toml":
        check_known(name, (*BUILT_IN, "speed"), f"no FILE.toml and no benchmark {name!r}")
    data = data or path.parent
    tables = toml_file(path, "a manifest")
    for key, rows in tables.items():
        check_known(key, ("log", "arm", "robot"), f"{path}: no table {key!r}")
        if not isinstance(rows, list) or not all(isinstance(row, dict) for row in rows):
            raise ParameterError(f"{path}: {key} is not a list of tables; write [[{key}]]")
    entries = tables.get("log", [])
    arms = dict.fromkeys(str(entry.get("arm")) for entry in entries)
    shared = {str(row.pop("name", "")): row for row in tables.get("arm", [])}
    for arm in shared:
        check_known(arm, arms, f"{path}: no log of arm {arm!r}")
    logs: dict[str, BenchmarkLog] = {}
    for entry in entries:
        for log in logs_of(shared.get(str(entry.get("arm")), {}) | entry, data):
            if log.name in logs:
                raise ParameterError(f"{path}: two logs are called {log.name}")
            logs[log.name] = log
    fits = (section_from(TrainedRobot, row, "robot") for row in tables.get("robot", []))
    return Manifest(path=path, data=data, logs=logs, robots={fit.name: fit for fit in fits})


def logs_of(table: Mapping[str, Any], data: Path) -> Iterator[BenchmarkLog]:
    """The log of an entry; with pushes two: without and with them."""
    # Wrong ones are refused now rather than in a worker.
    words = {key: OPTIONS[key].keyword(value) for key, value in table.items() if key in OPTIONS}
    rest = {key: value for key, value in table.items() if key not in OPTIONS}
    if Path(robot := str(words.get("robot", ""))).suffix:
        words["robot"] = str(data / robot)
    if "score" in table:
        rest.setdefault("vouched", table["score"])
    rest.setdefault("protocols", [p for p in PROTOCOLS if p == "alone" or table.get(p)])
    log = section_from(BenchmarkLog, rest, f"log {table.get('name', '')}".strip())
    if log.pushes and log.truth != "free":
        raise ParameterError(f"log {log.name}: pushes are planted where truth is free")
    log = replace(log, data=str(data), options=tuple(words.items()))
    yield replace(log, pushes=())
    if log.pushes:
        yield replace(log, name=f"{log.name}{PUSHED}", arm=f"{log.arm} (planted)")


def in_words(spans: Sequence[tuple[float, float]]) -> str:
    """Spans as a complaint names them. [s]"""
    each = ", ".join(f"{start:g} s to {stop:g} s" for start, stop in spans)
    return each.replace("inf s", "the end")


def rival_of(text: str, logs: Mapping[str, BenchmarkLog]) -> Rival:
    """The outside estimates of ``NAME=DIR`` for some logs."""
    name, _, place = text.partition("=")
    folder, file = Path(place), Path(place, "rival.toml")
    rules = {
        "it is not NAME=DIR": is_name(name) and place,
        f"{name} is one of our rows; give another name": name not in OURS,
        f"there is no folder {folder}": folder.is_dir(),
    }
    for rule, holds in rules.items():
        if not holds:
            raise ParameterError(f"--outside {text}: {rule}")
    table = toml_file(file, "a declaration") if file.is_file() else {}
    rival = section_from(Rival, {**table, "name": name, "folder": place}, "rival.toml")
    check_known(rival.protocol, PROTOCOLS, f"{file}: protocol {rival.protocol!r}")
    if not any(map(rival.file, logs.values())):
        there = listed(sorted(path.name for path in folder.iterdir())) or "no file"
        raise ParameterError(
            f"--outside {text}: {folder} has {there}; LOG.csv or LOG.parquet is looked for, "
            f"LOG one of {', '.join(logs)}"
        )
    return rival


def read_parts(log: BenchmarkLog) -> dict[str, Array]:
    """Columns t, q1… of an entry's text files, t first."""
    columns: dict[str, Array] = {}
    samples = 0
    for part, path in zip(log.parts, log.paths, strict=True):
        try:
            values = np.loadtxt(path, ndmin=1).ravel()
            rows = values.reshape(samples or len(values), -1)
        except (OSError, UnicodeDecodeError, ValueError):
            raise LogError(
                f"{path}: not numbers, as many for each of {samples or 'its'} samples"
            ) from None
        samples, signal = len(rows), part.partition("=")[0]
        names = ["t"] if signal == "t" else [f"{signal}{j + 1}" for j in range(rows.shape[1])]
        columns |= dict(zip(names, rows.T, strict=True))
    return columns
