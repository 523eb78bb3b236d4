"""The examination in every command, and bad input in one line.

The log is the UR5 fixture (its truth is known, so it is sound); the fault is its currents turned.
"""

import json
import os
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from example_logs import BEARING, CIRCLE

# The examination in every command: a health line, refusal, --anyway, and what outputs carry.

UR5 = ("--robot", "ur5")
COMMANDS: dict[str, tuple[str, ...]] = {
    "estimate": (*UR5, "--observer", "gmo", "-o", "out"),
    "compare": (*UR5, "--observer", "gmo", "--reference", f"file:{CIRCLE}.truth.parquet"),
    "report": (*UR5, "--observer", "gmo", "-o", "out"),
    "identify --method gains": (*UR5, "--free", "0:4", "-o", "gains.toml"),
    "admit": UR5,
    "identify": (*UR5, "-o", "mine.toml"),
}
"""Command that a fault refuses → what else it is given."""
pytestmark = pytest.mark.usefixtures("here")


@pytest.fixture
def turned(here: Path) -> str:
    """The fixture with its currents turned, in the folder that the commands run in."""
    table = pl.read_csv(CIRCLE, separator=" ")
    currents = -pl.col("^actual_current_.$")
    table.with_columns(currents).write_csv(here / "turned.csv", separator=" ")
    return "turned.csv"


@pytest.mark.slow
@pytest.mark.parametrize("command", [*COMMANDS, "convert"])
def test_a_sound_log_is_said_to_be_sound(command: str, ran) -> None:
    words = COMMANDS.get(command, ("-o", "other.csv"))
    out, err = ran(*command.split(), CIRCLE, *words, "--json", "-v")
    assert "log health: sound" in err.splitlines()
    # the short recipe has none, and the UR5's friction follows them where a command models the log
    assert err.count("no joint temperatures") == (command != "convert")
    json.loads(out)


def test_a_log_with_temperatures_is_modelled_by_them(ran) -> None:
    """At 35 °C, where the profile stands, the estimate is that without; in the cold it is not."""
    table = pl.read_csv(CIRCLE, separator=" ").head(500)
    estimates = {}
    for name, temperatures in (("untold", []), ("warm", 6 * [35.0]), ("cold", 6 * [25.0])):
        columns = {f"joint_temperatures_{j}": pl.lit(x) for j, x in enumerate(temperatures)}
        table.with_columns(**columns).write_csv(f"{name}.csv", separator=" ")
        err = ran("estimate", f"{name}.csv", *COMMANDS["estimate"], "--force", "-v")[1]
        assert ("no joint temperatures" in err) is (name == "untold")
        estimates[name] = pl.read_parquet("out/estimates.parquet")
    assert estimates["warm"].equals(estimates["untold"])
    assert not estimates["cold"].equals(estimates["untold"])


@pytest.mark.slow
@pytest.mark.parametrize("command", COMMANDS)
def test_a_meaningless_log_is_one_line_and_nothing_is_written(command, turned, refused, here):
    line = refused(*command.split(), turned, *COMMANDS[command])
    assert "effort-sign" in line
    assert "--anyway" in line
    assert [file.name for file in here.iterdir()] == [turned]


# identify has a guard of its own: links that explain nothing make no robot.
@pytest.mark.slow
@pytest.mark.parametrize("command", sorted(COMMANDS.keys() - {"identify"}))
def test_anyway_goes_on_and_says_so_first(command: str, turned: str, ran) -> None:
    err = ran(*command.split(), turned, *COMMANDS[command], "--anyway")[1]
    lines = err.splitlines()
    (doubt,) = [line for line in lines if line.startswith("MEANINGLESS")]
    assert "effort-sign" in doubt
    assert any("log health: " in line and "effort-sign" in line for line in lines)


@pytest.mark.slow
def test_every_output_of_a_report_carries_what_was_overridden(turned, ran, here: Path) -> None:
    truth = f"file:{CIRCLE}.truth.parquet"
    words = ("--reference", truth, "--observer", "gmo", "-o", "out", "--anyway")
    ran("report", turned, *UR5, *words)
    out = here / "out"
    record = json.loads((out / "run.json").read_text("utf-8"))
    (examined,) = record["examination"]
    assert examined["overridden"] == ["effort-sign"]
    assert not examined["sound"]
    finding = next(f for f in examined["findings"] if f["code"] == "effort-sign")
    assert finding["level"] == "warning"
    assert finding["values"]
    page = (out / "index.html").read_text("utf-8")
    assert page.index("MEANINGLESS") < page.index("Errors against the reference")
    assert (out / "errors.md").read_text("utf-8").startswith("> **MEANINGLESS")
    assert (out / "errors.tex").read_text("utf-8").startswith("% MEANINGLESS")
    rows = json.loads((out / "errors.json").read_text("utf-8"))
    table = pl.read_csv(out / "errors.csv")
    assert [row["rmse_Nm"] for row in rows] == table["rmse_Nm"].to_list()
    assert [row["overridden"] for row in rows] == ["effort-sign"] * 6 == [*table["overridden"]]
    assert "effort-sign" in pl.read_parquet_metadata(out / "estimates.parquet")["vftcli"]


def test_an_open_effort_heals_the_log(turned: str, run, ran) -> None:
    words = ("--observer", "gmo", "--set", "log.effort=auto", "-o", "out", "--json")
    out = ran("estimate", turned, *UR5, *words)[0]
    record = json.loads(out)
    assert record["examination"][0]["overridden"] == []
    assert "effort-used" in [repair["code"] for repair in record["repairs"]]
    healed = pl.read_parquet("out/estimates.parquet")
    run("estimate", CIRCLE, *UR5, "--observer", "gmo", "-o", "plain")
    plain = pl.read_parquet("plain/estimates.parquet")
    assert healed.equals(plain)


def test_free_runs_are_examined_too_and_reported_by_name(turned: str, refused) -> None:
    words = ("--observer", "gmo", "--free", turned, "-o", "out")
    assert "turned.csv: effort-sign" in refused("estimate", CIRCLE, *UR5, *words)


def test_inspect_examines_the_users_own_arm(turned: str, ran) -> None:
    out = ran("inspect", turned, *UR5, "--json")[0]
    assert "effort-sign" in [finding["code"] for finding in json.loads(out)["findings"]]


# Bad input: one line on stderr, exit 1 or 2, no traceback, and no partial output left.


def table(rows: int = 400) -> list[list[str]]:
    """A headerless log t, q, dq, current as rows of cells."""
    t = np.arange(rows) * 0.008
    angle = t[:, None] + np.arange(6)
    values = np.column_stack([t, np.sin(angle), np.cos(angle), 0.5 * np.ones((rows, 6))])
    return [[f"{v:.6f}" for v in row] for row in values]


def saved(path: Path, rows: list[list[str]], end: str = "\n") -> Path:
    path.write_text("\n".join(",".join(row) for row in rows) + end, encoding="utf-8")
    return path


def sound(folder: Path, every: int = 1) -> Path:
    return saved(folder / "log.csv", table()[::every])


def changed(folder: Path, rows: range, column: int, text: str) -> Path:
    """A log with other text in some cells of a column."""
    cells = table()
    for row in rows:
        cells[row][column] = text
    return saved(folder / "log.csv", cells)


def noise(folder: Path) -> Path:
    (folder / "noise.csv").write_bytes(np.random.default_rng(0).bytes(5000))
    return folder / "noise.csv"


COLUMNS, SOME = "t,q:6,dq:6,current:6", range(200, 201)
CASES: dict[str, tuple[Callable[[Path], Path], str, str]] = {
    "empty file": (lambda d: saved(d / "log.csv", [], end=""), COLUMNS, "empty"),
    "folder": (lambda d: d, COLUMNS, ""),
    "no such file": (lambda d: d / "nothing.csv", COLUMNS, "nothing.csv"),
    "unknown signal described": (sound, "t,q:6,speed:6,current:6", "--columns"),
    "missing current": (sound, "t,q:6,dq:6,_:6", "no motor currents"),
    # At 125 Hz they would be derived from the positions, and that be said.
    "missing velocity": (lambda d: sound(d, 5), "t,q:6,_:6,current:6", "no joint velocities"),
    "all-NaN column": (lambda d: changed(d, range(400), 14, "nan"), COLUMNS, "current of joint 2"),
    "NaN in the middle": (lambda d: changed(d, SOME, 3, "nan"), COLUMNS, "q of joint 3"),
    "time backwards": (lambda d: changed(d, SOME, 0, "0.5"), COLUMNS, "backwards"),
    "one sample": (lambda d: saved(d / "log.csv", table(rows=1)), COLUMNS, "samples is 1"),
    "letters in a number": (lambda d: changed(d, SOME, 3, "abc"), COLUMNS, ""),
    "binary noise": (noise, COLUMNS, "a binary file of no kind that is known"),
    "blank lines": (lambda d: saved(d / "log.csv", [[""]] * 3), COLUMNS, "a text of blank lines"),
}  # fmt: skip


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("command", ["estimate", "report", "compare"])
def test_a_bad_log_is_one_line(tmp_path: Path, refused, case: str, command: str) -> None:
    make, columns, words = CASES[case]
    inside = tmp_path / "in"
    inside.mkdir()
    log, out = make(inside), tmp_path / "out"
    more = ["--reference", "zero"] if command == "compare" else ["-o", out]
    assert words in refused(command, log, "--robot", "ur5", "--columns", columns, *more)
    assert not out.exists()


def test_a_column_of_a_known_format_that_is_there_twice_is_not_chosen_from(tmp_path, refused):
    head, *rows = CIRCLE.read_text().splitlines()
    text = [f"{head} actual_q_0", *(f"{row} 1.0" for row in rows), ""]
    (tmp_path / "log.csv").write_text("\n".join(text))
    said = refused("inspect", tmp_path / "log.csv")
    assert "2 columns are called 'actual_q_0'" in said
    assert "recipe" not in said  # nothing is missing


def test_a_cut_last_row_is_dropped_and_said(tmp_path: Path, ran) -> None:
    log = saved(tmp_path / "log.csv", [*table(), ["3.2", "0.1"]], end="")
    words = ("--robot", "ur5", "--columns", COLUMNS, "-o", tmp_path / "out", "--details")
    stderr = ran("estimate", log, *words)[1]
    assert "last" in stderr
    assert "400 samples" in stderr


@pytest.mark.parametrize("samples", [2, 3])
def test_an_arm_that_jumps_in_a_few_samples_is_no_motion_to_fit(tmp_path, ran, samples):
    """Samples 12 s apart, the errors of the doctor overruled: time enough, samples too few."""
    rows = [[12.0 * k, *[0.5 * k] * 6, *[0.1] * 6, *[0.0] * 6] for k in range(samples)]
    log = saved(tmp_path / "log.csv", [[str(x) for x in row] for row in rows])
    words = ("--robot", "ur5", "--columns", "t,q:6,dq:6,current:6", "--anyway", "--details")
    stderr = ran("estimate", log, *words, "-o", tmp_path / "out")[1]
    assert "too few samples" in " ".join(stderr.split())


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_an_unwritable_folder_is_one_line(tmp_path: Path, refused) -> None:
    locked = tmp_path / "locked"
    locked.mkdir(mode=0o500)
    refused("estimate", CIRCLE, "--robot", "ur5", "-o", locked / "out")


def test_an_output_that_is_a_file_is_one_line(tmp_path: Path, refused) -> None:
    taken = tmp_path / "taken"
    taken.write_text("a file")
    for place, said in ((taken, "is a file"), (taken / "below", "cannot be written")):
        assert said in refused("estimate", CIRCLE, *UR5, "-o", place)
    assert taken.read_text() == "a file"


@pytest.mark.slow
def test_a_name_with_markup_stays_text(tmp_path: Path, run) -> None:
    log = tmp_path / "<script>alert(1)<.csv"
    shutil.copy(CIRCLE, log)
    assert run("report", log, "--robot", "ur5", "-o", tmp_path / "out")[0] == 0
    assert "<script>alert" not in (tmp_path / "out" / "index.html").read_text()


PANDA = ("admit", BEARING, "--robot", "panda")
RELEASE = ("admit", "--release", "x=0.3", "--robot", "ur5")
IDENTIFY = ("identify", "log.csv", "--robot", "ur5", "-o", "r.toml")
ZERO = ("compare", CIRCLE, *UR5, "--reference", "zero")
ESTIMATES = ("batch", CIRCLE, "-o", "out", "--do", "estimate")
SIMULATED = ("simulate", "ur5-circle", "-o")

REFUSED: tuple[tuple[tuple[object, ...], str, str], ...] = (
    (ZERO, "--robot pnada", "Did you mean panda?"),
    (ZERO, "--observer gmoo", "Did you mean gmo?"),
    (ZERO, "--set gmo.gain=-3", "gmo.gain is [-3.0, "),
    (ZERO, "--set gmo.gain=much", "is not a number or a list"),
    (ZERO, "--set fdo.omega=-3", "fdo.omega is -3 rad/s; it must be positive"),
    (ZERO, "--set gmo.gain=1,2", "one for each of 6"),
    (ZERO, "--set kfo.noise_convention=white", "there is density"),
    (ZERO, "--interval 100:200", "the log runs from 0 to"),
    (ZERO, "--reference vendor", "no vendor estimates"),
    (ZERO, "--reference file:nowhere.csv", "nowhere.csv"),
    (ZERO, "--free 100:200", "holds 0 of its"),
    (ZERO, "--free 5:2", "interval '5:2' is not A:B with A < B"),  # and no name of a file
    (ZERO, "--free 3:3", "interval '3:3' is not A:B with A < B"),
    (RELEASE, "--set position.mass=0", "mass of axis x is 0"),
    (RELEASE, "--set foo.mass=3", "--set foo.mass is no setting here"),
    (RELEASE, "--set period=0.5", "= 4.25 must be below 4"),
    (RELEASE, "--set admittance.start=0,0,0,0,0,7", "is outside the joint limits"),
    (RELEASE, "--set admittance.threshold_mode=firm", "there is hard, soft"),
    (RELEASE, "--release w=1", "axis of x, y, z, rx, ry, rz"),
    (PANDA, "--set admittance.force=sensor", "wrench"),
    (PANDA, "--observer gmo --observer fdo", "give --observer once"),
    (PANDA, "--set admittance.force=x", "is neither sensor nor file:PATH"),
    (("admit",), "ur5-dragg", "ur5-drag"),
    (("batch", "-o", "out"), "nothing/*.csv --do estimate", "no log"),
    (("batch", CIRCLE, "-o", "out"), "--do dance", "estimate, compare, report, contacts"),
    (ESTIMATES, "--robot ur55", "ur55"),
    (ESTIMATES, "--robot ur5 --payload cup", "cup"),
    (("simulate",), "ur5-cirle -o x.csv", "Did you mean ur5-circle"),
    (SIMULATED, "none/x.csv", "no such folder"),
    (SIMULATED, ".", "-o"),
    (SIMULATED, "x.csv --as csv", "log format 'csv'"),
    # Nothing is left out without a word: --free without a payload had no effect.
    (IDENTIFY, "--free other.csv", "is the motion without the load that --method payload seeks"),
    (IDENTIFY, "--method payload --free 0:4", "give --free the log without it, once"),
    (IDENTIFY, "--method payload --free a.csv --free b.csv", "from one pair of logs"),
    (IDENTIFY, "--method guess", "there is friction, base"),
    (IDENTIFY, "--set identify.check-interval=4:1", "is not A:B with A < B"),
    (IDENTIFY, "--gains auto", "--gains is an option of --method gains"),
    (IDENTIFY, "--method base --gains auto", "--method base makes no use of --gains"),
    (IDENTIFY, "--method gains --check a.csv", "--method gains makes no use of --check"),
    (IDENTIFY, "--method gains other.csv", "takes one LOG; name free motion by --free"),
    (IDENTIFY, "--method gains --gains paper", "is not auto or delay=S (seconds) or"),
    # What the release before had.
    (("open",), "out", "open is gone; open DIR/index.html in a browser, or DIR/recording.rrd"),
    (("batch", CIRCLE), "--limit 3", "--limit is gone; leave it out"),
    (("report", CIRCLE), "--low-pass", "--low-pass is now --set two-cycle.low-pass=…; give a"),
    (("inspect", CIRCLE), "--robot-arg heavy=4", "'FILE heavy:=4'; give --robot"),
    (("contacts", "--"), "--low-pass", "error: --low-pass: "),  # behind two dashes: a log
)


@pytest.mark.parametrize(
    ("begin", "words", "said"),
    REFUSED,
    ids=[f"{begin[0]} {words}" for begin, words, _ in REFUSED],
)
def test_what_cannot_be_done_is_one_line_and_writes_nothing(refused, here, begin, words, said):
    """Values that every command refuses are in tests/cli/test_options.py."""
    assert said in refused(*begin, *words.split())
    assert list(here.iterdir()) == []
