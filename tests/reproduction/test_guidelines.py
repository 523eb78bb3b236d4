"""What the paper's guidelines go by, of observers whose responses are known."""

from types import SimpleNamespace

import numpy as np
import polars as pl
import pytest

from vftcli.evaluation.errors import SCHEMA
from vftcli.observers import FilteredDynamicsObserver, KalmanObserver, MomentumObserver
from vftcli.observers.observer import Observer
from vftcli.reproduction.estimates import guideline_numbers, step_response

STEP = 0.002


def numbers(
    *observers: Observer, step: float = STEP, errors: pl.DataFrame | None = None
) -> list[dict[str, float]]:
    """The numbers of observers on an arm of two joints, in their order."""
    made = SimpleNamespace(
        recording=SimpleNamespace(median_step=step, joints=2),
        observers=observers,
        tunings={o.name: o.tuning(step, 2) for o in observers},
        errors=errors,
    )
    return list(guideline_numbers(made).values())  # type: ignore[arg-type]


def test_a_first_order_filter_reaches_nine_tenths_at_its_time() -> None:
    """ln(10)/K, to the sample time; within 3 s: of K = .7 1/s, 3.29 s, nothing is known."""
    for gain in (20.0, 5.0, 0.8):
        found = step_response(MomentumObserver(gain=gain), STEP, 2)
        assert found == pytest.approx(np.full(2, np.log(10.0) / gain), abs=1.5 * STEP)
    assert np.isnan(step_response(MomentumObserver(gain=0.7), STEP, 1)[0])


def test_an_observers_rmse_is_its_own_mean_over_joints() -> None:
    """Two observers, three joints, rows of a wrench and an unknown joint among them."""
    each = [
        ("gmo", 1, 1.0),
        ("gmo", 2, 3.0),
        ("gmo", 3, None),
        ("fdo", 1, 50.0),
        ("fdo", 2, 70.0),
    ]
    rows = [dict(zip(("observer", "joint", "rmse_Nm"), row, strict=True)) for row in each]
    errors = pl.DataFrame([*rows, {"observer": "gmo", "rmse_Nm": 900.0}], SCHEMA)
    observers = MomentumObserver(gain=5.0), FilteredDynamicsObserver(omega=5.0), KalmanObserver()
    gmo, fdo, kalman = numbers(*observers, errors=errors)
    assert gmo["rmse"] == pytest.approx(2.0)
    assert fdo["rmse"] == pytest.approx(60.0)
    assert np.isnan(kalman["rmse"])
    assert gmo["numbers"] == 2.0


def test_what_passes_is_noise_above_a_persons_contacts() -> None:
    """A first-order low-pass of 50 1/s passes more of what lies above 5 Hz than one of 5 1/s."""
    f = np.linspace(0.0, 250.0, 513)[1:]  # up to half the sample rate of 2 ms
    for gain in (50.0, 5.0):
        (found,) = numbers(MomentumObserver(gain=gain))
        size = 1.0 / np.sqrt(1.0 + (2.0 * np.pi * f[f > 5.0] / gain) ** 2)
        # The sampled observer's response bends down near half the sample rate.
        assert found["passed"] == pytest.approx(100.0 * np.sqrt(np.mean(size**2)), rel=0.05)


def test_of_a_slow_log_what_passes_is_read_at_its_highest_frequency() -> None:
    """At 2 Hz nothing lies above 5 Hz; the mean of nothing was a NumPy warning on the terminal."""
    observer = MomentumObserver(gain=0.5)
    (found,) = numbers(observer, step=0.5)
    highest = np.abs(observer.frequency_response(np.array([1.0]), 0.5, 2))
    assert found["passed"] == pytest.approx(100.0 * float(np.mean(highest)), rel=1e-12)


def test_the_slowest_joint_decides_and_what_passes_is_the_joints_mean() -> None:
    """Joints of 50 and 5 1/s against observers that have one of them on both joints."""
    gains = (np.array([50.0, 5.0]), 50.0, 5.0)
    both, fast, slow = (numbers(MomentumObserver(gain=gain))[0] for gain in gains)
    assert both["response"] == slow["response"] > fast["response"]
    assert both["delay"] == slow["delay"] > fast["delay"]
    assert both["passed"] == pytest.approx(0.5 * (fast["passed"] + slow["passed"]), rel=1e-12)
