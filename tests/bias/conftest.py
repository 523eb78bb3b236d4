"""One analysed log for all tests here: the reference fixture with its truth."""

from pathlib import Path

import pytest
from made_runs import analyse_log

from vftcli.analysis import Analysis
from vftcli.evaluation import ReferenceChoice
from vftcli.observers import ObserverChoice
from vftcli.pipeline import AnalysisChoice
from vftcli.robots import RobotChoice

FIXTURE = Path(__file__).parent.parent.parent / "fixtures" / "ur5_circle.csv"
OBSERVERS = ObserverChoice(
    names=("gmo", "kfo-zoh", "kfo-rts", "kfo-auto", "rts-auto"),
    settings={"kfo": {"noise_convention": "density"}},
)
"""Bounds are shares of what filter and smoother reach with R and Q read as densities."""


@pytest.fixture(scope="session")
def request_() -> AnalysisChoice:
    truth = f"file:{FIXTURE}.truth.parquet"
    return AnalysisChoice(
        robot=RobotChoice(name="ur5"), observers=OBSERVERS, reference=ReferenceChoice(name=truth)
    )


@pytest.fixture(scope="session")
def worked_up(request_) -> Analysis:
    return analyse_log(FIXTURE, request_)
