"""A batch before its work: which logs a worker is given together."""

from pathlib import Path

import pytest

from vftcli.batch import WorkersChoice
from vftcli.batch.cluster import Effort, Failure, Outcome
from vftcli.batch.log_work import LogJob
from vftcli.batch.run import BatchCount, BatchRun, LogEntry
from vftcli.outputs.batch_folder import BatchFolder
from vftcli.pipeline import AnalysisChoice
from vftcli.signals.progress import heard_by


def batch(folder: Path, sizes: list[int], jobs: int | None, **more: int) -> BatchRun:
    """A batch of logs of these sizes [B], each of bytes of its own."""
    logs = []
    for k, size in enumerate(sizes):
        path = folder / f"{k:03}.csv"
        path.write_bytes(f"{k:08}".encode().ljust(size))
        logs.append(LogEntry(path=path, files=(path,), **more))
    return BatchRun(
        logs=logs,
        job=LogJob(do="estimate", choice=AnalysisChoice(), anyway=False),
        folder=BatchFolder(folder / "out"),
        workers=WorkersChoice(jobs=jobs),
        command="",
        tell=print,
    )


@pytest.mark.parametrize(
    ("logs", "jobs", "most"),
    # eight groups a worker at least, of four workers where none are stated, of 64 logs at most
    [(5, 2, 1), (64, 2, 4), (95, 2, 5), (64, None, 2), (95, 0, 2), (520, 1, 64)],
)
def test_small_logs_go_together_so_that_workers_end_together(
    tmp_path: Path, logs: int, jobs: int | None, most: int
) -> None:
    groups = [len(group) for group in batch(tmp_path, [8] * logs, jobs).groups()]
    assert groups == [most] * (logs // most) + [logs % most] * (logs % most > 0)


def test_a_log_of_300_kB_goes_alone_but_an_episode_with_others(tmp_path: Path) -> None:
    sizes = [8, 8, 8, 300_000, 299_999, *[8] * 59]
    asked = batch(tmp_path, sizes, 2)
    groups = [[int(task.path.stem) for task in group] for group in asked.groups()]
    assert groups[:3] == [[0, 1, 2], [3], [4, 5, 6, 7]]
    episodes = batch(tmp_path, [300_000] * 64, 2, episode=0)
    assert [len(group) for group in episodes.groups()] == [4] * 16


def test_equal_bytes_are_done_once_and_what_cannot_be_read_fails(tmp_path: Path) -> None:
    asked = batch(tmp_path, [8] * 4, 1)
    (tmp_path / "001.csv").write_bytes((tmp_path / "000.csv").read_bytes())
    (tmp_path / "002.csv").unlink()
    assert [task.path.stem for group in asked.groups() for task in group] == ["000", "003"]
    assert (asked.before, asked.done, [*asked.failures]) == (0, set(), [2])
    assert asked.failures[2].stage == "finding"


def test_rows_of_other_columns_are_of_another_batch(tmp_path: Path, monkeypatch) -> None:
    asked = batch(tmp_path, [8], 1)
    ((task,),) = asked.groups()
    monkeypatch.setattr("vftcli.batch.run.SCHEMA", {"key": str})
    ((other,),) = batch(tmp_path, [8], 1).groups()
    assert task.sha256 == other.sha256
    assert task.key != other.key


def test_a_batch_says_how_many_logs_ended_and_which_share_that_is(tmp_path: Path) -> None:
    """None of them is a log; each counts as it ends."""
    heard: list[tuple[str, float]] = []
    with heard_by(lambda *step: heard.append(step)):
        batch(tmp_path, [8] * 4, 0).work()
    assert heard == [(f"{k}/4 logs, {k} failed", k / 4) for k in range(1, 5)]


def test_the_record_counts_logs_and_adds_up_the_time_of_their_work(tmp_path: Path) -> None:
    """Three logs, the second from 5 s before the first's start to 20 s behind it."""
    asked = batch(tmp_path, [8] * 3, 1)
    first, second, _ = (task for group in asked.groups() for task in group)
    assert asked.record(BatchCount(3, 0, 0, 0))["first_to_last_s"] is None
    efforts = (Effort(100.0, 12.0, 7.0, "here 1"), Effort(95.0, 25.0, 20.0, "here 2"))
    failure = Failure("reading", "LogError", f"{second.path}: 001.csv: it is cut")
    asked.take(Outcome(first, effort=efforts[0]))
    asked.take(Outcome(second, failure=failure, effort=efforts[1]))
    assert asked.done == {first.key}
    assert asked.failures == {1: Failure("reading", "LogError", "it is cut")}
    record = asked.record(BatchCount(logs=3, before=1, done=4, failed=2))
    assert [log["recording"] for log in record["logs"]] == ["000.csv", "001.csv", "002.csv"]
    keys = ("do", "done_before", "done_now", "failed", "in_task_s", "in_task_cpu_s",
            "first_to_last_s")  # fmt: skip
    assert [record[key] for key in keys] == ["estimate", 1, 4, 2, 37.0, 27.0, 25.0]
    assert record["tasks"] == [
        {"log": f"00{k}.csv", "key": task.key, **effort._asdict()}
        for k, task, effort in zip((0, 1), (first, second), efforts, strict=True)
    ]
