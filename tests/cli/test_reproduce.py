"""`vftcli reproduce` as a user calls it."""

from pathlib import Path

import pytest

from vftcli.reproduction import experiments, paper
from vftcli.reproduction.paper import Experiment, Paper, PaperItem, PrintedLine
from vftcli.signals.errors import ParameterError


@pytest.mark.slow
def test_one_table_alone(run, refused, tmp_path: Path) -> None:
    words = ("reproduce", "huang2025", "--only", "table4,fig11", "-o", tmp_path / "out")
    code, out, err = run(*words)
    assert code == 0, err
    assert "Table IV" in out
    assert "a picture" in out
    names = {path.name for path in (tmp_path / "out").iterdir()}
    assert names == {"index.html", "reproduction.md", "run.json"}
    assert "--force" in refused(*words)


def test_an_experiment_that_fails_is_a_row_and_exit_code_one(
    run, monkeypatch, tmp_path: Path
) -> None:
    def fail(seed: int):
        raise ParameterError(f"nothing moved with {seed}")

    shared = {"title": "t", "why": "w."}
    item = PaperItem(label="Table I", verdict="no", experiments=("e",),
                     lines=(PrintedLine("k", "l"),), **shared)  # fmt: skip
    drawn = PaperItem(label="Fig. 1", verdict="a picture", **shared)
    failing = Experiment(title="the experiment", run="fail", seeds=(1,))
    declared = Paper(name="p", title="t", doi="d", experiments={"e": failing},
                     items={"table1": item, "fig1": drawn}, setting=())  # fmt: skip
    monkeypatch.setitem(paper.PAPERS, "p", declared)
    monkeypatch.setitem(experiments.RUNS, "fail", fail)
    code, out, err = run("reproduce", "p", "-o", tmp_path / "out")
    assert code == 1
    assert "the experiment, seed 1: nothing moved with 1" in out + err
    text = (tmp_path / "out" / "reproduction.md").read_text("utf-8")
    assert "## Fig. 1: t" in text
