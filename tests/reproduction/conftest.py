"""A paper whose experiments take no time: one that measures, and one that fails."""

from collections.abc import Iterator

import numpy as np
import pytest

from vftcli.outputs.charts import Chart, ChartLine
from vftcli.reproduction import experiments, paper
from vftcli.reproduction.paper import (
    AS_PRINTED,
    CORRECTED,
    FLOOR,
    Experiment,
    Given,
    Paper,
    PaperItem,
    PrintedLine,
)
from vftcli.signals.errors import ParameterError


def measure(seed: int) -> Iterator[Given]:
    t = np.linspace(0.0, 1.0, 50)
    line = ChartLine("ours", np.column_stack([np.sin(t), np.cos(t)]))
    yield from ((AS_PRINTED, "a", 3.0), (CORRECTED, "a", 2.0 + seed), (FLOOR, "a", 0.5))
    yield CORRECTED, "b", None if seed > 1 else -1.0
    yield "", "fig1", Chart("any", "", ("N", "N"), ("x", "y"), t, (line,))


def fail(seed: int, *, what: str) -> Iterator[Given]:
    raise ParameterError(f"{what} moved with {seed}")


PAPER = Paper(
    name="cheap",
    title="A paper",
    doi="10.1/1",
    experiments={e.name: e for e in (
        Experiment(name="works", title="what works", run="measure", seeds=(1, 2, 3)),
        Experiment(name="fails", title="what fails", run="fail", given={"what": "nothing"},
                   seeds=(1, 2)),
        Experiment(name="timed", title="what takes the time", run="measure", seeds=(0,),
                   alone=True),
    )},
    items={
        "fig1": PaperItem(
            label="Fig. 1", title="A <figure>", why="Because.", verdict="in size",
            experiments=("works",), traces="Two panels",
            lines=(PrintedLine("a", "alpha", "N", "2"), PrintedLine("b", "beta", "", "-1"))),
        "fig2": PaperItem(label="Fig. 2", title="Another", why="A sketch.", verdict="a picture"),
        "fig3": PaperItem(
            label="Fig. 3", title="Half of it", why="Why not.", verdict="no",
            experiments=("timed", "fails"), lines=(PrintedLine("a", "alpha", "N"),)),
    },
    setting=("It is set.",),
)  # fmt: skip


@pytest.fixture
def cheap(monkeypatch: pytest.MonkeyPatch) -> Paper:
    """That paper, among those there are."""
    monkeypatch.setitem(paper.PAPERS, PAPER.name, PAPER)
    monkeypatch.setitem(experiments.RUNS, "measure", measure)
    monkeypatch.setitem(experiments.RUNS, "fail", fail)
    return PAPER
