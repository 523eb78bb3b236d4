"""Identification: what was found, how well it predicts, and what the reader should know."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import polars as pl

from vftcli.identification.processing import PreparedLog, root_mean_square
from vftcli.robots.robot import Robot
from vftcli.signals.arrays import Array
from vftcli.signals.remarks import Remark

#: One row a log, model and joint: RMS of measured less predicted torque, in motion. `log_index`
#: counts the logs from 1, training first: two files of one name stay two logs.
RESIDUALS = pl.Schema(
    {
        "log": pl.String,
        "log_index": pl.Int64,
        "role": pl.String,
        "model": pl.String,
        "joint": pl.Int64,
        "rms_Nm": pl.Float64,
        "samples": pl.Int64,
    }
)
#: One row a number: its value, standard deviation, and what the profile said.
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
#: One row a friction candidate: its cross-validated error.
SHAPE_CHOICES = pl.Schema(
    {"joint": pl.Int64, "friction": pl.String, "cv_rms_Nm": pl.Float64, "chosen": pl.Boolean}
)
#: One row a base parameter, or a friction coefficient estimated along with them.
BASE = pl.Schema(
    {"parameter": pl.String, "value": pl.Float64, "sd": pl.Float64, "determined": pl.Boolean}
)
#: Parameter → its unit.
UNITS = {
    "torque_constant": "N·m/A",
    "rotor_inertia": "kg·m²",
    "coulomb": "N·m",
    "viscous": "N·m·s/rad",
    "offset": "N·m",
    "quadratic": "N·m·s²/rad²",
    "logarithmic": "N·m",
    "load_coulomb": "1",
    "presliding": "N·m",
    **{f"point{k}": "N·m" for k in range(1, 5)},
    "stribeck": "N·m",
    "mass": "kg",
    "com_x": "m",
    "com_y": "m",
    "com_z": "m",
}


class Number(NamedTuple):
    """One identified number; a row of `PARAMETERS`."""

    joint: int  #: Joint, from 1; the last one for a load on the flange.
    parameter: str  #: Its key in the robot file, one of `UNITS`.
    value: float  #: The estimate.
    sd: float  #: Its standard deviation.
    unit: str  #: Unit of value, sd and profile.
    profile: float  #: What the profile says, nan where it says nothing.
    determined: bool  #: Whether the logs determine it; a value that they do not is not written.


def number(
    j: int, parameter: str, value: float, sd: float, profile: float, determined: bool
) -> Number:
    """An identified number of joint j (from 0), with its parameter's unit."""
    unit, known = UNITS[parameter], bool(determined)
    return Number(j + 1, parameter, float(value), float(sd), unit, float(profile), known)


class MethodResult(NamedTuple):
    """What a method of identification hands back."""

    method: str  #: Its name.
    robot: Robot  #: The identified robot.
    numbers: Sequence[Number] = ()  #: Its identified numbers.
    remarks: Sequence[Remark] = ()  #: What the reader of the numbers should know.
    shape_choices: Sequence[tuple[int, str, float, bool]] = ()  #: Rows of `SHAPE_CHOICES`.
    base: pl.DataFrame | None = None  #: Base parameters (`BASE`), if the method has them.
    is_narrow: bool = False  #: Whether the motion tells the links too little.


class Trace(NamedTuple):
    """Measured and predicted torque of one log, filtered alike."""

    motion: PreparedLog  #: The prepared log.
    role: str  #: "train" or "held-out".
    measured: Array  #: Drive torque, by the identified drive constants. (M, n) [N·m]
    predicted: Array  #: What the identified robot expects. (M, n) [N·m]
    before: Array  #: RMS of what the profile does not explain. (n,) [N·m]

    @property
    def residual(self) -> Array:
        """Measured less predicted. (M, n) [N·m]"""
        difference: Array = self.measured - self.predicted
        return difference

    @property
    def rms(self) -> Array:
        """RMS of the residual in each joint. (n,) [N·m]"""
        return root_mean_square(self.residual)

    def rows(self, index: int) -> list[tuple[str, int, str, str, int, float, int]]:
        """Rows of `RESIDUALS`, this log being the one of this index."""
        name, samples = self.motion.recording.name, self.motion.samples
        return [
            (name, index, self.role, model, j, float(value), samples)
            for model, values in (("identified", self.rms), ("profile", self.before))
            for j, value in enumerate(values, start=1)
        ]


@dataclass(frozen=True, kw_only=True)
class Identification:
    """A robot made from logs, with the account of how."""

    robot: Robot  #: The identified robot; its document carries the sources.
    profile: Robot  #: The robot it started from.
    method: str  #: Name of the method.
    residuals: pl.DataFrame  #: RMS per log, model and joint (`RESIDUALS`).
    parameters: pl.DataFrame  #: Identified numbers (`PARAMETERS`).
    #: Friction candidates (`SHAPE_CHOICES`), empty where none competed.
    shape_choices: pl.DataFrame
    base: pl.DataFrame | None  #: Base parameters (`BASE`), None for methods that have none.
    traces: tuple[Trace, ...]  #: Measured and predicted torque of every log.
    #: Filters, differentiation, decimation and band, by name.
    processing: Mapping[str, Any] = field(default_factory=dict)
    remarks: tuple[Remark, ...] = ()  #: What the reader should know.
