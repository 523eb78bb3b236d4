"""Thresholds as the robots' own calls and as tables; the numbers are made up, their places not."""

import ast
import json
import re
import tomllib
from dataclasses import replace

import numpy as np
import pytest

from vftcli.contacts.threshold_check import CheckedContact, ThresholdDetection
from vftcli.contacts.thresholds import SignalThreshold, Thresholds, tail_of
from vftcli.outputs.grid import significant, terminal
from vftcli.outputs.run_record import jsonable
from vftcli.outputs.thresholds import (
    calls,
    check_line,
    thresholds_grid,
    thresholds_record,
    thresholds_text,
)

NAN = float("nan")


def made(joints: int = 7, *, own: bool = True, axes: int = 6) -> Thresholds:
    """Joint j at j + .001 N·m with its upper end 1 beyond; axes likewise from 10 on."""
    tail = tail_of(np.arange(900.0))

    def one(value: float) -> SignalThreshold:
        return SignalThreshold(value + 0.001, (value - 1, value + 1), 0.1, "free.csv", tail)

    return Thresholds(
        rate=1.0, of_vendor=own, logged_wrench=own,
        joints=tuple(one(j) for j in range(1, joints + 1)),
        axes=tuple(one(10.0 + k) for k in range(axes)), force=(one(30.0),) if axes else (),
    )  # fmt: skip


def test_a_franka_gets_contacts_at_the_threshold_and_collisions_at_its_upper_end() -> None:
    """Rounded up to hundredths; franka_ros the same in both phases."""
    found = calls(made())
    assert set(found) == {"libfranka", "franka_ros", "toml"}
    call = ast.parse(found["libfranka"]).body[0]
    lists = [ast.literal_eval(argument) for argument in call.value.args]
    assert lists == [
        [1.01, 2.01, 3.01, 4.01, 5.01, 6.01, 7.01],
        [2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0],
        [10.01, 11.01, 12.01, 13.01, 14.01, 15.01],
        [11.0, 12.0, 13.0, 14.0, 15.0, 16.0],
    ]
    head, *lines = found["franka_ros"].splitlines()
    assert head == "collision_config:"
    pairs = (line.split(":") for line in lines)
    values = {key.strip(): ast.literal_eval(value.strip()) for key, value in pairs}
    names = ("lower_torque", "upper_torque", "lower_force", "upper_force")
    assert values == {
        f"{name}_thresholds_{phase}": row
        for name, row in zip(names, lists, strict=True)
        for phase in ("acceleration", "nominal")
    }
    # The robot compares its own estimate, which this is not.
    other = calls(made(7, own=False))
    assert "tau_ext" in other["libfranka"].splitlines()[0]
    assert "tau_ext" in other["franka_ros"].splitlines()[0]


def test_a_ur_gets_the_size_of_the_force_and_a_toml_reads_back() -> None:
    found = calls(made(6))
    assert set(found) == {"ur_script", "toml"}
    text = found["ur_script"]
    assert re.search(r"if force\(\) > 30\.01:", text)
    assert text.count("end\n") == 3
    assert "#" not in text.splitlines()[0]
    assert "actual_TCP_force" in calls(made(6, own=False))["ur_script"].splitlines()[0]
    table = tomllib.loads(found["toml"])["thresholds"]
    assert table["joint_torque_Nm"] == [1.01, 2.01, 3.01, 4.01, 5.01, 6.01]
    assert (table["rate_per_h"], table["force_size_N"]) == (1.0, 30.01)
    assert table["force_N"] == [10.01, 11.01, 12.01]
    assert table["moment_upper_Nm"] == [14.0, 15.0, 16.0]
    for joints in (7, 4):
        assert set(calls(made(joints, axes=0))) == {"toml"}


def test_what_is_wide_is_no_threshold_and_in_no_call() -> None:
    plain = made(6)
    wide = plain.axes[2]._replace(interval=(1.0, 99.0))
    axes = (*plain.axes[:2], wide, *plain.axes[3:])
    some = replace(plain, axes=axes, force=(plain.force[0]._replace(interval=(3.0, 70.0)),))
    assert set(calls(some)) == {"toml"}
    assert set(calls(replace(made(7), axes=axes))) == {"toml"}
    table = tomllib.loads(calls(some)["toml"])["thresholds"]
    assert not {"force_N", "force_upper_N", "force_size_N"} & set(table)
    assert table["moment_Nm"] == [13.01, 14.01, 15.01]
    record = thresholds_record(some, ())
    assert [row["threshold_N"] for row in record["axes"][:3]] == [10.001, 11.001, None]
    assert record["force"]["threshold_N"] is None
    assert "–" in terminal(thresholds_grid(some)).splitlines()[-1]


def check(reference: str | None = "sensor") -> ThresholdDetection:
    contacts = (
        CheckedContact(1.0, 2.0, 40.0, 0.05, "J2"),
        CheckedContact(4.0, 5.0, 12.0, NAN, ""),
        CheckedContact(7.0, 8.0, 20.0, 0.15, "fz"),
    )
    counts = {"false_alarms": 2, "untouched_h": 0.5}
    counts = counts if reference else {"false_alarms": None, "untouched_h": NAN}
    found = {"log": "pushed.csv", "reference": reference, "contacts": contacts, "remarks": ()}
    return ThresholdDetection(**found | counts)


def test_the_record_has_the_keys_of_the_contract_and_is_strict_json() -> None:
    text = json.dumps(jsonable(thresholds_record(made(), [check()])), allow_nan=False)
    record = json.loads(text)
    assert [row["joint"] for row in record["joints"]] == [1, 2, 3, 4, 5, 6, 7]
    assert record["joints"][0]["interval_Nm"] == [0.0, 2.0]
    assert record["axes"][5]["interval_Nm"] == [14.0, 16.0]
    assert [row["axis"] for row in record["axes"]] == ["fx", "fy", "fz", "mx", "my", "mz"]
    assert record["force"]["threshold_N"] == pytest.approx(30.001)
    # k = 30 of 900 readings of a second: 120 an hour, a quarter of one.
    assert (record["joints"][0]["tail_maxima"], record["joints"][0]["hours"]) == (30, 0.25)
    (checked,) = record["checks"]
    assert (checked["detected"], checked["smallest_detected_N"]) == (2, 20.0)
    assert checked["contacts"][1]["delay_s"] is None


def test_what_has_no_tail_has_no_upper_end_either() -> None:
    short = SignalThreshold(5.0, (5.0, NAN), 1.0, "short.csv", None)
    one = replace(made(1, axes=0), joints=(short,))
    record = json.loads(json.dumps(jsonable(thresholds_record(one, ())), allow_nan=False))
    assert record["joints"][0]["interval_Nm"] == [5.0, None]
    assert tomllib.loads(record["calls"]["toml"])["thresholds"]["joint_torque_upper_Nm"] == [5.0]
    assert "short.csv" in terminal(thresholds_grid(one))


def test_the_tables_name_every_signal_and_log() -> None:
    """k = 30 of 900 readings of a second, the 31st largest of 0 … 899 on."""
    text = thresholds_text(made(6), [check()])
    table, checked, *texts = text.split("\n\n")
    title, heads, *rows, _ = table.splitlines()
    assert title == "Passed without contact 1 × an hour by any joint, or by any axis"
    assert " ".join(heads.split()) == "threshold 95 % free motion [h] set by"
    units = dict.fromkeys(["J1", "J2", "J3", "J4", "J5", "J6", "mx", "my", "mz"], "N·m")
    values = [*range(1, 7), *range(10, 16), 30]
    names = ["J1", "J2", "J3", "J4", "J5", "J6", "fx", "fy", "fz", "mx", "my", "mz", "|F|"]
    for row, name, value in zip(rows, names, values, strict=True):
        shown, low, high = (significant(x) for x in (value + 1e-3, value - 1.0, value + 1.0))
        tail = ["0.250", "free.csv"]
        assert row.split() == [name, shown, units.get(name, "N"), f"{low}–{high}", *tail]
    *lines, line = checked.splitlines()
    assert lines == [
        "pushed.csv: contacts at these thresholds",
        "#  from [s]  to [s]  |F| [N]  delay [ms]  alarm by",
        "1      1.00    2.00     40.0          50  J2",
        "2      4.00    5.00     12.0           –  missed",
        "3      7.00    8.00     20.0         150  fz",
    ]
    assert line == check_line(check())
    assert [text.partition(":")[0] for text in texts] == ["ur_script", "toml"]


def test_the_line_on_a_check_counts_and_sizes() -> None:
    line = check_line(check())
    assert "2 of 3 contacts detected" in line
    assert "100 ms after they begin (median), at most 150 ms" in line
    assert "weakest detected 20.0 N" in line
    assert "hardest missed 12.0 N" in line
    assert "2 false in 0.500 h" in line
    assert check_line(check(None)) == "pushed.csv: 3 alarms, the weakest at 20.0 N"
    on = check()._replace(contacts=(check().contacts[0]._replace(already_above=True),))
    assert ", 1 while an alarm was on already, 2 false" in check_line(on)
