"""The list of contacts as JSON, CSV and on the terminal."""

import csv
import io
from dataclasses import replace

import numpy as np
import pytest
from contact_rows import contact, contact_list

from vftcli.outputs.contacts import (
    contacts_csv,
    contacts_record,
    contacts_text,
    direction,
    overview,
    place_words,
)
from vftcli.outputs.log.run_record import jsonable

KEYS = {"recording", "frame", "sign", "free_part", "smallest_force_N", "contacts"}
"""What scripts rely on of a log."""

ROW = {"number", "start_s", "stop_s", "peak_s", "peak_force_N", "peak_force_band_N", "force_N",
       "moment_Nm", "mean_force_N", "impulse_Ns", "where", "evidence_nats", "joint_torque_Nm",
       "remarks"}  # fmt: skip
"""And of a contact."""


def test_the_record_holds_what_scripts_rely_on() -> None:
    record = jsonable(contacts_record(contact_list(contact())))
    assert set(record) >= KEYS
    (row,) = record["contacts"]
    assert set(row) >= ROW
    assert row["force_N"] == [0.4, 51.9, -38.8]
    assert row["moment_Nm"] == [0.2, 0.1, 0.0]
    assert row["places"] == ["flange", 5, 6]
    assert row["vendor_force_N"] is None
    assert record["free_part"] == "free part: 0.3 to 4 s, as given"
    assert record["remarks"][0]["code"] == "arm-stopped-abruptly"


def test_an_arm_without_a_wrench_has_no_newtons() -> None:
    bare = contact(peak_force=None, peak_band=None, wrench=None, wrench_sd=None, mean_force=None,
                   impulse=None, anywhere=None)  # fmt: skip
    (row,) = jsonable(contacts_record(contact_list(bare)))["contacts"]
    assert row["force_N"] is None
    text = contacts_text(contact_list(bare, smallest_force=None))
    assert "joint torque" in text
    assert "1 contact." in text


def test_csv_has_a_row_a_contact_and_vectors_taken_apart() -> None:
    rows = list(csv.DictReader(io.StringIO(contacts_csv([contact_list(contact(), contact())]))))
    assert len(rows) == 2
    assert float(rows[0]["force_N_y"]) == 51.9
    assert float(rows[0]["joint_torque_Nm_6"]) == 5.0
    assert float(rows[0]["anywhere_least_N"]) == 57.0
    assert contacts_csv([contact_list()]).startswith("recording,number")


def test_the_answer_comes_first() -> None:
    text = contacts_text(contact_list(contact()))
    assert "1 contact. The hardest, at 4.7 s: 65 ± 7 N on the wrist." in text
    assert "smallest force this log can tell: 6 N" in text
    assert "no contact listed in its 4 s" in text
    assert "; 2 contacts listed in its 4 s" in contacts_text(
        replace(contact_list(), false_on_free=2)
    )
    assert "caution: the arm stopped abruptly at 17.90 s" in text
    assert "Nothing touched the arm" in contacts_text(contact_list())
    load = contact(is_load=True, mean_force=np.array([0.0, 0.0, -27.0]), peak_force=27.0)
    assert "A load, or a wrong payload, or a wrong model: 27 ± 7 N on average, down" in (
        contacts_text(contact_list(load))
    )


def test_twenty_rows_unless_all_are_asked_for() -> None:
    many = [contact(number=k, start=float(k), peak_force=100.0 - k) for k in range(1, 31)]
    text = contacts_text(contact_list(*many))
    assert "the 20 hardest of 30: --all for the rest" in text
    assert len(text.splitlines()) < 40
    assert "hardest of" not in contacts_text(contact_list(*many), every=True)


@pytest.mark.parametrize(
    ("force", "words"),
    [
        ((0.0, 0.0, -5.0), "down"),
        ((1.0, 9.0, 0.0), "+y"),
        ((-9.0, 1.0, 0.0), "−x"),
        ((3.0, 4.0, -0.01), "(0.6, 0.8, 0.0)"),
        ((0.0, 0.0, 0.0), "–"),
    ],
)
def test_directions_are_words_where_one_axis_holds_most(
    force: tuple[float, float, float], words: str
) -> None:
    assert direction(np.array(force)) == words


def test_places_that_cannot_be_told_apart_are_named() -> None:
    def told(*links: int) -> str:
        return place_words(contact(where="cannot tell", places=links))

    assert told(2, 3, 6) == "link 2 … link 6"
    assert told(0, 3, 6) == "link 3 … flange"
    assert told(2) == "link 2"
    assert place_words(contact()) == "wrist"


def test_several_logs_are_a_line_each() -> None:
    text = overview([contact_list(contact()), contact_list(recording="other.csv")])
    assert text.splitlines()[1].split() == [
        "log.csv", "20.0", "s", "1", "65", "±", "7", "N", "at", "4.7", "s", "6", "N",
    ]  # fmt: skip
    assert "other.csv" in text
