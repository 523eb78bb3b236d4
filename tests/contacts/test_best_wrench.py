"""The list and the wrench of `best` beside it: two accounts of one contact that must agree."""

from functools import cache

import numpy as np
import pytest
from contact_logs import FIXTURES

from vftcli.analysis import Analysis
from vftcli.observers.choice import ObserverChoice
from vftcli.pipeline import AnalysisChoice, analyse_log
from vftcli.repetition.choice import FreeChoice
from vftcli.robots.choice import RobotChoice
from vftcli.virtual_sensor.choice import WrenchChoice

NAMES = "ur5_circle.csv", "ur5_table1.csv"


@cache
def analysed(name: str) -> Analysis:
    """A fixture's contacts and the wrench of `best`, base axes."""
    return analyse_log(
        FIXTURES / name,
        AnalysisChoice(
            robot=RobotChoice(name="ur5"),
            free=FreeChoice.parsed(free_part="0.3:4"),
            observers=ObserverChoice(names=("best",)),
            wrench=WrenchChoice(frame="base"),
        ),
    )


BEYOND = (
    "2 of 12: with the profile's friction the list misses the true forces at 7.3 and 11.3 s by 3.9 "
    "and 3.6 of its sd; best holds both"
)


@pytest.mark.parametrize(
    "name",
    [pytest.param(NAMES[0], marks=pytest.mark.xfail(reason=BEYOND, strict=True)), NAMES[1]],
)
def test_the_wrench_of_best_is_within_the_lists_band_at_its_peaks(name: str) -> None:
    """The list takes the model as it is, the wrench less the bias of the whole log.

    Both bands are of 95 %: of a dozen peaks one may lie beyond.
    """
    analysis = analysed(name)
    assert analysis.contacts is not None
    assert analysis.virtual_sensor is not None
    (best,) = analysis.virtual_sensor.wrenches
    assert best.sd is not None
    away = 0
    for row in analysis.contacts.contacts:
        assert row.wrench is not None
        assert row.wrench_sd is not None
        here = int(np.argmin(np.abs(best.t - row.peak)))
        apart = np.abs(best.values[here, :3] - row.wrench[:3])
        away += bool(np.any(apart > 1.96 * np.hypot(best.sd[here, :3], row.wrench_sd[:3])))
    assert away <= 1


@pytest.mark.parametrize("name", NAMES)
def test_outside_of_the_rows_and_a_block_on_either_side_best_has_no_wrench(name: str) -> None:
    analysis = analysed(name)
    assert analysis.contacts is not None
    assert analysis.virtual_sensor is not None
    (best,) = analysis.virtual_sensor.wrenches
    near = np.zeros(len(best.t), dtype=bool)
    for row in analysis.contacts.contacts:
        near |= (best.t > row.start - 0.08) & (best.t < row.stop + 0.08)
    assert not best.values[~near].any()
