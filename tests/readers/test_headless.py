"""Tables without a header: what their values settle, and what they leave open."""

from itertools import permutations
from pathlib import Path

import numpy as np
import pytest

from vftcli.readers.columns import Guess, guess_columns
from vftcli.readers.reading import read
from vftcli.signals.errors import LogError

T31 = "t,q:6,dq:6,current:6,target_current:6,target_torque:6"
K = np.array([12.0, 12.0, 9.8, 10.8, 10.8, 10.8])
"""Drive constants of the planted controller. [N·m/A]"""

Table = dict[str, np.ndarray]


def table(joints: int = 6, seed: int = 3) -> Table:
    """Signals of an arm on sines: a controller's currents carry friction, the measured ones noise.

    The positions are integrated, so that dq is their derivative but for rounding. 100 Hz, 20 s
    """
    rng = np.random.default_rng(seed)
    t = 100 + 0.01 * np.arange(2000) + 0.001 * rng.random(2000)
    w = 0.6 + 0.2 * np.arange(joints)
    q, dq = np.sin(np.outer(t, w)), w * np.cos(np.outer(t, w))
    torque = 30 * np.cos(q) + 5 * np.gradient(dq, t, axis=0)
    current = (torque + 8 * np.tanh(dq / 0.002) + 4 * dq) / np.resize(K, joints)
    measured = current + 0.4 * rng.standard_normal(current.shape)
    found = {"t": t[:, None], "q": q, "dq": dq, "current": measured}
    return found | {"target_current": current, "target_torque": torque}


def guess(signals: Table, *names: str) -> Guess | None:
    return guess_columns(list(np.hstack([signals[n] for n in names or signals]).T))


def settled(signals: Table, *names: str) -> bool:
    """Whether a controller's 31 columns are the only thing that fits."""
    found = guess(signals, *names)
    assert found is not None
    return found.columns == T31 and found.others == ()


@pytest.mark.parametrize("order", list(permutations((3, 4, 5))))
def test_a_controllers_targets_settle_three_efforts_in_their_usual_order(order):
    names = list(table())
    assert settled(table(), *names[:3], *(names[k] for k in order)) == (order == (3, 4, 5))


@pytest.mark.parametrize(
    ("joints", "fits"), [(2, False), (3, True), (5, True), (12, True), (13, False)]
)
def test_positions_with_velocities_alone_are_settled(joints, fits):
    """Of three to twelve joints."""
    columns = ",".join(["t", f"q:{joints}", f"dq:{joints}"])
    expected = Guess(columns, "the first steps evenly, dq is the derivative of q")
    assert guess(table(joints), "t", "q", "dq") == (expected if fits else None)


@pytest.mark.parametrize(("pause", "fits"), [(19.5, True), (20.5, False)])
def test_a_clock_waits_less_than_twenty_steps_but_for_a_twentieth(pause, fits):
    t = np.cumsum(np.where(np.arange(2000) % 16 == 5, pause, 1.0)) * 0.001  # 6 % of the steps
    phase, w = np.outer(t, 0.6 + 0.2 * np.arange(6)), 0.6 + 0.2 * np.arange(6)
    found = guess({"t": t[:, None], "q": np.sin(phase), "dq": w * np.cos(phase)})
    assert (found is not None) == fits


@pytest.mark.parametrize(
    ("current", "target", "constant", "expected"),
    [
        # noise of the measured current and of its target by their rms, drive constant
        (0.30, 0.0, 1.0, True),
        (0.44, 0.0, 1.0, True),  # a cosine of 1/√(1 + .44²) = .92
        (0.56, 0.0, 1.0, False),  # .87
        (0.30, 0.10, 1.0, True),
        (0.30, 0.14, 1.0, False),  # no current is .12 of a torque
        (0.02, 0.02, 1.0, False),  # both currents fit as well
        (0.30, 0.0, 4.9 / 9.8, True),
        (0.30, 0.0, 2.8 / 9.8, False),
        (0.30, 0.0, 390 / 12.0, True),
        (0.30, 0.0, 410 / 12.0, False),
    ],
)
def test_how_well_targets_and_currents_have_to_fit(current, target, constant, expected):
    signals, rng = table(), np.random.default_rng(7)
    clean = signals["target_current"]
    for name, noise in (("current", current), ("target_current", target)):
        scale = noise * np.sqrt(np.mean(clean**2, axis=0))
        signals[name] = clean + scale * rng.standard_normal(clean.shape)
    signals["target_torque"] = constant * signals["target_torque"]
    assert settled(signals) == expected


@pytest.mark.parametrize(
    ("gain", "expected"), [(0.45, False), (0.55, True), (1.9, True), (2.1, False), (-1.0, False)]
)
def test_a_measured_current_is_between_half_and_twice_its_target(gain, expected):
    signals = table()
    signals["current"] = gain * signals["current"]
    assert settled(signals) == expected


def test_one_effort_may_be_torque_or_current_and_what_follows_is_skipped():
    names = ["t", "q", "dq", "current"]
    for more, skipped in (([], ""), (["more"], ",_:2")):
        found = guess(table() | {"more": np.ones((2000, 2))}, *names, *more)
        assert found is not None
        efforts = [f"t,q:6,dq:6,{effort}:6{skipped}" for effort in ("tau", "current", "tau+g")]
        assert [found.columns, *found.others] == efforts


@pytest.mark.parametrize("names", ["q dq current", "t q current", "t current q", "t dq q"])
def test_what_has_no_clock_or_no_velocities_behind_positions_is_not_guessed(names):
    assert guess(table(), *names.split()) is None


def test_a_joint_that_stands_is_counted_and_one_that_moves_without_velocity_is_not():
    signals = table()
    first = signals["q"][:, 0].copy()
    signals["q"][:, [0, 5]], signals["dq"][:, [0, 5]] = 0.3, 0.0
    found = guess(signals, "t", "q", "dq")
    assert found is not None
    assert found.columns == "t,q:6,dq:6"
    # Travel below 20 mrad need not show its velocity.
    for travel, fits in ((0.018, True), (0.022, False), (2.0, False)):
        signals["q"][:, 0] = 0.5 * travel * first
        assert (guess(signals, "t", "q", "dq") is not None) == fits


def check_read_as_described(path: Path) -> None:
    log, described = read(path), read(path, columns=T31)
    assert log.signals == described.signals, path
    for signal in ("t", *described.signals):
        np.testing.assert_array_equal(getattr(log, signal), getattr(described, signal))
    (reported,) = [r for r in log.source.remarks if r.code == "columns-by-value"]
    assert reported.values["columns"] == T31
    assert str(reported).startswith(f"31 columns read as {T31}: the first steps evenly")


def test_a_settled_table_is_read_as_if_it_were_described_and_that_is_said(tmp_path):
    signals = np.hstack(list(table().values()))
    np.save(tmp_path / "log.npy", signals)
    np.savetxt(tmp_path / "log.csv", signals, delimiter=",")
    for path in tmp_path.iterdir():
        check_read_as_described(path)
    np.savetxt(tmp_path / "log.csv", signals[:, :19], delimiter=",")
    with pytest.raises(LogError, match=r"19 columns .* t,q:6,dq:6,tau:6 or t,q:6,dq:6,current:6"):
        read(tmp_path / "log.csv")


def test_real_tables_are_read_as_their_description_says(logs):
    files = sorted((logs / "ur10e").iterdir())
    assert len(files) == 11
    for file in files:
        check_read_as_described(file)


@pytest.mark.parametrize(
    ("name", "line"),
    [("fr3/run_a.npy", "t,q:7,dq:7,tau:7,_:20"), ("ur10_link4/link4.csv.gz", "t,q:6,dq:6,tau:6")],
)
def test_other_real_tables_are_reported_what_fits(logs, name, line):
    with pytest.raises(LogError, match=line):
        read(logs / name)
