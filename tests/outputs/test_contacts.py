"""The list of contacts as JSON, CSV and on the terminal."""

import csv
import io

from contact_rows import contact, contact_list

from vftcli.outputs.contacts import (
    answer,
    contact_grid,
    contacts_csv,
    contacts_record,
    hardest_rows,
)
from vftcli.outputs.run_record import jsonable
from vftcli.signals.remarks import caution

KEYS = {"recording", "frame", "sign", "free_part", "smallest_force_N", "contacts", "candidates"}
"""What scripts rely on of a log."""

ROW = {"number", "start_s", "stop_s", "peak_s", "peak_force_N", "peak_force_band_N", "force_N",
       "moment_Nm", "mean_force_N", "impulse_Ns", "where", "trust", "size_known", "anywhere_N",
       "evidence_nats", "joint_torque_Nm", "remarks"}  # fmt: skip
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
    assert contact_grid([bare]).columns[2].head == "joint torque [N·m]"
    assert answer(contact_list(bare, smallest_force=None)) == "1 contact."


def test_csv_has_a_row_a_contact_and_vectors_taken_apart() -> None:
    rows = list(csv.DictReader(io.StringIO(contacts_csv([contact_list(contact(), contact())]))))
    assert len(rows) == 2
    assert float(rows[0]["force_N_y"]) == 51.9
    assert float(rows[0]["joint_torque_Nm_6"]) == 5.0
    assert float(rows[0]["anywhere_least_N"]) == 57.0
    assert contacts_csv([contact_list()]).startswith("recording,number")


def test_a_size_that_depends_on_the_place_is_a_range() -> None:
    by_place = caution("size-goes-with-place", least_N=20.0, most_N=248.0)
    unknown = contact(remarks=(by_place,), anywhere=(20.0, 248.0))
    assert answer(contact_list(unknown)) == (
        "1 contact. Its size depends on where it touched, unknown: 20–248 N."
    )
    (row,) = contact_grid([unknown]).rows
    assert row[2:4] == ["unknown", "20–248"]
    assert "The hardest of known size" in answer(contact_list(unknown, contact(number=2)))


def test_the_hardest_rows_are_in_the_order_of_time() -> None:
    many = [contact(number=k, start=float(k), peak_force=100.0 - k) for k in range(30, 0, -1)]
    assert [row.number for row in hardest_rows(many)] == list(range(1, 21))
    assert [row.number for row in hardest_rows(many, 3)] == [1, 2, 3]
    wide = contact(number=2, peak_force=88.0, peak_band=170.0)
    assert [row.number for row in hardest_rows([wide, contact()], 1)] == [1]
