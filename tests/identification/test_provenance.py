"""Where the numbers of an identified robot come from, as its file says."""

from pathlib import Path

import numpy as np
import polars as pl

from vftcli.identification.fitting import (
    PARAMETERS,
    RESIDUALS,
    SHAPE_CHOICES,
    Identification,
    Trace,
    with_provenance,
)
from vftcli.identification.links import BASE
from vftcli.identification.methods import number
from vftcli.identification.payload import LoadFit
from vftcli.robots import Payload, load_robot
from vftcli.robots.profile import robot_toml
from vftcli.signals.recording import Recording, Source
from vftcli.signals.remarks import fact

UR5 = load_robot("ur5")


def log(path, sha256="ab"):
    """A log of one second."""
    t = np.arange(0, 1.01, 0.01)
    zero = np.zeros((len(t), 6))
    return Recording(t=t, q=zero, dq=zero, source=Source(path=Path(path), sha256=sha256))


def found(method="friction", base=None, robot=UR5):
    """An identification that found J2's rotor inertia, but not J3's, and J1's constant."""
    numbers = [
        number(0, "torque_constant", 12.0, 0.1, 11.0, True),
        number(1, "rotor_inertia", 5.0, 0.1, 4.0, True),
        number(2, "rotor_inertia", 5.0, 9.0, 4.0, False),
    ]
    rows = [
        ("log.csv", index, role, model, j, 0.123456 * j + index, 100)
        for index, role in ((1, "train"), (2, "held-out"))
        for model in ("identified", "profile")
        for j in (1, 2)
    ]
    return Identification(
        robot=robot,
        profile=UR5,
        method=method,
        residuals=pl.DataFrame(rows, schema=RESIDUALS, orient="row"),
        parameters=pl.DataFrame(numbers, schema=PARAMETERS, orient="row"),
        shape_choices=pl.DataFrame([], schema=SHAPE_CHOICES, orient="row"),
        base=base,
        traces=(),
        processing={"cutoff_hz": 8.0},
    )


def sources(robot, key):
    """Where the numbers of one kind come from, joint by joint."""
    return [table[f"{key}_source"] for table in robot.document["joints"]]


def test_what_was_determined_names_the_logs_the_rest_the_profile():
    logs = [log("a/log.csv"), log("free.csv")]
    robot = with_provenance(found(), "mine", logs, logs[:1], None)
    new, old = "identified (friction) from log.csv", "profile ur5"
    assert sources(robot, "rotor_inertia") == [old, new, old, old, old, old]
    assert sources(robot, "torque_constant") == [new, *[old] * 5]
    assert sources(robot, "inertial") == [old] * 6
    account = robot.document["identification"]
    assert (account["method"], account["profile"]) == ("friction", "ur5")
    assert account["logs"] == ["log.csv", "free.csv"]
    assert account["sha256"] == ["ab", "ab"]
    assert (robot.name, robot.path) == ("mine", None)
    assert robot.title.endswith(", identified")
    assert with_provenance(found(), "", logs, logs, None).name == "ur5-identified"


def test_the_method_of_the_whole_arm_names_the_links_too():
    base = pl.DataFrame([("m1", 1.0, float("inf"), False)], schema=BASE, orient="row")
    robot = with_provenance(found("base", base), "", [log("a.csv")], [log("a.csv")], None)
    assert set(sources(robot, "inertial")) == {"identified (base) from a.csv"}
    assert set(sources(robot, "rotor_inertia")) == {"identified (base) from a.csv"}
    (row,) = robot.document["identification"]["base_parameters"]
    assert row == {"parameter": "m1", "value": 1.0, "sd": float("inf"), "determined": False}


def test_a_load_says_how_it_was_found_and_in_which_log():
    load = Payload(mass=1.5, com=np.array([0.0, 0.0, 0.1]), inertia=np.zeros((3, 3)))
    origin = fact("load-from-poses", poses=7, different=7, logs=1)
    carried = (log("a/log.csv"),)
    fit = LoadFit(load, 0.1, np.full(3, 0.01), np.ones(6), carried, origin)
    loaded = UR5.with_payload(load)
    robot = with_provenance(found("payload", robot=loaded), "", carried, (), fit)
    assert robot.document["payload"]["source"].startswith("load from 7 poses at rest")
    table = robot.document["identification"]["payload"]
    assert (table["loaded"], table["mass_sd"]) == ("log.csv", 0.1)
    assert table["residual_Nm"] == [1.0] * 6


def test_residuals_are_one_table_a_log_even_of_one_name(prepared):
    t, left = np.arange(0, 1, 0.01), np.tile([1.123456, 1.246912], (100, 1))
    roles = enumerate(("train", "held-out"))
    traces = [
        Trace(prepared(t, tau=left), role, left + k, 0 * left, left[0]) for k, role in roles
    ]
    scored = found()._replace(traces=tuple(traces))
    robot = with_provenance(scored, "", [log("a.csv")], [log("a.csv")], None)
    assert robot.document["identification"]["residuals"] == [
        {"log": "recording", "role": "train", "rms_Nm": [1.1235, 1.2469]},
        {"log": "recording", "role": "held-out", "rms_Nm": [2.1235, 2.2469]},
    ]


def test_a_source_has_length_and_digest():
    logs = [log("b.csv"), log("c.csv"), log("a/log.csv", "")]
    table = with_provenance(found(), "", logs, logs, None).document["sources"][-1]
    assert (table["id"], table["sha256"]) == ("log-3", "unknown")
    assert table["ref"] == "log.csv, 101 samples, 1.000 s"


def test_traces_give_rows_and_rms(prepared):
    t = np.arange(0, 1, 0.01)
    measured = np.tile([3.0, 4.0], (100, 1))
    motion = prepared(t, tau=measured)
    trace = Trace(motion, "train", measured, np.zeros((100, 2)), np.array([7.0, 8.0]))
    np.testing.assert_array_equal(trace.rms, [3.0, 4.0])
    assert trace.rows(5) == [
        ("recording", 5, "train", "identified", 1, 3.0, 100),
        ("recording", 5, "train", "identified", 2, 4.0, 100),
        ("recording", 5, "train", "profile", 1, 7.0, 100),
        ("recording", 5, "train", "profile", 2, 8.0, 100),
    ]


def test_what_a_paper_printed_of_the_profile_is_not_said_of_another_arm():
    assert UR5.published
    assert "published" in UR5.document
    robot = with_provenance(found(), "mine", [log("a.csv")], [log("a.csv")], None)
    assert robot.published == {}
    assert "published" not in robot.document
    assert "published" in UR5.document
    assert "[published]" not in robot_toml(robot)
