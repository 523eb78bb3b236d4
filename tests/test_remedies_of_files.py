"""Every remedy that an error text names, tried on the command that it refused.

Of the rooms that read files and options: cli, readers, robots, signals, batch, doctor. A row runs a
command that is refused, reads the option out of the refusal, and runs the command with it, or
without it where the refusal says to leave it out. A text that names an option or a command and has
no row needs a reason.
"""

import ast
import re
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import h5py
import numpy as np
import polars as pl
import pytest
from test_remedies import Command, free_log, printed, robot_file, sound

import vftcli

PACKAGE = Path(vftcli.__file__).parent
ROOMS = ("cli", "readers", "robots", "signals", "batch", "doctor")

FIXTURES = Path(__file__).parent.parent / "fixtures"
EPISODES, UR5 = FIXTURES / "panda_episodes", FIXTURES / "ur5_circle.csv"
PLAIN = "t=t,q=q{i},dq=dq{i},current=current{i}"
COUNTED = "t,q:6,dq:6,current:6"
LEFT_OUT, FLAG = None, True
"""The value of an option that the refusal says to leave out, and of one that takes none."""

Change = Callable[[pl.DataFrame], pl.DataFrame]


class Row(NamedTuple):
    """A remedy that is tried.

    Attributes:
        text: Words that only this error has.
        command: Makes what is refused in a folder, and the command that is refused.
        options: The options that the refusal names, one behind the other.
        value: What the user gives the last of them; "" for what the refusal says; a function makes
            a file.
    """

    text: str
    command: Command
    options: str
    value: str | bool | Callable[[Path], str] | None = ""


def frame() -> pl.DataFrame:
    """Two seconds of a sound log of a UR5: t, q1 …, dq1 …, current1 …."""
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
    """A conversion of an HDF5 file of these datasets, which hold a rising number."""

    def command(folder: Path) -> list[Any]:
        with h5py.File(folder / "log.hdf5", "w") as file:
            for name, shape in names.items():
                file[name] = np.linspace(0.0, 1.0, int(np.prod(shape))).reshape(shape)
        return ["convert", folder / "log.hdf5", "-o", "out.csv", *words]

    return command


def named_arrays(folder: Path) -> list[Any]:
    """A conversion of an .npz, its columns counted."""
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
    return ["convert", folder / "log.csv", "-o", "out.csv", "--format", "ur-csv"]


def on(log: Change, *words: Any) -> Command:
    """A command on a changed log of a UR5; `words` begin with its name."""
    return lambda folder: [words[0], written(folder, log), *words[1:]]


def estimated(folder: Path) -> Path:
    """What an estimate of the log writes."""
    made = printed(["estimate", written(folder, same), "--robot", "ur5", "--observer", "gmo",
                    "--no-contacts", "-o", folder / "made"])  # fmt: skip
    assert made[0] == 0, made[1]
    return folder / "made" / "estimates.parquet"


def judged(reference: Change, header: bool = True) -> Command:
    """A comparison with a table of torques."""
    return lambda f: [
        "compare", written(f, same), *GMO, "--reference",
        f"file:{written(f, reference, 'truth.csv', header)}"]  # fmt: skip


def annotated(*words: str) -> Command:
    return lambda _: ["annotate", EPISODES, "-o", "out", "--robot", "panda", *words]


def mimicking(folder: Path) -> list[Any]:
    """A description whose third joint follows its second."""
    text = (FIXTURES / "arm.urdf").read_text("utf-8")
    parts = text.split("</joint>")
    parts[2] += '<mimic joint="' + re.findall('<joint name="([^"]+)"', text)[1] + '"/>'
    (folder / "arm.urdf").write_text("</joint>".join(parts), encoding="utf-8")
    return ["robots", folder / "arm.urdf"]


def xacro(folder: Path) -> list[Any]:
    """A xacro that needs an argument: how heavy its first link is."""
    text = (FIXTURES / "arm.urdf").read_text("utf-8")
    text = re.sub("<robot ", '<robot xmlns:xacro="http://www.ros.org/wiki/xacro" ', text, count=1)
    text = re.sub('<mass value="[^"]*"', '<mass value="$(arg heavy)"', text, count=1)
    (folder / "arm.urdf.xacro").write_text(text, encoding="utf-8")
    return ["robots", folder / "arm.urdf.xacro"]


def gripping(folder: Path) -> list[Any]:
    """An examination with the log's payload, which the log does not say."""
    own = robot_file(folder, more="\n[payload.gripper]\nmass = 1.0\ncom = [0.0, 0.0, 0.05]\n")
    return ["inspect", written(folder, same), "--robot", own, "--payload", "log"]


def waiting(table: pl.DataFrame) -> pl.DataFrame:
    """A pause of a day in the middle."""
    half = table["t"][len(table) // 2]
    return table.with_columns(t=pl.col("t") + 86400.0 * (pl.col("t") > half))


GMO = ("--robot", "ur5", "--observer", "gmo")
RELEASE = ("admit", "--release", "x=0.3", "--robot", "ur5")
PULL = renamed({"current": "pull"})
LISTS = pl.concat_list(["t", "t"])

ROWS = [
    # cli
    Row("give one of LOG, --release", lambda _: ["admit", "--robot", "ur5"], "--release", "x=0.3"),
    Row("are of what -o DIR writes", lambda _: [*RELEASE, "--figures", "svg"], "-o", "out"),
    Row("choose one of --json and --latex", lambda _: [*RELEASE, "--json", "--latex"], "--latex",
        LEFT_OUT),
    Row("s force drives the replay", on(same, "admit", *GMO, "--observer", "kfo-zoh"),
        "--observer", "gmo"),
    Row("leave --frame away", on(same, "admit", *GMO, "--frame", "tool"), "--frame", LEFT_OUT),
    Row("--do compare needs --reference", on(same, "batch", *GMO, "--do", "compare", "-o", "out",
                                             "--workers", "0"), "--reference", "zero"),
    Row("--figures and -o DIR need each other", on(
        same, "compare", *GMO, "--reference", "zero", "--figures", "svg"), "-o", "out"),
    Row("leave --significance away", on(
        same, "compare", *GMO, "--reference", "zero", "--figures", "svg", "-o", "out",
        "--significance"), "--significance", LEFT_OUT),
    Row("choose one of --details, --quiet", converted(same, "--details", "--quiet"), "--quiet",
        LEFT_OUT),
    Row("choose one of --json, --csv", on(
        same, "contacts", "--robot", "ur5", "--json", "--csv"), "--csv",
        LEFT_OUT),
    Row("--derive dq belongs to an estimate", converted(same, "--derive", "dq"), "--derive",
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
    Row("Choose one with --observer.", lambda f: [
        "admit", estimated(f), "--robot", "ur5", "--observer", "kfo-zoh"], "--observer", "gmo"),
    Row("could each be the positions", arrays({"a/q": (99, 6), "b/q": (99, 6), "a/t": (99,)}),
        "--columns", "t=a/t,q=a/q"),
    Row("laid out as", arrays({"obs/robot0_joint_pos": (99, 7), "qp_arm": (99, 7), "time": (99,),
                               "qv_arm": (99, 7)}), "--columns", "t=time,q=qp_arm,dq=qv_arm"),
    Row("no timestamp among", without_clock, "--format --columns"),
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
    Row("the reference torques cannot be told", judged(PULL), "--reference-columns",
        "t=t,tau_ext=pull{i}"),
    # readers: the clock
    Row("the clock starts anew", converted(
        lambda table: pl.concat([table.with_columns(t=pl.col("t") - table["t"][0])] * 2)),
        "--columns"),
    Row("which no clock shows", converted(
        with_columns(t=(1e9 * pl.col("t")).round() + 1.7e18), "--columns",
        PLAIN.replace("t=t", "t[s]=t")), "--columns", PLAIN.replace("t=t", "t[ns]=t", 1)),
    Row("which no robot's log is", converted(
        with_columns(t=1e9 * pl.col("t")), "--columns", PLAIN.replace("t=t", "t[s]=t", 1)),
        "--columns", PLAIN.replace("t=t", "t[ns]=t", 1)),
    Row("the clock is coarser than the samples", converted(
        with_columns(t=pl.col("t").round(1))), "--columns", PLAIN.replace("t=t", "t@125Hz", 1)),
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
    # robots
    Row("only joints that move by themselves", mimicking, "--tip"),
    Row("which payload the controller", gripping, "--payload", "gripper"),
    Row("joints but robot", on(same, "estimate", "-o", "out", "--robot", "panda"), "--robot",
        "ur5"),
    Row("positions alone carry no force", on(PULL, "estimate", "-o", "out", *GMO), "--columns",
        PLAIN.replace("=current", "=pull")),
    Row("the xacro needs", xacro, "--robot-arg", "heavy=1"),
    Row("the xacro takes no argument", lambda f: [*xacro(f), "--robot-arg", "heavi=1"],
        "--robot-arg", "heavy=1"),
    # signals
    Row("the log waits", on(waiting, "estimate", "-o", "out", *GMO, "--anyway"), "--interval",
        "0:0.9"),
    Row("leave --free away", lambda f: ["compare", written(f, same), *GMO, "--reference", "zero",
                                        "--free", written(f, same)], "--free", LEFT_OUT),
    Row("Record them, or name their columns with --columns….", on(
        renamed({"dq": "speed"}), "estimate", "-o", "out", *GMO, "--derive", "none"), "--derive"),
    Row("so none of it can be", on(PULL, "inspect", "--robot", "ur5", "--effort", "current"),
        "--columns", PLAIN.replace("=current", "=pull")),
    # batch
    Row("the torques of one observer; give --observer once", annotated(
        "--observer", "gmo", "--observer", "kfo-zoh"), "--observer", "gmo"),
    Row("leave --interval and --episode out", annotated("--interval", "0:1"), "--interval",
        LEFT_OUT),
    Row("leave --interval and --episode out", annotated("--episode", "1"), "--episode", LEFT_OUT),
    Row("states no standard deviation", annotated("--sd", "--observer", "gmo"), "--observer",
        "kfo-zoh"),
    # doctor
    Row("With --anyway it goes on all the same.", on(
        with_columns(pl.col("^current.$") * 0.0), "estimate", "-o", "out", *GMO), "--anyway", FLAG),
]  # fmt: skip


def mended(words: list[Any], refused: str, row: Row) -> list[Any]:
    """The command with the options that the refusal names, or without the one to leave out."""
    for option in row.options.split():
        found = re.search(rf"{option}(?![-a-z])(?:[ =]('[^']+'|[^\s,;)]+))?", refused)
        assert found is not None, refused
        value = row.value(Path.cwd()) if callable(row.value) else row.value
        if value == "":
            value = (found[1] or "").rstrip(".:").strip("'")
        while option in words:
            at = words.index(option)
            takes = len(words) > at + 1 and not str(words[at + 1]).startswith("-")
            words = [*words[:at], *words[at + 1 + takes :]]
        if value is not None:
            words = [*words, option, *([] if value is FLAG else [value])]
    return words


@pytest.mark.parametrize("row", ROWS, ids=lambda row: f"{row.text}-{row.options}")
def test_the_remedy_of_an_error_is_tried(
    row: Row, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    words = row.command(tmp_path)
    code, refused = printed(words)
    assert code in {1, 2}
    for piece in row.text.split("…"):
        assert piece in refused
    code, after = printed(mended(words, refused, row))
    assert code == 0, after


NOT_YET = "no row yet"
NAMED = "only names the option that is wrong, and what it may be"
WITHOUT_ROW = {
    NAMED: (
        ": too large for a file of options",
        ": not a text in UTF-8",
        "--config …: …",
        "--columns is empty",
        "has no column name while others have one",
        "is given twice. Skip the other",
        "--columns: no q; a log needs",
        "must be one whole number, from 1",
        "--columns: cannot understand",
        "--columns: no signal",
        ": _ only skips",
        "it must cover at least one",
        "a table without a clock is given as",
        "--columns: … has no unit",
        "has no field",
        "is neither a number, as in 0, nor all",
        "--columns turns the sign of the clock",
        "names a column of … twice",
        "is no address, as tcp",
        "--tip …: ",
        "--reference-columns names no tau_ext",
        "is for a xacro, which this is not",
    ),
    NOT_YET: (
        "give one of LOG, --release",
        "are of what -o DIR writes",
        "choose one of --json and --latex",
        "s force drives the replay",
        "leave --frame away",
        "choose one of --sensor and --truth",
        "holds still over a span",
        "the closed loop runs",
        "--do compare needs --reference",
        "--figures and -o DIR need each other",
        "leave --significance away",
        "and none ran",
        "vftcli init LOG writes one",
        "choose one of --details, --quiet",
        "choose one of --json, --csv",
        "--derive dq belongs to an estimate",
        "a load is found from one pair of logs",
        "free motion to identify the arm from",
        "`vftcli report LOG -o DIR` writes both",
        "--reference says where a log was touched",
        "two columns could be",
        "could both be",
        "with holes. Name them",
        "holds no number in its first row",
        "could each be the clock",
        "but a sample has one time",
        "--columns must name them",
        "and no topic has one; leave it out",
        "two arms were recorded",
        "the clock starts anew",
        "which no clock shows",
        "the clock stands still",
        "which no robot's log is",
        "the clock is coarser than the samples",
        "which looks like degrees",
        "Choose one with --observer.",
        "holds estimates, not what the drives measured",
        "could each be the positions",
        "laid out as",
        "no external torques of",
        "no joint positions among",
        "the positions are of",
        "The header was edited",
        "no episode",
        "arm alone; leave --arm out",
        "holds two arms",
        "a log of one arm; leave --arm out",
        "--episode all is for commands",
        "leave --episode out.",
        "--columns does not apply to",
        "Say which with --format.",
        "a table without a header. Say what its",
        "the reference torques cannot be told",
        "no timestamp among",
        "must count its",
        "--columns describes",
        "no clock. Name its column",
        "the two columns of the clock",
        "no observer can run on that",
        "no joint positions (q) among",
        "Check --columns.",
        "columns without a header. Say what they are",
        "only joints that move by themselves",
        "which payload the controller",
        "joints but robot",
        "positions alone carry no force",
        "do not tell those of robot",
        "is what an MJCF gives its joints",
        "the xacro takes no argument",
        "the xacro needs",
        "the xacro cannot be expanded",
        "the log waits",
        "leave --free away",
        "Record them, or name their columns with --columns….",
        "so none of it can be",
        "leave --ship out",
        "the torques of one observer; give --observer once",
        "leave --interval and --episode out",
        "--derive dq makes them",
        "gravity would be written as force",
        "states no standard deviation",
        "add --scheduler ADDRESS",
        "need Dask and cryptography",
        "(all three) belong together",
        "leave --workers out",
        "are given together",
        "can run code as you",
        "workers need a certificate",
        "no Dask scheduler answers",
        "has no worker; start some",
        "send the logs there with --ship",
        "of another log `vftcli estimate` writes",
        "exists; give another -o, or --force",
        "--force removes no other folder",
        "cannot be mended: leave out --causal",
        "With --anyway it goes on all the same.",
    ),
}
"""Why a text has no row, and words that only it has."""


@cache
def texts() -> dict[str, str]:
    """Every text of a raise that names an option or a command; a value in it is `…`."""
    found = {}
    for room in ROOMS:
        for path in sorted((PACKAGE / room).rglob("*.py")):
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                if isinstance(node, ast.Raise) and node.exc is not None:
                    text = "".join(spoken(node.exc))
                    if re.search(r"--[a-z]|vftcli [a-z]", text):
                        found[f"{path.relative_to(PACKAGE)}:{node.lineno}"] = text
    return found


def spoken(node: ast.expr) -> Iterator[str]:
    """The pieces of a text as they are written, `…` for a value."""
    for part in ast.iter_child_nodes(node):
        if isinstance(part, ast.FormattedValue):
            yield "…"
        elif isinstance(part, ast.Constant) and isinstance(part.value, str):
            yield part.value
        elif isinstance(part, ast.expr):
            yield from spoken(part)


def test_every_text_with_an_option_is_tried_or_says_why_not() -> None:
    reasons = [words for each in WITHOUT_ROW.values() for words in each]
    wrong = []
    for place, text in texts().items():
        by = [words for words in reasons if words in text]
        if len(by) != 1:
            wrong.append(f"{place}: {text!r} has {by}")
    unused = [words for words in reasons if not any(words in text for text in texts().values())]
    assert not wrong, "\n".join(wrong)
    assert not unused
