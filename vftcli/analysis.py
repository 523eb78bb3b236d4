"""Analysis: everything one run over one log made, ready to be shown."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import polars as pl

from vftcli.observers.observer import Observer, Tuning
from vftcli.robots.robot import Robot
from vftcli.robots.terms import DynamicsTerms
from vftcli.signals.arrays import Array
from vftcli.signals.external_torque import ExternalTorque
from vftcli.signals.recording import Recording

if TYPE_CHECKING:
    from vftcli.evaluation.print_table import Comparison
    from vftcli.refinement.refine import Refinement
    from vftcli.signals.wrench import Wrench
    from vftcli.virtual_sensor.detection import ContactScore
    from vftcli.virtual_sensor.sensor_reading import SensorReading


@dataclass(frozen=True, kw_only=True)
class Analysis:
    """One log, one robot, its observers' estimates, and how they compare with the reference.

    Attributes:
        recording: The log.
        robot: The arm as it was used: payload mounted, friction possibly off.
        terms: p and μ along the log.
        observers: The observers that ran.
        estimates: Their estimates, in the same order.
        tunings: What each observer's parameters mean at this log's sample time, by name.
        reference: What the estimates are judged by, or None.
        errors: The tidy error table (`vftcli.evaluation.SCHEMA`), or None without a reference.
        virtual_sensor: The wrenches and what is known of them, or None where none was asked for.
        contacts: How each observer tells contacts, or empty where it was not asked.
        published: A printed table beside these errors, or None where none was asked for.
        workup: What the complete log told, its free part, spectra and limits, or None where nothing
            asked for it.
        notes: What the reader of the numbers should know, one sentence each.
        run: The command, versions and conventions, as `run.json` holds them.
    """

    recording: Recording
    robot: Robot
    terms: DynamicsTerms
    observers: tuple[Observer, ...]
    estimates: tuple[ExternalTorque, ...]
    tunings: Mapping[str, Tuning]
    reference: ExternalTorque | None = None
    errors: pl.DataFrame | None = None
    virtual_sensor: "SensorReading | None" = None
    contacts: "tuple[ContactScore, ...]" = ()
    published: "Comparison | None" = None
    workup: "Refinement | None" = None
    notes: tuple[str, ...] = ()
    run: Mapping[str, Any] = field(default_factory=dict)

    @property
    def torques(self) -> tuple[ExternalTorque, ...]:
        """The estimates, and the reference last if there is one, under the name "reference"."""
        if self.reference is None:
            return self.estimates
        return (*self.estimates, self.reference)

    @property
    def wrenches(self) -> "tuple[Wrench, ...]":
        """One an observer, and the reference's last under the name "reference" if there is one."""
        if self.virtual_sensor is None:
            return ()
        reference = self.virtual_sensor.reference
        if reference is None:
            return self.virtual_sensor.wrenches
        return (*self.virtual_sensor.wrenches, replace(reference, name="reference"))

    @property
    def t(self) -> Array:
        """Time since the log's first sample. (T,) [s]"""
        return self.recording.t
