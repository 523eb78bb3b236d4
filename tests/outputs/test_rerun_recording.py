import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import rerun.chunk
from contact_rows import contact, contact_list
from example_logs import CIRCLE
from made_runs import analyse_log
from rerun_rows import rows_of, times_of

from vftcli.analysis import Analysis
from vftcli.contacts.contact_list import Unexplained
from vftcli.observers import ObserverChoice
from vftcli.outputs import FULL, LEVELS
from vftcli.outputs.charts import PLACES
from vftcli.outputs.contacts import answer
from vftcli.outputs.rerun_file import NEWTON_PER_METRE, arrow_scale, motion, painted_links
from vftcli.outputs.rerun_recording import (
    contact_log,
    force_arrow,
    plot_groups,
    summary,
    tabs_of,
    write_rrd,
)
from vftcli.outputs.run_record import all_remarks
from vftcli.pipeline import AnalysisChoice
from vftcli.robots import RobotChoice
from vftcli.robots.chain import link_poses
from vftcli.signals.arrays import Z_95
from vftcli.signals.remarks import Where, caution
from vftcli.signals.wrench import AXES
from vftcli.wrench import WrenchChoice, ZeroChoice
from vftcli.wrench.solvers import frame_pose


@pytest.fixture(scope="module")
def path(analysis: Analysis, tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("rrd") / "recording.rrd"
    write_rrd(file, analysis)
    return file


@pytest.mark.slow
def test_the_file_verifies_and_its_blueprint_is_in_use_when_it_is_opened(path: Path) -> None:
    """The text is asserted: for a file that is no recording the exit code is 0 as well.

    A blueprint that is a default alone comes too late for a viewer in a browser.
    """
    said = {}
    for word in ("verify", "print"):
        command = [sys.executable, "-m", "rerun", "rrd", word, str(path)]
        done = subprocess.run(command, capture_output=True, text=True, check=True)
        said[word] = done.stdout + done.stderr
    assert "1 file verified without error" in said["verify"]
    assert "make_active: true, make_default: true" in said["print"]
    reader = rerun.chunk.RrdReader(str(path))
    assert (len(reader.blueprints()), len(reader.recordings())) == (1, 1)


def test_lines_and_times_read_back(path: Path, analysis: Analysis) -> None:
    for j in range(1, 7):
        assert rows_of(path, f"/tau_ext/J{j}", "SeriesLines:names")[-1] == [
            "reference (vendor)", "fdo", "gmo", "kfo-fe", "kfo-zoh", "best", "best 95 % upper",
            "best 95 % lower",
        ]  # fmt: skip
        assert rows_of(path, f"/residual/J{j}", "Scalars:scalars")
    for entity in ("/q", "/dq", "/drive_torque"):
        names = rows_of(path, entity, "SeriesLines:names")
        assert names[-1] == [f"J{j}" for j in range(1, 7)]
    for entity in ("/summary", "/errors"):
        assert rows_of(path, entity, "TextDocument:text")
    values = np.array(rows_of(path, "/tau_ext/J2", "Scalars:scalars"))
    best, *others = (e.tau[:, 1] for e in analysis.estimates)
    expected = [analysis.reference.tau[:, 1], *others, best]
    np.testing.assert_array_equal(values[:, : len(expected)], np.column_stack(expected))
    left = np.array(rows_of(path, "/residual/J2", "Scalars:scalars"))
    plain = np.column_stack([*others, best]) - analysis.reference.tau[:, 1:2]
    np.testing.assert_array_equal(left, plain)
    # Rerun counts nanoseconds, Python's timedelta microseconds
    times = times_of(path, "/q", "Scalars:scalars")
    np.testing.assert_allclose(times, analysis.t, atol=1e-6)


def test_the_tabs_hold_plots_with_titles_units_and_lines(touched: Analysis) -> None:
    tabs = {tab.name: tab.plots for tab in tabs_of(touched, FULL)}
    assert {name: [plot.key for plot in plots] for name, plots in tabs.items()} == {
        "Contacts": ["/force"],
        "Joint torques": [f"/tau_ext/J{j}" for j in range(1, 7)],
        "Residual": [f"/residual/J{j}" for j in range(1, 7)],
        "Wrench": [f"/wrench/{axis}" for axis in AXES],
        "Motion": ["/q", "/dq", "/drive_torque"],
    }
    assert [(plot.title, plot.units) for plots in tabs.values() for plot in plots[-1:]] == [
        ("|F| on the robot as at the flange, 95 % band; bars: touched; diamonds: peaks by place; "
         "green: 6 N, the smallest that is listed", ("N",)),
        ("J6: External torque on the robot", ("N·m",)),
        ("J6: estimate − reference", ("N·m",)),
        ("mz: Wrench in flange axes", ("N·m",)),
        ("drive torque", ("N·m",)),
    ]  # fmt: skip
    (force,), q = tabs["Contacts"], tabs["Motion"][0]
    np.testing.assert_array_equal(np.hstack([li.values for li in q.series]), touched.recording.q)
    (best,) = (wrench for wrench in touched.wrenches if wrench.name == "best")
    lines = {line.name: line.values[:, 0] for line in force.series}
    names = ["|F|", "95 % upper", "95 % lower", "smallest that is listed", "touched: wrist",
             "touched: forearm", "peaks"]  # fmt: skip
    assert list(lines) == names
    np.testing.assert_array_equal(lines["|F|"], best.size)
    np.testing.assert_array_equal(tabs["Wrench"][4].series[0].values[:, 0], best.known[:, 4])
    np.testing.assert_array_equal(lines["95 % upper"], best.size + Z_95 * best.size_sd)
    assert np.nanmin(lines["95 % lower"]) >= 0.0
    t, level = touched.t, -0.06 * max(64.8, np.nanmax(best.size))
    spans = {"wrist": (1.0, 1.5), "forearm": (2.2, 2.6)}
    for where, (start, stop) in spans.items():
        inside = (t >= start) & (t <= stop)
        expected = np.where(inside, level, np.nan)
        np.testing.assert_allclose(lines[f"touched: {where}"], expected, rtol=1e-15)
    peaks = force.series[-1]
    assert (peaks.x.tolist(), lines["peaks"].tolist()) == ([1.2, 2.4], [64.8, 64.8])


def test_the_summary_tells_log_and_arrow(touched: Analysis, without_reference: Analysis) -> None:
    lines = summary(touched).splitlines()
    assert lines[:3] == [
        r"# script\>&\_%.csv",
        "Universal Robots UR5 (CB3), 600 samples in 5.192 s at 125 Hz; format table.",
        "",
    ]
    (arrow,) = (line for line in lines if line.startswith("- **arrow**"))
    # 65 N are a third of a metre.
    assert "; 1 m is 200 N. On the wrist it is the force as it runs" in arrow
    notes = lines[lines.index("## Notes") + 1 : -2]
    assert len(notes) == len(touched.recording.source.remarks) + len(all_remarks(touched))
    assert notes[0] == r"- turned the sign of \<b\>one\</b\> (--columns)"
    assert lines[-1] == f"Log sha256 {'ab' * 32}"
    bare = replace(without_reference, contacts=None)
    scale = f"1 m is {NEWTON_PER_METRE:g} N"
    assert f"first observer; {scale}; none where the pose leaves it open" in summary(bare)


def test_the_arrow_is_the_force_to_scale(analysis: Analysis, tmp_path: Path) -> None:
    """About 50 arrows a second: every second sample of this log at 125 Hz, of the best.

    Without a list of contacts it runs on.
    """
    write_rrd(tmp_path / "r.rrd", replace(analysis, contacts=None))
    drawn = rows_of(tmp_path / "r.rrd", "/robot/flange_force", "Arrows3D:vectors")
    (best,) = (wrench for wrench in analysis.wrenches if wrench.name == "best")
    assert best.frame == "flange"
    flange = link_poses(analysis.robot.chain, analysis.recording.q[::2])
    expected = np.einsum("tij,tj->ti", flange.rotation[:, -1], best.force[::2])
    assert len(drawn) == len(expected)
    for arrow, force in zip(drawn, expected, strict=True):
        if np.all(np.isfinite(force)):
            # Rerun holds vectors in float32
            np.testing.assert_allclose(arrow[0], force / NEWTON_PER_METRE, rtol=1e-5, atol=1e-6)
        else:
            assert not arrow


def test_no_reference_is_no_residual_and_odd_names_do_no_harm(without_reference, as_if, tmp_path):
    log = without_reference.recording
    source = replace(log.source, path=Path("日志 ᵀ.csv"), label="日志 ᵀ.csv")
    write_rrd(tmp_path / "odd.rrd", as_if(without_reference, replace(log, source=source)))
    chunks = list(rerun.chunk.RrdReader(str(tmp_path / "odd.rrd")).stream())
    entities = {chunk.entity_path for chunk in chunks}
    assert "/tau_ext/J1" in entities
    assert not [entity for entity in entities if entity.startswith("/residual")]
    for chunk in chunks:
        assert "ᵀ" not in str(chunk.to_record_batch().to_pydict())


@pytest.mark.slow
@pytest.mark.parametrize("frame", ["flange", "base", "tool", "sensor"])
def test_the_arrow_is_the_tabled_force_at_its_own_point(frame: str) -> None:
    """Also in the frame of a tool or sensor: zero removed, turned into base axes, nothing else.

    In those frames the arrow was the raw torque's: (1.96, 2.45, −.94) N over a span whose mean the
    table makes zero.
    """
    mounted = {"tool": "0.05,0,0.15,0.3,-0.2,0.8", "sensor_pose": "0,0,0.03"}
    wrench = WrenchChoice(frame=frame, zero=ZeroChoice(spans=((1.0, 2.5),)), **mounted)
    robot, observers = RobotChoice(name="ur5"), ObserverChoice(names=("kfo-fe",))
    choice = AnalysisChoice(robot=robot, observers=observers, wrench=wrench)
    analysis = analyse_log(CIRCLE, choice)
    poses = motion(analysis.robot.chain, analysis.t, analysis.recording.q)
    rows = np.searchsorted(analysis.t, poses.t)
    arrow = force_arrow(analysis, poses, rows)
    reading = analysis.virtual_sensor
    pose = frame_pose(frame, reading.sensor.mounting)
    flange = link_poses(analysis.robot.chain, poses.q)
    turn = np.eye(3) if frame == "base" else flange.rotation[:, -1] @ pose.rotation
    tabled = reading.wrenches[0].force[rows]
    expected = np.squeeze(turn @ tabled[:, :, None], axis=2)
    # one rotation of some 20 N, rounding only
    np.testing.assert_allclose(arrow.force, expected, atol=1e-12)
    span = (poses.t >= 1.0) & (poses.t <= 2.5)
    # of 75 drawn of the 188 samples whose mean is zero, turned by some 10° on the way
    assert np.all(np.abs(np.nanmean(arrow.force[span], axis=0)) < 0.25)
    point = flange.translation[:, -1] + flange.rotation[:, -1] @ pose.translation
    np.testing.assert_allclose(arrow.origin, point, atol=1e-12)


def test_a_long_log_is_held_by_levels(touched: Analysis, monkeypatch: pytest.MonkeyPatch) -> None:
    analysis = touched
    monkeypatch.setattr("vftcli.outputs.rerun_recording.STRETCHES", 20)
    monkeypatch.setattr("vftcli.outputs.rerun_recording.AROUND", 0.2)
    monkeypatch.setattr("vftcli.outputs.rerun_recording.WHOLE_TIME", 0.4)
    t, found = analysis.t, analysis.contacts
    strongest = max(found.contacts, key=lambda contact: contact.peak_force or 0.0)
    near = t[np.abs(t - strongest.start) <= 0.2]
    whole = {plot.key: plot for tab in tabs_of(analysis, FULL) for plot in tab.plots}
    for tab in tabs_of(analysis, LEVELS):
        for plot in tab.plots:
            assert set(near) <= set(plot.x)
            # two, and one unknown, of each line and stretch, the ends, and what is whole
            assert len(plot.x) <= 3 * 20 * len(plot.series) + 2 + len(near)
            assert len(plot.x) < len(whole[plot.key].x) == len(t)
            assert plot.ends(0) == whole[plot.key].ends(0)  # no spike is lost


def test_a_line_of_the_log_stands_at_the_time_that_it_is_about() -> None:
    """A contact at its start, a remark at the start of its span, else at the log's."""
    there = caution("arm-stopped-abruptly", Where(span=(3.0, 4.0)), at_s=3.0)
    by_joint = contact(number=2, peak_force=None, wrench=None, where="cannot tell", places=(2, 3))
    remarks = (there, caution("contact-is-load"))
    found = contact_list(contact(start=1.5), by_joint, remarks=remarks)
    lines = contact_log(found)
    places = [(line.path, line.t, line.colour, line.level) for line in lines]
    (grey,) = {line.colour for line in lines[2:]}
    assert places == [
        ("/contacts/1", 1.5, PLACES["wrist"], "INFO"),
        ("/contacts/2", 4.602, PLACES["cannot tell"], "INFO"),
        ("/remarks", 3.0, grey, "WARN"),
        ("/remarks", 0.0, grey, "WARN"),
    ]
    assert [line.text for line in lines[:2]] == [
        "1.50 s: contact 1 begins, for 3.28 s: 65 ± 7 N, +y, down, wrist (good)",
        "4.60 s: contact 2 begins, for 0.18 s: joint torques 0.0, 1.0, 2.0, 3.0, 4.0, 5.0 N·m, "
        "link 2 … link 3 (weak)",
    ]
    unknown = contact_list(remarks=(), unexplained=Unexplained(13.0, 4, 17.0))
    for empty in (contact_list(remarks=()), unknown):
        (nothing,) = contact_log(empty)
        assert nothing[:3] == ("/remarks", 0.0, answer(empty))


def test_without_a_wrench_there_is_no_force_and_a_load_has_no_peak(touched: Analysis) -> None:
    assert not list(plot_groups(replace(touched, virtual_sensor=None))["Contacts"])
    load = contact_list(contact(start=1.0, stop=4.0, peak=2.0, is_load=True))
    (plot,) = plot_groups(replace(touched, contacts=load))["Contacts"]
    assert all(line.x is None for line in plot.series)
    assert "load 1 begins" in contact_log(load)[0].text


def test_the_touched_links_are_painted(touched: Analysis) -> None:
    """The flange moves with the last link."""
    found = painted_links(touched.contacts, 6)
    assert sorted(found) == [3, 5, 6]
    assert found[6] == {1.0: PLACES["wrist"], 1.5: ""}
    assert found[3] == {2.2: PLACES["forearm"], 2.6: ""}


def test_arrows_last_as_long_as_the_contact(touched: Analysis, tmp_path: Path) -> None:
    """Also where a pose is drawn as it ends: each second sample is, that of 2.016 s too."""
    first, second = touched.contacts.contacts
    stop, path = float(touched.t[252]), tmp_path / "r.rrd"
    found = replace(touched.contacts, contacts=(replace(first, stop=stop), second))
    write_rrd(path, replace(touched, contacts=found))
    last = []
    for each in found.contacts:
        arrows = rows_of(path, f"/contacts/{each.number}", "Arrows3D:vectors")
        t = times_of(path, f"/contacts/{each.number}", "Arrows3D:vectors")
        drawn = [time for time, arrow in zip(t, arrows, strict=True) if arrow]
        # Poses are drawn 50 times a second, at whole microseconds.
        assert each.start <= drawn[0] < each.start + 0.02
        assert each.stop - 0.02 < drawn[-1] <= each.stop + 1e-6
        assert not arrows[-1]
        last.append(drawn[-1])
    assert last[0] == pytest.approx(stop, abs=1e-6)
    # On a link it is the force of the peak, whatever the flange's would be.
    expected = np.array([0.4, 51.9, -38.8]) / arrow_scale(touched.contacts)
    np.testing.assert_allclose(arrows[0][0], expected, rtol=1e-6)  # float32
    assert not rows_of(path, "/robot/flange_force", "Arrows3D:vectors")
