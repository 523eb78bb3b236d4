"""What a notebook asks of a log, without a command line."""

import json
from collections.abc import Callable
from dataclasses import replace
from inspect import signature
from pathlib import Path

import numpy as np
import pytest
from example_logs import CIRCLE, FIXTURES, TAPS
from made_runs import command

import vftcli as vft
from vftcli.free_motion import FreeChoice
from vftcli.pipeline import AnalysisChoice, analyse_logs, list_touches
from vftcli.robots import RobotChoice

T, Q = np.linspace(0.0, 1.0, 11), np.zeros((11, 6))


@pytest.fixture(scope="module")
def analysis() -> vft.Analysis:
    return vft.report(CIRCLE, "ur5", observer=["best", "gmo"], reference="two-cycle")


def test_contacts_are_those_of_the_pipeline() -> None:
    robot, free = RobotChoice.parsed(robot="ur5"), FreeChoice.parsed(free=["0.3:4"])
    choice = AnalysisChoice(robot=robot, free=free)
    (made,) = analyse_logs([TAPS], choice, work=list_touches)
    found = vft.contacts(TAPS, robot="ur5", free=["0.3:4"])
    rows = [(contact.start, contact.stop, contact.peak_force) for contact in found]
    assert rows == [(c.start, c.stop, c.peak_force) for c in made.contacts.contacts]
    assert len(rows) == len(found) == 2
    assert found.to_polars()["peak_force_N"].to_list() == [peak for _, _, peak in rows]
    assert found.hardest.where == "wrist"


def test_a_log_and_a_robot_may_be_files_or_objects() -> None:
    recording, robot = vft.read(TAPS), vft.load_robot("ur5")
    named = vft.contacts(TAPS, "ur5", free=["0.3:4"], interval="0:6").to_polars()
    held = vft.contacts(recording, robot, free=["0.3:4"], interval="0:6").to_polars()
    assert named.equals(held)
    free = vft.read(CIRCLE, interval="0:4")
    assert vft.contacts(recording, robot, free=free, interval="5:6").basis == "free motion"


@pytest.mark.slow
def test_a_list_without_contacts_is_a_list_nevertheless(analysis: vft.Analysis) -> None:
    empty = replace(analysis.contacts, contacts=())
    assert empty
    assert len(empty) == 0
    assert list(empty) == []
    assert empty.to_polars().columns[:2] == ["number", "start_s"]
    assert "0 contacts" in repr(empty)


@pytest.mark.slow
def test_a_report_answers_everything(analysis: vft.Analysis) -> None:
    assert len(analysis.contacts) == 12  # the pushes of the fixture's truth
    assert analysis.wrench.name == "best"
    assert set(analysis.errors["observer"]) == {"best", "gmo"}
    codes = analysis.remarks.to_polars()["code"].to_list()
    assert {"free-cycles-found", "floor-propagated", "wrench-smoothed"} <= set(codes)
    assert len(codes) == len(analysis.remarks)
    estimates, wrenches = analysis.estimates.to_polars(), analysis.wrenches.to_polars()
    assert estimates["tau_ext/gmo/1"].to_numpy() == pytest.approx(analysis.estimates[1].tau[:, 0])
    assert wrenches.equals(analysis.wrench.to_polars())
    assert estimates.columns.count("t") == 1


def test_everything_in_hand_is_one_line_and_a_table(analysis: vft.Analysis) -> None:
    things = [
        *(analysis, analysis.recording, analysis.robot, analysis.robot.chain, analysis.reference),
        *(analysis.contacts, analysis.contacts[0], analysis.contacts.model, analysis.wrench),
        *(analysis.estimates[0], analysis.remarks, analysis.remarks[0], analysis.motion),
        *(analysis.motion.log, analysis.motion.log.terms, analysis.virtual_sensor),
        *(analysis.refinement, analysis.examinations[0], analysis.tunings["gmo"]),
        *(*analysis.observers, vft.KalmanObserver()),
    ]
    assert "ur5: best, gmo; 12 contacts" in repr(analysis)
    for thing in things:
        assert len(repr(thing)) <= 162, type(thing)
        assert "\n" not in repr(thing), type(thing)
        table = thing._repr_html_()
        assert table.startswith("<table>"), type(thing)
        assert len(table) < 6000, type(thing)


def test_a_report_is_written_where_it_is_asked_for(tmp_path: Path) -> None:
    asked = {"robot": "ur5", "observer": "gmo", "interval": "0:6", "free": "0:4"}
    vft.report(CIRCLE, output=tmp_path / "out", **asked)
    record = json.loads((tmp_path / "out" / "run.json").read_text("utf-8"))
    assert record["command"].startswith("vftcli.report(")
    assert (tmp_path / "out" / "index.html").exists()
    with pytest.raises(vft.VftError, match="--force"):
        vft.report(CIRCLE, output=tmp_path / "out", **asked)


@pytest.mark.slow
def test_thresholds_are_those_of_the_command(tmp_path: Path) -> None:
    free = tmp_path / "free.parquet"
    words = ("--set", "contacts=[]", "--set", "trajectory.cycles=9")
    command("simulate", "ur5-circle", *words, "-o", free)
    record = json.loads(command("thresholds", free, "--robot", "ur5", "--json"))
    found = vft.thresholds(free, "ur5")
    rows = [row["threshold_Nm"] for row in record["joints"]]
    assert found.to_polars().filter(unit="N·m")["threshold"].to_list()[:6] == rows
    assert [remark.code for remark in found.remarks] == [r["code"] for r in record["remarks"]]
    assert len(repr(found)) <= 162
    assert found._repr_html_().count("<tr>") == 1 + 6 + 6 + 1  # head, joints, axes, |F|


def test_options_and_settings_are_the_keywords_of_a_call(analysis: vft.Analysis) -> None:
    """Made from the fields of the choices: the calls take what the commands take, as `vftcli`."""
    words = set(signature(vft.report).parameters)
    assert {"log", "robot", "free", "observer", "gains", "zero", "reference_columns"} <= words
    made = vft.estimate(CIRCLE, "ur5", observer="gmo", frame="base", settings={"gmo.gain": 5})
    assert analysis.recording.source.sha256 == made.recording.source.sha256
    assert made.wrench.frame == "base"
    assert np.all(getattr(made.observers[0], "gain", None) == 5.0)
    table = vft.compare(CIRCLE, "ur5", "two-cycle", observer=["best", "gmo"])
    assert table.columns == analysis.errors.columns
    assert table.filter(recording=CIRCLE.name)["rmse_Nm"].equals(analysis.errors["rmse_Nm"])


def test_an_analysis_is_plotted_and_saved(analysis: vft.Analysis, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    for what, panels in {"contacts": 1, "torques": 6, "wrench": 6, "errors": 1}.items():
        assert len(analysis.plot(what).axes) == panels
    assert len(analysis.plot("torques", joints=[2], observers=["gmo"]).axes) == 1
    assert len(analysis.plot("torques", joints=2, observers="gmo").axes) == 1
    (axes,) = analysis.contacts.plot().axes
    assert len(axes.lines) >= len(analysis.contacts)
    for wrong in (
        {"what": "forces"}, {"what": None}, {"joints": [7]}, {"joints": "2"}, {"joints": 0},
        {"joints": 1.5}, {"observers": ["fdo"]}, {"observers": "fdo"}, {"observers": 3},
    ):  # fmt: skip
        with pytest.raises(vft.VftError, match="there is"):
            analysis.plot(**wrong)
    other = replace(analysis, errors=analysis.errors.clear())
    with pytest.raises(vft.VftError, match="the analysis holds no errors to plot"):
        other.plot("errors")
    analysis.save(tmp_path / "out")
    assert (tmp_path / "out" / "index.html").exists()


@pytest.mark.slow
def test_robots_scenarios_and_replays_are_asked_for(tmp_path: Path) -> None:
    log = vft.simulate("ur5-circle", seed=2, settings={"duration": 4})
    assert log.truth.columns[:2] == ["t", "tau_ext/1"]
    assert np.allclose(log.truth["t"].to_numpy()[-1], log.duration, atol=0.01)
    examined = vft.inspect(log)
    assert examined.robots[0].robot == "ur5"
    assert len(examined.remarks.to_polars()) == len(examined.remarks)
    rows = vft.admit(robot="ur5", alpha=[1, 1.6], release="x=0.3")
    assert rows["alpha"].to_list() == [None, 1.0, 1.6]
    mine = vft.identify(FIXTURES / "ur5_table1.csv", "ur5", "friction")
    mine.save(tmp_path / "mine.toml")
    assert vft.load_robot(tmp_path / "mine.toml").friction == mine.friction
    with pytest.raises(vft.VftError, match="--force"):
        mine.save(tmp_path / "mine.toml")
    tuned = vft.identify(CIRCLE, "ur5", method="gains", interval="0:12")
    tuned.save(tmp_path / "tuned.toml")
    gains = vft.load_robot(tmp_path / "tuned.toml").gains
    assert np.allclose(gains["gmo"]["gain"], tuned.gains["gmo"]["gain"])


MISTAKES: dict[str, tuple[str, Callable[[], object]]] = {
    "gain": ("one for each of 6", lambda: vft.MomentumObserver(gain=[5, 3]).estimate(TERMS)),
    "gain 2d": ("2 values", lambda: vft.MomentumObserver(gain=[[5, 3]]).estimate(TERMS)),
    "gain text": ("array of numbers", lambda: vft.MomentumObserver(gain="fast")),
    "kalman": ("r_diag has 2", lambda: vft.KalmanObserver(r_diag=[1, 2]).estimate(TERMS)),
    "omega": ("one number", lambda: vft.FilteredDynamicsObserver(omega=[1, 2])),
    "no terms": ("Run", lambda: vft.MomentumObserver().estimate(RECORDING)),
    "q one joint": (r"\(T, n\)", lambda: vft.Recording(t=T, q=Q[:, 0])),
    "q text": ("array of numbers", lambda: vft.Recording(t=T, q="q")),
    "q none": (r"\(T, n\)", lambda: vft.Recording(t=T, q=None)),
    "ragged": ("array of numbers", lambda: vft.Recording(t=T, q=[[1, 2], [3]])),
    "t scalar": ("one-dimensional", lambda: vft.Recording(t=1.0, q=Q)),
    "dq": (r"\(11, 6\)", lambda: vft.Recording(t=T, q=Q, dq=Q[:, :5])),
    "names": ("one per joint", lambda: vft.Recording(t=T, q=Q, joint_names=("a",))),
    "payload": (r"\(3,\)", lambda: vft.Recording(t=T, q=Q, payload_com=(1.0,))),
    "p": (r"\(T, n\)", lambda: vft.DynamicsTerms(t=T, p=Q[:, 0], mu=Q)),
    "tau": (r"\(T, n\)", lambda: vft.ExternalTorque(name="x", t=T, tau=Q[:, 0])),
    "keyword": ("refrence. Did you mean reference", lambda: vft.report(CIRCLE, refrence="zero")),
    "setting": ("is no setting here.*low-pass", lambda: vft.contacts(CIRCLE, settings=LOW)),
    "setting's value": ("expected a text", lambda: vft.contacts(CIRCLE, settings=NONE)),
    "flag": ("True or False", lambda: vft.estimate(CIRCLE, causal="yes")),
    "nothing": ("required argument: 'log'", vft.inspect),
    "no reference": ("needs reference=: two-cycle", lambda: vft.compare(CIRCLE, "ur5")),
    "two drivers": ("once", lambda: vft.admit(CIRCLE, "ur5", observer=["gmo", "fdo"])),
    "scenario": ("no scenario 'circle'", lambda: vft.simulate("circle")),
    "robot's number": ("profile's name", lambda: vft.load_robot(5)),
    "pose": (r"\(T, 6\)", lambda: vft.flange_jacobian(vft.load_robot("ur5").chain, Q[0])),
    "no chain": ("robot.chain", lambda: vft.link_poses(vft.load_robot("ur5"), Q)),
    "errors": ("list of ExternalTorque", lambda: vft.evaluate("log", TORQUE, TORQUE)),
    "errors' log": ("recording.name", lambda: vft.evaluate(RECORDING, [TORQUE], TORQUE)),
    "rmse": ("array of numbers", lambda: vft.rmse(TORQUE, TORQUE)),
    "read's keyword": ("colums. Did you mean columns", lambda: vft.read(CIRCLE, colums="t")),
    "scenario's number": ("expected a file's name", lambda: vft.simulate(3)),
    "settings": ("settings are a dict", lambda: vft.contacts(CIRCLE, "ur5", settings=3)),
    "scenario's settings": ("are a dict", lambda: vft.simulate("taps", settings=["a=3"])),
    "None": ("log is None", lambda: vft.contacts(None)),
    "two logs": ("log is \\[", lambda: vft.contacts([CIRCLE, CIRCLE], "ur5")),
    "output": ("output is 3", lambda: vft.report(CIRCLE, "ur5", output=3)),
    "path": ("expected a file's name", lambda: vft.read(None)),
    "arm": ("--arm middle; there is left, right", lambda: vft.read(CIRCLE, arm="middle")),
    "columns as a number": ("columns is 3; expected a text", lambda: vft.read("a.csv", columns=3)),
    "columns": ("no column", lambda: vft.read(CIRCLE, columns="q=foo*")),
    "columns of an object": ("read already", lambda: vft.contacts(RECORDING, columns="q=a*")),
    "interval": ("is not A:B", lambda: vft.contacts(CIRCLE, "ur5", interval=(0, 4))),
    "free": ("3: no such file", lambda: vft.report(CIRCLE, "ur5", free=3)),
    "report's robot": ("a Robot", lambda: vft.report(CIRCLE, 5)),
    "report's log": ("a Recording", lambda: vft.report(5)),
    "no free log": ("no log is given", lambda: vft.thresholds([], "ur5")),
    "no file": ("no such file", lambda: vft.contacts("no_such_log.csv", robot="ur5")),
}  # fmt: skip

LOW, NONE = {"two-cycle.lowpass": 5}, {"two-cycle.low-pass": None}
RECORDING = vft.Recording(t=T, q=Q, dq=Q, torque=Q)
TERMS = vft.DynamicsTerms(t=T, p=Q, mu=Q)
TORQUE = vft.ExternalTorque(name="gmo", t=T, tau=Q)


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_is_one_line_that_says_what_was_expected(mistake: str) -> None:
    expected, make = MISTAKES[mistake]
    with pytest.raises(vft.VftError, match=expected) as caught:
        make()
    assert "\n" not in str(caught.value)
