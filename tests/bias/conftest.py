"""One analysed log for all tests here: the reference fixture with its truth."""

from pathlib import Path

import pytest

from vftcli.analysis import Analysis
from vftcli.notebook import report

FIXTURE = Path(__file__).parent.parent.parent / "fixtures" / "ur5_circle.csv"


@pytest.fixture(scope="session")
def worked_up() -> Analysis:
    """Bounds are shares of what filter and smoother reach with R and Q read as densities."""
    names = ("gmo", "kfo-zoh", "kfo-rts", "kfo-auto", "rts-auto")
    density, truth = {"kfo.noise_convention": "density"}, f"file:{FIXTURE}.truth.parquet"
    return report(FIXTURE, "ur5", observer=names, settings=density, reference=truth)
