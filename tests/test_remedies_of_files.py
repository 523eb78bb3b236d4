"""Every remedy that an error text names, tried on the command that it refused.

Of the rooms that read files and options: cli, readers, robots, signals, batch, doctor. A row runs a
command that is refused, reads the option out of the refusal, and runs the command with it, or
without it where the refusal says to leave it out. A text that names an option or a command and has
no row needs a reason.
"""

import ast
from pathlib import Path

import polars as pl
import pytest
from refused_commands import (
    COUNTED,
    EPISODES,
    GMO,
    LISTS,
    PLAIN,
    PULL,
    RELEASE,
    UR5,
    annotated,
    arrays,
    circle,
    converted,
    edited_header,
    estimated,
    gripping,
    judged,
    mimicking,
    named_arrays,
    on,
    own_bag,
    renamed,
    same,
    short_scenario,
    two_bags,
    two_copies,
    waiting,
    with_columns,
    with_jacobian,
    without_clock,
    written,
    xacro,
)
from seed_logs import ur_binary
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
    spoken,
)

import vftcli
from vftcli.readers.reading import FORMATS

ROOMS = ("cli", "readers", "robots", "signals", "batch", "doctor", "answering.py",
         "admittance/closed_loop.py")  # fmt: skip

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
    Row("leave --frame away", on(same, "admit", *GMO, "--frame", "tool"), "--frame", LEFT_OUT),
    Row("holds still over a span", lambda f: [
        "admit", short_scenario(f), "--zero", "start"], "--zero", "0:1"),
    Row("the closed loop runs", lambda f: [
        "admit", short_scenario(f), "--observer", "gmo"], "--observer",
        "kfo-zoh"),
    Row("--do compare needs --reference", on(same, "batch", *GMO, "--do", "compare", "-o", "out",
                                             "--jobs", "0"), "--reference", "zero"),
    Row("--figures and -o DIR need each other", on(
        same, "compare", *GMO, "--reference", "zero", "--figures", "svg"), "-o", "out"),
    Row("choose one of --details, --quiet", converted(same, "--details", "--quiet"), "--quiet",
        LEFT_OUT),
    Row("choose one of --json, --csv", on(
        same, "contacts", "--robot", "ur5", "--json", "--csv"), "--csv",
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
    Row("could each be the positions", arrays({"a/q": (99, 6), "b/q": (99, 6), "a/t": (99,)}),
        "--columns", "t=a/t,q=a/q"),
    Row("which hold no torque", arrays({"obs/robot0_joint_pos": (99, 7), "obs/tau": (99, 7)}),
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
    Row("leave --free away", lambda f: ["compare", written(f, same), *GMO, "--reference", "zero",
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
    Row("With --anyway it goes on all the same.", on(
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
        (lambda f: ["contacts", f / "made" / "estimates.parquet"],
         lambda f: ["admit", f / "made" / "estimates.parquet", "--robot", "ur5"]),
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
        "is now --robot", "is what an MJCF gives its joints", "makes no use of …; leave it away",
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
        "--data …: there is no such folder", "benchmark speed has --json",
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
