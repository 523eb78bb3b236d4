"""What a notebook asks of a log, without a command line."""

from pathlib import Path

import pytest

import vftcli as vft
from vftcli.pipeline import AnalysisChoice, analyse_logs, list_touches
from vftcli.repetition.choice import FreeChoice
from vftcli.robots.choice import RobotChoice

TAPS = Path(__file__).parents[1] / "fixtures" / "ur5_taps_ur_rtde.csv"


def test_contacts_are_those_of_the_pipeline() -> None:
    choice = AnalysisChoice(
        robot=RobotChoice.parsed(robot="ur5"), free=FreeChoice.parsed(free_part="0.3:4")
    )
    (made,) = analyse_logs([TAPS], choice, work=list_touches)
    assert (expected := made.contacts) is not None
    found = vft.contacts(TAPS, robot="ur5", free_part="0.3:4")
    rows = [(contact.start, contact.stop, contact.peak_force) for contact in found.contacts]
    assert rows == [(c.start, c.stop, c.peak_force) for c in expected.contacts]
    assert len(rows) == 2


def test_a_file_that_is_not_there_is_one_line() -> None:
    with pytest.raises(vft.VftError):
        vft.contacts("no_such_log.csv", robot="ur5")
