"""Latencies of a loop whose times are made up, so that they are known."""

from typing import Any

import numpy as np
import pytest

from vftcli.admittance.closed_loop import ClosedLoop, latencies
from vftcli.admittance.law import controllers, from_table
from vftcli.robots import load_robot

CONTROLLER = controllers(from_table(load_robot("ur5").admittance, "ur5", {}))[-1]
PERIOD = CONTROLLER.parameters.period
LIMIT = CONTROLLER.parameters.threshold
ROWS = 1000


def loop(**changed: Any) -> ClosedLoop:
    """A push along x in rows 300 to 500, seen 10 rows late, followed 20 rows late."""
    rows = np.arange(ROWS)
    truth, estimate, moved = (np.zeros((ROWS, 6)) for _ in range(3))
    truth[(rows >= 300) & (rows < 500), 0] = 2.0 * LIMIT[0]
    estimate[(rows >= 310) & (rows < 515), 0] = -1.5 * LIMIT[0]
    moved[:, 1] = np.clip((rows - 319) * 0.01, 0.0, 1.0)
    still = np.zeros((ROWS, 6))
    run = ClosedLoop(
        controller=CONTROLLER,
        t=rows * PERIOD,
        estimate=estimate,
        truth=truth,
        dragged=still > 0,
        commanded=still,
        q=still,
        moved=moved,
        reached=np.ones(ROWS, dtype=bool),
        zero=np.zeros(6),
        simulation=None,
    )
    return run._replace(**changed)


def test_a_push_is_seen_followed_and_withdrawn() -> None:
    (found,) = latencies(loop())
    assert found.axis == 0
    assert found.force == pytest.approx(300 * PERIOD)
    assert found.detection == pytest.approx(10 * PERIOD)
    assert found.motion == pytest.approx(20 * PERIOD)  # 10 mm, the first beyond 5
    assert found.withdrawal == pytest.approx(15 * PERIOD)
    assert found.rested


def test_the_paper_times_from_detection_and_from_the_estimate_s_fall() -> None:
    """Seen in row 310, 10 mm on in 320; gone in 515, and the way ends in 518 at 199 · 10 mm."""
    moved = np.zeros((ROWS, 6))
    moved[:, 1] = np.clip((np.arange(ROWS) - 319) * 0.01, 0.0, 1.99)
    (found,) = latencies(loop(moved=moved))
    assert found.reaction == pytest.approx(10 * PERIOD)
    assert found.turn == pytest.approx(3 * PERIOD)
    never = latencies(loop(estimate=np.zeros((ROWS, 6)), moved=np.zeros((ROWS, 6))))[0]
    assert never.reaction is never.detection is never.motion is None
    away = np.where(np.arange(ROWS)[:, None] < 300, 0.0, moved + np.arange(ROWS)[:, None])
    assert latencies(loop(moved=away))[0].turn is None


@pytest.mark.parametrize(
    ("axis", "speed", "begin", "rested"),
    # below 5 mm/s and .05 rad/s an arm rests, whatever it does once the force is there
    [
        *((0, 0.0045, 0, True), (0, 0.0055, 0, False), (1, 1.0, 300, True)),
        *((3, 0.045, 0, True), (4, 0.055, 0, False)),
    ],
)
def test_an_arm_that_moves_already_did_not_rest(
    axis: int, speed: float, begin: int, rested: bool
) -> None:
    moved, truth = np.zeros((2, ROWS, 6))
    moved[:, axis] = np.clip(np.arange(ROWS) - begin, 0, None) * PERIOD * speed
    truth[300:500, axis] = 2.0 * LIMIT[axis]
    (found,) = latencies(loop(moved=moved, truth=truth))
    assert found.rested == rested


def test_a_second_push_soon_after_is_the_same_one() -> None:
    truth = np.array(loop().truth)
    truth[510:600, 0] = 2.0 * LIMIT[0]
    assert len(latencies(loop(truth=truth))) == 1
    late = np.array(loop().truth)
    pause = round(1.0 / PERIOD)
    late[499 + pause : 520 + pause, 3] = 2.0 * LIMIT[3]
    assert [one.axis for one in latencies(loop(truth=late))] == [0, 3]
