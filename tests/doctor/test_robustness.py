"""Whatever a Recording can hold, it is examined: no exception, no warning of NumPy, no NaN."""

import json
from functools import cache
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from vftcli.doctor import examine, finding_record
from vftcli.robots import Robot, load_robot
from vftcli.signals.recording import JOINT_SIGNALS, Recording

SIZES = st.sampled_from(
    [0.0, 5e-324, 1e-300, 1e-12, 1e-3, 1.0, 13.5, 70.0, 1e4, 9e8, 1e30, 1e308]
)
"""From denormal to the largest numbers, past each limit of the doctor."""
STEPS = st.sampled_from([1e-300, 1e-12, 1e-6, 1e-3, 8e-3, 0.5, 1.0, 1e3, 1e10, 1e290])


@st.composite
def recordings(draw: st.DrawFn) -> Recording:
    """Logs of 1 to 50 samples and 1 to 7 joints: constant, smooth, noisy or zero, of every size."""
    samples, joints = draw(st.integers(1, 50)), draw(st.integers(1, 7))
    chance = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    usual, odd = draw(STEPS), draw(STEPS)
    steps = np.where(chance.random(samples) < draw(st.sampled_from([0.0, 0.1, 0.5])), odd, usual)
    t = np.cumsum(steps) - steps[0]
    t = t[np.concatenate([[True], np.diff(t) > 0])]  # a small step beside a large time is none
    shape = (len(t), joints)

    def signal(width: int) -> Any:
        size = draw(SIZES)
        kind = draw(st.sampled_from(["constant", "wave", "noise", "steps", "one joint"]))
        value = {
            "constant": np.ones((len(t), width)),
            "wave": np.sin(np.outer(np.arange(len(t)), 0.1 + np.arange(width))),
            "noise": chance.uniform(-1, 1, (len(t), width)),
            "steps": np.repeat(chance.uniform(-1, 1, (len(t), width)), 9, axis=0)[: len(t)],
            "one joint": np.eye(width)[0] * chance.uniform(-1, 1, (len(t), 1)),
        }[kind]
        return size * value

    chosen = draw(st.sets(st.sampled_from([n for n in JOINT_SIGNALS if n != "q"])))
    signals = {name: signal(joints) for name in sorted(chosen)}
    if draw(st.booleans()):
        signals["wrench"] = signal(6)
    return Recording(t=t, q=signal(shape[1]), **signals)


def log_of(t: list[float], value: float = 1.0) -> Recording:
    """Six joints with every common signal, all of one value."""
    x = np.full((len(t), 6), value)
    return Recording(t=np.array(t), q=x, dq=x, torque=x, current=x, target_current=x)


@cache
def arm(joints: int) -> Robot:
    """An arm with as many joints, whether the log is from it or not."""
    return load_robot({6: "ur5e", 7: "panda"}[joints])


@pytest.mark.slow
@given(recordings())
@example(log_of([0.0]))
@example(log_of([0.0, 1e-300]))
@example(log_of([1e-300 * k for k in range(30)]))
@example(log_of([float(k) for k in range(30)], 0.0))
@settings(max_examples=200)
def test_every_recording_is_examined_and_what_is_said_is_json(recording):
    """pytest turns every warning into an error here, NumPy's of an overflow too."""
    robot = arm(recording.joints) if recording.joints in {6, 7} else None
    examination = examine(recording, robot)
    for finding in examination.findings:
        json.dumps(finding_record(finding), allow_nan=False)
    json.dumps([(fit.misfit, fit.load) for fit in examination.robots], allow_nan=False)
