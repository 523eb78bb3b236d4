"""Identification: what was found, how well it predicts, and what the reader should know."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import polars as pl

from vftcli.robots.robot import Robot
from vftcli.signals.arrays import Array
from vftcli.signals.recording import Recording

RESIDUALS = pl.Schema(
    {
        "log": pl.String,
        "role": pl.String,
        "model": pl.String,
        "joint": pl.Int64,
        "rms_Nm": pl.Float64,
        "samples": pl.Int64,
    }
)
"""One row a log, model and joint: RMS of measured less predicted torque, in motion."""

PARAMETERS = pl.Schema(
    {
        "joint": pl.Int64,
        "parameter": pl.String,
        "value": pl.Float64,
        "sd": pl.Float64,
        "unit": pl.String,
        "profile": pl.Float64,
        "determined": pl.Boolean,
    }
)
"""One row a number: its value, standard deviation, and what the profile said."""

CONTESTS = pl.Schema(
    {"joint": pl.Int64, "friction": pl.String, "cv_rms_Nm": pl.Float64, "chosen": pl.Boolean}
)
"""One row a friction candidate: its cross-validated error."""

BASE = pl.Schema(
    {"parameter": pl.String, "value": pl.Float64, "sd": pl.Float64, "determined": pl.Boolean}
)
"""One row a base parameter, or a friction coefficient estimated along with them."""

UNITS = {
    "torque_constant": "N·m/A",
    "rotor_inertia": "kg·m²",
    "coulomb": "N·m",
    "viscous": "N·m·s/rad",
    "offset": "N·m",
    "quadratic": "N·m·s²/rad²",
    "load_coulomb": "1",
    "stribeck": "N·m",
    "mass": "kg",
    "com": "m",
}
"""Unit of each kind of number."""


class Number(NamedTuple):
    """One identified number; a row of `PARAMETERS`."""

    joint: int
    parameter: str
    value: float
    sd: float
    profile: float
    determined: bool

    @property
    def row(self) -> tuple[int, str, float, float, str, float, bool]:
        """The row with its unit."""
        unit = UNITS.get(self.parameter.split("_")[0], UNITS.get(self.parameter, ""))
        return (*self[:4], UNITS.get(self.parameter, unit), *self[4:])


class Trace(NamedTuple):
    """Measured and predicted torque of one log, filtered alike.

    Attributes:
        recording: The log.
        role: "train" or "held-out".
        t: Time. (M,) [s]
        dq: Velocities. (M, n) [rad/s]
        measured: Drive torque. (M, n) [N·m]
        predicted: What the identified robot expects. (M, n) [N·m]
    """

    recording: Recording
    role: str
    t: Array
    dq: Array
    measured: Array
    predicted: Array

    @property
    def residual(self) -> Array:
        """Measured less predicted. (M, n) [N·m]"""
        difference: Array = self.measured - self.predicted
        return difference


@dataclass(frozen=True, kw_only=True)
class Identification:
    """A robot made from logs, with the account of how.

    Attributes:
        robot: The identified robot; its document carries the sources.
        profile: The robot it started from.
        method: Name of the method.
        residuals: RMS per log, model and joint (`RESIDUALS`).
        parameters: Identified numbers (`PARAMETERS`).
        contests: Friction candidates (`CONTESTS`), empty where none competed.
        base: Base parameters (`BASE`), None for methods that have none.
        traces: Measured and predicted torque of every log.
        processing: Filters, differentiation, decimation and band, by name.
        notes: What the reader should know, one sentence each.
    """

    robot: Robot
    profile: Robot
    method: str
    residuals: pl.DataFrame
    parameters: pl.DataFrame
    contests: pl.DataFrame
    base: pl.DataFrame | None
    traces: tuple[Trace, ...]
    processing: Mapping[str, Any] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    def mean_rms(self, log: str, model: str = "identified") -> float:
        """Mean over the joints of one log's RMS under one model. [N·m]"""
        rows = self.residuals.filter((pl.col("log") == log) & (pl.col("model") == model))
        return float(rows["rms_Nm"].mean() or 0.0)  # type: ignore[arg-type]
