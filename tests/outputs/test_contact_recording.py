"""Contacts in the recording: what is plotted, said, painted and drawn, and when."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from contact_rows import contact, contact_list
from rerun_rows import rows_of, times_of

from vftcli.analysis import Analysis
from vftcli.contacts.contact_list import Unexplained
from vftcli.outputs.charts import PLACES
from vftcli.outputs.rerun_arm import painted_links
from vftcli.outputs.rerun_recording import (
    contact_log,
    newton_per_metre,
    plot_groups,
    write_rrd,
)
from vftcli.outputs.shapes import touched_point
from vftcli.signals.remarks import Where, caution


def test_the_force_stands_in_its_band_above_the_spans(touched: Analysis) -> None:
    ((plot,), wrench) = plot_groups(touched)["Contacts"], touched.wrench
    lines = {line.name: line.values[:, 0] for line in plot.series}
    size = np.linalg.norm(wrench.known[:, :3], axis=1)
    np.testing.assert_allclose(lines["|F|"], size, rtol=1e-12)
    assert np.all(lines["95 % lower"] <= size)
    assert np.all(lines["95 % upper"] >= size)
    assert set(lines["smallest that is listed"]) == {6.5}
    t = touched.t
    for name, start, stop in (("wrist", 1.0, 1.5), ("forearm", 2.2, 2.6)):
        bar = lines[f"touched: {name}"]
        np.testing.assert_array_equal(np.isfinite(bar), (t >= start) & (t <= stop))
        assert np.nanmax(bar) < 0.0
    (peaks,) = (line for line in plot.series if line.x is not None)
    assert peaks.x.tolist() == [1.2, 2.4]
    assert lines["peaks"].tolist() == [64.8, 64.8]


def test_without_a_wrench_there_is_no_force(touched: Analysis) -> None:
    assert not list(plot_groups(replace(touched, virtual_sensor=None))["Contacts"])


def test_a_load_has_no_peak(touched: Analysis) -> None:
    load = contact_list(contact(start=1.0, stop=4.0, peak=2.0, is_load=True))
    (plot,) = plot_groups(replace(touched, contacts=load))["Contacts"]
    assert all(line.x is None for line in plot.series)
    assert "load 1 begins" in contact_log(load)[0].text


def test_the_log_says_when_how_hard_and_where() -> None:
    stop = caution("arm-stopped-abruptly", Where(span=(17.9, 17.9)), at_s=17.9)
    found = contact_list(contact(number=3, where="forearm", places=(3,)), remarks=(stop,))
    first, remark = contact_log(found)
    assert first.path == "/contacts/3"
    assert first.t == 4.602
    assert first.colour == PLACES["forearm"]
    words = "4.60 s: contact 3 begins, for 0.18 s: 65 ± 7 N, +y, down, forearm (weak)"
    # |F_y| is .801 of the force and |F_z| nearly .6: both hold more than .35 of it
    assert first.text in {words, words.replace("weak", "good")}
    assert (remark.path, remark.t, remark.level) == ("/remarks", 17.9, "WARN")
    (nothing,) = contact_log(contact_list(remarks=()))
    assert nothing.text == "Nothing touched the arm, as far as this log shows."
    unknown = contact_list(remarks=(), unexplained=Unexplained(13.0, 4, 17.0))
    assert "Largest unexplained torque: 13 N·m on J4" in contact_log(unknown)[0].text


def test_the_touched_links_are_painted(touched: Analysis) -> None:
    """The flange moves with the last link."""
    found = painted_links(touched.contacts, 6)
    assert sorted(found) == [3, 5, 6]
    assert found[6] == {1.0: PLACES["wrist"], 1.5: ""}
    assert found[3] == {2.2: PLACES["forearm"], 2.6: ""}


@pytest.mark.parametrize(("places", "point"), [((0, 6), 6.0), ((2, 3), 2.5), ((), 6.0)])
def test_the_arrow_stands_at_the_place(places: tuple[int, ...], point: float) -> None:
    """Link k lies between the origins k − 1 and k; here each origin has its own number as x."""
    origins = np.tile(np.arange(7.0)[None, :, None], (1, 1, 3))
    assert touched_point(contact(places=places), origins)[0, 0] == point


def test_arrows_are_there_while_the_contact_lasts_and_no_longer(
    touched: Analysis, tmp_path: Path
) -> None:
    path = tmp_path / "r.rrd"
    write_rrd(path, touched)
    for number, start, stop in ((1, 1.0, 1.5), (2, 2.2, 2.6)):
        arrows = rows_of(path, f"/contacts/{number}", "Arrows3D:vectors")
        t = times_of(path, f"/contacts/{number}", "Arrows3D:vectors")
        drawn = [time for time, arrow in zip(t, arrows, strict=True) if arrow]
        # Poses are drawn 50 times a second.
        assert start <= drawn[0] < start + 0.02
        assert stop - 0.02 < drawn[-1] <= stop
        assert not arrows[-1]
    # On a link it is the force of the peak, whatever the flange's would be.
    expected = np.array([0.4, 51.9, -38.8]) / newton_per_metre(touched)
    np.testing.assert_allclose(arrows[0][0], expected, rtol=1e-6)  # float32
    assert not rows_of(path, "/robot/flange_force", "Arrows3D:vectors")


def test_the_arrow_goes_even_where_a_pose_is_drawn_as_the_contact_ends(
    touched: Analysis, tmp_path: Path
) -> None:
    """Each second sample is drawn: 2.016 s is one of them."""
    stop = float(touched.t[252])
    found = contact_list(contact(start=1.0, stop=stop, peak=1.2))
    write_rrd(tmp_path / "r.rrd", replace(touched, contacts=found))
    arrows = rows_of(tmp_path / "r.rrd", "/contacts/1", "Arrows3D:vectors")
    t = times_of(tmp_path / "r.rrd", "/contacts/1", "Arrows3D:vectors")
    assert t[-2] == pytest.approx(stop, abs=1e-6)  # whole microseconds
    assert arrows[-2]
    assert not arrows[-1]


def test_without_a_list_the_force_runs_on(touched: Analysis, tmp_path: Path) -> None:
    write_rrd(tmp_path / "r.rrd", replace(touched, contacts=None))
    assert rows_of(tmp_path / "r.rrd", "/robot/flange_force", "Arrows3D:vectors")
    assert not rows_of(tmp_path / "r.rrd", "/contacts/1", "Arrows3D:vectors")
