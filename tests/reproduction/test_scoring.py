"""What is scored of one log: every row beside plain NumPy, the worst span, a carried weight."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from vftcli.evaluation.scores import LAGS, ListedRow
from vftcli.pipeline import AnalysisChoice
from vftcli.readers.reader import RawLog
from vftcli.reproduction import scoring
from vftcli.reproduction.benchmark import planted
from vftcli.reproduction.manifest import BenchmarkLog, Rival
from vftcli.reproduction.scoring import (
    Answer,
    KnownTruth,
    own_answers,
    rows_of,
    truth_of,
    worst_of,
)
from vftcli.robots import load_robot
from vftcli.robots.run import Run
from vftcli.signals.external_torque import ExternalTorque
from vftcli.signals.recording import Recording, Source

LOG = BenchmarkLog(
    name="a", arm="A", truth="sensor", file="a.csv", score=((1.0, 18.0),),
    vouched=((0.0, 15.0),), weight_N=10.0,
)  # fmt: skip
TOUCHED = ((5.0, 7.0, 20.0), (12.0, 13.0, np.nan))


def answered() -> tuple[Answer, KnownTruth]:
    """Torque of two joints and wrench, both with gaps, .03 s behind a truth that ends early."""
    rng = np.random.default_rng(3)
    t = np.cumsum(rng.choice([0.01, 0.015], 1600))
    truth, late = (np.stack([np.sin(3.0 * x), 0.5 * np.cos(5.0 * x)], 1) for x in (t, t - 0.03))
    truth[t > 17.0] = np.nan
    late[(t > 6.0) & (t < 6.5), 0] = np.nan
    wrench, held = (rng.normal(size=(len(t), 6)) for _ in range(2))
    held[(t > 12.0) & (t < 12.2)] = np.nan
    rows = [ListedRow(5.2, 6.0, 17.0, 4.0), ListedRow(9.0, 10.0, 6.0), ListedRow(16.0, 17.0, 8.0)]
    torque = ExternalTorque(name="best", t=t, tau=late)
    return Answer(torque, held, lists={"list": rows}), KnownTruth(truth, wrench, TOUCHED)


def by_part(answer: Answer, truth: KnownTruth, log: BenchmarkLog) -> dict[Any, dict[str, Any]]:
    """The rows by part, and joint or axis where they have one; that of shifts as "lag"."""
    rows = list(rows_of(answer, truth, log))
    named = {}
    for row in rows:
        column = row.get("joint", row.get("axis"))
        place = row["part"] if column is None else (row["part"], column)
        named["lag" if "lag_squares" in row else place] = row
    assert len(named) == len(rows)
    return named


def test_every_row_is_that_of_plain_numpy() -> None:
    answer, truth = answered()
    found = by_part(answer, truth, LOG)
    t, w = answer.torque.t, np.gradient(answer.torque.t)  # no step is over 5 medians
    scored = (t >= 1.0) & (t <= 17.0)  # where the truth ends
    touch, near = (
        np.any([(t >= a - far) & (t <= b + far) for a, b, _ in TOUCHED], axis=0)
        for far in (0.0, 0.5)
    )
    parts = {"contact": scored & touch, "free": scored & ~near, "all": scored}
    error = np.nan_to_num(answer.torque.tau) - truth.tau
    for part, inside in parts.items():
        for j in (0, 1):
            row, e, mine = found[part, j + 1], error[inside, j], w[inside]
            assert row["rmse_Nm"] == pytest.approx(np.sqrt((mine * e**2).sum() / mine.sum()))
            assert row["l1_Nm"] == pytest.approx((mine * abs(e)).sum() / mine.sum())
            assert sum(row["seconds"]) == pytest.approx(mine.sum())
            silent = np.isnan(answer.torque.tau[inside, j])
            assert sum(row["missing"]) == pytest.approx(mine[silent].sum())
    # What is late by .03 s fits best .03 s later, but for the noiseless gap of .5 s.
    assert LAGS[np.argmin(found["lag"]["lag_squares"])] == pytest.approx(0.03)
    unshifted = (w[scored, None] * error[scored] ** 2).sum()
    assert found["lag"]["lag_squares"][10] == pytest.approx(unshifted)
    f, known = np.nan_to_num(answer.wrench)[touch], np.isfinite(answer.wrench[touch, 0])
    for axis in range(6):
        row, own = found["wrench", axis + 1], truth.wrench[touch, axis]
        square = (w[touch] * (f[:, axis] - own) ** 2).sum()
        assert sum(row["squares"]) == pytest.approx(square)
        assert sum(row["truth"]) == pytest.approx((w[touch] * own**2).sum())
        assert sum(row["missing"]) == pytest.approx(w[touch][~known].sum())
        assert sum(row["seconds"]) == pytest.approx(w[touch].sum())
    up, asked = -answer.wrench[:, 2], (t >= 1.0) & (t <= 18.0)
    here = asked & np.isfinite(up)
    assert found["weight"]["mean_N"] == pytest.approx((w * up)[here].sum() / w[here].sum())
    square = (w * (up - LOG.weight_N) ** 2)[here].sum() / w[here].sum()
    assert found["weight"]["rms_error_N"] == pytest.approx(np.sqrt(square))
    assert found["weight"]["answered"] == pytest.approx(w[here].sum() / w[asked].sum())
    # A row finds the first contact, one is false, one lies where nobody vouches.
    keys = ("true_contacts", "found", "false", "hardest_false_N", "peaks_held")
    assert [found["list"][key] for key in keys] == [2, 1, 1, 6.0, 1]
    assert found["list"]["free_h"] == pytest.approx((15.0 - 3.0) / 3600.0)
    assert found["worst"]["worst_t"][-1] <= 17.0


def test_parts_that_are_empty_or_scored_elsewhere_have_no_row() -> None:
    answer, truth = answered()
    whole = truth._replace(contacts=[(0.0, 30.0, np.nan)])
    parts = {key[0] for key in by_part(answer, whole, LOG) if isinstance(key, tuple)}
    assert parts == {"contact", "all", "wrench"}
    pushed = replace(LOG, pushes=((5.0, 2.0, (1.0, 0.0, 0.0)),))
    parts = {key[0] for key in by_part(answer, truth, pushed) if isinstance(key, tuple)}
    assert parts == {"contact", "all", "wrench"}
    free = KnownTruth(np.zeros_like(truth.tau), None, [])
    kept = by_part(answer, free, replace(LOG, truth="free", weight_N=0.0))
    assert set(kept) == {("free", 1), ("free", 2), "worst", "list"}
    # Times alone: of a torque nothing is known, and its list is counted.
    times = by_part(answer, KnownTruth(None, None, TOUCHED), replace(LOG, weight_N=0.0))
    assert set(times) == {"list"}
    # Without a list, without a wrench, zero: the torque alone, which no shift makes better.
    zero = ExternalTorque(name="zero", t=answer.torque.t, tau=0.0 * np.nan_to_num(truth.tau))
    kept = by_part(Answer(zero), truth, LOG)
    assert set(kept) == {(part, j) for part in ("contact", "free", "all") for j in (1, 2)}


def test_the_worst_span_is_where_the_error_is() -> None:
    t = np.arange(0.0, 40.0, 0.01)
    tau = np.zeros((len(t), 3))
    tau[(t > 21.0) & (t < 23.0), 1] = 4.0
    tau[t > 35.0, 0] = 90.0  # not scored
    torque = ExternalTorque(name="best", t=t, tau=tau)
    found = worst_of(torque, np.zeros_like(tau), t < 30.0)
    assert found["worst_joint"] == 2
    assert found["worst_t"][0] <= 21.0
    assert found["worst_t"][-1] > 22.98
    assert found["worst_t"][-1] - found["worst_t"][0] == pytest.approx(10.0, abs=0.02)
    assert max(found["worst_estimate"]) == 4.0


def read_truth(path: Path, columns: dict[str, Any], words: str, **more: Any) -> KnownTruth:
    """The truth that an entry with these words finds in a file."""
    np.savetxt(path, np.column_stack(list(columns.values())), delimiter=",")
    log = replace(LOG, truth_columns=words, **more)
    log = replace(log, data=str(path.parent), truth_file=path.name)
    t = columns["t"]
    source = Source(format="x", clock="x", rows=len(t), duplicates=0, t0=0.0)
    recording = Recording(t=t, q=np.zeros((len(t), 6)), source=source)
    return truth_of(log, recording, load_robot("ur5"))


def test_a_torque_alone_shows_its_contacts(tmp_path: Path) -> None:
    """Columns by the entry's words; from the sample above .05 N·m to the one below .025."""
    t = np.arange(0.0, 4.0, 0.01)
    tau = np.zeros((len(t), 6))
    tau[100:150, 4] = -0.06
    tau[150:160, 4] = 0.03
    tau[160:170, 4] = 0.02
    tau[250:300, 2] = 0.04  # below where one starts
    found = {"t": t, "tau": tau}
    truth = read_truth(tmp_path / "truth.csv", found, "t,tau_ext:6", truth="torque")
    assert truth.tau == pytest.approx(tau)
    assert [x[:2] for x in truth.contacts] == [pytest.approx((1.0, 1.6))]
    assert np.isnan(truth.contacts[0][2])
    assert truth.wrench is None


def test_a_wrench_shows_contacts_of_the_force_that_the_entry_says(tmp_path: Path) -> None:
    """From 2 N on until it is below half of that, whatever its moment is."""
    t = np.arange(0.0, 4.0, 0.01)
    w = np.zeros((len(t), 6))
    w[100:150, :2] = [1.5, -2.0]  # 2.5 N
    w[150:160, 0] = 1.1
    w[160:170, 0] = 0.9
    w[250:300, 1], w[300:, 3] = 1.9, 9.0
    words = {"truth": "sensor", "contact_N": 2.0}
    truth = read_truth(tmp_path / "truth.csv", {"t": t, "w": w}, "t,wrench:6", **words)
    assert truth.wrench == pytest.approx(w)
    assert truth.contacts == [pytest.approx((1.0, 1.6, 2.5))]


@pytest.mark.parametrize(("name", "signal"), [("ur5", "current"), ("panda", "torque")])
def test_a_planted_push_is_half_a_sine_at_the_flange_and_missing_in_the_drives(name, signal):
    """Its joint torque by Pinocchio's Jacobian; two pushes that meet add up."""
    robot, t = load_robot(name), np.linspace(0.0, 4.0, 401)
    q = np.linspace(-0.6, 0.5, robot.joints) + 0.1 * t[:, None]
    free = Recording(t=t, q=q, dq=0.1 + 0.0 * q, **{signal: np.ones(q.shape)})
    pushes = ((1.0, 2.0, (3.0, -4.0, 12.0)), (2.0, 0.5, (0.0, 8.0, 0.0)))
    pushed, wrench, tau = planted(Run(recording=free, robot=robot), pushes)
    sine = np.sin(np.pi * np.clip((t - 1.0) / 2.0, 0.0, 1.0))[:, None] * [3.0, -4.0, 12.0]
    sine[:, 1] += 8.0 * np.sin(np.pi * np.clip((t - 2.0) / 0.5, 0.0, 1.0))
    np.testing.assert_allclose(wrench[:, :3], sine, atol=1e-12)
    assert not wrench[:, 3:].any()
    data, axes = robot.model.createData(), pin.LOCAL_WORLD_ALIGNED
    flange = robot.model.getFrameId("flange")
    for k in range(0, 401, 40):
        J = pin.computeFrameJacobian(robot.model, data, q[k], flange, axes)
        np.testing.assert_allclose(tau[k], J.T @ wrench[k], atol=1e-9)
    effort = tau if signal == "torque" else tau / robot.torque_constant
    np.testing.assert_allclose(pushed.require(signal), 1.0 - effort, atol=1e-12)


@pytest.mark.parametrize(("apart", "own"), [(0.9e-6, True), (1.1e-6, False)])
def test_stamps_within_a_microsecond_are_the_logs_own(tmp_path, monkeypatch, apart, own) -> None:
    """Else what another program says is read off between its samples."""
    t = 0.01 * np.arange(50)
    steps = np.where(np.arange(50)[:, None] % 2, 1.0, 0.0) * np.ones(6)
    said = RawLog(stamps=t + apart, tick=1.0, clock="t", signals={"tau_ext": steps})
    listed = [ListedRow(0.1, 0.2, 3.0, 1.0)]
    monkeypatch.setattr(scoring, "read_outside", lambda *_: said)
    monkeypatch.setattr(scoring, "read_list", lambda _: listed)
    rival = Rival(name="theirs", folder=str(tmp_path), causal=True)
    for name in ("a.csv", "a.contacts.csv"):
        (tmp_path / name).touch()
    answer = scoring.outside_answer(Recording(t=t, q=np.zeros((50, 6))), LOG, rival)
    assert np.array_equal(answer.torque.tau, steps) == own
    assert (answer.about, answer.lists) == ({"future": False}, {"list": listed})


def test_the_lists_of_the_best_estimate_keep_peaks_and_bands(monkeypatch) -> None:
    """A contact of unknown force is listed with 0 N; candidates are sorted in by time."""
    contact = SimpleNamespace(start=3.0, stop=4.0, peak_force=17.0, peak_band=4.0, is_load=False)
    unknown = SimpleNamespace(start=1.0, stop=2.0, peak_force=None, peak_band=None, is_load=True)
    t, tau = 0.01 * np.arange(500), np.zeros((500, 6))
    made = SimpleNamespace(
        wrenches=(),
        motion=SimpleNamespace(log=SimpleNamespace(terms=None)),
        observers=[SimpleNamespace(estimate=lambda _: None)] * 2,
        contacts=SimpleNamespace(contacts=[contact], candidates=[unknown]),
        estimates=[ExternalTorque(name=name, t=t, tau=tau) for name in ("best", "gmo")],
    )
    monkeypatch.setattr(scoring, "analyse", lambda *_: made)
    run = Run(recording=Recording(t=t, q=tau), robot=load_robot("ur5"))
    answers = own_answers(run, AnalysisChoice(), LOG)
    lists = {answer.torque.name: answer.lists for answer in answers}
    listed = ListedRow(3.0, 4.0, 17.0, 4.0)
    both = [ListedRow(1.0, 2.0, 0.0, 0.0, is_load=True), listed]
    best = {"list": [listed], "list with candidates": both}
    assert lists == {"zero": {}, "gmo": {}, "best": best}
