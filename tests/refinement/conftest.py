"""One analysed log for all tests here: the reference fixture with its truth."""

from dataclasses import replace
from pathlib import Path

import pytest

from vftcli.analysis import Analysis
from vftcli.pipeline import AnalysisChoice, analyse_log

FIXTURE = Path(__file__).parent.parent.parent / "fixtures" / "ur5_circle.csv"
OBSERVERS = ("gmo", "kfo-zoh", "kfo-rts", "kfo-auto", "rts-auto")


@pytest.fixture(scope="session")
def request_() -> AnalysisChoice:
    truth = f"file:{FIXTURE}.truth.parquet"
    return AnalysisChoice(robot="ur5", reference=truth, observers=OBSERVERS)


@pytest.fixture(scope="session")
def worked_up(request_: AnalysisChoice) -> Analysis:
    return analyse_log(FIXTURE, request_)


@pytest.fixture(scope="session")
def without_bias(request_: AnalysisChoice) -> Analysis:
    return analyse_log(FIXTURE, replace(request_, remove_bias="free-cycle"))
