"""Analysis: the results of one run over one log."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import field, replace
from functools import cached_property
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from vftcli.observers.observer import Observer, Tuning
from vftcli.robots.robot import Robot
from vftcli.robots.run import Run, RunSamples
from vftcli.signals.arrays import Array
from vftcli.signals.external_torque import ExternalTorque
from vftcli.signals.parsing import counted
from vftcli.signals.recording import Recording
from vftcli.signals.remarks import Remark, Remarks
from vftcli.signals.shown import Several, Shown, joined, record

if TYPE_CHECKING:
    import polars as pl
    from matplotlib.figure import Figure

    from vftcli.bias.refine import Refinement
    from vftcli.contacts.contact_list import Contact, ContactList
    from vftcli.doctor.examination import Examination
    from vftcli.evaluation.published import Comparison
    from vftcli.free_motion.free_motion import FreeMotion
    from vftcli.signals.wrench import Wrench
    from vftcli.wrench.sensing import FreeLog
    from vftcli.wrench.sensor import SensorReading


@record
class Analysis(Shown):
    """One log, one robot, the estimates, and their errors."""

    #: The log with its robot as used, and its free motion.
    motion: "FreeMotion"
    observers: tuple[Observer, ...]  #: The observers that ran.
    estimates: tuple[ExternalTorque, ...]  #: Their estimates, in the same order.
    #: Meaning of each observer's parameters for this log, by name.
    tunings: Mapping[str, Tuning]
    of_robot_file: bool = False  #: Whether all have the robot file's gains.
    #: Corrections of the estimates by the complete log, or None.
    refinement: "Refinement | None" = None
    #: The wrenches and their limits, or None if none was asked for.
    virtual_sensor: "SensorReading | None" = None
    reference: ExternalTorque | None = None  #: The torque to compare with, or None.
    #: The errors (`vftcli.evaluation.SCHEMA`), or None.
    errors: "pl.DataFrame | None" = None
    #: The contacts, or None if not asked or not known.
    contacts: "ContactList | None" = None
    #: A printed table beside these errors, or None.
    published: "Comparison | None" = None
    #: Findings on the log, then on its free runs.
    examinations: "tuple[Examination, ...]" = ()
    #: Limits of the numbers, as `Remarks`.
    remarks: tuple[Remark, ...] = ()
    #: The command, versions and conventions, as in `run.json`.
    run: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        object.__setattr__(self, "remarks", Remarks(self.remarks))
        object.__setattr__(self, "estimates", Several(self.estimates))

    def _headline(self) -> str:
        names = ", ".join(estimate.name for estimate in self.estimates) or "no observer"
        listed = "no list of contacts"
        if self.contacts is not None:
            listed = counted(len(self.contacts), "contact")
        return f"of {self.recording.name} on {self.robot.name}: {names}; {listed}"

    def _rows(self) -> Iterator[Sequence[object]]:
        yield "what", "of it"
        yield "recording", self.recording._headline()
        yield "robot", self.robot._headline()
        if self.contacts is not None:
            yield "contacts", self.contacts._headline()
        yield from (("wrench", wrench._headline()) for wrench in self.wrenches)
        for estimate in self.estimates:
            yield "estimate", estimate._headline()
        if self.reference is not None:
            yield "reference", self.reference.name
        if self.errors is not None:
            for name, error in self.errors.group_by("observer", maintain_order=True):
                yield f"error of {name[0]}", f"rmse {joined(error['rmse_Nm'])} N·m"
        yield "remarks", Remarks(self.remarks)._headline()

    @property
    def wrench(self) -> "Wrench | None":
        """The first observer's wrench: `best` if contacts are listed."""
        return next(iter(self.wrenches), None)

    @cached_property
    def recording(self) -> Recording:
        """The log."""
        return self.motion.log.recording

    @cached_property
    def robot(self) -> Robot:
        """The arm as it was used."""
        return self.motion.log.robot

    @property
    def listed(self) -> "tuple[Contact, ...]":
        """The contacts of the list, none without one."""
        return () if self.contacts is None else self.contacts.contacts

    @property
    def torques(self) -> tuple[ExternalTorque, ...]:
        """The estimates, and last the reference as "reference"."""
        if self.reference is None:
            return self.estimates
        return (*self.estimates, self.reference)

    @property
    def wrenches(self) -> "Several[Wrench]":
        """One an observer, and last the reference's as "reference"."""
        if self.virtual_sensor is None:
            return Several()
        reference = self.virtual_sensor.reference
        last = () if reference is None else (replace(reference, name="reference"),)
        return Several((*self.virtual_sensor.wrenches, *last))

    def plot(
        self,
        what: str = "contacts",
        joints: int | Sequence[int] | None = None,
        observers: str | Sequence[str] | None = None,
    ) -> "Figure":
        """A matplotlib figure of contacts, torques, wrench or errors, not shown or saved.

        Args:
            what: contacts, torques, wrench or errors.
            joints: The joints, from 1; None for all.
            observers: The observers; None for `best`, else for all that ran.

        Raises:
            VftError: If there is no such plot, or matplotlib is missing.
        """
        # Drawing and writing are several floors up.
        draw = import_module("vftcli.outputs.figures").plot
        figure: Figure = draw(self, what, joints, observers)
        return figure

    def save(self, folder: str | Path, *, force: bool = False) -> None:
        """Write page, recording, tables, estimates into a folder, as `vftcli report`."""
        write = import_module("vftcli.outputs.report").write_report
        command = self.run.get("command", "vftcli.Analysis.save")
        write(Path(folder), [self], command=command, force=force)

    def run_of(self, name: str, run: "Run") -> "Run":
        """The log or a free run, as this observer has it."""
        found = self.refinement
        return run if found is None else found.baselines.of(name).of(run)

    def spare(self) -> None:
        """Free the terms of a long log, which are made again."""
        self.motion.log.spare("terms")
        if self.refinement is not None:
            self.refinement.baselines.best.spare()

    def free_log(self, name: str | None = None) -> "FreeLog":
        """The log with its free motion, as an observer has it."""
        from vftcli.free_motion.free_motion import without_load
        from vftcli.wrench.sensing import FreeLog, as_modelled

        if self.refinement is None:
            return as_modelled(self.motion)
        found = self.refinement.baselines.plain
        load = found.load if found.untouched else None
        pieces = ((self.run_of(name, run) if name else run, at) for run, at in found.untouched)
        free = tuple(RunSamples(without_load(run, load), inside) for run, inside in pieces)
        log = self.motion.log
        return FreeLog(self.run_of(name, log) if name else log, free, load)

    @property
    def t(self) -> Array:
        """Time since the log's first sample. (T,) [s]"""
        return self.recording.t
