"""Every remedy that is printed, tried on the log that printed it: with it the remark is gone.

A row plants what a remark or an error speaks of, runs a command, reads the option out of what it
prints, and runs the command with it. A remark that names an option and has no row needs a reason.
"""

import contextlib
import json
import os
import re
import string
import tomllib
from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import polars as pl
import pytest
from example_logs import FIXTURES
from fault_commands import run
from moving_arms import moving
from planted_faults import (
    FAULTS,
    Table,
    dropped_span,
    gravity_torque,
    payload,
    stuck,
    velocities_in_degrees,
    with_more_torque,
)
from planted_spans import picked_up
from seed_containers import aloha

from vftcli.readers.reading import read
from vftcli.robots import PROFILES
from vftcli.signals.recording import Recording
from vftcli.signals.remarks import WORDS
from vftcli.signals.remarks import words as words_of

LOGS = {"ur5": "ur5_circle.csv", "panda": "panda_bearing.csv"}
"""Arm → the log of it that faults are planted in; nobody touches the UR5 before 4 s."""

Command = Callable[[Path], list[Any]]
PUSHED = ("estimate", "-o", "out", "--observer", "gmo", "--json")
NO_LIST = ("--set", "contacts.list=no")
WHOLE_LOG = ("--set", "bias.method=whole-log")
TOOL = ("--set", "virtual-sensor.tool=0,0,0.1")


@cache
def sound(robot: str = "ur5") -> Table:
    log = read(FIXTURES / LOGS[robot])
    signal, effort = ("current", log.current) if robot == "ur5" else ("tau", log.torque)
    return Table(t=log.t, q=log.q, dq=log.require("dq"), effort=effort, signal=signal,
                 tau_ext=log.tau_ext, robot=robot, given=robot)  # fmt: skip


def measured(log: Recording) -> Table:
    effort = log.require("current")
    return replace(sound(), t=log.t, q=log.q, dq=log.require("dq"), effort=effort)


def of(plant: Callable[[Table], Table], *words: str, robot: str = "ur5") -> Command:
    """A command on a planted log; `words` begin with its name, `inspect` without any."""

    def command(folder: Path) -> list[Any]:
        table, (name, *more) = plant(sound(robot)), words or ("inspect",)
        return [name, table.write(folder / "log.csv"), "--robot", table.given, *more]

    return command


def cut(start: float, stop: float, *words: str, robot: str = "ur5") -> Command:
    return of(lambda table: table.between(start, stop), *words, robot=robot)


def planted(name: str, *words: str, robot: str = "ur5") -> Command:
    return of(FAULTS[name].plant, *words, robot=robot)


def unnamed(plant: Callable[[Table], Table], robot: str = "ur5") -> Command:
    return lambda folder: of(plant, robot=robot)(folder)[:2]


def renamed_columns(table: Table, old: str, new: str, folder: Path) -> list[Any]:
    """An examination of a table whose columns `old1` … are called `new1` …."""
    names = {c: c.replace(old, new) for c in table.frame().columns}
    table.frame().rename(names).write_csv(folder / "log.csv", float_precision=9)
    return ["inspect", folder / "log.csv", "--robot", table.given]


def touched(table: Table) -> Table:
    """Four seconds with a push of a second, 200 N·m on the shoulder."""
    table = table.between(0.0, 4.0)
    push = 200.0 * np.sin(np.pi * np.clip(table.t - table.t[0] - 1.5, 0.0, 1.0))
    return with_more_torque(table, push[:, None] * np.eye(6)[1])


def with_wrench(folder: Path, *words: str) -> list[Any]:
    """A comparison with the wrench of a log whose header does not say its frame."""
    frame = sound().between(0.0, 4.0).frame()
    wrench = [pl.col("q2").alias(name) for name in ("fx", "fy", "fz", "mx", "my", "mz")]
    frame.with_columns(wrench).write_csv(folder / "log.csv", float_precision=9)
    return ["compare", folder / "log.csv", "--robot", "ur5", "--observer", "gmo",
            "--reference", "sensor", "--details", *words]  # fmt: skip


def robot_file(folder: Path, gravity: str = "[0.0, 0.0, -9.81]", more: str = "") -> str:
    """A copy of the UR5's profile with another gravity and more sections."""
    profile = PROFILES["ur5"].read_text("utf-8")
    text = re.sub(r"gravity = \[.*?\]", f"gravity = {gravity}", profile)
    (folder / "my.toml").write_text(text + more, encoding="utf-8")
    return str(folder / "my.toml")


def free_log(folder: Path) -> str:
    return str(sound().between(0.0, 3.9).write(folder / "free.csv"))


def arm_of_five(folder: Path) -> str:
    text, path = (FIXTURES / "arm.urdf").read_text(), folder / "five.urdf"
    path.write_text(text.replace('"hand" type="revolute"', '"hand" type="fixed"'))
    return str(path)


def shared(name: str) -> Path:
    """A real log or a sample beside the folder that VFT_LOGS names."""
    if not (logs := os.environ.get("VFT_LOGS")):
        pytest.skip("VFT_LOGS is not set: real logs and samples are not part of the repository")
    return Path(logs).parent / name


def rubbing(table: Table) -> Table:
    """Currents of friction alone, which no arm explains; J2's has its sign turned."""
    return replace(table, effort=5.0 * np.array([1, -1, 1, 1, 1, 1]) * np.tanh(table.dq / 0.01))


def turned_and_unknown(table: Table) -> Table:
    """Currents of friction and of another arm's gravity, their sign turned on every joint."""
    gravity = gravity_torque(table, table.arm)[:, ::-1] / table.constant
    return replace(table, effort=-5.0 * np.tanh(table.dq / 0.01) - gravity)


def rtde(folder: Path, left_out: str = "") -> Path:
    """A log of a controller, with its payload and a force in base axes."""
    table = pl.read_csv(FIXTURES / "ur5_taps_ur_rtde.csv")
    force = [pl.col("actual_q_1").alias(f"actual_TCP_force_{k}") for k in range(6)]
    said = {"payload": 1.5, "payload_cog_0": 0.0, "payload_cog_1": 0.0, "payload_cog_2": 0.05}
    payload_said = [pl.lit(value).alias(name) for name, value in said.items()]
    # Off the CB3's 8 ms: an e-Series, whose fields do not say which sensor it is.
    stamps = pl.col("timestamp") * 1.0001
    table = table.with_columns(stamps, *payload_said, *force)
    kept = [c for c in table.columns if not left_out or left_out not in c]
    table.select(kept).write_csv(folder / "log.csv", separator=" ", float_precision=6)
    return folder / "log.csv"


def controlled(folder: Path, left_out: str = "") -> list[Any]:
    return ["compare", rtde(folder, left_out), "--robot", "ur5", "--observer", "gmo",
            "--reference", "sensor", "--details", "--anyway"]  # fmt: skip


def checked_thresholds(folder: Path) -> list[Any]:
    """Thresholds of half a minute that nobody touches, checked on a log of six seconds."""
    table = measured(moving("ur5", seconds=30.0))
    check = table.between(0.0, 6.0).write(folder / "check.csv")
    return ["thresholds", table.write(folder / "free.csv"), "--robot", "ur5", "--rate", "100",
            "--check", check]  # fmt: skip


LEFT_OUT, FLAG = None, True
"""The value of an option that a remedy says to leave out, and of one that takes none."""


class Row(NamedTuple):
    """A remedy that is tried.

    Attributes:
        code: The remark; of an error, words that only it has, `…` for a value among them.
        command: Makes the log in a folder, and the command that prints the remark.
        option: The option of the remedy that is tried; of an error, several one behind the other.
        value: What the user puts where the remedy leaves that open; a function makes a file.
    """

    code: str
    command: Command
    option: str
    value: str | bool | Callable[[Path], object] | None = ""


def one_by_one(name: str, order: tuple[str, ...]) -> str:
    """Columns of a signal named one by one, as --columns takes them."""
    return f"{name}=" + "|".join(re.sub(r"(\d)", rf"{name}\1", each) for each in order)


def gripping(plant: Callable[[Table], Table], kg: float, *words: str) -> Command:
    """A command on a planted log, the robot file with a gripper that is not mounted."""
    gripper = f"\n[payload.gripper]\nmass = {kg}\ncom = [0.0, 0.0, 0.05]\n"
    own = partial(robot_file, more=gripper)
    return lambda folder: [*of(plant, *words)(folder), "--robot", own(folder)]


SWAPPED = ("1", "3", "2", "4", "5", "6")
TURNED_TORQUE = of(lambda table: replace(table, effort=-table.torque))
TURNED_CURRENT = of(lambda table: replace(table, effort=-table.effort, signal="tau"))


def third_in_degrees(table: Table) -> Table:
    return replace(table, dq=table.dq * [1.0, 1.0, np.rad2deg(1.0), 1.0, 1.0, 1.0])


def elsewhere(table: Table) -> Table:
    """Currents of zero, and what they were in the place of the estimate."""
    return replace(table, effort=0.0 * table.effort, tau_ext=table.effort)


def rehomed(table: Table) -> Table:
    moved = (table.t - table.t[0] > 12.0)[:, None] * np.eye(6)[2]
    return replace(table, q=table.q + 0.2 * moved)


ROWS = [
    Row("gaps", of(dropped_span), "interval", "0:9"),
    Row("load-changes", of(partial(picked_up, mass=3.0)), "interval", "0:9"),
    Row("position-jump", of(rehomed), "interval", "0:11"),
    Row("velocity-of-another-kind", of(third_in_degrees), "log.derive"),
    Row("no-effort", lambda f: renamed_columns(sound(), "current", "pull", f), "columns",
        "current=pull{i}"),
    Row("zero-effort", lambda f: renamed_columns(elsewhere(sound()), "tau_ext", "pull", f),
        "columns", "current=pull{i}"),
    Row("milliamperes", planted("current_mA"), "columns"),
    Row("velocity-unit", of(velocities_in_degrees), "columns", "dq[deg/s]=dq{i}"),
    Row("velocity-order", planted("velocity_swapped_J2_J3"), "columns", one_by_one("dq", SWAPPED)),
    Row("time-unit", planted("time_ms"), "columns"),
    Row("stuck-position", of(partial(stuck, signal="q", joint=4, start=0.4)), "interval", "0:6"),
    Row("stuck-velocity", of(partial(stuck, signal="dq", joint=2)), "interval", "0:10"),
    Row("stuck-effort", planted("stuck_effort_J3"), "interval", "0:10"),
    Row("saturation", planted("saturated_J2"), "interval", "0:1"),
    Row("unmodelled-load", gripping(payload, 2.8), "payload", "gripper"),
    Row("light-load", gripping(partial(payload, mass=0.8), 0.8), "payload", "gripper"),
    Row("other-robot", planted("wrong_robot"), "robot"),
    Row("joint-sign", planted("one_sign_J2"), "columns",
        one_by_one("current", ("1", "-2", "3", "4", "5", "6"))),
    Row("effort-order", planted("effort_swapped_J2_J3"), "columns",
        one_by_one("current", SWAPPED)),
    Row("joint-order", planted("all_swapped_J2_J3"), "columns",
        ",".join(one_by_one(name, SWAPPED) for name in ("q", "dq", "current"))),
    Row("torque-without-gravity", planted("gravity_compensated"), "log.effort"),
    Row("torque-without-gravity", planted("gravity_compensated", robot="panda"), "log.effort"),
    Row("torque-with-gravity", of(
        lambda t: replace(t, effort=t.torque, signal="tau"), "inspect", "--set",
        "log.effort=torque-without-gravity"), "log.effort"),
    Row("current-as-torque", planted("torque_called_current"), "log.effort"),
    Row("torque-as-current", planted("current_called_torque"), "log.effort"),
    Row("current-as-turned-torque", TURNED_TORQUE, "log.effort"),
    Row("current-as-turned-torque", TURNED_TORQUE, "columns", "-tau=current{i}"),
    Row("torque-as-turned-current", TURNED_CURRENT, "log.effort"),
    Row("torque-as-turned-current", TURNED_CURRENT, "columns", "-current=tau{i}"),
    Row("upside-down", planted("ceiling_mount"), "robot",
        partial(robot_file, gravity="[-0.17, 0.03, 9.81]")),
    Row("tilted-base", planted("wall_mount_30deg"), "robot",
        partial(robot_file, gravity="[-0.17, -4.90, -8.50]")),
    Row("vendor-sign", planted("tau_ext_inverted", robot="panda"), "columns"),
    Row("effort-sign", planted("all_signs"), "columns"),
    Row("time-reset", planted("time_reset"), "columns"),
    Row("no-free-part", cut(4.5, 9, *PUSHED, *WHOLE_LOG), "free-part", "0:0.5"),
    Row("no-free-part", cut(4.5, 9, *PUSHED, *WHOLE_LOG), "free", free_log),
    Row("no-spectra", cut(0, 8, *PUSHED[:3], "--observer", "rts-auto", "--json", "--free",
                          "0.3:0.35"), "free", "0.3:3.9"),
    Row("free-part-loaded", gripping(lambda t: payload(t.between(0.0, 12.0)), 2.8, *PUSHED,
                                     "--free", "0.3:6", "--anyway"), "payload", "gripper"),
    Row("wrench-noise-assumed", cut(4.5, 9, *PUSHED[:3], "--wrench", "--json"), "free", free_log),
    Row("no-wrench-band", cut(0, 5, *PUSHED, "--wrench"), "zero", "0.3:3"),
    Row("no-wrench-band", cut(0, 5, *PUSHED, "--wrench"), "free", "0.3:3"),
    Row("no-wrench-band", cut(0, 5, *PUSHED, "--wrench"), "virtual-sensor.torque-sd", "1"),
    Row("reference-zero-touched", of(lambda t: t, "compare", "--reference", "zero", "--observer",
                                     "gmo", "--details"), "interval"),
    Row("travel-implausible-hard", of(touched, "admit", "--anyway", "--details"),
        "admittance.threshold_mode"),
    Row("wrench-frame-unstated", with_wrench, "columns", "wrench[base]=fx|fy|fz|mx|my|mz"),
    Row("sensor-pose-unstated", with_wrench, "virtual-sensor.sensor", "0,0,0.05"),
    Row("tool-pose-unstated", lambda f: with_wrench(
        f, "--columns", "wrench[tool]=fx|fy|fz|mx|my|mz"), "virtual-sensor.tool", "0,0,0.05"),
    Row("degrees", of(lambda t: replace(t, q=np.rad2deg(t.q), dq=np.rad2deg(t.dq)), "inspect",
                      "--columns", "q[rad]=q{i},dq[rad]=dq{i}"), "columns",
        "q[deg]=q{i},dq[deg/s]=dq{i}"),
    Row("effort-sign-of-some", unnamed(rubbing), "columns",
        one_by_one("current", ("1", "-2", "3", "4", "5", "6"))),
    Row("effort-sign-by-work", unnamed(turned_and_unknown), "columns"),
    Row("effort-is-current", lambda _: ["inspect", shared(
        "samples/reach/ros2_ur_effort_full_torque")], "columns"),
    Row("arm-side-chosen", lambda f: ["inspect", aloha(f / "episode_0.hdf5")], "arm", "right"),
    Row("no-profile", unnamed(lambda t: replace(
        t, q=t.q[:, :5], dq=t.dq[:, :5], effort=t.effort[:, :5])), "robot", arm_of_five),
    Row("free-by-the-fit", cut(4.5, 20, *PUSHED[:3], "--json", *NO_LIST), "free", free_log),
    Row("check-without-truth", checked_thresholds, "reference", "zero"),
    Row("payload-not-mounted", lambda f: ["inspect", rtde(f), "--robot", "ur5"], "payload"),
    Row("controller-point-without-tool", controlled, "virtual-sensor.tool", "0,0,0.1"),
    Row("controller-point-open", lambda f: [*controlled(f), *TOOL], "columns"),
    Row("controller-point-without-currents", lambda f: [
        *controlled(f, "target_current"), *TOOL], "columns"),
    Row("episode-chosen", lambda _: ["inspect", FIXTURES / "panda_episodes"], "episode", "1"),
]  # fmt: skip


def printed(words: list[Any]) -> tuple[int, str]:
    """How a command ends, and all that it prints, as one line."""
    code, out, err = run(words)
    with contextlib.suppress(json.JSONDecodeError):
        out = json.dumps(json.loads(out), ensure_ascii=False)
    return code, " ".join(f"{out} {err}".replace('\\"', '"').split())


def reported(code: str, text: str) -> str | None:
    """What a text says of a code, with its remedy; None where it says nothing of it."""
    entry = words_of(code)
    rest = [entry[key] for key in ("consequence", "remedy") if key in entry]
    if (whole := found_in(text, ". ".join([entry["short"], *rest]))) is not None:
        return whole
    short = found_in(text, entry["short"])
    return None if short is None else f"{short}. {entry.get('remedy', '')}"


def found_in(text: str, template: str) -> str | None:
    """Where a text holds what a template gives with some values, its pieces in their order."""
    pieces = [piece for piece, *_ in string.Formatter().parse(template) if piece]
    begin = text.find(pieces[0])
    while begin >= 0:
        at = begin
        for piece in pieces:
            at = text.find(piece, at, at + len(piece) + 300)
            if at < 0:
                break
            at += len(piece)
        else:
            # A value may end it: all up to the next blank.
            return text[begin:at] + re.split(r'[\s"]', text[at:], maxsplit=1)[0]
        begin = text.find(pieces[0], begin + 1)
    return None


@pytest.mark.slow
@pytest.mark.parametrize("row", ROWS, ids=lambda row: f"{row.code}-{row.option}")
def test_the_remedy_heals(row: Row, tmp_path: Path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    words = row.command(tmp_path)
    before = printed(words)[1]
    said = reported(row.code, before)
    assert said is not None, before
    code, after = printed(with_option(words, said, row))
    assert code == 0, after
    assert reported(row.code, after) is None


def with_option(words: list[Any], said: str, row: Row) -> list[Any]:
    """The command with the option that was printed, over what was made before."""
    value = row.value(Path.cwd()) if callable(row.value) else row.value
    value = value or value_of(row.option, said)
    again = ["--force"] if "-o" in words else []
    return [*words, *again, *typed(row.option, value)]


def named(option: str) -> str:
    return option if "." in option or option.startswith("-") else f"--{option}"


def value_of(option: str, said: str) -> str:
    """What a text says behind an option or a setting that it must name."""
    name = re.escape(named(option))
    found = re.search(rf"{name}(?![-a-z])(?:[ =]('[^']+'|[^\s,;)|]+))?", said)
    assert found is not None, said
    return (found[1] or "").rstrip(".:").strip("'")


def typed(option: str, value: object) -> list[Any]:
    return ["--set", f"{option}={value}"] if "." in option else [named(option), value]


WITHOUT_ROW = {
    "the reader refuses such a file first; only a log made in memory gets as far": (
        "absurd-clock", "absurd-steps", "absurd-values"),
    "names a command; tried below": ("effort-offset",),
    "asks for a log with other numbers": ("current-without-gravity",),
    "which columns hold the effort is the user's to say": ("effort-unexplained",),
    "says which option did it, or what not to do; there is nothing to mend": (
        "field-used", "gain-from-kalman-delay", "sign-turned", "signal-by-name", "zero-wrench",
        "zero-wrench-beside-tau-ext"),
    "no-free-part stands beside it and has the options": (
        "free-part-not-quiet", "gains-without-free-part"),
    "keeps the profile's links where the user wants them": ("links-identified",),
    "asks for a description of the user's own arm": ("no-robot-fits", "no-robot-fits-any"),
    "tried in tests/robots/test_urdf.py": ("simulator-friction-left",),
    "needs a data set with a wrench of unknown origin": ("wrench-left-out",),
}  # fmt: skip
"""Why a remark with an option has no row."""


def test_every_remark_with_an_option_is_tried_or_says_why_not() -> None:
    files = (tomllib.loads(path.read_text("utf-8")) for path in WORDS.glob("*.toml"))
    catalogue = (item for file in files for item in file.items())
    with_option = {c for c, entry in catalogue if re.search("--[a-z]", " ".join(entry.values()))}
    tried = {row.code for row in ROWS}
    excused = {code for each in WITHOUT_ROW.values() for code in each}
    assert with_option - tried - excused == set()
    assert excused & tried == set()
    assert excused <= with_option


@pytest.mark.slow
def test_a_load_that_a_log_shows_is_found_and_mounted(tmp_path: Path) -> None:
    """The doctor's and the list's command, on a motion whose poses differ."""
    log = moving("ur5", load=2.8, seconds=12.0)
    path, own = measured(log).write(tmp_path / "log.csv"), tmp_path / "loaded.toml"
    said = reported("unmodelled-load", printed(["inspect", path, "--robot", "ur5"])[1])
    assert said is not None
    name, *how = re.search(r"(identify) (--method) (payload)", said).groups()  # type: ignore[union-attr]
    code, text = printed([name, path, *how, "--robot", "ur5", "-o", own])
    assert code == 0, text
    assert reported("unmodelled-load", printed(["inspect", path, "--robot", own])[1]) is None


@pytest.mark.slow
def test_an_offset_is_taken_out_with_the_remedy(tmp_path: Path, monkeypatch) -> None:
    """J3's, after 4 s, by the friction that is identified on the free cycle before."""
    monkeypatch.chdir(tmp_path)
    said = reported("effort-offset", printed(planted("offset_J3_20pct")(tmp_path))[1])
    assert said is not None
    (shift,) = re.findall(r"has an offset of (\S+) ", said)
    (how,) = re.findall("identify --interval A:B --method (friction) -o FILE.toml", said)
    search = ("identify", "--interval", "0.3:4", "--method", how, "-o", "own.toml")
    code, text = printed(planted("offset_J3_20pct", *search)(tmp_path))
    assert code == 0, text

    def mean(arm: str, plant: Callable[[Table], Table]) -> float:
        words = of(plant, *PUSHED, *NO_LIST, "--force")(tmp_path)
        code, text = printed([arm if word == "ur5" else word for word in words])
        assert code == 0, text
        estimate = pl.read_parquet("out/estimates.parquet").filter(pl.col("t").is_between(4, 20))
        return float(estimate["tau_ext/gmo/3"].mean())

    # 0.02 of 7.25 N·m were measured: what J3's friction on the day differs by beside its offset.
    left = mean("own.toml", FAULTS["offset_J3_20pct"].plant) - mean("ur5", lambda table: table)
    assert abs(left) < 0.1 * abs(float(shift))


@pytest.mark.slow
def test_a_load_that_one_motion_does_not_show_is_found_in_a_pair(tmp_path: Path) -> None:
    """As the refusal says."""
    loaded, free = payload(sound()).write(tmp_path / "a.csv"), sound().write(tmp_path / "b.csv")
    search = ["--method", "payload", "--robot", "ur5", "-o", tmp_path / "loaded.toml"]
    code, text = printed(["identify", loaded, *search])
    assert code == 1
    assert "in a pair of logs of one motion with and without it" in text
    code, text = printed(["identify", loaded, "--free", free, *search])
    assert code == 0, text
