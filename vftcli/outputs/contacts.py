"""The list of contacts as JSON, CSV and a table; read again from a folder of estimates."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from vftcli.contacts.contact_list import (
    FIRST_COLUMNS,
    CarriedLoad,
    Contact,
    ContactList,
    ContactModel,
    Unexplained,
)
from vftcli.outputs.answer import direction, free_words, place_words
from vftcli.outputs.files import SEAL
from vftcli.outputs.grid import Column, Grid, csv_rows
from vftcli.outputs.quantity import banded
from vftcli.signals.arrays import Array
from vftcli.signals.errors import LogError
from vftcli.signals.remarks import Remark, Where
from vftcli.virtual_sensor.smoother import WrenchPrior

MOST_ROWS = 20  #: Rows on the terminal unless all are asked for.

FRAME, SIGN = "base axes, moment about the flange point", "on the robot"

#: Field of a list → its key in the record, where both hold one thing.
LIST_KEYS = {
    "recording": "recording", "duration": "duration_s", "basis": "basis", "free_seconds": "free_s",
    "false_on_free": "false_on_free", "threshold": "evidence_threshold_nats",
    "smallest_force": "smallest_force_N",
}  # fmt: skip
#: Field of a contact → its key in the record, in the same way; and of vectors.
CONTACT_KEYS = {
    "number": "number", "start": "start_s", "stop": "stop_s", "peak": "peak_s",
    "peak_force": "peak_force_N", "peak_band": "peak_force_band_N", "place_band": "place_band_N",
    "where": "where", "lead": "where_lead_nats", "evidence": "evidence_nats", "at_rest": "at_rest",
    "vendor_force": "vendor_force_N", "sensor_force": "sensor_force_N",
}  # fmt: skip
VECTOR_KEYS = {
    "mean_force": "mean_force_N", "impulse": "impulse_Ns", "joint_torque": "joint_torque_Nm",
    "joint_torque_sd": "joint_torque_sd_Nm",
}  # fmt: skip


def contacts_record(found: ContactList) -> dict[str, Any]:
    """A log's contacts for machines; units stand in the names."""
    model = found.model
    return {
        "recording": found.recording,
        "frame": FRAME,
        "sign": SIGN,
        "free_part": free_words(found) or None,
        "free_s": found.free_seconds,
        "smallest_force_N": found.smallest_force,
        "evidence_threshold_nats": found.threshold,
        "false_on_free": found.false_on_free,
        "basis": found.basis,
        "load": None if found.load is None else found.load.record(),
        "largest_unexplained": None if found.unexplained is None else found.unexplained._asdict(),
        "duration_s": found.duration,
        "stops_s": list(found.stops),
        "model": {
            "tau_w_s": model.prior.time if model.prior else None,
            "sigma_force_N": model.prior.force if model.prior else None,
            "sigma_moment_Nm": model.prior.moment if model.prior else None,
            "noise_sd_Nm": model.noise_sd,
            "friction_sd_Nm": model.error_sd,
            "friction_time_s": model.error_time,
            "block_s": model.block,
        },
        "remarks": list(found.remarks),
        "contacts": [contact.record() for contact in found.contacts],
        "candidates": [contact.record() for contact in found.candidates],
    }


def contacts_csv(lists: Sequence[ContactList]) -> str:
    """One row a contact of every log, vectors split."""
    rows = [
        {"recording": found.recording} | contact.row()
        for found in lists
        for contact in found.contacts
    ]
    keys = list(dict.fromkeys(key for row in rows for key in row))
    keys = keys or ["recording", *FIRST_COLUMNS]
    return csv_rows([{key: row.get(key) for key in keys} for row in rows], keys)


def hardest_rows(contacts: Sequence[Contact], most: int = MOST_ROWS) -> list[Contact]:
    """So many contacts with the largest force, else the most evidence, in time's order."""
    order = sorted(contacts, key=by_force, reverse=True)
    return sorted(order[:most], key=lambda contact: contact.start)


def by_force(contact: Contact) -> tuple[bool, float, float]:
    """By what contacts are ordered: those with a size before the others, then force, evidence."""
    return contact.size_known, contact.peak_force or 0.0, contact.evidence or 0.0


def contact_grid(contacts: Sequence[Contact]) -> Grid:
    """The table of contacts."""
    force = any(contact.peak_force is not None for contact in contacts)
    columns = [Column("#"), Column("from – to [s]", words=True)]
    if force:
        columns += [Column("|F| [N]"), Column("range"), Column("direction", words=True)]
    else:
        columns += [Column("joint torque [N·m]", words=True)]
    columns += [Column("where", words=True), Column("trust", words=True)]
    return Grid(columns=tuple(columns), rows=tuple(contact_row(c, force) for c in contacts))


def contact_row(contact: Contact, force: bool) -> list[str]:
    """One row of the table."""
    row = [str(contact.number), f"{contact.start:6.2f} – {contact.stop:6.2f}"]
    if force and contact.wrench is not None and contact.anywhere is not None:
        low, high = contact.anywhere
        size = banded(contact.peak_force, contact.peak_band, unit="")
        row += ["unknown" if contact.place_unknown else size, f"{low:.0f}–{high:.0f}"]
        row.append(direction(contact.wrench[:3]))
    else:
        row.append(" ".join(f"{torque:.1f}" for torque in contact.joint_torque))
    return [*row, place_words(contact), contact.trust]


def stored_record(estimates: Path) -> dict[str, Any]:
    """The contacts in the ``run.json`` beside an ``estimates.parquet``, as they were written."""
    path = estimates.with_name(SEAL)
    try:
        record = json.loads(path.read_text(encoding="utf-8"))
        found, log = record["contacts"], record["input"]["path"]
        about = {"path": log, "sha256": record["input"]["sha256"]}
    except (OSError, ValueError, KeyError, TypeError):
        raise LogError(
            f"{estimates} holds estimates, and no {SEAL} of theirs is beside it; give the log"
        ) from None
    if not isinstance(found, dict):
        raise LogError(f"{estimates} was made without a list of contacts; give the log, {log}")
    if "basis" not in found:
        raise LogError(f"{estimates} was written by an older vftcli; give the log, {log}")
    return {**found, **about}


def stored_list(record: Mapping[str, Any]) -> ContactList:
    """A list from its record; what its free motion was is not kept, but in words."""
    model, torque, load = record["model"], record["largest_unexplained"], record["load"]
    prior = (model["tau_w_s"], model["sigma_force_N"], model["sigma_moment_Nm"])
    if load is not None:
        start, stop = load["span_s"]
        mass = load["mass_kg"], load["mass_sd_kg"]
        load = CarriedLoad(*mass, load["robot"], load["payload"], (start, stop))
    return ContactList(
        **{field: record[key] for field, key in LIST_KEYS.items()},
        contacts=tuple(map(stored_contact, record["contacts"])),
        candidates=tuple(map(stored_contact, record["candidates"])),
        free=(),
        unexplained=None if torque is None else Unexplained(**torque),
        load=load,
        stops=tuple(record["stops_s"]),
        model=ContactModel(
            prior=None if None in prior else WrenchPrior(*prior),
            noise_sd=numbers(model["noise_sd_Nm"]),
            error_sd=numbers(model["friction_sd_Nm"]),
            error_time=numbers(model["friction_time_s"]),
            block=model["block_s"],
        ),
        remarks=tuple(map(stored_remark, record["remarks"])),
    )


def stored_contact(row: Mapping[str, Any]) -> Contact:
    """One contact from its record."""
    vectors = {field: row[key] for field, key in VECTOR_KEYS.items()}
    for field, unit in (("wrench", ""), ("wrench_sd", "_sd")):
        force = row[f"force{unit}_N"]
        vectors[field] = None if force is None else [*force, *row[f"moment{unit}_Nm"]]
    fields = {field: row[key] for field, key in CONTACT_KEYS.items()}
    fields |= {field: None if v is None else numbers(v) for field, v in vectors.items()}
    anywhere = row["anywhere_N"]
    return Contact(
        **fields,
        is_load=row["kind"] == "load",
        anywhere=None if anywhere is None else (anywhere[0], anywhere[1]),
        places=tuple(0 if place == "flange" else place for place in row["places"]),
        remarks=tuple(map(stored_remark, row["remarks"])),
    )


def stored_remark(record: Mapping[str, Any]) -> Remark:
    """A remark from its record."""
    span = record["span_s"]
    where = Where(record["about"] or "", tuple(record["joints"]), tuple(span) if span else None)
    return Remark(record["code"], record["level"], record["values"], where)


def numbers(values: list[float | None]) -> Array:
    """Numbers of a record, NaN for what is not known. (n,)"""
    return np.array([np.nan if value is None else value for value in values])
