"""The list of contacts as JSON, CSV and on the terminal."""

import csv
import io
from dataclasses import replace

import numpy as np
import pytest
from contact_rows import contact, contact_list

from vftcli.contacts.contact_list import (
    OF_FORCES,
    SURE_NATS,
    CarriedLoad,
    ContactList,
    Unexplained,
)
from vftcli.outputs import contacts
from vftcli.outputs.run_record import jsonable
from vftcli.signals.remarks import caution

ROW = {"number", "start_s", "stop_s", "peak_s", "peak_force_N", "peak_force_band_N", "force_N",
       "moment_Nm", "mean_force_N", "impulse_Ns", "where", "trust", "size_known", "anywhere_N",
       "evidence_nats", "joint_torque_Nm", "remarks"}  # fmt: skip
"""What scripts rely on of a contact."""


BARE = replace(contact(number=2, is_load=True), **dict.fromkeys(OF_FORCES))
"""Of an arm whose joints tell no force."""


def test_the_record_holds_what_scripts_rely_on() -> None:
    record = jsonable(contacts.contacts_record(contact_list(contact(), BARE)))
    row, bare = record["contacts"]
    assert set(row) >= ROW
    assert bare["force_N"] is None
    assert row["force_N"] == [0.4, 51.9, -38.8]
    assert row["moment_Nm"] == [0.2, 0.1, 0.0]
    assert row["places"] == ["flange", 5, 6]
    assert row["vendor_force_N"] is None
    assert record["free_part"] == "contact-free: 0.3 to 4 s, as given"
    assert record["remarks"][0]["code"] == "arm-stopped-abruptly"


def test_csv_has_a_row_a_contact_and_vectors_taken_apart() -> None:
    text = contacts.contacts_csv([contact_list(contact(), contact())])
    rows = list(csv.DictReader(io.StringIO(text)))
    assert len(rows) == 2
    assert float(rows[0]["force_N_y"]) == 51.9
    assert float(rows[0]["joint_torque_Nm_6"]) == 5.0
    assert float(rows[0]["anywhere_least_N"]) == 57.0
    assert contacts.contacts_csv([contact_list()]).startswith("recording,number")


def test_the_table_for_a_paper_has_units_and_bands() -> None:
    found = contact_list(contact(), contact(number=2, where="cannot tell", places=(3, 4)))
    lines = contacts.contacts_latex(found).splitlines()
    (heads,) = (k for k, line in enumerate(lines) if "$|F|$" in line)
    assert [text.strip() for text in lines[heads + 1][:-2].split("&")] == [
        "", "[s]", r"\multicolumn{1}{c}{[N]}", r"\multicolumn{1}{c}{[N]}", "", "", "",
    ]  # fmt: skip
    first = [text.strip() for text in lines[heads + 3][:-2].split("&")]
    assert first[1:5] == ["4.60 --   4.78", r"65 $\pm$ 7", "57--78", "+y, down"]
    assert r"link 3 \ldots{} link 4" in lines[heads + 4]
    assert lines[heads + 5] == r"\bottomrule"
    assert "force ON the robot" in lines[-2]


def test_the_hardest_rows_are_in_the_order_of_time() -> None:
    many = [contact(number=k, start=float(k), peak_force=100.0 - k) for k in range(30, 0, -1)]
    assert [row.number for row in contacts.hardest_rows(many)] == list(range(1, 21))
    assert [row.number for row in contacts.hardest_rows(many, 3)] == [1, 2, 3]
    wide = contact(number=2, peak_force=88.0, peak_band=170.0)
    assert [row.number for row in contacts.hardest_rows([wide, contact()], 1)] == [1]


LOAD = CarriedLoad(2.88, 0.09, "ur10e", None, (4.7, 50.5))
BY_PLACE = contact(
    remarks=(caution("size-goes-with-place", least_N=20.0, most_N=248.0),), anywhere=(20.0, 248.0)
)
WIDE = contact(number=2, peak_force=88.0, peak_band=170.0)
"""A force within its band."""
FELT = contact(peak_force=33.0, peak_band=7.0, peak=12.9)
UNSURE = contact(peak_force=21.0, place_band=None, peak=3.04)
NO_SIZE = contact(peak_force=None)


@pytest.mark.parametrize(("found", "words"), [
    (contact_list(contact()), "1 contact. The hardest, at 4.7 s: 65 ± 7 N on the wrist."),
    (contact_list(), "Nothing touched the arm, as far as this log shows."),
    (contact_list(contact(is_load=True, mean_force=np.array([0, 0, -27.0]), peak_force=27.0)),
     "or a wrong model: 27 ± 7 N on average, down."),
    (contact_list(contact(peak_force=3.0, peak_band=5.0, is_load=True)),
     "or a wrong model: below 8 N on average."),
    (contact_list(replace(BARE, is_load=False), smallest_force=None), "1 contact."),
    (contact_list(BY_PLACE), "depends on where it touched, unknown: 20–248 N."),
    (contact_list(BY_PLACE, contact(number=2)),
     "The hardest of known size, at 4.7 s: 65 ± 7 N on the wrist."),
    (contact_list(contact(), WIDE),
     "2 contacts. The hardest of known size, at 4.7 s: 65 ± 7 N on the wrist."),
    (contact_list(WIDE), "1 contact. How hard is unknown: below 258 N."),
    (contact_list(contact(peak_band=30.0, where="cannot tell")), "s: 65 ± 30 N (weak)."),
    # What may have been touched is never called untouched.
    (contact_list(basis="whole log"), "No contact stands out."),
    (contact_list(basis="whole log", candidates=(FELT,)),
     "cannot explain: name free motion (--free) or measure your friction (vftcli identify)."),
    # A press of 3 N on an arm that the model misses by 5 N·m: one candidate of any size.
    (contact_list(candidates=(FELT,)),
     "Up to 40 N near 12.9 s this model cannot explain: measure your friction (vftcli "
     "identify)."),
    (contact_list(candidates=(NO_SIZE,)), "No contact stands out."),
    (contact_list(candidates=(NO_SIZE, UNSURE, contact(peak_force=5.0))),
     "Up to 21 N near 3.0 s this model cannot explain: measure your friction (vftcli "
     "identify)."),
    (contact_list(false_on_free=2), "the free part, which itself shows 2: was nobody there?"),
    (contact_list(basis="none", unexplained=Unexplained(22.1, 4, 3.2)),
     "22 N·m on J4 at 3.2 s: a contact or a model error. To list contacts name free motion "
     "(--free) or give a robot with friction (vftcli identify)."),
    # ± is a band of 95 %.
    (contact_list(basis="whole log", load=LOAD),
     "carries 2.88 ± 0.18 kg that ur10e does not know of (4.7–50.5 s). No contact stands out."),
    (contact_list(basis="whole log", load=LOAD._replace(payload="franka_hand")),
     "50.5 s): franka_hand? Add --payload franka_hand. No contact stands out."),
])  # fmt: skip
def test_the_answer_is_a_sentence(found: ContactList, words: str) -> None:
    assert contacts.answer(found).endswith(words)


def test_a_row_names_size_range_and_places() -> None:
    rows = [contact(where="cannot tell", places=each) for each in ((2, 3, 6), (0, 3, 6), (2,))]
    grid = contacts.contact_grid([BY_PLACE, *rows])
    assert grid.rows[0][2:4] == ["unknown", "20–248"]
    # 88 ± 170 N is no size.
    assert contacts.contact_grid(contact_list(WIDE)).rows[0][2] == "unknown"
    places = [row[-2].text for row in grid.cells]
    assert places == ["wrist", "link 2 … link 6", "link 3 … flange", "link 2"]
    assert contacts.contact_grid([BARE]).columns[2].heading == "joint torque [N·m]"


def test_a_direction_names_its_large_axes() -> None:
    """More than .35 of the force: 0.35² is an eighth of its square."""
    named = {
        (0.4, 51.9, -38.8): "+y, down", (3.0, -4.0, 3.0): "−y, +x, up", (0.0, 0.0, 2.0): "up",
        (1.0, 9.0, 0.0): "+y", (-9.0, 1.0, 0.0): "−x", (0.0, 0.0, 0.0): "–",
    }  # fmt: skip
    assert {force: contacts.direction(np.array(force)) for force in named} == named


@pytest.mark.parametrize(("changed", "words"), [
    ({}, "the band is 10% of the force"),
    ({"anywhere": (20.0, 90.0)}, "the band is 10% of the force; the size depends on the place"),
    ({"evidence": SURE_NATS}, "the band is 10% of the force"),
    ({"evidence": SURE_NATS - 0.1}, "little evidence: friction explains nearly as much"),
    ({"remarks": (caution("arm-stopped-abruptly", at_s=3.0),)},
     "the arm stopped abruptly at 3.00 s; what follows is not counted as contact"),
    ({"peak_force": None}, "too few joints to know the force"),
    ({"peak_band": None}, "too few joints to know the force"),
    ({"is_load": True}, "lasts for most of the log"),
])  # fmt: skip
def test_trust_says_why(changed, words):
    sure = {"evidence": 400.0, "anywhere": (45.0, 60.0), "peak_force": 50.0, "peak_band": 5.0}
    assert contacts.reason(contact(**({"remarks": ()} | sure | changed))) == words


@pytest.mark.parametrize(("changed", "words"), [
    ({}, "Nothing above 6 N at the flange. Weaker pushes may not show."),
    ({"contacts": (contact(),)},
     "Nothing else above 6 N at the flange. Weaker pushes may not show."),
    ({"contacts": (contact(peak_force=6.0),)},
     "Nothing else above 6 N at the flange (less at good poses)."),
    ({"contacts": (contact(is_load=True),)}, ""),
    ({"smallest_force": None}, ""),
    ({"smallest_force": np.inf}, "A push along one axis may go unseen: the pose hardly shows it."),
    ({"basis": "whole log", "contacts": (contact(),)},
     "Flange pushes below 6 N, and some harder or lasting ones, may not show."),
    ({"candidates": (contact(),)},
     "Flange pushes below 6 N may not show. 1 candidate: contacts --all."),
    ({"candidates": (contact(), contact(number=2)), "basis": "friction"},
     "Flange pushes below 6 N, and some harder or lasting ones, may not show. 2 candidates: "
     "contacts --all."),
    ({"smallest_force": 3473.0}, "A push along one axis may go unseen: the pose hardly shows it."),
])  # fmt: skip
def test_what_can_be_said_of_the_rest(changed: dict[str, object], words: str) -> None:
    assert contacts.otherwise(contact_list(**changed)) == words
