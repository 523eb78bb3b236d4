"""Metamorphic relations: what must not change when a log is given in another but equal way.

No answer is known here; two ways of asking are, that must agree, or must be refused. Every relation
is tried on every command that takes it, on short simulated logs of one motion (8 s of the circle at
125 Hz): one with contacts (seed 4) and two free runs (seeds 1 and 2) on the same clock.
"""

import json
import shutil
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import polars as pl
import pytest
from example_logs import FIXTURES
from made_runs import command as run

from vftcli.signals.errors import VftError

SAME = 1e-6
"""Equal to six digits: relations move inputs by rounding at most (a clock of 1e6 s keeps 1e-10 s
of a sample, an angle of 2π more 1e-15 of it)."""

Numbers = dict[str, float]

KEYS = ("recording", "log", "observer", "other", "joint", "axis", "parameter", "role", "signal",
        "controller", "alpha", "drag", "name", "code")  # fmt: skip
"""What names a row of a table, so that its place in the list does not."""

UNLIKE = {"seconds", "time", "command", "versions", "sha256", "path", "t0_s", "rows", "bytes"}
"""What a command says of the run itself, or of the file that it read."""


class Logs(NamedTuple):
    """The logs, and what has been asked of them already.

    Attributes:
        load: With contacts from 4.2 s on.
        free: The same motion, untouched.
        other: The same motion, untouched, another noise.
        asked: Command → its numbers.
        folder: Where copies go.
    """

    load: Path
    free: Path
    other: Path
    asked: dict[tuple[str, ...], Numbers]
    folder: Path


@pytest.fixture(scope="session")
def logs_of_one_motion(tmp_path_factory: pytest.TempPathFactory) -> Logs:
    folder = tmp_path_factory.mktemp("motion")
    made = []
    # Pushes that would begin at 99 s never do: a free run.
    for name, seed, begin in (("load", 4, 4.2), ("free", 1, 99.0), ("other", 2, 99.0)):
        path = folder / f"{name}.parquet"
        words = ["simulate", "ur5-circle", "--seed", seed, "--as", "parquet", "-o", path]
        run(*words, "--set", "duration=8", "--set", f"contacts.hand.begin={begin}")
        made.append(path)
    return Logs(*made, asked={}, folder=folder)


def flat(value: Any, path: str = "") -> Iterator[tuple[str, float]]:
    """Every number of nested lists and tables by its path; rows of tables by what names them."""
    if isinstance(value, Mapping):
        for key, item in value.items():
            if key not in UNLIKE and key not in KEYS:
                yield from flat(item, f"{path}/{key}")
    elif isinstance(value, list):
        seen: dict[str, int] = {}
        for k, item in enumerate(value):
            name = str(k)
            if isinstance(item, Mapping):
                name = ",".join(str(item[key]) for key in KEYS if item.get(key) is not None)
                seen[name] = seen.get(name, -1) + 1
                name += f"#{seen[name]}" if seen[name] else ""
            yield from flat(item, f"{path}[{name}]")
    elif value is None:
        yield path, float("nan")
    elif isinstance(value, int | float):
        yield path, float(value)


def table(path: Path) -> Numbers:
    """Mean and mean square of every column: enough to tell two tables of samples apart."""
    found = {}
    for column in pl.read_parquet(path).iter_columns():
        values = column.to_numpy().astype(float)
        values = values[np.isfinite(values)]
        found[f"{column.name} samples"] = float(len(values))
        found[f"{column.name} mean"] = float(values.mean()) if len(values) else np.nan
        rms = np.sqrt(np.mean(values**2)) if len(values) else np.nan
        found[f"{column.name} rms"] = float(rms)
    return found


def estimate(folder: Path, log: Path, *words: object) -> Numbers:
    run("estimate", log, "--robot", "ur5", "-o", folder / "out", *words)
    return table(folder / "out/estimates.parquet")


def compare(_: Path, *words: object) -> Numbers:
    reference = () if "--reference" in words else ("--reference", "vendor")
    out = run("compare", *words, "--robot", "ur5", *reference, "--json")
    return dict(flat(json.loads(out)["rows"]))


def report(folder: Path, *words: object) -> Numbers:
    reference = () if "--reference" in words else ("--reference", "vendor")
    run("report", *words, "--robot", "ur5", *reference, "-o", folder / "out")
    found = {}
    for path in sorted((folder / "out").rglob("errors.json")):
        found |= dict(flat(json.loads(path.read_text()), str(path.parent.relative_to(folder))))
    for path in sorted((folder / "out").rglob("estimates.parquet")):
        name = path.parent.relative_to(folder)
        found |= {f"{name}/{key}": value for key, value in table(path).items()}
    return found


def inspect(_: Path, log: Path, *words: object) -> Numbers:
    return dict(flat(json.loads(run("inspect", log, *words, "--json"))))


def identify(folder: Path, *words: object) -> Numbers:
    out = run("identify", *words, "--robot", "ur5", "-o", folder / "robot.toml", "--json")
    found = json.loads(out)
    return dict(flat({key: found[key] for key in ("parameters", "residuals")}))


def gains(folder: Path, log: Path, *words: object) -> Numbers:
    method = ("--method", "gains", "-o", folder / "gains.toml")
    found = json.loads(run("identify", log, "--robot", "ur5", *method, "--json", *words))
    del found["remarks"]  # of runs and observers in the order in which they were named
    return dict(flat(found))


def convert(folder: Path, log: Path, *words: object) -> Numbers:
    run("convert", log, "-o", folder / "log.parquet", *words)
    return table(folder / "log.parquet")


def admit(_: Path, log: Path, *words: object) -> Numbers:
    return dict(flat(json.loads(run("admit", log, "--robot", "ur5", "--json", *words))["rows"]))


COMMANDS: dict[str, Callable[..., Numbers]] = {
    f.__name__: f for f in (inspect, estimate, compare, report, identify, gains, convert, admit)
}

Ask = Callable[..., Numbers]
"""Takes the words of a command and gives its numbers."""


def equal(one: Numbers, other: Numbers, but: tuple[str, ...] = ()) -> None:
    """Both have the same numbers, to `SAME` of the larger of a number and 1."""
    keys, others = ({k for k in x if not any(part in k for part in but)} for x in (one, other))
    assert keys, "no numbers at all"
    assert keys == others
    for key in keys:
        value = one[key]
        gap = abs(value - other[key])
        same = gap <= SAME * max(abs(value), 1.0) or (np.isnan(value) and np.isnan(other[key]))
        assert same, f"{key}: {value} or {other[key]}"


def of(log: Path, numbers: Numbers, other: Path) -> Numbers:
    return {key.replace(other.name, log.name): value for key, value in numbers.items()}


def changed(log: Path, change: Callable[[pl.DataFrame], pl.DataFrame], folder: str) -> Path:
    path = log.parent / folder / log.name
    if not path.exists():
        path.parent.mkdir(exist_ok=True)
        change(pl.read_parquet(log)).write_parquet(path)
    return path


def copied(log: Path, *parts: str) -> Path:
    path = log.parent.joinpath(*parts)
    path.parent.mkdir(exist_ok=True)
    shutil.copy(log, path)
    return path


def refused(ask: Ask, *words: object) -> None:
    """The command ends with an error that says that two of its logs are one."""
    with pytest.raises(VftError, match="equal sha256"):
        ask(*words)


# What each relation does; `ask` gives a command's numbers.


def renamed(ask: Ask, logs: Logs) -> None:
    """A file's name is no datum."""
    other = copied(logs.load, "elsewhere", "z.parquet")
    equal(ask(logs.load), of(logs.load, ask(other), other))


def of_one_name(ask: Ask, logs: Logs) -> None:
    """Two logs of one file name in two folders are two logs."""
    one, two = copied(logs.free, "a", "log.parquet"), copied(logs.other, "b", "log.parquet")
    named, alike = ask(logs.free, logs.other), ask(one, two)
    # Labels differ, so rows differ by place: the order of the logs is the same.
    assert len(alike) == len(named)
    assert list(alike.values()) == pytest.approx(list(named.values()), nan_ok=True, rel=SAME)


def copy_is_no_second_log(ask: Ask, logs: Logs) -> None:
    for second in (logs.load, copied(logs.load, "copy.parquet")):
        refused(ask, logs.load, second)


def copy_is_no_free_run(ask: Ask, logs: Logs, more: tuple[str, ...] = ()) -> None:
    refused(ask, logs.load, "--free", copied(logs.load, "copy.parquet"), *more)


def logs_permuted(ask: Ask, logs: Logs) -> None:
    one, two = ask(logs.free, logs.other), ask(logs.other, logs.free)
    # Not identify's standard deviations: the memory of its errors is found over the logs' seam too,
    # and differs by a per cent or two with what stands there.
    equal(one, two, but=("/sd", "/determined", "log_index"))


TUNED = ("--observer", "gmo", "--observer", "rts-auto")


def free_runs_permuted(ask: Ask, logs: Logs, more: tuple[str, ...] = ()) -> None:
    one = ask(logs.load, "--free", logs.free, "--free", logs.other, *more)
    equal(one, ask(logs.load, "--free", logs.other, "--free", logs.free, *more))


def observers_permuted(ask: Ask, logs: Logs, more: tuple[str, ...] = ()) -> None:
    one = ask(logs.load, "--observer", "gmo", "--observer", "kfo-fe", *more)
    equal(one, ask(logs.load, "--observer", "kfo-fe", "--observer", "gmo", *more))


SENSOR = ("--reference", "sensor", "--wrench", "--zero", "start", "--set",
          "virtual-sensor.sensor=0,0,0.03", "--interval", "0:9")  # fmt: skip


def observers_permuted_before_a_sensor(ask: Ask, logs: Logs) -> None:
    sensed = logs._replace(load=FIXTURES / "ur5_sensor.parquet")
    observers_permuted(ask, sensed, SENSOR)


def free_run_repeated(ask: Ask, logs: Logs, more: tuple[str, ...] = ()) -> None:
    refused(ask, logs.load, "--free", logs.free, "--free", logs.free, *more)


def clock_shifted(ask: Ask, logs: Logs) -> None:
    late = changed(logs.load, lambda log: log.with_columns(pl.col("t") + 1e6), "late")
    # convert keeps the log's own stamps beside t, for who wants them. The windows of inspect's fit
    # are 37.5 samples here: the last digit of the sample time decides which way that is rounded,
    # and with it what every arm misses and the load that its fit takes instead.
    fitted = tuple(f"robots[#{k}]/load" for k in range(1, 20))  # of the arms that it is not
    equal(ask(logs.load), ask(late), but=("t_src_ns", "misfit", *fitted))


def joint_wrapped(ask: Ask, logs: Logs) -> None:
    """J4 turned once more: positions move by 2π, nothing else does; it stays within its limits."""
    turn = pl.col("q/4", "target_q/4") + 2.0 * np.pi
    turned = changed(logs.load, lambda log: log.with_columns(turn), "turned")
    equal(ask(logs.load), ask(turned), but=("q/4",))


def whole_interval(ask: Ask, logs: Logs) -> None:
    equal(ask(logs.load), ask(logs.load, "--interval", "0:1000"))


def observer_added(ask: Ask, logs: Logs) -> None:
    """What one observer says does not depend on who else is asked."""
    alone = ask(logs.load, "--observer", "gmo", "--free", logs.free)
    more = ("--observer", "gmo", "--observer", "rts-auto", "--free", logs.free)
    both = ask(logs.load, *more)
    equal(alone, {key: both[key] for key in alone if key in both})


def observer_added_before_a_sensor(ask: Ask, _: Logs) -> None:
    """Nor does the unloaded start, which the log itself tells."""
    log = FIXTURES / "ur5_sensor.parquet"
    alone = ask(log, "--observer", "gmo", *SENSOR)
    both = ask(log, "--observer", "fdo", "--observer", "gmo", *SENSOR)
    equal(alone, {key: both[key] for key in alone if key in both})


def split(ask: Ask, logs: Logs) -> None:
    """The same data in another format, and the samples of two parts are those of the whole."""
    text = logs.load.with_name("as-text.csv")
    if not text.exists():
        run("convert", logs.load, "-o", text)
    equal(ask(logs.load), of(logs.load, ask(text), text))


def in_two_parts(ask: Ask, logs: Logs) -> None:
    whole = ask(logs.load)
    # A boundary between two samples of 8 ms: none is in both.
    parts = [ask(logs.load, "--interval", part) for part in ("0:3.9961", "3.9961:8")]
    for key in (key for key in whole if key.endswith("samples")):
        assert parts[0][key] + parts[1][key] == whole[key]
        square = key.replace("samples", "rms")
        total = sum(part[square] ** 2 * part[key] for part in parts)
        assert np.sqrt(total / whole[key]) == pytest.approx(whole[square], rel=SAME)


NEAR = 0.05
"""Share by which three rows of a thousand less may move an error: its own sampling, < 1 % here."""


def same_clock(ask: Ask, logs: Logs, more: tuple[str, ...] = ()) -> None:
    """Two free runs on one clock are two runs: three rows less of one make no difference."""
    short = changed(logs.other, lambda log: log[:-3], "short")
    equally = ask(logs.load, "--free", logs.free, "--free", logs.other, *more)
    unequally = ask(logs.load, "--free", logs.free, "--free", short, *more)
    sizes = (k for k in equally if k.endswith(("rms", "rmse_Nm")) and np.isfinite(equally[k]))
    for key in sizes:
        scale = max(abs(equally[key]), 0.05)  # N·m: a share of nothing means nothing
        assert abs(equally[key] - unequally[key]) <= NEAR * scale, key


TWO_CYCLE = ("--reference", "two-cycle")
SINGLE, COMPARED = tuple(COMMANDS), ("compare", "report")
MANY, OBSERVED = (*COMPARED, "identify"), ("estimate", *COMPARED)

RELATIONS: dict[str, tuple[Callable[..., None], tuple[str, ...]]] = {
    "rename": (renamed, SINGLE),
    "rename: two logs of one name": (of_one_name, MANY),
    "repeat or copy a log": (copy_is_no_second_log, MANY),
    "copy: as a free run": (copy_is_no_free_run, ("estimate", "gains")),
    "copy: as a free run of the reference": (
        partial(copy_is_no_free_run, more=TWO_CYCLE), COMPARED),
    "permute logs": (logs_permuted, ("compare", "identify")),
    "permute free runs": (partial(free_runs_permuted, more=TUNED), OBSERVED),
    "permute free runs of the reference": (partial(free_runs_permuted, more=TWO_CYCLE), COMPARED),
    "permute free runs of the gains": (free_runs_permuted, ("gains",)),
    "permute observers": (observers_permuted, OBSERVED),
    "permute observers of wrenches": (
        partial(observers_permuted, more=("--wrench", "--zero", "0.5:3.5")), OBSERVED),
    "permute observers before a sensor": (observers_permuted_before_a_sensor, ("compare",)),
    "repeat a free run": (free_run_repeated, ("estimate", "gains")),
    "repeat a free run of the reference": (partial(free_run_repeated, more=TWO_CYCLE), COMPARED),
    "shift the clock": (clock_shifted, SINGLE),
    "wrap a joint": (joint_wrapped, SINGLE),
    "whole interval": (whole_interval, SINGLE[1:]),
    "add an observer": (observer_added, OBSERVED),
    "add an observer before a sensor": (observer_added_before_a_sensor, ("compare",)),
    "split reading: another format": (split, SINGLE),
    "split reading: two parts": (in_two_parts, ("convert",)),
    "same clock": (partial(same_clock, more=TUNED), OBSERVED),
    "same clock of the gains": (same_clock, ("gains",)),
}  # fmt: skip
"""Relation → what it tries, and the commands that take it."""
CASES = [(relation, command) for relation, (_, some) in RELATIONS.items() for command in some]


@pytest.mark.slow
@pytest.mark.parametrize(("relation", "command"), CASES)
def test_relation(relation: str, command: str, logs_of_one_motion: Logs, tmp_path: Path) -> None:
    logs = logs_of_one_motion
    count = 0

    def ask(*words: object) -> Numbers:
        nonlocal count
        key = (command, *map(str, words))
        if key not in logs.asked:
            folder = tmp_path / str(count)
            folder.mkdir()
            count += 1
            logs.asked[key] = COMMANDS[command](folder, *words)
        return logs.asked[key]

    RELATIONS[relation][0](ask, logs)
