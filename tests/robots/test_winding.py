"""Endless joints: positions within one turn are wound up again."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from made_urdfs import arm, link, robot, written

from vftcli.doctor.examination import Examiner
from vftcli.readers.reader import ReadChoice
from vftcli.robots import load_robot
from vftcli.robots.pairing import unwound
from vftcli.signals.recording import Recording


def test_a_jump_of_a_turn_is_taken_back_and_said(tmp_path: Path) -> None:
    arm6 = load_robot(written(tmp_path, robot(link("base"), arm(6, kind="continuous"))))
    t = np.arange(0.0, 8.0, 0.01)
    q = np.stack([(k - 2.5) * t for k in range(6)], axis=1)
    within = (q + np.pi) % (2.0 * np.pi) - np.pi
    log = Recording(t=t, q=within, target_q=within)
    found = unwound(log, arm6)
    np.testing.assert_allclose(found.q, q, atol=1e-13)  # rounding of a few turns
    assert found.target_q is not None
    np.testing.assert_allclose(found.target_q, q, atol=1e-13)
    (remark,) = found.source.remarks
    assert remark.where.joints == (1, 2, 3, 4, 5, 6)
    assert Examiner().taken(log, arm6, ReadChoice()).source.remarks == (remark,)


def test_what_does_not_jump_is_the_log_itself(tmp_path: Path) -> None:
    endless = load_robot(written(tmp_path, robot(link("base"), arm(5, kind="continuous"))))
    limited = replace(endless, endless=())
    jumping = Recording(t=np.array([0.0, 0.1]), q=np.array([[0.0] * 5, [6.0] * 5]))
    still = replace(jumping, q=np.zeros((2, 5)))
    missing = replace(jumping, q=np.array([[0.0] * 5, [np.nan] * 5]))
    for log, robot_ in ((jumping, limited), (still, endless), (missing, endless)):
        assert unwound(log, robot_) is log
