"""Every remedy that an error text names, tried on the command that it refused.

A row runs a command that is refused, reads the option out of the refusal, and runs the command with
it, or without it where the refusal says to leave it out. A text that names an option or a command
and has no row needs a reason.
"""

import ast
import re
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import polars as pl
import pytest
from example_logs import CIRCLE, EPISODES, FIXTURES
from moving_arms import moving
from planted_faults import Table, gravity_torque, positions_in_degrees, with_more_torque
from seed_logs import libfranka_csv, ur_binary
from test_remedies import (
    FLAG,
    LEFT_OUT,
    NO_LIST,
    WHOLE_LOG,
    Command,
    Row,
    arm_of_five,
    cut,
    free_log,
    measured,
    named,
    of,
    printed,
    renamed_columns,
    robot_file,
    sound,
    typed,
    value_of,
)
from test_topics import ALPHABETICAL, ur_message, write_joint_states

import vftcli
from vftcli.readers.reading import FORMATS
from vftcli.robots import load_robot
from vftcli.robots.chain import flange_jacobian

PLAIN = "t=t,q=q{i},dq=dq{i},current=current{i}"
COUNTED = "t,q:6,dq:6,current:6"
Change = Callable[[pl.DataFrame], pl.DataFrame]


def frame() -> pl.DataFrame:
    return sound().between(0.0, 2.0).frame().select(pl.col("^(t|q.|dq.|current.)$"))


def converted(change: Change, *words: str, name: str = "log.csv", header: bool = True) -> Command:
    """A conversion of a changed log: nothing but the reader works."""

    def command(folder: Path) -> list[Any]:
        return ["convert", written(folder, change, name, header), "-o", "out.csv", *words]

    return command


def written(folder: Path, change: Change, name: str = "log.csv", header: bool = True) -> Path:
    table = change(frame())
    if name.endswith("parquet"):
        table.write_parquet(folder / name)
    else:
        table.write_csv(folder / name, include_header=header, float_precision=9)
    return folder / name


def with_columns(*columns: pl.Expr, **named: pl.Expr) -> Change:
    return lambda table: table.with_columns(*columns, **named)


def renamed(names: dict[str, str]) -> Change:
    """Columns under other names; a name of one letter is of all joints."""
    return lambda table: table.rename(
        lambda c: names.get(c) or re.sub("^([a-z]+)(?=\\d)", lambda m: names.get(m[1], m[1]), c)
    )


def same(table: pl.DataFrame) -> pl.DataFrame:
    return table


def arrays(names: dict[str, tuple[int, ...]], *words: str) -> Command:
    def command(folder: Path) -> list[Any]:
        with h5py.File(folder / "log.hdf5", "w") as file:
            for name, shape in names.items():
                file[name] = np.linspace(0.0, 1.0, int(np.prod(shape))).reshape(shape)
        return ["convert", folder / "log.hdf5", "-o", "out.csv", *words]

    return command


def named_arrays(folder: Path) -> list[Any]:
    table = frame()
    groups = {name: table.select(pl.col(f"^{name}.$")).to_numpy() for name in ("q", "dq")}
    np.savez(folder / "log.npz", t=table["t"].to_numpy(), **groups)
    return ["convert", folder / "log.npz", "-o", "out.csv", "--columns", "t,q:6,dq:6"]


def own_bag(folder: Path) -> list[Any]:
    """A conversion of a bag without a wrench, and of its wrench something is said."""
    assert printed(["convert", written(folder, same), "-o", folder / "log.mcap"])[0] == 0
    return ["convert", folder / "log.mcap", "-o", "out.csv", "--columns", "wrench[base]"]


def without_clock(folder: Path) -> list[Any]:
    """A conversion of an RTDE log without its timestamp, read as what it was."""
    table = pl.read_csv(CIRCLE, separator=" ").head(250).drop("timestamp")
    table.write_csv(folder / "log.csv", separator=" ", float_precision=9)
    return ["convert", folder / "log.csv", "-o", "out.csv", "--set", "log.format=ur-csv"]


def on(log: Change, *words: Any) -> Command:
    """A command on a changed log of a UR5; `words` begin with its name."""
    return lambda folder: [words[0], written(folder, log), *words[1:]]


def estimated(folder: Path, *words: str) -> Path:
    log = written(folder, lambda _: circle().head(500))
    code, said = printed(["estimate", log, "--robot", "ur5", "-o", folder / "made", *words])
    assert code == 0, said
    return folder / "made" / "estimates.parquet"


def judged(reference: Change, header: bool = True) -> Command:
    return lambda f: [
        "compare", written(f, same), *GMO, "--reference",
        f"file:{written(f, reference, 'truth.csv', header)}"]  # fmt: skip


def annotated(*words: str) -> Command:
    return lambda _: ["annotate", EPISODES, "-o", "out", "--robot", "panda", *words]


def mimicking(folder: Path) -> list[Any]:
    text = (FIXTURES / "arm.urdf").read_text("utf-8")
    parts = text.split("</joint>")
    parts[2] += '<mimic joint="' + re.findall('<joint name="([^"]+)"', text)[1] + '"/>'
    (folder / "arm.urdf").write_text("</joint>".join(parts), encoding="utf-8")
    return ["help", "robots", folder / "arm.urdf"]


def xacro(folder: Path) -> list[Any]:
    """A xacro that needs an argument: how heavy its first link is."""
    text = (FIXTURES / "arm.urdf").read_text("utf-8")
    text = re.sub("<robot ", '<robot xmlns:xacro="http://www.ros.org/wiki/xacro" ', text, count=1)
    text = re.sub('<mass value="[^"]*"', '<mass value="$(arg heavy)"', text, count=1)
    (folder / "arm.urdf.xacro").write_text(text, encoding="utf-8")
    return ["inspect", written(folder, same), "--robot", folder / "arm.urdf.xacro"]


def gripping(folder: Path) -> list[Any]:
    """An examination with the log's payload, which the log does not say."""
    own = robot_file(folder, more="\n[payload.gripper]\nmass = 1.0\ncom = [0.0, 0.0, 0.05]\n")
    return ["inspect", written(folder, same), "--robot", own, "--payload", "log"]


def circle() -> pl.DataFrame:
    return sound().frame()


def waiting(table: pl.DataFrame) -> pl.DataFrame:
    last = table["t"][3 * len(table) // 4]
    return table.with_columns(t=pl.col("t") + 86400.0 * (pl.col("t") > last))


def short_scenario(folder: Path) -> str:
    text = (FIXTURES / "ur5_circle.csv.scenario.toml").read_text("utf-8")
    text = re.sub("(?m)^duration = .*", "duration = 3.0", text)
    (folder / "short.toml").write_text(text, encoding="utf-8")
    return str(folder / "short.toml")


def edited_header(folder: Path) -> list[Any]:
    path = libfranka_csv(folder / "log.csv")
    path.write_text(path.read_text("utf-8").replace("state.q[3]", "state.x[3]"), encoding="utf-8")
    return ["convert", path, "-o", "out.csv"]


def two_bags(folder: Path) -> list[Any]:
    messages = [
        ur_message(k, name=[f"{side}_{name}" for name in ALPHABETICAL],
                   topic=f"/{side}/joint_states")
        for side in ("left", "right") for k in range(20)
    ]  # fmt: skip
    return ["convert", write_joint_states(folder / "bag", messages), "-o", "out.csv"]


def with_jacobian(table: pl.DataFrame) -> pl.DataFrame:
    """A vendor's torques beside its Jacobian, its axes of length 1, a wrench, no positions."""
    cells = {
        f"jacobian_{row}_{k}": pl.lit(float(row % 3 == k % 3)) if row > 2 else pl.col(f"q{k + 1}")
        for row in range(6) for k in range(6)
    }  # fmt: skip
    axes = zip(("fx", "fy", "fz", "mx", "my", "mz"), range(1, 7), strict=True)
    wrench = {axis: pl.col(f"q{k}") for axis, k in axes}
    torques = {f"tau_ext_{k}": pl.col(f"q{k + 1}") for k in range(6)}
    return table.select("t", **torques, **wrench, **cells)


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


def tuned(folder: Path) -> str:
    before(cut(0, 4, *TUNE))(folder)
    return "g.toml"


def no_batch(folder: Path) -> list[Any]:
    """A batch into a folder that holds what another program left."""
    (folder / "b" / "rows").mkdir(parents=True)
    return BATCH(folder)


def unknown_estimate(table: Table) -> Table:
    assert table.tau_ext is not None
    tau_ext = table.tau_ext.copy()
    tau_ext[1000:1050] = np.nan
    return replace(table, tau_ext=tau_ext)


GMO = ("--robot", "ur5", "--observer", "gmo")
RELEASE = ("admit", "--release", "x=0.3", "--robot", "ur5")
PULL = renamed({"current": "pull"})
LISTS = pl.concat_list(["t"] * 3)
BY_SENSOR = "compare", "--reference", "sensor", "--wrench"

EST = ("estimate", "-o", "out", "--json", *NO_LIST, "--observer", "gmo")
SMOOTHED = (*EST[:-1], "rts-auto")
TWO = ("compare", "--observer", "gmo", *NO_LIST, "--reference", "two-cycle")
SENSOR = (*TWO[:-1], "sensor", "--wrench")
TUNE = ("identify", "--method", "gains", "-o", "g.toml", "--free", "0.3:3.9")
MAKE = ("identify", "-o", "own.toml")
CONSTANTS = ("--set", "identify.constants=yes")
BATCH = cut(0, 4, "batch", "--do", "estimate", "--observer", "gmo", "-o", "b", "--jobs", "0")
W = "wrench/fx|wrench/fy|wrench/fz|wrench/mx|wrench/my|wrench/mz"
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
    # cli
    Row("give one of LOG, SCENARIO, --release", lambda _: ["admit", "--robot", "ur5"],
        "--release", "x=0.3"),
    Row("are of what -o DIR writes", lambda _: [*RELEASE, "--figures", "svg"], "-o", "out"),
    Row("choose one of …", lambda _: [*RELEASE, "--json", "--latex"], "--latex",
        LEFT_OUT),
    Row("s force drives the replay", on(same, "admit", *GMO, "--observer", "kfo-zoh"),
        "--observer", "gmo"),
    Row("leave --frame out", on(same, "admit", *GMO, "--frame", "tool"), "--frame", LEFT_OUT),
    Row("holds still over a span", lambda f: [
        "admit", short_scenario(f), "--zero", "start"], "--zero", "0:1"),
    Row("the closed loop runs", lambda f: ["admit", short_scenario(f), *GMO[2:]], "--observer",
        "kfo-zoh"),
    Row("--do compare needs --reference", on(same, "batch", *GMO, "--do", "compare", "-o", "out",
                                             "--jobs", "0"), "--reference", "zero"),
    Row("writes no estimates; leave --csv", on(same, "batch", *GMO, "--do", "contacts", "--csv",
                                               "-o", "out", "--jobs", "0"), "--csv", LEFT_OUT),
    Row("--figures and -o DIR need each other", on(
        same, "compare", *GMO, "--reference", "zero", "--figures", "svg"), "-o", "out"),
    Row("choose one of --details, --quiet", converted(same, "--details", "--quiet"), "--quiet",
        LEFT_OUT),
    Row("choose one of …", on(same, "contacts", *GMO[:2], "--json", "--csv"), "--csv",
        LEFT_OUT),
    Row("--set log.derive=dq belongs to an estimate", converted(same, "--set", "log.derive=dq"),
        "log.derive", LEFT_OUT),
    Row("free motion to identify the arm from", lambda f: [
        "identify", CIRCLE, "-o", "my.toml", "--robot", "ur5", "--free", free_log(f)], "--free",
        LEFT_OUT),
    # readers: which column is which
    Row("two columns could be", converted(with_columns(q_1=pl.col("q1"))), "--columns", PLAIN),
    Row("could both be", converted(with_columns(pl.col("^dq.$").name.replace("dq", "qd"))),
        "--columns", PLAIN),
    Row("have several units", converted(renamed({"q3": "q3 [rad]"})), "--columns",
        PLAIN.replace("q=q{i}", "q=q1|q2|q3 [rad]|q4|q5|q6", 1)),
    Row("with holes. Name them", converted(renamed({"q3": "q9"})), "--columns",
        PLAIN.replace("q=q{i}", "q=q1|q2|q9|q4|q5|q6", 1)),
    Row("holds no number in its first row", converted(
        with_columns(tau_ext=pl.lit([], pl.List(pl.Float64))), name="log.parquet"), "--columns",
        PLAIN),
    Row("could each be the clock", converted(with_columns(time=pl.col("t") + 1.0)), "--columns",
        PLAIN),
    Row("but a sample has one time", converted(with_columns(t=LISTS, tick=pl.col("t")),
                                               name="log.parquet"), "--columns",
        PLAIN.replace("t=t", "t=tick", 1)),
    Row("--columns must name them", named_arrays, "--columns", "t=t,q=q,dq=dq"),
    Row("and no topic has one; leave it out", own_bag, "--columns", LEFT_OUT),
    Row("no estimates of", lambda f: [
        "admit", estimated(f, "--observer", "kfo-fe"), "--robot", "ur5", "--observer",
        "kfo-zoh"], "--observer", "kfo-fe"),
    Row("settle which arm it is of", lambda f: ["admit", estimated(f)], "--robot", "ur5"),
    Row("could each be the positions", arrays({"a/q": (99, 6), "b/q": (99, 6), "a/t": (99,)}),
        "--columns", "t=a/t,q=a/q"),
    Row("which has no torque", arrays({"obs/robot0_joint_pos": (99, 7), "obs/tau": (99, 7)}),
        "--columns", "t@20Hz,q=obs/robot0_joint_pos,tau=obs/tau"),
    Row("Add timestamp and actual_q", without_clock, "--columns"),
    Row("must count its", converted(same, "--columns", PLAIN, header=False), "--columns", COUNTED),
    Row("--columns describes", converted(same, "--columns", "t,q:6,dq:6", header=False),
        "--columns", "t,q:6,dq:6,_:6"),
    Row("no clock. Name its column", converted(renamed({"t": "tick"})), "--columns",
        PLAIN.replace("t=t", "t=tick", 1)),
    Row("no clock. Name its column", converted(renamed({"t": "tick"})), "--columns",
        "t@125Hz,q=q{i}"),
    Row("the two columns of the clock", converted(
        with_columns(secs=pl.col("t"), nsecs=0.5 + pl.col("t")), "--columns",
        PLAIN.replace("t=t", "t=secs|nsecs", 1)), "--columns", PLAIN),
    Row("Check --columns.", converted(same, "--columns", "t=t,q=q{i},dq=dq1|dq2"), "--columns",
        PLAIN),
    Row("columns without a header. Say what they are", converted(
        lambda table: table.select("t", "q1", "current1"), header=False), "--columns",
        "t,q:1,current:1"),
    Row("a table without a header. Say what its", judged(
        lambda table: table.select("t", pl.col("^current.$")), header=False),
        "--reference-columns", "t,tau_ext:6"),
    Row("which columns are the reference torques is unclear", judged(PULL), "--reference-columns",
        "t=t,tau_ext=pull{i}"),
    Row("The header was edited", edited_header, "log.format --columns",
        "t[ms]=time,q=" + "|".join(f"state.{'x' if j == 3 else 'q'}[{j}]" for j in range(7))),
    Row("--columns does not apply to", lambda f: [
        "convert", ur_binary(f / "log.bin"), "-o", "out.csv", "--columns", PLAIN], "--columns",
        LEFT_OUT),
    # readers: the clock
    Row("the clock restarts", converted(
        lambda table: pl.concat([table.with_columns(t=pl.col("t") - table["t"][0])] * 2)),
        "--columns"),
    Row("which no clock shows", converted(
        with_columns(t=(1e9 * pl.col("t")).round() + 1.7e18), "--columns",
        PLAIN.replace("t=t", "t[s]=t")), "--columns", PLAIN.replace("t=t", "t[ns]=t", 1)),
    Row("which no robot's log is", converted(
        with_columns(t=1e9 * pl.col("t")), "--columns", PLAIN.replace("t=t", "t[s]=t", 1)),
        "--columns", PLAIN.replace("t=t", "t[ns]=t", 1)),
    Row("the clock is coarser", converted(with_columns(t=pl.col("t").round(1))), "--columns",
        PLAIN.replace("t=t", "t@125Hz", 1)),
    # readers: which part of a file
    Row("no episode", lambda _: ["convert", EPISODES, "-o", "out.csv", "--episode", "9"],
        "--episode", "1"),
    Row("a log of one arm; leave --arm out", converted(same, "--arm", "left"), "--arm", LEFT_OUT),
    Row("holds two arms", arrays({"observations/qpos": (99, 14), "observations/qvel": (99, 14),
                                  "observations/effort": (99, 14)}), "--arm"),
    Row("--episode all is for commands", lambda _: [
        "convert", EPISODES, "-o", "out.csv", "--episode", "all"], "--episode", "1"),
    Row("leave --episode out.", converted(same, "--episode", "1"), "--episode", LEFT_OUT),
    Row("leave --episode out.", on(same, "compare", *GMO, "--reference", "zero", "--episode",
                                   "all"), "--episode", LEFT_OUT),
    Row("two arms were recorded", two_bags, "--columns"),
    Row("no external torques of", on(
        lambda table: with_jacobian(table).rename(lambda c: c.replace("tau_ext", "pull")),
        *BY_SENSOR), "--columns", "tau_ext=pull_{i}"),
    # robots
    Row("only joints that move by themselves", mimicking, "--tip"),
    Row("which payload was set", gripping, "--payload", "gripper"),
    Row("joints but robot", on(same, "estimate", "-o", "out", "--robot", "panda"), "--robot",
        "ur5"),
    Row("positions alone carry no force", on(
        lambda _: PULL(circle()), "identify", "-o", "my.toml", "--robot", "ur5"), "--columns",
        PLAIN.replace("=current", "=pull")),
    Row("the xacro needs", xacro, "--robot", "arm.urdf.xacro heavy:=1"),
    # signals
    Row("the log waits", on(
        lambda _: waiting(circle()), "identify", "-o", "my.toml", "--robot", "ur5"), "--interval",
        "0:15"),
    Row("leave --free out", lambda f: ["compare", written(f, same), *GMO, "--reference", "zero",
                                        "--free", written(f, same)], "--free", LEFT_OUT),
    Row("Record them, or name their columns with --columns….", on(
        renamed({"dq": "speed"}), "estimate", "-o", "out", *GMO, "--set",
        "log.derive=none"), "log.derive"),
    Row("so none of it can be", on(
        PULL, "inspect", "--robot", "ur5", "--set", "log.effort=current"),
        "--columns", PLAIN.replace("=current", "=pull")),
    # batch
    Row("the torques of one observer; give --observer once", annotated(
        "--observer", "gmo", "--observer", "kfo-zoh"), "--observer", "gmo"),
    Row("leave --interval and --episode out", annotated("--interval", "0:1"), "--interval",
        LEFT_OUT),
    Row("leave --interval and --episode out", annotated("--episode", "1"), "--episode", LEFT_OUT),
    Row("states no standard deviation", annotated("--add", "sd", "--observer", "gmo"), "--observer",
        "kfo-zoh"),
    Row("exists; give another -o, or --force", before(annotated("--observer", "gmo")), "--force",
        FLAG),
    Row("--force removes no other folder", lambda f: [
        "annotate", EPISODES, "-o", written(f, same).parent, "--robot", "panda", "--observer",
        "gmo"], "-o", "out"),
    # doctor
    Row("--anyway continues despite this.", on(
        with_columns(pl.col("^current.$") * 0.0), "estimate", "-o", "out", *GMO), "--anyway", FLAG),
    # the analysis
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
    Row("which looks like degrees", of(positions_in_degrees), "columns", "q[deg]=q{i}"),
    Row("Nothing is filled in", of(unknown_estimate, robot="panda"), "columns",
        "t=t,q=q{i},dq=dq{i},tau=tau{i}"),
    Row("never moves: all", of(lambda t: replace(t, t=0.0 * t.t)), "columns", "t@125Hz"),
    Row("no joint positions (q)", lambda f: renamed_columns(sound(), "q", "zz", f), "columns",
        "q=zz{i},dq=dzz{i}"),
    Row("no repetition found", cut(4.5, 9, *TWO), "free", free_log),
    Row("there is no Jacobian for it", cut(0, 4, *EST, "--frame", "tool"),
        "virtual-sensor.tool", "0,0,0.1"),
    Row("a release needs an arm", lambda _: ["admit", "--release", "x=0.3"], "robot", "ur5"),
]  # fmt: skip


def dropped(words: list[Any], option: str) -> list[Any]:
    """A command without an option or a setting, and its value."""
    left: list[Any] = []
    rest = list(words)
    while rest:
        word = rest.pop(0)
        if word == "--set" and rest and str(rest[0]).startswith(f"{option}="):
            rest.pop(0)
        elif word == named(option):
            del rest[: bool(rest) and not str(rest[0]).startswith("-")]
        else:
            left.append(word)
    return left


def mended(words: list[Any], refused: str, row: Row) -> list[Any]:
    """The command with the options that an error names, or without the one to leave out."""
    *others, last = row.option.split()
    for option in (*others, last):
        said, value = value_of(option, refused), row.value if option == last else ""
        words = dropped(words, option)
        if value is FLAG:
            words = [*words, named(option)]
        elif value is not LEFT_OUT:
            given = value(Path.cwd()) if callable(value) else value
            if option == "set" and "=VALUE" in said:
                given = said.replace("VALUE", given)
            words = [*words, *typed(option, given or said)]
    return words


def spoken(node: ast.AST) -> Iterator[str]:
    """The pieces of a text as they are written, `…` for a value."""
    for part in ast.iter_child_nodes(node):
        if isinstance(part, ast.FormattedValue):
            yield "…"
        elif isinstance(part, ast.Constant) and isinstance(part.value, str):
            yield part.value
        elif isinstance(part, ast.expr):
            yield from spoken(part)


BAG = FIXTURES / "panda_bag/panda_bag.mcap"
COMMANDS: dict[str, tuple[Command, tuple[Command, ...]]] = {
    "vftcli inspect LOG -o FILE writes one": (
        on(same, "inspect", "--config", "my.toml"),
        (on(same, "inspect", "-o", "my.toml"), on(same, "inspect", "--config", "my.toml")),
    ),
    "holds estimates, not what the drives measured": (
        lambda f: ["estimate", estimated(f), "--robot", "ur5", "-o", "out"],
        (lambda f: ["admit", f / "made" / "estimates.parquet", "--robot", "ur5"],),
    ),
    "of another log `vftcli estimate` writes": (
        on(same, "annotate", "-o", "out", "--robot", "ur5"),
        (on(same, "estimate", "-o", "out", *GMO),),
    ),
    "no observer can run on that": (
        on(with_jacobian, "estimate", "-o", "out"), (on(with_jacobian, *BY_SENSOR),),
    ),
    "not a table of text": (
        lambda _: ["inspect", BAG, "--set", "log.format=table"], (lambda _: ["inspect", BAG],),
    ),
}  # fmt: skip
"""Error that names a command → what it refuses, and the commands that it names."""


@pytest.mark.parametrize("text", COMMANDS)
def test_the_command_that_an_error_names_runs(text: str, tmp_path: Path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    refused, named = COMMANDS[text]
    code, said = printed(refused(tmp_path))
    assert code == 1
    assert text in said
    for command in named:
        code, after = printed(command(tmp_path))
        assert code == 0, after


@pytest.mark.slow
@pytest.mark.parametrize("row", ROWS, ids=lambda row: f"{row.code}-{row.option}")
def test_the_remedy_of_an_error_is_tried(row: Row, tmp_path: Path, monkeypatch) -> None:
    """A remedy on the command that it refused."""
    monkeypatch.chdir(tmp_path)
    words = row.command(tmp_path)
    code, refused = printed(words)
    assert code == (2 if "Error: " in refused else 1), refused
    for piece in row.code.split("…"):
        assert piece in refused
    error = refused[max(refused.find("error: "), 0) :]
    code, after = printed(mended(words, error, row))
    assert code == 0, after
    assert row.code not in after


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


WITHOUT_ROW = {
    "names only the option that is wrong, and what it may be": (
        "--columns is empty", "has no column name: name every signal",
        "is given twice. Skip the other", "--columns: no q; a log needs",
        "must be one whole number, from 1", "--columns: cannot understand", "--columns: no signal",
        ": _ only skips", "it must cover at least one", "a table without a clock is given as",
        "only _:* covers", "give it once", "--columns: … has no unit", "has no field",
        "is neither a number, as in 0, nor all", "--columns turns the sign of the clock",
        "names a column of … twice", "--tip …: ",
        "--reference-columns names no tau_ext", "is not a number or a list",
        "is no setting here; vftcli help settings lists all", "--set …=… is not ……",
        "no such admittance parameter. Sections", "--release … is not …", "--only names nothing",
        "rad; it must be less than 10 m and π", "holds no sample of the log",
        "is not a positive number of false alarms per hour",
        "--gains … is not …, a positive number", "--set … is not …",
        "is not a positive time in seconds",
        "is not a positive cutoff in Hz", "is no list of cycle numbers as",
        "names no cycle; they begin at 1", "is not a cutoff between 0 and",
        "is neither sensor nor …PATH", "is not a positive number or one per joint"),
    "says what does not go together or not here; what to do is the user's to say": (
        "is now --robot", "is what an MJCF gives its joints", "makes no use of …; leave it out",
        "takes one LOG; name free motion", "are not named as those of robot",
        "Say which: --set log.format=NAME.", "a load is found from one pair of logs",
        "--reference says where a log was touched", "of the wrench's options it takes only --zero",
        "is of an arm with … joints", "and --force does not overwrite that either"),
    "needs a dataset with other features than the fixture's, or another recording": (
        "no joint positions among", "the positions are of", "arm alone; leave --arm out",
        "--set log.derive=dq makes them", "gravity would be written as force",
        "a log at rest identifies no friction", "have a partner in the free run",
        "less than the period of", "no whole cycle of"),
    "needs a cluster, its certificates or an installation without Dask": (
        "add --set cluster.address=ADDRESS", "need Dask and cryptography", "is no address, as tcp",
        "leave --jobs out", "can run code as you", "workers need a certificate",
        "has no worker; start some"),
    "only Python gets as far; the command line refuses such a log or word first": (
        "samples are not finite; leave them out with --interval",
        "a free run must be of the same arm"),
    "its remark, or its command, is tried": (
        "no [observers.*] tables",),
    "tried in tests/cli/test_benchmark.py and tests/reproduction/test_manifest.py": (
        "--data …: there is no such folder", "--outside …: …", "is looked for, LOG one of"),
    "no log that provokes it is known": (
        "the fit of physical links did not settle", "equations for … unknowns",
        "or let --method base identify the links too"),
}  # fmt: skip
"""Why a text has no row, and words that only it has."""


def texts() -> set[str]:
    """Every text of an error; a value in it is `…`."""
    found = {form.remedy for form in FORMATS.values()}
    for path in Path(vftcli.__file__).parent.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            # A refusal of all rooms is one assignment, which each hands its remedy.
            again = isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "again"
            if again or isinstance(node, ast.Raise):
                found.add("".join(spoken(node)))
    return found


@pytest.mark.slow
def test_every_error_with_an_option_is_tried_or_says_why_not() -> None:
    every, tried = texts(), {row.code for row in ROWS} | COMMANDS.keys()
    reasons = {words for each in WITHOUT_ROW.values() for words in each}
    assert [words for words in tried | reasons if words not in " ".join(every)] == []
    for text in every:
        if re.search(r"--[a-z]|vftcli [a-z]|[a-z]\.[a-z_-]+=", text):
            kinds = [any(words in text for words in some) for some in (tried, reasons)]
            assert sum(kinds) == 1, text
