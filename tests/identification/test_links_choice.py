"""The default method: links are held unless they are wrong."""

from dataclasses import replace

import numpy as np
import pytest
from sound_logs import BULLET

from vftcli.evaluation.errors import rmse
from vftcli.identification import Task
from vftcli.identification.fitting import identify
from vftcli.identification.methods import chosen_method
from vftcli.identification.training import prepare_training
from vftcli.observers import MomentumObserver
from vftcli.readers.reading import read
from vftcli.robots import load_robot
from vftcli.robots.kernels import chain_parameters, torque_regressor
from vftcli.robots.terms import dynamics_terms

pytestmark = pytest.mark.slow

UR5 = load_robot("ur5")


def with_other_links(recording, sines, share):
    """The currents of an arm whose links weigh so much more, alternately less."""
    _, q, dq, ddq = sines(seconds=12.0, seed=2)
    factor = share * np.array([1, -1, 1, -1, 1, -1])
    chain = replace(UR5.chain, mass=UR5.chain.mass * (1.0 + factor))
    more = chain_parameters(chain) - chain_parameters(UR5.chain)
    extra = torque_regressor(UR5.chain, q, dq, ddq) @ more
    return replace(recording, current=recording.current + extra / UR5.torque_constant)


@pytest.mark.parametrize(("share", "method"), [(0.0, "friction"), (0.35, "base")])
def test_wrong_links_are_identified_too(recording, sines, share, method):
    log = with_other_links(recording, sines, share)
    result = chosen_method(prepare_training([log], UR5))
    assert result.method == method
    said = "links-identified" in [remark.code for remark in result.remarks]
    assert said is (method == "base")


def test_a_log_that_no_profile_made_is_identified_without_a_method(logs):
    """Bullet's UR5: no friction, no rotors, nobody's links; a third file tests the other two."""
    free = [read(logs / "bullet_ur5" / f"free_{k}.csv.gz", columns=BULLET) for k in (5, 6, 7)]
    found = identify(free[:2], UR5, Task())
    assert found.method == "base"
    gain = UR5.gains["gmo"]["gain"]
    left = MomentumObserver(gain=gain).estimate(dynamics_terms(free[2], found.robot)).tau
    # the figure required; .13 measured, 1.15 with the profile's links
    assert float(np.mean(rmse(left, 0.0 * left))) <= 0.20
