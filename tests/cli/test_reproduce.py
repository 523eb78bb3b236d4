"""`vftcli reproduce` as a user calls it."""

from pathlib import Path

import pytest
from typer.testing import CliRunner

from vftcli.cli import make_app
from vftcli.reproduction import experiments, paper
from vftcli.reproduction.paper import Experiment, Paper, PaperItem, PrintedLine
from vftcli.signals.errors import ParameterError

app = make_app()


def invoke(*words: object):
    return CliRunner().invoke(app, [str(word) for word in words])


@pytest.mark.slow
def test_one_table_alone(tmp_path: Path) -> None:
    words = ("reproduce", "huang2025", "--only", "table4,fig11", "-o", tmp_path / "out")
    result = invoke(*words)
    assert result.exit_code == 0, result.output
    assert "Table IV" in result.output
    assert "a picture" in result.output
    names = {path.name for path in (tmp_path / "out").iterdir()}
    assert names == {"index.html", "reproduction.md", "run.json"}
    again = invoke(*words)
    assert again.exit_code == 1
    assert "--force" in str(again.exception or again.output)


def test_an_experiment_that_fails_is_a_row_and_exit_code_one(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def fail(seed: int):
        raise ParameterError(f"nothing moved with {seed}")

    item = PaperItem(
        label="Table I",
        title="t",
        why="w.",
        verdict="no",
        experiments=("e",),
        lines=(PrintedLine("k", "l"),),
    )
    drawn = PaperItem(label="Fig. 1", title="t", why="w.", verdict="a picture")
    items = {"table1": item, "fig1": drawn}
    declared = Paper(
        name="p",
        title="t",
        doi="d",
        experiments={"e": Experiment(title="the experiment", run="fail", seeds=(1,))},
        items=items,
        setting=(),
    )
    monkeypatch.setitem(paper.PAPERS, "p", declared)
    monkeypatch.setitem(experiments.RUNS, "fail", fail)
    result = invoke("reproduce", "p", "-o", tmp_path / "out")
    assert result.exit_code == 1
    assert "the experiment, seed 1: nothing moved with 1" in result.output
    text = (tmp_path / "out" / "reproduction.md").read_text("utf-8")
    assert "## Fig. 1: t" in text
