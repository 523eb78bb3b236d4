"""`vftcli batch` as a user sees it: every log once, exit codes, equal bytes, resume."""

import json
import shutil
from pathlib import Path

import polars as pl
import pytest
from example_logs import CIRCLE, FIXTURES

ONE = ("--robot", "ur5", "--observer", "gmo", "--set", "contacts.list=no")
HERE = ("--do", "estimate", *ONE, "--jobs", "0")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Two logs of one name in two folders, one of them twice."""
    for place in ("a", "b"):
        (tmp_path / "logs" / place).mkdir(parents=True)
    shutil.copy(CIRCLE, tmp_path / "logs" / "a" / "log.csv")
    shutil.copy(CIRCLE, tmp_path / "logs" / "a" / "same.csv")
    shutil.copy(FIXTURES / "ur5_table1.csv", tmp_path / "logs" / "b" / "log.csv")
    return tmp_path / "logs"


def rows_there(out: Path) -> dict[str, tuple[int, int]]:
    """Every row file with what changes when it is written again."""
    return {p.name: (p.stat().st_ino, p.stat().st_mtime_ns) for p in out.glob("rows/*/*.parquet")}


def record(out: Path) -> dict[str, object]:
    return json.loads((out / "run.json").read_text())


@pytest.mark.slow
def test_every_log_is_done_once_whatever_the_workers(run, folder: Path, tmp_path: Path) -> None:
    """A LocalCluster of two workers against this process against the command of one log."""
    out, cluster = tmp_path / "out", tmp_path / "cluster"
    assert run("batch", folder, *HERE, "-o", out)[0] == 0
    done = run("batch", folder, "--do", "estimate", *ONE, "--jobs", "2", "-o", cluster)
    assert done[0] == 0, done[2]
    assert (out / "batch.parquet").read_bytes() == (cluster / "batch.parquet").read_bytes()
    table = pl.read_parquet(out / "batch.parquet")
    labels = table["log"].unique(maintain_order=True).to_list()
    assert labels == ["a/log.csv", "same.csv", "b/log.csv"]
    # Two logs of equal bytes are one result.
    keys = dict(table.select("log", "key").unique().iter_rows())
    assert keys["a/log.csv"] == keys["same.csv"] != keys["b/log.csv"]
    assert len(rows_there(out)) == 2
    assert run("estimate", CIRCLE, *ONE, "-o", tmp_path / "one")[0] == 0
    single = (tmp_path / "one" / "estimates.parquet").read_bytes()
    for made in (out, cluster):
        place = made / "logs" / keys["same.csv"][:2] / keys["same.csv"]
        assert (place / "estimates.parquet").read_bytes() == single
    assert len({task["place"] for task in record(cluster)["tasks"]}) == 2


def test_a_second_run_does_what_is_left(run, folder: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    (folder / "empty.csv").touch()
    assert run("batch", folder / "a" / "log.csv", *HERE, "-o", out)[0] == 0
    first = rows_there(out)
    code, _, err = run("batch", folder, *HERE, "-o", out)
    assert code == 3
    assert "empty.csv" in err
    assert first.items() <= rows_there(out).items()
    # The equal log was done before, under another name.
    assert (record(out)["done_before"], record(out)["done_now"]) == (2, 1)
    done, table = rows_there(out), (out / "batch.parquet").read_bytes()
    assert run("batch", folder, *HERE, "-o", out)[0] == 3
    # What is finished is not done again; what failed is.
    assert [task["log"] for task in record(out)["tasks"]] == ["empty.csv"]
    # Of one task from its first moment to its last is its own time.
    assert record(out)["first_to_last_s"] == pytest.approx(record(out)["in_task_s"], abs=1e-3)
    assert rows_there(out) == done
    assert (out / "batch.parquet").read_bytes() == table
    failures = pl.read_parquet(out / "failures.parquet").select("log", "stage", "error")
    assert failures.rows() == [("empty.csv", "reading", "LogError")]


def test_a_failure_stands_for_every_log_of_equal_bytes_and_names_it_once(run, folder, tmp_path):
    """Here the second is found after the first has failed."""
    for name in ("bad.csv", "worse.csv"):
        (folder / name).write_text("a,b,c\n1,2,3\n4,5,6\n")
    code, _, err = run("batch", folder, *HERE, "-o", tmp_path / "out")
    assert code == 3
    assert "5 logs: 3 done now, 0 earlier, 2 failed" in err
    failures = pl.read_parquet(tmp_path / "out" / "failures.parquet")
    assert failures["log"].to_list() == ["bad.csv", "worse.csv"]
    assert all(line.startswith("no joint positions") for line in failures["line"])


def test_what_failed_is_tried_again(run, folder: Path, tmp_path: Path) -> None:
    out, gone = tmp_path / "out", folder / "gone.csv"
    words = ("batch", folder / "b/log.csv", gone, *HERE, "-o", out)
    assert run(*words)[0] == 3
    assert pl.read_parquet(out / "failures.parquet")["stage"].to_list() == ["finding"]
    shutil.copy(CIRCLE, gone)
    assert run(*words)[0] == 0
    (folder / "bad.csv").write_text("no,log\n1,2\n")
    words = ("batch", folder / "bad.csv", *HERE, "-o", tmp_path / "bad")
    for _ in range(2):
        assert run(*words)[0] == 1
        assert len(record(tmp_path / "bad")["tasks"]) == 1


def test_compare_has_the_errors_of_compare(run, tmp_path: Path) -> None:
    words = (*ONE, "--reference", "zero", "--interval", "0:4")
    out = tmp_path / "out"
    assert run("batch", CIRCLE, "--do", "compare", *words, "-o", out, "--jobs", "0")[0] == 0
    rows = json.loads(run("compare", CIRCLE, *words, "--json")[1])["rows"]
    table = pl.read_parquet(out / "batch.parquet")
    assert table["rmse_Nm"].to_list() == [row["rmse_Nm"] for row in rows]
    assert table["reference_floor_Nm"].to_list() == [row["reference_floor_Nm"] for row in rows]


def test_contacts_are_counted_and_listed(run, tmp_path: Path) -> None:
    words = ("--robot", "ur5", "--interval", "3:8", "--jobs", "0", "-o", tmp_path)
    code, said, _ = run("batch", CIRCLE, "--do", "contacts", *words, "--json")
    assert (code, json.loads(said)) == (0, record(tmp_path))
    (row,) = pl.read_parquet(tmp_path / "batch.parquet").iter_rows(named=True)
    (listed,) = tmp_path.glob("logs/*/*/contacts.json")
    assert row["contacts"] == len(json.loads(listed.read_text())["contacts"])


def test_an_episode_is_a_log(run, samples: Path, tmp_path: Path) -> None:
    words = ("--do", "estimate", "--observer", "gmo", "--jobs", "0", "-o", tmp_path)
    done = run("batch", samples / "lerobot_v3_effort", *words)
    assert done[0] == 0, done[2]
    table = pl.read_parquet(tmp_path / "batch.parquet").unique("log", maintain_order=True)
    # Lengths of the sample's episodes, by its table.
    assert table.select("episode", "samples").rows() == [(0, 700), (1, 600), (2, 650)]


def test_free_motion_among_the_logs_is_none_of_them(run, folder: Path, tmp_path: Path) -> None:
    words = (*HERE, "--free", folder / "b" / "log.csv", "-o", tmp_path / "out")
    code, _, err = run("batch", folder, *words)
    assert (code, err.splitlines()[-1].split(":")[0]) == (0, "2 logs")


def test_what_describes_logs_is_passed_over_and_said_once(
    run, ran, folder, tmp_path: Path
) -> None:
    described = folder / "a" / "meta.json"
    described.write_text('{"operator": "x", "gains": [1, 2, 3]}')
    for name in ("b/meta.json", "meta.json", "more.json"):
        shutil.copy(described, folder / name)
    (folder / "a" / "log.csv.scenario.toml").write_text("seed = 1\n")
    names = "log.csv.scenario.toml, meta.json, meta.json and 2 more"
    for place, said in ((folder, f"left out, not a log: {names}"),
                        (folder / "b", "left out, not a log: meta.json")):  # fmt: skip
        err = ran("batch", place, *HERE, "-o", tmp_path / f"{place.name}-out")[1]
        assert err.count("not logs") + err.count("not a log") == 1
        assert f"note: {said}\n" in err
    _, _, err = run("batch", described, *HERE, "-o", tmp_path / "named")
    assert "error: meta.json: no joint positions (q) among gains" in err


def test_ten_failures_are_told_the_others_counted(run, tmp_path: Path) -> None:
    for k in range(12):
        (tmp_path / f"{k:02}.csv").write_text(f"a,b,c\n1,2,{k}\n")
    words = ("--do", "contacts", "--robot", "ur5", "--jobs", "0", "-o")
    rest = "… 2 more in failures.parquet\n12 logs: 0 done now, 0 earlier, 12 failed; "
    for some, more in (("0?", ""), ("??", rest)):
        logs = sorted(tmp_path.glob(f"{some}.csv"))
        code, _, err = run("batch", *logs, *words, tmp_path / f"of {len(logs)}")
        assert (code, err.count("error: "), "more" in err) == (1, 10, bool(more))
        assert more in err


@pytest.mark.statistical
def test_an_address_that_does_not_answer_is_one_line(refused, tmp_path: Path) -> None:
    address = ("--set", "cluster.address=tcp://127.0.0.1:1")
    asked = ("batch", CIRCLE, "--do", "estimate", *ONE, *address, "-o", tmp_path / "out")
    assert "use tls://" in refused(*asked)
    error = refused(*asked, "--anyway")
    assert "no Dask scheduler answers at tcp://127.0.0.1:1 within 10 s" in error


@pytest.mark.slow
@pytest.mark.parametrize("do", ["estimate", "contacts"])
def test_a_reference_that_nothing_is_compared_with_is_left_out(run, tmp_path: Path, do) -> None:
    """The log has no sensor: as a reference it would be refused."""
    words = ("--do", do, *ONE, "--jobs", "0", "--reference", "sensor", "-o", tmp_path / "out")
    code, _, err = run("batch", CIRCLE, *words)
    assert (code, "--reference is left out" in err) == (0, True)
