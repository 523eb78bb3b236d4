"""Every option that an error of the analysis names, tried on what provoked it: the error is gone.

As tests/test_remedies.py, for the errors of the rooms below; those of the others have their own.
"""

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest
from moving_arms import moving
from planted_faults import Table, gravity_torque, with_more_torque
from test_remedies import (
    FIXTURES,
    FLAG,
    LEFT_OUT,
    NO_LIST,
    REFUSALS,
    WHOLE_LOG,
    Command,
    Row,
    arm_of_five,
    check_error,
    cut,
    dropped,
    free_log,
    measured,
    of,
    printed,
    raised,
    robot_file,
    sound,
)

from vftcli.robots import load_robot
from vftcli.robots.chain import flange_jacobian

ROOMS = ("admittance", "contacts", "evaluation", "identification", "observers", "outputs",
         "bias", "free_motion", "reproduction", "simulation", "wrench",
         "answering.py", "notebook.py", "pipeline.py", "proposal.py")  # fmt: skip


def fixture(name: str, span: str, *words: str) -> Command:
    log = (FIXTURES / name, "--robot", "ur5", "--interval", span)
    return lambda _: [*words[:1], *log, *words[1:]]


def simulated(name: str, *words: str) -> Command:
    return lambda _: ["simulate", name, "--set", "duration=1", *words]


def before(command: Command, *words: str) -> Command:
    """A command that has been run before; now with more words."""

    def again(folder: Path) -> list[Any]:
        made = command(folder)
        assert printed(made)[0] == 0
        return [*made, *words]

    return again


def beside(command: Command, option: str, make: Callable[[Path], object]) -> Command:
    """A command with an option that names a file."""
    return lambda folder: [*command(folder), option, make(folder)]


def released(without: str) -> Command:
    """A release of an arm that lacks one line of its robot file."""

    def command(folder: Path) -> list[Any]:
        path = Path(robot_file(folder))
        path.write_text(re.sub(rf"(?m)^{without}.*$", "", path.read_text("utf-8")), "utf-8")
        return ["admit", "--release", "x=0.3", "--robot", path]

    return command


def moved(seconds: float = 4.0) -> Table:
    """A motion that the sound log does not hold, nobody touching the arm."""
    return measured(moving("ur5", seconds=seconds))


def still(table: Table, seconds: float = 4.0) -> Table:
    table = table.between(0.0, seconds)
    held = {name: np.tile(value[0], (len(table.t), 1)) for name, value in table.series()}
    return replace(table, **held | {"dq": 0.0 * table.dq})


def gap_at_the_end(table: Table) -> Table:
    table = table.between(0.0, 9.0)
    return replace(table, t=np.append(table.t[:-3], table.t[-3:] + 1e5))


def backwards(table: Table) -> Table:
    return replace(table, dq=-table.dq).between(0.0, 8.0)


def against_gravity(table: Table) -> Table:
    """Currents of friction, and of gravity turned around."""
    gravity = gravity_torque(table, table.arm) / table.constant
    return replace(table, effort=5.0 * np.tanh(table.dq / 0.01) - gravity).between(0.0, 4.0)


def touched_late(folder: Path) -> list[Any]:
    """Thresholds of a log that somebody pushes after 31 s."""
    table = moved(33.0)
    push = 200.0 * np.sin(np.pi * np.clip(table.t - 31.0, 0.0, 1.0))
    pushed = with_more_torque(table, push[:, None] * np.eye(6)[1])
    return ["thresholds", pushed.write(folder / "log.csv"), "--robot", "ur5", "--rate", "100"]


def of_five_joints(folder: Path) -> list[Any]:
    table = sound().between(0.0, 4.0)
    five = {name: value[:, :5] for name, value in table.series()}
    made = replace(table, **five | {"effort": table.torque[:, :5]}, signal="tau")
    return ["estimate", made.write(folder / "log.csv"), "--robot", arm_of_five(folder), *EST[1:],
            "--wrench", "--anyway"]  # fmt: skip


def by_jacobian(sensor: str, *words: str) -> Command:
    """A comparison of a log without positions: torques, their Jacobian, a wrench called so."""

    def command(folder: Path) -> list[Any]:
        rng = np.random.default_rng(0)
        J = flange_jacobian(load_robot("panda").chain, rng.uniform(-1.0, 1.0, (400, 7)))
        columns = {"timestamp": np.arange(400) / 80.0}
        columns |= {f"tau_ext_{j}": rng.standard_normal(400) for j in range(7)}
        columns |= {f"jacobian_{r}_{c}": J[:, r, c] for r in range(6) for c in range(7)}
        columns |= {f"{sensor}{k}{x}": rng.standard_normal(400) for k in "fm" for x in "xyz"}
        pl.DataFrame(columns).write_csv(folder / "jacobian.csv")
        return ["compare", folder / "jacobian.csv", *words]

    return command


def stored(folder: Path) -> list[Any]:
    before(cut(0, 4, *EST))(folder)
    return ["admit", folder / "out" / "estimates.parquet", "--robot", "ur5", "--observer", "gmo",
            "--set", "virtual-sensor.solver=smoother"]  # fmt: skip


def gains(folder: Path) -> Path:
    (folder / "gains.toml").write_text("[observers.gmo]\ngain = 10.0\n", "utf-8")
    return folder / "gains.toml"


def tuned(folder: Path) -> str:
    before(cut(0, 4, *TUNE))(folder)
    return "g.toml"


def no_batch(folder: Path) -> list[Any]:
    """A batch into a folder that holds what another program left."""
    (folder / "b" / "rows").mkdir(parents=True)
    return BATCH(folder)


EST = ("estimate", "-o", "out", "--json", *NO_LIST, "--observer", "gmo")
SMOOTHED = (*EST[:-1], "rts-auto")
TWO = ("compare", "--observer", "gmo", *NO_LIST, "--reference", "two-cycle")
SENSOR = (*TWO[:-1], "sensor", "--wrench")
TUNE = ("identify", "--method", "gains", "-o", "g.toml", "--free", "0.3:3.9")
MAKE = ("identify", "-o", "own.toml")
CONSTANTS = ("--set", "identify.constants=yes")
BATCH = cut(0, 4, "batch", "--do", "estimate", "--observer", "gmo", "-o", "b", "--jobs", "0")
W = "wrench/fx|wrench/fy|wrench/fz|wrench/mx|wrench/my|wrench/mz"
TRUTH = f"file:{FIXTURES / 'ur5_circle.csv.truth.parquet'}"
ONE_LOG = beside(cut(0, 9, *TWO, "--set", "two-cycle.period=4"), "--free", free_log)
WHOLE_CAUSAL = cut(0, 4, *EST, *WHOLE_LOG, "--causal")
PRINTED_MATCHED = cut(0, 4, *EST, "--gains", "delay=0.05", "--as-printed")
LOG_AS_ZERO = beside(cut(0, 4, *EST, "--wrench"), "--zero", free_log)
NO_RECORDING = cut(0, 4, *EST, "--rrd", "--set", "recording.detail=none")
COMMANDED = cut(0, 12, *TWO, "--set", "two-cycle.alignment=commanded")
SMOOTHER = ("--set", "virtual-sensor.solver=smoother")
PRINT = ("--set", "report.published=table1")
FIT = ("--set", "virtual-sensor.sensor=fit")
TOO_LONG = cut(0, 9, *TWO, "--set", "two-cycle.period=30")

ROWS = [
    Row("has no admittance.start", released("start"), "admittance.start",
        "0,-1.35,1.9,-2.12,-1.57,0"),
    Row("no admittance.period", released("period"), "admittance.period", "0.008"),
    Row(": no admittance ", released("mass = 3.0"), "set", "3"),
    Row("a release needs a deviation", lambda _: [
        "admit", "--release", "x=0", "--robot", "ur5"], "release"),
    Row("unstable: ", lambda _: ["admit", "--release", "x=0.3", "--robot", "ur5", "--set",
                                 "position.alpha=50"], "anyway", FLAG),
    Row("needs the log itself", stored, "virtual-sensor.solver", LEFT_OUT),
    Row("can be compared with its", by_jacobian("", "--reference", "vendor"), "reference"),
    Row("no wrench of a sensor to compare", by_jacobian("a", "--reference", "sensor"), "columns",
        "wrench=afx|afy|afz|amx|amy|amz"),
    Row("leave model.friction=none out", fixture("ur5_circle.csv", "0:8", *MAKE, "--method",
        "targets", "--set", "model.friction=none"), "model.friction", LEFT_OUT),
    Row("has no torque constants", cut(0, 8, *MAKE, "--method", "targets", robot="panda"),
        "method"),
    Row("--causal leaves out", cut(0, 4, *SMOOTHED, "--causal"), "observer", "gmo"),
    Row("Leave --gains or", PRINTED_MATCHED, "gains", LEFT_OUT),
    Row("Leave --gains or", PRINTED_MATCHED, "as-printed", LEFT_OUT),
    Row("--gains cannot tune", cut(0, 4, *SMOOTHED, "--gains", "delay=0.05"), "observer", "gmo"),
    Row("no such file of gains", cut(0, 4, *EST, "--gains", "mine.toml"), "gains", "paper"),
    Row("no such file of gains", cut(0, 4, *EST, "--gains", "mine.toml"), "gains", tuned),
    Row("a file for this goal", cut(0, 4, *EST, "--gains", "false-alarms=9"), "gains", tuned),
    Row("which no batch wrote", no_batch, "force", FLAG),
    Row("holds a batch of other options", before(BATCH, "--causal"), "force", FLAG),
    Row("exists; give another -o", before(cut(0, 4, *TUNE)), "force", FLAG),
    Row("exists; give another -o", before(simulated("ur5-circle", "-o", "sim.csv")), "force",
        FLAG),
    Row("writes no recording", NO_RECORDING, "recording.detail", LEFT_OUT),
    Row("add --set alarm", cut(0, 4, *TUNE, "--gains", "false-alarms=1"), "set",
        "alarm.threshold=5"),
    Row("raise --set alarm", cut(0, 4, *TUNE, "--gains", "false-alarms=1", "--set",
                                 "alarm.threshold=0.001"), "set", "alarm.threshold=50"),
    Row("are for cycles of one log", ONE_LOG, "two-cycle.period", LEFT_OUT),
    Row("are for cycles of one log", ONE_LOG, "free", LEFT_OUT),
    Row("alignment commanded needs", COMMANDED, "two-cycle.period", "4"),
    Row("nearly all of that is a gap", of(gap_at_the_end, *TWO, "--anyway"), "interval", "0:9"),
    Row("does not fit into", TOO_LONG, "two-cycle.period", "4"),
    Row("the arm does not move", of(still, *TWO, "--anyway"), "free",
        lambda folder: str(still(sound(), 3.0).write(folder / "free.csv"))),
    Row("cannot log as a Franka", simulated("ur5-circle", "-o", "sim", "--as", "libfranka"), "as",
        "rtde"),
    Row("cannot log in a UR", simulated("panda-bearing", "-o", "sim", "--as", "rtde"), "as",
        "libfranka"),
    Row("whole-log needs the complete log", WHOLE_CAUSAL, "bias.method", LEFT_OUT),
    Row("whole-log needs the complete log", WHOLE_CAUSAL, "causal", LEFT_OUT),
    Row("give another solver", cut(0, 4, *EST, "--wrench", *SMOOTHER, "--causal"),
        "virtual-sensor.solver", "pinv"),
    Row("--zero takes either start or", cut(0, 4, *EST, "--wrench", "--zero", "start", "--zero",
                                            "0:1"), "zero", "0:1"),
    Row("the sensor's pose on the flange", cut(0, 4, *EST, "--wrench", "--frame", "sensor"),
        "virtual-sensor.sensor", "0,0,0.05"),
    Row("no frame known here", fixture("ur5_sensor.parquet", "0:5", *SENSOR, "--columns",
                                       f"wrench[world]={W}"), "columns", f"wrench[base@tool]={W}"),
    Row("the forces lie on one line", fixture("ur5_sensor.parquet", "0:5", *SENSOR,
                                              *FIT), "virtual-sensor.sensor", "0,0,0.05"),
    Row("six components of a wrench", of_five_joints, "wrench", LEFT_OUT),
    Row("name a log of free motion by --free", LOG_AS_ZERO, "zero", "0:1"),
    Row("no unloaded start", cut(4.5, 9, *EST, "--wrench", "--zero", "start"), "zero", "0:1"),
    Row("or take it all with --anyway", touched_late, "interval", "0:30.5"),
    Row("or take it all with --anyway", touched_late, "anyway", FLAG),
    Row("is for --method friction", cut(
        0, 8, *MAKE, *CONSTANTS, "--method", "base"), "method", "friction"),
    Row("it would push", of(backwards, *MAKE, "--anyway"), "columns",
        "t=t,q=q{i},-dq=dq{i},current=current{i}"),
    Row("not in sensor axes", fixture("ur5_sensor.parquet", "0:18", *SENSOR, *FIT,
                                      "--columns", f"wrench[base]={W}"), "columns",
        f"wrench[sensor]={W}"),
    Row("--set identify.constants=yes needs motor currents", cut(0, 8, *MAKE, *CONSTANTS,
                                                    robot="panda"), "set", LEFT_OUT),
    Row("is not a free run of the trajectory", beside(
        cut(4.5, 9, *TWO), "--free", lambda folder: moved().write(folder / "other.csv")),
        "free", free_log),
    Row("sets errors beside the paper's", cut(
        0, 9, "report", "-o", "out", "--observer", "gmo", *PRINT), "reference"),
    Row("torque behind the gears", cut(0, 8, *MAKE, "--set", "model.friction=none", robot="panda"),
        "method"),
    Row("leave out --set identify.constants=yes", of(
        against_gravity, *MAKE, *CONSTANTS, "--anyway"), "set", LEFT_OUT),
]  # fmt: skip
WITHOUT_ROW: dict[str, tuple[str, ...]] = {
    "names only the option that is wrong, or the words it takes": (
        "no such admittance parameter. Sections", "--release … is not …", "--only names nothing",
        "rad; it must be less than 10 m and π", "holds no sample of the log",
        "is not a positive number of false alarms per hour",
        "--gains … is not …, a positive number",
        "--set … is not …", "recording.detail=… is none of",
        "is not a positive time in seconds", "is not a positive cutoff in Hz",
        "is no list of cycle numbers as", "names no cycle; they begin at 1",
        "is not a cutoff between 0 and", "is neither sensor nor …PATH",
        "is not a positive number or one per joint"),
    "says what cannot be combined, or not here; there is nothing to try": (
        "of the wrench's options it takes only --zero A:B", "is of an arm with … joints",
        "and --force does not overwrite that either"),
    "asks for another recording, or for poses that no fixture has": (
        "a log at rest identifies no friction", "have a partner in the free run",
        "less than the period of", "no whole cycle of"),
    "only Python gets as far; the command line refuses such a log or word first": (
        "samples are not finite; leave them out with --interval",
        "a free run must be of the same arm"),
    "said as contacts-not-judged, tried in tests/evaluation/test_references.py": (
        "no free part to learn the band",),
    "its command is tried where there is no such file of gains": ("no [observers.*] tables",),
    "tried in tests/reproduction/test_manifest.py": (
        "--outside …: …", "is looked for, LOG one of"),
    "tried in tests/test_remedies_of_files.py": (
        "s force drives the replay", "leave --frame out", "holds still over a span",
        "the closed loop runs", "settle which arm it is of"),
    "no log that provokes it is known": (
        "the fit of physical links did not settle", "equations for … unknowns",
        "or let --method base identify the links too"),
}  # fmt: skip
"""Reason → texts, by words that only they have, that name an option and have no row."""


@pytest.mark.slow
@pytest.mark.parametrize("row", ROWS, ids=lambda row: f"{row.code}-{row.option}")
def test_the_remedy_is_taken(row: Row, tmp_path: Path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    check_error(row, tmp_path)


def test_a_remedy_of_two_options_is_taken(tmp_path: Path, monkeypatch) -> None:
    """A free run in the place of a period; a wrench left out with its solver."""
    monkeypatch.chdir(tmp_path)
    words = TOO_LONG(tmp_path)
    assert "in its place a free run in another log with --free" in printed(words)[1]
    assert printed([*dropped(words, "two-cycle.period"), "--free", free_log(tmp_path)])[0] == 0
    words = [*of_five_joints(tmp_path), *SMOOTHER]
    assert "leave --wrench and its options out" in printed(words)[1]
    assert printed(dropped(dropped(words, "wrench"), "virtual-sensor.solver"))[0] == 0


def test_no_free_run_is_asked_for_where_none_helps(tmp_path: Path) -> None:
    """Seven samples, of which a free run makes no more."""
    refused = printed(cut(0, 0.05, *TWO, "--anyway")(tmp_path))[1]
    assert "7 samples are too few" in refused
    assert "--free" not in refused


@pytest.mark.slow
def test_every_error_with_an_option_is_tried_or_says_why_not() -> None:
    known = raised(ROOMS).values()
    tried = {row.code for row in ROWS}
    excused = {fragment for each in WITHOUT_ROW.values() for fragment in each}
    elsewhere = {row.code for row in REFUSALS}
    assert [t for t in known if not any(f in t for f in tried | excused | elsewhere)] == []
    assert [f for f in tried | excused if not any(f in t for t in known)] == []
    assert [t for t in known if any(f in t for f in tried) and any(f in t for f in excused)] == []
