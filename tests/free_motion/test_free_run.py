"""A free run has one owner: read, modelled and aligned once, one object."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from vftcli.free_motion import free_motion as room
from vftcli.free_motion.free_motion import FreeRun
from vftcli.readers.reading import read
from vftcli.robots import load_robot
from vftcli.robots.run import Run
from vftcli.signals.errors import ReferenceTorqueError
from vftcli.signals.recording import Recording

FIXTURE = Path(__file__).parents[2] / "fixtures" / "ur5_circle.csv"
ROBOT = load_robot("ur5")
Make = Callable[[Recording, float, float], Recording]


@pytest.fixture(scope="module")
def circle() -> Recording:
    return read(FIXTURE)


def test_alignment_and_pairing_are_made_once(
    part_of: Make, circle: Recording, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = []
    whole = room.align
    monkeypatch.setattr(room, "align", lambda *logs: made.append(logs) or whole(*logs))
    log, free = part_of(circle, 5.0, 11.0), part_of(circle, 0.0, 4.0)
    run = FreeRun(run=Run(recording=free, robot=ROBOT), log=Run(recording=log, robot=ROBOT))
    assert run.pairing is run.pairing
    assert run.alignment.overlap.any()
    assert len(made) == 1
    # The circle takes 4 s: the log's sample at t is at the place of t + 5 s of the whole log.
    known = run.pairing.known
    off = (run.pairing.times[known] - log.t[known] - 5.0 + 2.0) % 4.0 - 2.0
    np.testing.assert_allclose(off, 0.0, atol=2e-3)  # a quarter of a sample


def test_another_motion_has_no_pairing_and_says_so_each_time(
    part_of: Make, circle: Recording
) -> None:
    log = part_of(circle, 4.0, 8.0)
    other = replace(log, q=log.q[:, ::-1] + 0.5, source=replace(log.source, t0=99.0))
    run = FreeRun(run=Run(recording=other, robot=ROBOT), log=Run(recording=log, robot=ROBOT))
    for _ in range(2):
        with pytest.raises(ReferenceTorqueError, match="not a free run of the trajectory"):
            _ = run.pairing
