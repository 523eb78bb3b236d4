"""The list of contacts that a folder of estimates holds, read again without recomputation."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from vftcli.contacts.contact_list import (
    CarriedLoad,
    Contact,
    ContactList,
    ContactModel,
    Unexplained,
)
from vftcli.outputs.seals import SEAL
from vftcli.signals.arrays import Array
from vftcli.signals.errors import LogError
from vftcli.signals.remarks import Remark, Where
from vftcli.virtual_sensor.smoother.prior import WrenchPrior


def stored_record(estimates: Path) -> dict[str, Any]:
    """The contacts in the ``run.json`` beside an ``estimates.parquet``, as they were written."""
    path = estimates.with_name(SEAL)
    try:
        record = json.loads(path.read_text(encoding="utf-8"))
        found = record["contacts"]
        log = record["input"]["path"]
    except (OSError, ValueError, KeyError, TypeError):
        raise LogError(
            f"{estimates} holds estimates, and no {SEAL} of theirs is beside it; give the log"
        ) from None
    if not isinstance(found, dict):
        raise LogError(f"{estimates} was made without a list of contacts; give the log, {log}")
    if "basis" not in found:
        raise LogError(f"{estimates} was written by an older vftcli; give the log, {log}")
    return found


def stored_list(record: Mapping[str, Any]) -> ContactList:
    """A list from its record; what its free motion was is not kept, but in words."""
    model = record["model"]
    torque, load = record["largest_unexplained"], record["load"]
    prior = (model["tau_w_s"], model["sigma_force_N"], model["sigma_moment_Nm"])
    return ContactList(
        recording=record["recording"],
        duration=record["duration_s"],
        contacts=tuple(stored_contact(row) for row in record["contacts"]),
        candidates=tuple(stored_contact(row) for row in record["candidates"]),
        basis=record["basis"],
        free=(),
        free_seconds=record["free_s"],
        false_on_free=record["false_on_free"],
        threshold=record["evidence_threshold_nats"],
        smallest_force=record["smallest_force_N"],
        unexplained=None if torque is None else Unexplained(**torque),
        load=None if load is None else stored_load(load),
        stops=tuple(record["stops_s"]),
        model=ContactModel(
            prior=None if None in prior else WrenchPrior(*prior),
            noise_sd=numbers(model["noise_sd_Nm"]),
            error_sd=numbers(model["friction_sd_Nm"]),
            error_time=numbers(model["friction_time_s"]),
            block=model["block_s"],
        ),
        remarks=tuple(stored_remark(each) for each in record["remarks"]),
    )


def stored_load(row: Mapping[str, Any]) -> CarriedLoad:
    """A load from its record."""
    start, stop = row["span_s"]
    return CarriedLoad(
        row["mass_kg"], row["mass_sd_kg"], row["robot"], row["payload"], (start, stop)
    )


def stored_contact(row: Mapping[str, Any]) -> Contact:
    """One contact from its record."""
    force, sd = row["force_N"], row["force_sd_N"]
    anywhere = row["anywhere_N"]
    return Contact(
        number=row["number"],
        start=row["start_s"],
        stop=row["stop_s"],
        peak=row["peak_s"],
        is_load=row["kind"] == "load",
        peak_force=row["peak_force_N"],
        peak_band=row["peak_force_band_N"],
        place_band=row["place_band_N"],
        wrench=None if force is None else numbers([*force, *row["moment_Nm"]]),
        wrench_sd=None if sd is None else numbers([*sd, *row["moment_sd_Nm"]]),
        mean_force=None if row["mean_force_N"] is None else numbers(row["mean_force_N"]),
        impulse=None if row["impulse_Ns"] is None else numbers(row["impulse_Ns"]),
        anywhere=None if anywhere is None else (anywhere[0], anywhere[1]),
        where=row["where"],
        lead=row["where_lead_nats"],
        places=tuple(0 if place == "flange" else place for place in row["places"]),
        evidence=row["evidence_nats"],
        joint_torque=numbers(row["joint_torque_Nm"]),
        joint_torque_sd=numbers(row["joint_torque_sd_Nm"]),
        at_rest=row["at_rest"],
        vendor_force=row["vendor_force_N"],
        sensor_force=row["sensor_force_N"],
        remarks=tuple(stored_remark(each) for each in row["remarks"]),
    )


def stored_remark(record: Mapping[str, Any]) -> Remark:
    """A remark from its record."""
    span = record["span_s"]
    where = Where(record["about"] or "", tuple(record["joints"]), tuple(span) if span else None)
    return Remark(record["code"], record["level"], record["values"], where)


def numbers(values: list[float | None]) -> Array:
    """Numbers of a record, NaN for what is not known. (n,)"""
    return np.array([np.nan if value is None else value for value in values])
