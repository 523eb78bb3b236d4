"""Contact and ContactList."""

from dataclasses import replace

import numpy as np
import pytest
from contact_rows import contact, contact_list

from vftcli.contacts.contact_list import CarriedLoad
from vftcli.free_motion.free_motion import FreeLoad
from vftcli.robots import Payload, load_robot
from vftcli.robots.run import Run
from vftcli.signals.recording import Recording
from vftcli.signals.remarks import caution


@pytest.mark.parametrize(
    ("changed", "trust"),
    [
        ({}, "good"),
        ({"evidence": 49.0}, "weak"),
        ({"peak_band": 0.3 * 64.8}, "fair"),
        ({"peak_band": 0.5 * 64.8}, "weak"),
        ({"remarks": (caution("size-in-doubt"),)}, "weak"),
        ({"is_load": True}, "weak"),
        ({"peak_force": None}, "weak"),
        ({"inferred": True}, "fair"),
        ({"peak_band": 0.5 * 64.8, "place_band": 7.1}, "fair"),
        # 40 % of 64.8 N: from 38.9 to 90.7 N
        ({"anywhere": (39.0, 90.0)}, "good"),
        ({"anywhere": (38.0, 90.0)}, "fair"),
        ({"anywhere": (39.0, 91.0)}, "fair"),
    ],
)
def test_trust_goes_by_evidence_band_and_remarks(changed, trust):
    assert contact(**changed).trust == trust


@pytest.mark.parametrize("doubt", ["velocity-late", "stuck-effort"])
def test_no_size_in_doubt_is_good(doubt):
    found = contact_list(contact(), contact(number=2))
    assert [row.trust for row in found.weighed(None, set())] == ["good", "good"]
    assert [row.trust for row in found.weighed(None, {doubt})] == ["weak", "weak"]


def test_a_load_is_as_heavy_as_the_examination_says():
    fitted = CarriedLoad(2.5, 0.4, "ur10e", None, (1.0, 9.0))
    found = replace(contact_list(), load=fitted)
    assert found.weighed((2.88, 0.09), set()).load == fitted._replace(mass=2.88, sd=0.09)
    assert found.weighed(None, set()).load == fitted


def test_beside_a_joint_without_effort_every_row_is_a_candidate():
    """In the order of time, each with the reason; nothing is claimed, nor called untouched."""
    late, early = contact(start=9.0, stop=9.5), contact(start=2.0, evidence=30.0)
    found = replace(contact_list(late), candidates=(early,)).weighed(None, {"zero-effort"})
    assert not len(found)
    assert [(row.number, row.start) for row in found.candidates] == [(1, 2.0), (2, 9.0)]
    assert {row.trust for row in found.candidates} == {"weak"}
    assert not found.tells_untouched


def test_the_hardest_has_the_largest_force_of_those_beyond_their_band():
    soft, hard = contact(peak_force=10.0), contact(number=2, peak_force=80.0)
    wide = contact(peak_force=88.0, peak_band=170.0)
    assert contact_list(soft, hard, wide).hardest is hard
    assert contact_list(wide).hardest is wide
    assert contact_list().hardest is None
    assert (wide.size_known, hard.size_known) == (False, True)


def test_a_size_that_depends_on_an_unknown_place_is_unknown():
    by_place = caution("size-goes-with-place", least_N=20.0, most_N=248.0)
    unknown = contact(remarks=(by_place,), peak_force=70.0)
    assert not unknown.size_known
    assert unknown.trust == "weak"
    # One whose size is known goes before a larger one whose size is not.
    sized = contact(number=2)
    assert contact_list(unknown, sized).hardest is sized


@pytest.mark.parametrize(("least", "told"), [(6.5, 6.5), (3473.0, None), (None, None)])
def test_a_pose_that_is_blind_along_an_axis_tells_no_least_force(least, told):
    assert contact_list(smallest_force=least).detectable_force == told
    assert contact_list(smallest_force=float("nan")).detectable_force is None


def test_a_row_of_a_table_has_a_column_for_each_number():
    remark = caution("size-goes-with-place", least_N=12.0, most_N=20.0)
    row = contact(remarks=(remark,)).row()
    assert [row[f"force_N_{axis}"] for axis in "xyz"] == [0.4, 51.9, -38.8]
    assert [row[f"moment_sd_Nm_{axis}"] for axis in "xyz"] == [0.5, 0.5, 0.5]
    assert [row[f"joint_torque_Nm_{j}"] for j in range(1, 7)] == [0, 1, 2, 3, 4, 5]
    assert (row["anywhere_least_N"], row["anywhere_most_N"]) == (57.0, 78.0)
    assert (row["kind"], row["places"]) == ("contact", "flange 5 6")
    assert row["remarks"] == str(remark)


def test_a_list_is_a_sequence_of_its_rows_and_a_table():
    rows = contact(), contact(number=2, is_load=True, peak_force=80.0)
    found = contact_list(*rows)
    assert (len(found), found[1], list(found)) == (2, rows[1], list(rows))
    assert found.to_polars()["peak_force_N"].to_list() == [64.8, 80.0]
    assert repr(found).startswith("<ContactList of log.csv: 2 contacts in 20 s, the hardest 80")
    assert repr(rows[0]) == "<Contact 1, a contact: 4.60 to 4.78 s, 65 ± 7 N, wrist (good)>"
    assert repr(rows[1]).startswith("<Contact 2, a load: ")
    assert "<td>0 52 -39</td>" in found._repr_html_()
    assert bool(contact_list())
    assert repr(contact_list()) == "<ContactList of log.csv: 0 contacts in 20 s>"
    assert contact_list().to_polars().is_empty()
    assert (found.tells_untouched, contact_list(rows[0]).tells_untouched) == (False, True)


def test_a_size_is_a_range_where_the_place_is_unknown_and_torques_where_no_force_is():
    by_place = caution("size-goes-with-place", least_N=20.0, most_N=248.0)
    assert "57–78 N" in repr(contact(remarks=(by_place,)))
    bare = contact_list(contact(), candidates=(contact(number=2),)).without_forces()
    assert "0 1 2 3 4 5 N·m" in repr(bare[0])
    assert (bare[0].wrench, bare.candidates[0].peak_force, bare.smallest_force) == (None,) * 3
    assert bare.remarks[-1].code == "no-wrench-of-few-joints"
    assert bare[0].row()["anywhere_least_N"] is None


@pytest.mark.parametrize(
    ("mass", "sd", "name"),
    [(2.8, 0.1, "gripper"), (2.5, 0.2, "gripper"), (2.5, 0.1, None), (1.2, 0.02, "camera")],
)
def test_a_load_is_the_payload_that_weighs_as_much(mass, sd, name):
    """2.8 kg or 1.1 kg, within a tenth of the load or two of its standard deviations."""
    body = {"com": np.zeros(3), "inertia": np.zeros((3, 3))}
    payloads = {"gripper": Payload(mass=2.8, **body), "camera": Payload(mass=1.1, **body)}
    robot, t = replace(load_robot("ur5"), payloads=payloads), 0.1 * np.arange(100)
    dq = np.where((t > 2.0) & (t < 7.0), 0.3, 0.0)[:, None] * np.ones(6)
    run = Run(recording=Recording(t=t, q=0.0 * dq, dq=dq), robot=robot)
    load = FreeLoad(mass=mass, moment=np.zeros(3), sd=sd, moment_sd=np.zeros(3), share=0.5)
    carried = CarriedLoad.of(load, run)
    assert (carried.mass, carried.sd, carried.payload) == (mass, sd, name)
    assert carried.span == pytest.approx((2.1, 6.9))


def test_a_log_that_should_be_free_names_its_longest_free_span_without_forces_too():
    """Contacts at 2 to 3 s and 7 to 8 s of 0 to 20 s leave 8 to 20 s."""
    found = contact_list(contact(start=2.0, stop=3.0), contact(start=7.0, stop=8.0))
    for listed in (found, found.without_forces()):
        (remark,) = listed.not_free(np.array([0.0, 20.0]))
        values = remark.values
        assert (values["begin_s"], values["end_s"], values["spans"]) == (8.0, 20.0, 2)
    assert "N·m" in values["size"]
    assert list(contact_list().not_free(np.array([0.0, 20.0]))) == []
