"""`vftcli benchmark`, `reproduce` and `simulate` as a user calls them."""

import json
import re
import shutil
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from example_logs import CIRCLE, FIXTURES

from vftcli.evaluation.references import since_start
from vftcli.readers.reading import Library, read
from vftcli.reproduction import experiments, paper
from vftcli.reproduction.paper import Experiment, Paper, PaperItem, PrintedLine
from vftcli.signals.errors import ParameterError

# `vftcli benchmark` as a user sees it: rivals as rows, resume, tables, what is refused.

MANIFEST = """
[[log]]
name = "circle"
arm = "UR5"
file = "ur5_circle.csv"
robot = "ur5"
truth = "torque"
truth_file = "ur5_circle.csv.truth.parquet"
truth_error = { tau_Nm = 0.05, note = "a simulation's" }
free = ["gone"]
[[log]]
name = "gone"
arm = "UR5"
file = "nowhere.csv"
source = "a page that has it"
truth = "free"
"""


@pytest.fixture
def manifest(tmp_path: Path) -> Path:
    """A manifest of one log that is there, and one that is not, which is its free motion."""
    path = tmp_path / "my.toml"
    path.write_text(MANIFEST)
    return path


def asked(manifest: Path, *words: object) -> tuple[object, ...]:
    out = manifest.with_name("out")
    return ("benchmark", manifest, "--data", FIXTURES, "--jobs", "0", "-o", out, *words)


def record(manifest: Path) -> dict[str, object]:
    return json.loads((manifest.with_name("out") / "run.json").read_text())


def check_colours(page: str) -> None:
    """A method has one colour in tables, legend and dots; zero, which has no dot, has none."""
    swatch = r'\[data-swatch="(.+?)"\]::before{border-top:3px solid (.+?)}'
    tables = dict(re.findall(swatch, page))
    dots = set(re.findall(r"<title>UR5, (.+?): .*?<circle [^>]*fill=\"(.+?)\"", page))
    (legend,) = re.findall(r'<p class="legend">(<span data-swatch=.*?)</p>', page)
    assert dots == set(tables.items())
    assert re.findall(r'data-swatch="(.+?)"', legend) == [*tables]
    assert "zero" not in tables
    assert len(set(tables.values())) == min(len(tables), 9)  # there are no more colours


@pytest.mark.slow
def test_rivals_are_rows_and_copies_score_alike(run, ran, manifest: Path, tmp_path: Path) -> None:
    """A copy of gmo, the truth, nothing, and the truth 50 ms late."""
    truth = pl.read_parquet(FIXTURES / "ur5_circle.csv.truth.parquet")
    t = since_start(truth["t"].to_numpy(), Library().open(CIRCLE))
    tau = truth.select(pl.col("^tau_ext/[0-9]+$"))
    assert run("estimate", CIRCLE, "--robot", "ur5", "-o", tmp_path / "e", "-q")[0] == 0
    estimates = pl.read_parquet(tmp_path / "e" / "estimates.parquet")
    gmo, best = (
        estimates.select("t", pl.col(f"^(tau_ext|band)/{x}/.*$").name.replace(f"/{x}", ""))
        for x in ("gmo", "best")
    )
    late = pl.DataFrame({x.name: np.interp(t - 0.05, t, x.to_numpy()) for x in tau})
    files = {
        "copy": gmo,
        "bands": best,
        "true": tau.with_columns(t=pl.Series(t)),
        "silent": gmo.select("t", pl.exclude("t") * None),
        "late": late.with_columns(t=pl.Series(t)),
    }
    words: list[object] = []
    for name, table in files.items():
        (tmp_path / name).mkdir()
        table.write_csv(tmp_path / name / "circle.csv")
        words += ["--outside", f"{name}={tmp_path / name}"]
    out = ran(*asked(manifest, *words, "--json"))[0]
    rows = {(r["method"], r["part"]): r for r in json.loads(out)["rows"]}
    keys = ("rmse_Nm", "l1_Nm", "skill", "rmse_low_Nm", "rmse_high_Nm")
    banded = (*keys, "coverage_95", "interval_score_Nm")
    for part in ("contact", "all"):
        # CSV keeps every digit of a double.
        assert [rows["copy", part][k] for k in keys] == [rows["gmo", part][k] for k in keys]
        assert [rows["bands", part][k] for k in banded] == [rows["best", part][k] for k in banded]
        assert rows["bands", part]["coverage_95"] is not None
        assert [rows["silent", part][k] for k in keys] == [rows["zero", part][k] for k in keys]
        assert rows["silent", part]["missing"] == 1.0
        assert rows["true", part]["skill"] == pytest.approx(1.0, abs=1e-9)
        assert rows["true", part]["l1_Nm"] == pytest.approx(0.0, abs=1e-9)
    assert rows["late", "all"]["lag_s"] == pytest.approx(0.05)
    assert rows["copy", "free"]["skill"] is None
    assert 0.0 < rows["gmo", "all"]["observer_us"] < rows["gmo", "all"]["command_us"]
    assert rows["copy", "all"]["observer_us"] is rows["zero", "all"]["command_us"] is None
    out = ran(*asked(manifest, *words))[0]  # on the screen that everybody sees
    (silent,) = [line for line in out.splitlines() if "no answer" in line]
    assert silent == "silent, alone: no answer for 100.0 % of the time, read as 0"
    check_colours((manifest.with_name("out") / "index.html").read_text("utf-8"))


@pytest.mark.slow
def test_a_second_run_does_what_is_left_and_the_same_bytes(run, ran, manifest, monkeypatch):
    """The same but for times, which are held here."""
    monkeypatch.setattr("vftcli.reproduction.scoring.thread_time", lambda: 0.0)
    out, err = ran(*asked(manifest))
    assert f"gone: no {FIXTURES / 'nowhere.csv'}; source: a page that has it" in err
    assert max(map(len, out.splitlines())) <= 80
    folder = manifest.with_name("out")
    names = ("scores.parquet", "index.html")
    before = {name: (folder / name).read_bytes() for name in names}
    assert "<h1>1 log against the truth</h1>" in (folder / "index.html").read_text("utf-8")
    (row,) = folder.glob("rows/*/*.parquet")
    row.unlink()  # as a run that was killed leaves it
    (folder / "scores.parquet").unlink()
    assert run(*asked(manifest))[:2] == (0, out)
    assert {name: (folder / name).read_bytes() for name in names} == before
    assert [task["task"] for task in record(manifest)["tasks"]] == ["circle, alone"]
    table = pl.read_csv(run(*asked(manifest, "--csv"))[1].encode())
    assert record(manifest)["tasks"] == []
    assert {"zero", "gmo", "best"} <= set(table["method"])


@pytest.mark.slow
def test_planted_pushes_are_scored_against_their_truth(run, ran, tmp_path: Path) -> None:
    shutil.copy(CIRCLE, tmp_path / "log.csv")
    (tmp_path / "my.toml").write_text(
        '[[log]]\nname = "a"\narm = "UR5"\nfile = "log.csv"\nrobot = "ur5"\ntruth = "free"\n'
        "pushes = [[10, 2, [0, 30, -20]]]\nscore = [[1, 15]]\n"
    )
    words = ("benchmark", tmp_path / "my.toml", "--jobs", "0", "-o", tmp_path / "out")
    assert run(*words, "--observer", "gmo")[0] == 2  # methods are the tool's own
    ran(*words)
    (pushed,) = tmp_path.glob("out/made/*/a-pushed.parquet")
    truth = pl.read_parquet(f"{pushed}.truth.parquet")
    # It is scored against this truth, of the pushed log alone in contact, of the other when free.
    rows = pl.read_parquet(tmp_path / "out" / "scores.parquet").drop_nulls("joint")
    parts = rows.group_by("log", maintain_order=True).agg(pl.col("part").unique().sort())
    assert dict(parts.iter_rows()) == {"a": ["free"], "a-pushed": ["all", "contact"]}
    inside = truth.filter(pl.col("t").is_between(1.0, 15.0))["tau_ext/2"].to_numpy()
    (second,) = rows.filter(method="zero", log="a-pushed", part="all", joint=2).to_dicts()
    assert second["rmse_Nm"] == pytest.approx(np.sqrt(np.mean(inside**2)), rel=1e-3)  # even clock


@pytest.mark.slow
def test_another_file_ends_with_one_line_or_marks_its_rows(ran, refused, manifest: Path) -> None:
    manifest.write_text(MANIFEST.replace('file = "ur5', f'sha256 = "{"1" * 64}"\nfile = "ur5', 1))
    error = refused(*asked(manifest))
    assert "circle: " in error
    assert "sha256" in error
    assert not manifest.with_name("out").exists()
    out = ran(*asked(manifest, "--anyway"))[0]
    assert "scored despite a complaint (--anyway): circle" in out


EVERY_KIND = """
[[robot]]
name = "fitted"
train = ["before"]
interval = "0:3"
[[robot]]
name = "of-nobody"
train = ["push"]
[[log]]
name = "push"
arm = "UR5"
day = "monday"
file = "push.csv"
robot = "ur5"
truth = "torque"
truth_file = "truth.parquet"
free = ["before"]
identified = "fitted"
score = [[0, 4]]
[[log]]
name = "before"
arm = "UR5 free"
day = "tuesday"
file = "before.csv"
robot = "ur5"
truth = "free"
[[log]]
name = "parts"
arm = "UR5 parts"
parts = ["t=t.txt", "q=q.txt", "dq=dq.txt", "current=current.txt"]
robot = "ur5"
truth = "free"
[[log]]
name = "times"
arm = "UR5 times"
file = "push.csv"
robot = "ur5"
truth = "contacts"
contacts = [[0.9, 2]]
"""
PARTS = ("q", "dq", "current")


@pytest.fixture
def kinds(tmp_path: Path) -> Path:
    """`EVERY_KIND` beside its logs: 4 s before the scenario's push, and 3 s with it."""
    lines = CIRCLE.read_text().splitlines(keepends=True)
    (tmp_path / "push.csv").write_text("".join([lines[0], *lines[501:901]]))
    (tmp_path / "before.csv").write_text("".join(lines[:502]))
    shutil.copy(f"{CIRCLE}.truth.parquet", tmp_path / "truth.parquet")
    log = Library().open(tmp_path / "before.csv")
    for name, values in (("t", log.t), *((name, log.require(name)) for name in PARTS)):
        np.savetxt(tmp_path / f"{name}.txt", values)
    for name, joints in (("thin", 5), ("wide", 7)):
        (tmp_path / name).mkdir()
        table = {"t": log.t, **{f"tau_ext/{j}": 0.0 * log.t for j in range(1, joints + 1)}}
        pl.DataFrame(table).write_csv(tmp_path / name / "before.csv")
    (tmp_path / "my.toml").write_text(EVERY_KIND)
    return tmp_path


@pytest.mark.slow
def test_every_kind_of_entry_is_scored_by_all_that_it_can_be(run, kinds: Path) -> None:
    """With estimates of 5 and of 7 joints, which fail."""
    words = ("benchmark", kinds / "my.toml", "--jobs", "0", "-o", kinds / "o")
    rivals = ("--outside", f"thin={kinds / 'thin'}", "--outside", f"wide={kinds / 'wide'}")
    code, _, err = run(*words, *rivals)
    assert code == 3
    for name, joints in (("thin", 5), ("wide", 7)):
        assert f"before.csv: torques of {joints} joints for a log of 6" in err
        assert f"error: before, alone, {name}: " in err
    record = json.loads((kinds / "o" / "run.json").read_text())
    scored = [f"push, {p}" for p in ("alone", "free", "identified")]
    scored += [f"{name}, alone" for name in ("before", "parts", "times")]
    failed = [f"before, alone, {name}" for name in ("thin", "wide")]
    assert [x["task"] for x in record["tasks"]] == ["parts", "fitted", *scored, *failed]
    assert [*record["failures"]] == failed
    # What is made: a log of its parts, and a robot of the logs that it names.
    (made,) = (kinds / "o").glob("made/parts-*/parts.parquet")
    whole, log = (Library().open(path) for path in (made, kinds / "before.csv"))
    for name in PARTS:
        np.testing.assert_array_equal(whole.require(name), log.require(name))
    (robot,) = (kinds / "o").glob("made/*/*.toml")
    assert robot.name == "fitted.toml"
    rows = pl.read_parquet(kinds / "o" / "scores.parquet")
    best = rows.filter(method="best", part="contact", log="push")
    errors = [best.filter(protocol=p)["rmse_Nm"].mean() for p in ("alone", "free", "identified")]
    assert len(set(errors)) == 3  # each saw something else
    pushed = rows.filter(method="zero", part="contact")["rmse_Nm"].mean()
    assert max(errors) < 0.3 * pushed
    # Of the times of a push that the list finds no peak is known, and of its torque nothing.
    (times,) = rows.filter(log="times").to_dicts()[:1]
    assert (times["true_contacts"], times["peak_error_N"]) == (1, [])
    assert set(rows.filter(log="times")["part"]) == {"list", "list with candidates"}
    # A second run does what failed, and without these nothing: the same bytes.
    before = (kinds / "o" / "scores.parquet").read_bytes()
    assert run(*words, *rivals)[0] == 3
    again = json.loads((kinds / "o" / "run.json").read_text())
    assert [x["task"] for x in again["tasks"]] == failed
    assert run(*words)[0] == 0
    assert json.loads((kinds / "o" / "run.json").read_text())["tasks"] == []
    assert (kinds / "o" / "scores.parquet").read_bytes() == before


@pytest.mark.slow
def test_a_method_that_lacks_an_arm_is_named(ran, manifest: Path, tmp_path: Path) -> None:
    """Estimates of the first second of one of two arms."""
    one = MANIFEST.partition('free = ["gone"]')[0]
    manifest.write_text(one + one.replace('"circle"', '"again"').replace('"UR5"', '"UR5 b"'))
    (tmp_path / "zz").mkdir()
    t = np.arange(0.0, 1.0, 0.01)
    part = pl.DataFrame({"t": t, **{f"tau_ext/{j}": 0.0 * t for j in range(1, 7)}})
    part.write_csv(tmp_path / "zz" / "circle.csv")
    out = ran(*asked(manifest, "--outside", f"zz={tmp_path / 'zz'}"))[0]
    rows = [line.split()[0] for line in out.splitlines()]
    assert "best" in rows
    assert "zz" not in rows
    assert "in no mean, as some arm lacks them (-v and page have their rows): zz" in out
    # What is scored begins at 1 s, where these estimates end.
    assert "zz, alone: no answer for 100.0 % of the time, read as 0" in out


@pytest.mark.slow
def test_a_log_that_fails_leaves_the_others(run, manifest: Path) -> None:
    """Where every log fails the code is that of an error."""
    broken = manifest.with_name("broken.csv")
    broken.write_text("t,q1\n0,nothing\n")
    entry = f'[[log]]\nname = "b"\narm = "a"\nfile = "{broken}"\nrobot = "ur5"\ntruth = "free"\n'
    for text, expected in ((MANIFEST + entry, 3), (entry, 1)):
        manifest.write_text(text)
        code, out, err = run(*asked(manifest, "-o", manifest.with_name(str(expected))))
        assert (code, "best" in out) == (expected, expected == 3)
        assert "error: b, alone: " in err
    assert out == ""


def test_no_log_that_is_there_makes_no_table(run, manifest: Path, tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    words = ("benchmark", manifest, "--data", tmp_path / "empty", "-o", tmp_path / "out")
    code, out, err = run(*words)
    assert (code, out) == (0, "")
    *lines, last = err.splitlines()
    assert [line.partition(":")[0] for line in lines] == ["circle", "gone"]
    assert lines[1].endswith("source: a page that has it")
    assert last.startswith(f"Nothing is scored: {tmp_path / 'empty'} has none of the logs.")
    assert not (tmp_path / "out").exists()
    code, out, _ = run(*words, "--json")
    assert code == 0
    assert [len(json.loads(out)[key]) for key in ("rows", "left_out")] == [0, 2]


@pytest.mark.parametrize(("words", "complaint"), [
    ("field --data nodir", "--data nodir: there is no such folder"),
    ("sim --data . --robot ur5", "benchmark sim takes no --robot, --data"),
    ("field --set bench.rounds=1", "benchmark field takes no --set bench"),
    ("sim --outside zz=nodir", "--outside zz=nodir: there is no folder nodir"),
    ("speed --jobs 0 --open", "benchmark speed takes no --open, --jobs"),
    ("speed --csv", "benchmark speed takes no --csv"),
])  # fmt: skip
def test_a_wrong_word_is_one_error(run, words: str, complaint: str) -> None:
    code, out, err = run("benchmark", *words.split())
    assert (code, out) == (2, "")
    assert err.splitlines()[-1] == f"Error: Invalid value: {complaint}"


def test_times_are_printed_in_the_form_that_is_asked_for(run, monkeypatch) -> None:
    row = {"total_s": 1.5, "per_sample_us": 1250.0}
    observers = [{"name": "gmo", **row, "paper_s": 10.541}]
    made = {"simd": "AVX9", "robot": "ur5", "dynamics": row}
    made |= {"observers": observers, "ratios": {"even": 1.234, "jittering": 2.345}}
    monkeypatch.setattr("vftcli.reproduction.timing.benchmark", lambda *_: made)
    title = "Computing time: ur5, 30060 samples, median of 7 rounds, NumPy with AVX9"
    code, out, _ = run("benchmark", "speed")
    assert (code, out.splitlines()[0]) == (0, title)
    assert out.splitlines()[-2].startswith("Dynamics with four observers take 1.23 of the time")
    assert out.splitlines()[-1].startswith("2.35 on a clock that jitters")
    assert json.loads(run("benchmark", "speed", "--json")[1])["ratios"] == made["ratios"]
    for form, begins in (("--markdown", "**Computing"), ("--latex", "\\begin{table}")):
        out = run("benchmark", "speed", form)[1]
        assert begins in out
        assert title in out.replace("\\_", "_")


# `vftcli reproduce` as a user calls it.


@pytest.mark.slow
def test_one_table_alone(ran, refused, tmp_path: Path) -> None:
    words = ("reproduce", "huang2025", "--only", "table4,fig11", "-o", tmp_path / "out")
    out = ran(*words)[0]
    assert "Table IV" in out
    assert "a picture" in out
    names = {path.name for path in (tmp_path / "out").iterdir()}
    assert names == {"index.html", "reproduction.md", "run.json"}
    assert "--force" in refused(*words)


def test_an_experiment_that_fails_is_a_row_and_exit_code_one(run, monkeypatch, tmp_path):
    def fail(seed: int):
        raise ParameterError(f"nothing moved with {seed}")

    shared = {"title": "t", "why": "w."}
    item = PaperItem(label="Table I", verdict="no", experiments=("e",),
                     lines=(PrintedLine("k", "l"),), **shared)  # fmt: skip
    drawn = PaperItem(label="Fig. 1", verdict="a picture", **shared)
    failing = Experiment(name="e", title="the experiment", run="fail", seeds=(1,))
    declared = Paper(name="p", title="t", doi="d", experiments={"e": failing},
                     items={"table1": item, "fig1": drawn}, setting=())  # fmt: skip
    monkeypatch.setitem(paper.PAPERS, "p", declared)
    monkeypatch.setitem(experiments.RUNS, "fail", fail)
    code, out, err = run("reproduce", "p", "-o", tmp_path / "json", "--json")
    assert (code, json.loads(out)["paper"]) == (1, "p")
    code, out, err = run("reproduce", "p", "-o", tmp_path / "out")
    assert code == 1
    assert "the experiment, seed 1: nothing moved with 1" in out + err
    text = (tmp_path / "out" / "index.html").read_text("utf-8")
    assert "Fig. 1: t</h2>" in text


# `vftcli simulate` as a user calls it.

AS_CIRCLE = ("simulate", "ur5-circle", "-o")
pytestmark = pytest.mark.usefixtures("here")


def test_writes_log_truth_and_a_scenario_that_makes_the_same_log(run) -> None:
    code, out, _ = run(*AS_CIRCLE, "a.csv", "--set", "duration=0.5", "--seed", "3", "--json")
    about = json.loads(out)
    assert (code, about["seed"]) == (0, 3)
    assert about["samples"] == read(Path("a.csv")).samples == 63
    endings = ("", ".truth.parquet", ".scenario.toml", ".run.json")
    assert [Path(f).name for f in about["files"]] == [f"a.csv{ending}" for ending in endings]
    assert run("simulate", "a.csv.scenario.toml", "-o", "b.csv")[0] == 0
    assert Path("a.csv").read_bytes() == Path("b.csv").read_bytes()


def test_pair_writes_two_logs(run, here: Path) -> None:
    lossy = ("--set", "duration=0.3", "--set", "sensing.dropped=0.5")
    _, out, _ = run("simulate", "payload-pair", "-o", "p.csv", *lossy, "--json")
    rows = {p.name: p.read_text().count("\n") - 1 for p in here.glob("*.csv")}
    assert rows.keys() == {"p.csv", "p.free.csv"}
    printed, record = json.loads(out), json.loads((here / "p.csv.run.json").read_text("utf-8"))
    assert printed["samples"] == rows["p.csv"] != rows["p.free.csv"]
    assert printed.keys() == record.keys()


def test_lists_the_scenarios(run) -> None:
    text, record = run("simulate", "list")[1], json.loads(run("simulate", "list", "--json")[1])
    assert list(record["scenarios"]) == re.findall(r"^[\w-]+", text, re.MULTILINE)
    assert re.search(r"^ur5-circle +UR5 on a horizontal circle", text, re.MULTILINE)


def test_nothing_is_overwritten_without_force_or_simulated_without_a_place(run, refused) -> None:
    path = Path("log.csv")
    path.write_text("mine")
    assert "--force" in refused(*AS_CIRCLE, path, "--set", "duration=0.3")
    assert path.read_text() == "mine"
    code, _, err = run("simulate", "ur5-circle")
    assert (code, "-o PATH says where" in err) == (2, True)
    code, _, err = run(*AS_CIRCLE, "x.csv", "--seed", "-1")
    assert (code, "'--seed': -1 is not in the range x>=0" in err) == (2, True)
