"""Warm-up: friction that falls while a log runs is told, with its joints."""

from dataclasses import replace

import numpy as np
import pytest

from vftcli.identification.processing import Processing
from vftcli.identification.training import all_residuals, fit_frictions, prepare_training
from vftcli.identification.warm_up import warm_up_remarks


def remarks_of(recording, arm):
    """What is said of a log's warm-up."""
    data = prepare_training([recording], arm, Processing(), fit_constants=False)
    weights = [m.usable.astype(float) for m in data.motions]
    fits = fit_frictions(data, weights)
    return warm_up_remarks(data, all_residuals(data, fits), weights, fits)


@pytest.mark.slow
def test_a_joint_that_rubs_less_and_less_is_told(rubbing_arm, rubbing_log):
    assert remarks_of(rubbing_log, rubbing_arm) == []
    # 2 N·m more in joint 1 at the start, gone at the end: +.67 and −.67 in the outer thirds
    more = 2.0 * np.linspace(1.0, 0.0, rubbing_log.samples) * np.sign(rubbing_log.dq[:, 0])
    current = rubbing_log.current.copy()
    current[:, 0] += more / rubbing_arm.torque_constant[0]
    (said,) = remarks_of(replace(rubbing_log, current=current), rubbing_arm)
    assert (said.code, said.where.joints) == ("warm-up", (1,))
    # a swing of some seconds does not fill a third evenly
    assert said.values["first_Nm"] == pytest.approx([0.67], abs=0.25)
    assert said.values["last_Nm"] == pytest.approx([-0.67], abs=0.25)
