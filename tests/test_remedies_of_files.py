"""Every remedy that an error text names, tried on the command that it refused.

Of the rooms that read files and options: cli, readers, robots, signals, batch, doctor. A row runs a
command that is refused, reads the option out of the refusal, and runs the command with it, or
without it where the refusal says to leave it out. A text that names an option or a command and has
no row needs a reason.
"""

import ast
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import polars as pl
import pytest
from seed_logs import libfranka_csv, ur_binary
from test_remedies import (
    FIXTURES,
    FLAG,
    LEFT_OUT,
    Command,
    Row,
    check_error,
    free_log,
    printed,
    raised,
    robot_file,
    sound,
    spoken,
)
from test_topics import ALPHABETICAL, ur_message, write_joint_states

import vftcli
from vftcli.readers.reading import FORMATS

ROOMS = ("cli", "readers", "robots", "signals", "batch", "doctor", "answering.py",
         "admittance/closed_loop.py")  # fmt: skip

EPISODES, UR5 = FIXTURES / "panda_episodes", FIXTURES / "ur5_circle.csv"
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
    table = pl.read_csv(UR5, separator=" ").head(250).drop("timestamp")
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


def two_copies(folder: Path) -> list[Any]:
    """A copy of a dataset with forces, where there is one."""
    words = annotated("--observer", "gmo")(folder)
    assert printed(words)[0] == 0
    return words


GMO = ("--robot", "ur5", "--observer", "gmo")
RELEASE = ("admit", "--release", "x=0.3", "--robot", "ur5")
PULL = renamed({"current": "pull"})
LISTS = pl.concat_list(["t"] * 3)
BY_SENSOR = "compare", "--reference", "sensor", "--wrench"

ROWS = [
    # cli
    Row("give one of LOG, SCENARIO, --release", lambda _: ["admit", "--robot", "ur5"],
        "--release", "x=0.3"),
    Row("are of what -o DIR writes", lambda _: [*RELEASE, "--figures", "svg"], "-o", "out"),
    Row("choose one of --json and --latex", lambda _: [*RELEASE, "--json", "--latex"], "--latex",
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
    Row("--figures and -o DIR need each other", on(
        same, "compare", *GMO, "--reference", "zero", "--figures", "svg"), "-o", "out"),
    Row("choose one of --details, --quiet", converted(same, "--details", "--quiet"), "--quiet",
        LEFT_OUT),
    Row("choose one of --json, --csv", on(same, "contacts", *GMO[:2], "--json", "--csv"), "--csv",
        LEFT_OUT),
    Row("--set log.derive=dq belongs to an estimate", converted(same, "--set", "log.derive=dq"),
        "log.derive", LEFT_OUT),
    Row("free motion to identify the arm from", lambda f: [
        "identify", UR5, "-o", "my.toml", "--robot", "ur5", "--free", free_log(f)], "--free",
        LEFT_OUT),
    # readers: which column is which
    Row("two columns could be", converted(with_columns(q_1=pl.col("q1"))), "--columns", PLAIN),
    Row("could both be", converted(with_columns(pl.col("^dq.$").name.replace("dq", "qd"))),
        "--columns", PLAIN),
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
    Row("exists; give another -o, or --force", two_copies, "--force", FLAG),
    Row("--force removes no other folder", lambda f: [
        "annotate", EPISODES, "-o", written(f, same).parent, "--robot", "panda", "--observer",
        "gmo"], "-o", "out"),
    # doctor
    Row("--anyway continues despite this.", on(
        with_columns(pl.col("^current.$") * 0.0), "estimate", "-o", "out", *GMO), "--anyway", FLAG),
]  # fmt: skip


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
    monkeypatch.chdir(tmp_path)
    check_error(row, tmp_path)


NOTHING = "says what does not go together; what to do depends on the files of the user"
ELSEWHERE = "tried in tests/test_remedies.py"
DATASET = "needs a dataset with other features than the fixture's"
CLUSTER = "needs a cluster, its certificates or an installation without Dask"
NAMED = "only names the option that is wrong, and what it may be"
WITHOUT_ROW = {
    NAMED: (
        "--columns is empty", "has no column name: name every signal",
        "is given twice. Skip the other", "--columns: no q; a log needs",
        "must be one whole number, from 1", "--columns: cannot understand", "--columns: no signal",
        ": _ only skips", "it must cover at least one", "a table without a clock is given as",
        "only _:* covers", "give it once",
        "--columns: … has no unit", "has no field", "is neither a number, as in 0, nor all",
        "--columns turns the sign of the clock", "names a column of … twice",
        "--tip …: ", "--figures … is not … or …", "--reference-columns names no tau_ext",
        "is not a number or a list", "is no setting here; vftcli help settings lists all",
        "--set …=… is not ……",
    ),
    NOTHING: (
        "is now --robot", "is what an MJCF gives its joints", "makes no use of …; leave it out",
        "takes one LOG; name free motion",
        "are not named as those of robot", "Say which: --set log.format=NAME.",
    ),
    ELSEWHERE: (
        "a load is found from one pair of logs", "--reference says where a log was touched",
        "the clock never moves", "which looks like degrees", "no joint positions (q) among",
    ),
    DATASET: (
        "no joint positions among", "the positions are of", "arm alone; leave --arm out",
        "--set log.derive=dq makes them", "gravity would be written as force",
    ),
    CLUSTER: (
        "add --set cluster.address=ADDRESS", "need Dask and cryptography", "is no address, as tcp",
        "leave --jobs out",
        "can run code as you", "workers need a certificate",
        "has no worker; start some",
    ),
    "tried in tests/test_remedies_of_analysis.py": ("or take it all with --anyway",),
    "tried in tests/cli/test_benchmark.py": (
        "--data …: there is no such folder",
    ),
}  # fmt: skip
"""Why a text has no row, and words that only it has."""


def texts() -> dict[str, str]:
    """Every text that names an option or a command; a value in it is `…`."""
    found = {f"formats: {name}": form.remedy for name, form in FORMATS.items() if form.remedy}
    # A refusal of all rooms, which each hands its remedy.
    source = (Path(vftcli.__file__).parent / "free_motion/free_motion.py").read_text("utf-8")
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "again":
            found["refuse_repeated_logs"] = "".join(spoken(node))
    return found | raised(ROOMS)


@pytest.mark.slow
def test_every_text_with_an_option_is_tried_or_says_why_not() -> None:
    known = texts()
    tried = {row.code for row in ROWS} | COMMANDS.keys()
    reasons = {words for each in WITHOUT_ROW.values() for words in each}
    assert not tried & reasons
    for place, text in known.items():
        by = [words for words in tried | reasons if words in text]
        assert len(by) == 1, f"{place}: {text!r} has {by}"
    spoken_of = " ".join(known.values())
    assert not [words for words in tried | reasons if words not in spoken_of]
