"""The --columns grammar, and the tables it describes."""

import numpy as np
import polars as pl
import pytest
from seed_logs import headerless_csv, motion, table_csv

from vftcli.readers.columns import parse_columns
from vftcli.readers.reader import ReadChoice
from vftcli.readers.reading import read, read_chosen
from vftcli.signals.errors import ClockError, LogError
from vftcli.signals.wrench import WrenchFrame

DEGREE = np.pi / 180


def test_one_joint_of_several_is_turned(path):
    path.write_text("t q_0 q_1 dq_0 dq_1\n0 0.1 0.2 0.3 0.0\n1 0.2 0.3 0.4 0.5\n")
    recording = read(path, columns="t=t,q=q_{i},dq=dq_0|-dq_1")
    np.testing.assert_array_equal(recording.dq, [[0.3, 0.0], [0.4, -0.5]])
    assert not np.signbit(recording.require("dq")[0, 1])
    assert "turned the sign of dq (--columns)" in recording.source.repairs
    for columns, words in (
        ("q=q_{i},dq=dq_0|-dq_0", "a column of dq twice"),
        ("q=q_{i},dq=dq_0|-dq_7", "no column 'dq_7' for dq"),
        ("t=q_0|-q_1,q=q_{i}", "time cannot run back"),
    ):
        with pytest.raises(LogError, match=words):
            read(path, columns=columns)


UNITS = {
    "t": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9},
    "q": {"rad": 1.0, "mrad": 1e-3, "deg": DEGREE, "rev": 2 * np.pi},
    "dq": {"rad/s": 1.0, "rad": 1.0, "deg/s": DEGREE, "deg": DEGREE, "rpm": np.pi / 30},
    "current": {"A": 1.0, "mA": 1e-3},
    "tau": {"Nm": 1.0, "N·m": 1.0, "mNm": 1e-3, "Ncm": 1e-2},
    "temperature": {"C": 1.0, "°C": 1.0, "degC": 1.0},
}
UNITS |= {"target_q": UNITS["q"], "target_dq": UNITS["dq"], "target_current": UNITS["current"]}
UNITS |= dict.fromkeys(("tau+g", "tau_ext", "target_torque"), UNITS["tau"])
FIELDS = {"tau": "torque", "tau+g": "torque_without_gravity"}


@pytest.mark.parametrize(("signal", "unit"), [(s, u) for s, each in UNITS.items() for u in each])
def test_every_unit_becomes_that_of_the_si(signal, unit, path):
    given = {"t": 1000.0 * np.arange(10), "q": np.arange(10) / 50}
    given[signal] = given.get(signal, np.arange(10) / 8)
    np.savetxt(path, np.column_stack([*given.values()]), delimiter=",")
    units = {"t": "s", "q": "rad", signal: unit}
    recording = read(path, columns=",".join(f"{name}[{units[name]}]" for name in given))
    values = getattr(recording, FIELDS.get(signal, signal)).reshape(10)
    np.testing.assert_allclose(values, given[signal] * UNITS[signal][unit], rtol=1e-12)


def test_degrees_without_a_unit_are_refused(path):
    path.write_text("".join(f"{k / 100},{90 + k}\n" for k in range(10)))
    with pytest.raises(LogError, match=r"q\[deg\]"):
        read(path, columns="t,q")
    assert read(path, columns="t,q[rad]").joints == 1


def test_named_columns_start_at_the_smallest_index(path):
    rows = "".join(f"{k / 10},{k},{2 * k},{0.1 * k},{0.2 * k}\n" for k in range(4))
    path.write_text("clock,eff_3,eff_4,pos_3,pos_4\n" + rows)
    recording = read(path, columns="t=clock,q=pos_{i},tau=eff_{i}")
    np.testing.assert_allclose(recording.q, np.outer(np.arange(4), [0.1, 0.2]), rtol=1e-12)
    np.testing.assert_array_equal(recording.require("torque")[:, 1], 2 * np.arange(4))


def test_wrench_by_names_carries_its_frame(path):
    rows = "".join(f"{k},0,1,2,3,4,5,{k}\n" for k in range(4))
    path.write_text("t,q1,Fx,Fy,Fz,Mx,My,Mz\n" + rows)
    recording = read(path, columns="t=t,q=q{i},wrench[base]=Fx|Fy|Fz|Mx|My|Mz")
    assert recording.wrench_frame == WrenchFrame("base", "flange")
    np.testing.assert_array_equal(recording.require("wrench")[3], [1, 2, 3, 4, 5, 3])


def test_one_of_several_recordings(path):
    rows = "".join(f"{k / 100},{j + 0.001 * k}\n" for j in range(3) for k in range(30))
    path.write_text("t,q1\n" + rows)
    with pytest.raises(ClockError, match="segment=1"):
        read(path)
    for none in (0, 4):
        with pytest.raises(ClockError, match=f"no segment {none}; the file holds 3"):
            read(path, columns=f"segment={none}")
    second = read(path, columns="segment=2")
    assert (second.samples, second.q[0, 0]) == (30, 1.0)
    expected = [-1] * 30 + list(range(30)) + [-1] * 30  # the sample that each row is
    assert second.source.row_samples.tolist() == expected
    assert "read recording 2 of 3, rows 31 to 60 (segment)" in second.source.repairs
    reported, *_ = read_chosen(path, ReadChoice(examining=True)).source.remarks
    assert (reported.code, reported.level) == ("time-reset", "warning")
    assert reported.values["rows"] == [30, 60]


@pytest.mark.parametrize(
    ("text", "reported"),
    [
        ("", "empty"),
        ("t,q:6,speed:6", "no signal 'speed'"),
        ("t,q:6,q:6", "twice"),
        ("t,dq:6", "no q"),
        ("t,q[furlong]:6", "no unit 'furlong'"),
        ("t,q:0", "at least one"),
        ("t:2,q:6", "at least one"),
        ("t,q=pos_{i}", "t has no column name"),
        ("t,q:6;dq:6", "cannot understand"),
        ("t@0Hz,q:6", "t@125Hz"),
        ("segment=x,q:6", "whole number"),
        ("t,q:*", "only _:"),
        ("t,_:*,q:6,_:*", "give it once"),
    ],
)
def test_what_cannot_be_understood_is_said(text, reported):
    with pytest.raises(LogError, match=reported):
        parse_columns(text)


@pytest.mark.parametrize(
    "columns", ["t,q:6,dq:6,current:6", "t,q:6,dq:6,_:6", "t,q:6,dq:6,_:*", "t,q:6,_:*,current:6"]
)
def test_columns_are_counted_in_file_order_and_some_skipped(path, columns):
    recording, log = read(headerless_csv(path), columns=columns), motion()
    assert (recording.source.format, recording.torque) == ("headerless", None)
    np.testing.assert_allclose(recording.t, log["t"], atol=1e-9)
    for name in ("q", "dq", "current"):
        values = getattr(recording, name)
        assert (values is None) == (name not in columns)
        if values is not None:
            np.testing.assert_allclose(values, log[name], atol=5e-7)  # six decimals are written


HEADED, HEADERLESS = table_csv, headerless_csv


@pytest.mark.parametrize(
    ("make", "columns", "reported"),
    [
        (HEADERLESS, "t,q:6", "skip the rest with _:12"),
        (HEADERLESS, "t,q:6,dq:6,current:6,tau:6", "describes 25 columns, the table has 19"),
        (HEADERLESS, "t,q:6,dq:5,current:7", "dq has 5 columns, q has 6"),
        (HEADERLESS, "q=x_{i}", "no header"),
        (HEADED, "t=time,q=q_{i}", "no column 'time'.*q_0"),
        (HEADED, "t=t,q=pos_{i}", r"no column 'pos_\{i\}'"),
        (HEADED, "t=t,q=q_0|q_1,dq=dq_0", "dq has 1 columns, q has 2"),
        (HEADED, "t=t,q=q_0[0:2]", "not of lists"),
        (HEADED, "t=t,q=q_0|q_1|q_1", "a column of q twice"),
        (HEADED, "-tau=effort", "no column 'effort' for tau; the table has t, q_0, q_1"),
    ],
)
def test_a_table_that_is_described_wrongly(path, make, columns, reported):
    with pytest.raises(LogError, match=reported):
        read(make(path), columns=columns)


def test_columns_of_lists_hold_the_clock_or_are_no_numbered_columns(path):
    """A pair of seconds and nanoseconds may be one list; q_{i} finds no lists."""
    stamps, q = [[k, 5 * 10**8] for k in range(9)], [[0.1 * k, 0.2] for k in range(9)]
    pl.DataFrame({"stamp": stamps, "q_0": q}).write_parquet(path)
    for clock in ("stamp", "stamp[0]|stamp[1]"):
        assert read(path, columns=f"t={clock},q=q_0").source.t0_ns == 5 * 10**8
    with pytest.raises(LogError, match=r"no column 'q_\{i\}'"):
        read(path, columns="t=stamp,q=q_{i}")


def test_a_torque_without_gravity_is_no_torque(path):
    """By its name in --columns, and by UR's own name in a recording of its client."""
    rows = "\n".join(f"{0.1 * k},{','.join(str(k + j) for j in range(12))}" for k in range(4))
    q, efforts = (",".join(f"{name}{j}" for j in range(6)) for name in "qe")
    path.write_text(f"t,{q},{efforts}\n{rows}\n")
    found = read(path, columns="t=t,q=q{i},-tau+g[mNm]=e{i}")
    assert found.signals == ("q", "torque_without_gravity")
    expected = [-1e-3 * (2 + j) for j in range(6, 12)]
    assert found.require("torque_without_gravity")[2].tolist() == pytest.approx(expected)
    names = q.replace("q", "actual_q_"), efforts.replace("e", "actual_current_as_torque_")
    path.write_text(f"timestamp,{','.join(names)}\n{rows}\n")
    assert read(path).signals == ("q", "torque_without_gravity")


@pytest.mark.parametrize(
    ("columns", "signal", "value"),
    [
        ("-tau=effort", "torque", -5.0),
        ("-tau=effort_{i}", "torque", -5.0),
        ("-tau", "torque", -5.0),
        ("t[ms],tau[mNm]", "torque", 5e-3),
        ("current[mA]=EFFORT", "current", 5e-3),
        ("t[ms]=time", "torque", 5.0),
    ],
)
def test_a_text_without_positions_is_of_its_signals_alone(path, columns, signal, value):
    rows = "\n".join(f"{k / 10},0.1,0.2,0.3,0.4,5,6" for k in range(5))
    path.write_text("time,q_0,q_1,dq_0,dq_1,effort_0,effort_1\n" + rows + "\n")
    recording = read(path, columns=columns)
    assert recording.signals == tuple(sorted({"q", "dq", signal}, key=["q", "dq", signal].index))
    assert getattr(recording, signal)[0, 0] == pytest.approx(value)
    assert recording.median_step == pytest.approx(1e-4 if columns.startswith("t[") else 0.1)


def test_an_error_lists_24_columns_and_counts_the_others(path):
    """A name of more than 40 letters is cut to 37."""
    names = ["t", "q1", "x" * 40, "y" * 41, *(f"c{k}" for k in range(22))]
    path.write_text(f"{','.join(names)}\n{','.join('1' * len(names))}\n")
    shown = ", ".join([*names[:3], "y" * 37 + "…", *names[4:24]])
    with pytest.raises(LogError, match=f"the table has {shown} and 2 more.$"):
        read(path, columns="q=nope")
