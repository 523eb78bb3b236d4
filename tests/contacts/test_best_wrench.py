"""The list and the wrench of `best` beside it: two accounts of one contact that must agree."""

import numpy as np
import pytest
from contact_logs import FIXTURES

from vftcli.observers.choice import ObserverChoice
from vftcli.pipeline import AnalysisChoice, analyse_log
from vftcli.repetition.choice import FreeChoice
from vftcli.robots.choice import RobotChoice
from vftcli.virtual_sensor.choice import WrenchChoice


@pytest.mark.parametrize("name", ["ur5_circle.csv", "ur5_table1.csv"])
def test_the_wrench_of_best_is_within_the_lists_band_at_its_peaks(name: str) -> None:
    """The list takes the model as it is, the wrench less the bias of the whole log.

    Both bands are of 95 %: of a dozen peaks one may lie beyond.
    """
    analysis = analyse_log(
        FIXTURES / name,
        AnalysisChoice(
            robot=RobotChoice(name="ur5"),
            free=FreeChoice.parsed(free_part="0.3:4"),
            observers=ObserverChoice(names=("best",)),
            wrench=WrenchChoice(frame="base"),
        ),
    )
    assert analysis.contacts is not None
    assert analysis.virtual_sensor is not None
    (best,) = analysis.virtual_sensor.wrenches
    assert best.sd is not None
    rows = analysis.contacts.contacts
    away = 0
    for row in rows:
        assert row.wrench is not None
        assert row.wrench_sd is not None
        here = int(np.argmin(np.abs(best.t - row.peak)))
        apart = np.abs(best.values[here, :3] - row.wrench[:3])
        away += bool(np.any(apart > 1.96 * np.hypot(best.sd[here, :3], row.wrench_sd[:3])))
    assert away <= 1
    # Outside of the rows, and a block on either side, there is no wrench.
    near = np.zeros(len(best.t), dtype=bool)
    for row in rows:
        near |= (best.t > row.start - 0.08) & (best.t < row.stop + 0.08)
    assert not best.values[~near].any()
