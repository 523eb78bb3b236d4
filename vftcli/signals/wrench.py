"""Wrench: the environment's force and moment on the robot, in a stated frame."""

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from vftcli.signals.arrays import Array, Mask, check_clock, seal
from vftcli.signals.errors import ParameterError
from vftcli.signals.remarks import Remark
from vftcli.signals.shown import ALL, TimeSeries, record

#: Names of the six components, force first, as in column names and tables.
AXES = ("fx", "fy", "fz", "mx", "my", "mz")
#: Point of a moment → its words; a log may name another.
POINTS = {
    "flange": "the flange point",
    "tool": "the tool's point",
    "base": "the base's origin",
    "controller": "the flange point or the tool's, by which sensor the controller has",
    "sensor": "the sensor's origin",
}
#: Axes → usual point of their moments, if not their origin.
OWN_POINT = {"base": "flange"}
#: Whether a force is the environment's on the robot, or the robot's on the environment.
Sign = Literal["on-robot", "by-robot"]


@dataclass(frozen=True)
class WrenchFrame:
    """A log's statement of its own wrench."""

    #: base, flange, tool or sensor; or a frame that only the log knows.
    axes: str
    point: str  #: Point of its moment: a key of `POINTS`, or the log's own.
    sign: Sign = "on-robot"  #: On or by the robot.

    @classmethod
    def parsed(cls, text: str) -> "WrenchFrame":
        """The frame that ``AXES[@POINT][,by-robot]`` states."""
        place, _, sign = text.strip().partition(",")
        axes, at, point = place.strip().partition("@")
        sign = sign.strip() or "on-robot"
        wrong = not axes or (at and not point) or len(place.split()) != 1
        if wrong or sign not in get_args(Sign):
            raise ParameterError(
                f"the frame of a wrench {text!r} is not AXES[@POINT][,by-robot], as base, "
                "base@tool or sensor,by-robot"
            )
        # get_args has checked the sign, which the type checker cannot see.
        return cls(axes, point or OWN_POINT.get(axes, axes), sign)  # type: ignore[arg-type]

    @classmethod
    def of_conversion(cls, notation: object) -> "WrenchFrame | None":
        """The frame that a log converted by us holds, None of an unknown one.

        Earlier versions wrote a sentence there: their files read, without a stated frame.
        """
        with suppress(ParameterError):
            return cls.parsed(notation) if isinstance(notation, str) else None
        return None

    @property
    def notation(self) -> str:
        """The frame as `parsed` reads it."""
        return f"{self.axes}@{self.point}" + (",by-robot" if self.sign == "by-robot" else "")

    @property
    def factor(self) -> float:
        """Factor from the values to force on the robot: 1 or −1."""
        return -1.0 if self.sign == "by-robot" else 1.0

    def __str__(self) -> str:
        point = POINTS.get(self.point, self.point)
        sense = "BY the robot ON the environment" if self.sign == "by-robot" else "on the robot"
        return f"{self.axes} axes at {point}, as force {sense}"


#: O_F_ext_hat_K of libfranka: on an FR3 pinv(Jᵀ)·tau_ext_hat_filtered, J about the base.
FRANKA_FRAME = WrenchFrame("base", "base", "by-robot")


def unit_of(axis: str | int) -> str:
    """The unit of an axis, by its name or its number from 0: N or N·m."""
    number = AXES.index(axis) if isinstance(axis, str) else axis
    return "N" if number < 3 else "N·m"


def per_axis(name: str, values: Array) -> Iterator[tuple[str, Array]]:
    """One contiguous column an axis, fx to mz."""
    for axis, column in zip(AXES, np.ascontiguousarray(values.T), strict=True):
        yield f"{name}/{axis}", column


@record
class Wrench(TimeSeries):
    """Force and moment that the environment exerts on the robot."""

    name: str  #: Name of the observer or of the reference.
    t: Array  #: Time on the recording's clock. (T,) [s]
    #: Force, then moment, even where the pose leaves them open: see `known`. (T, 6) [N, N·m]
    values: Array
    frame: str  #: Axes and reference point: a key of `vftcli.wrench.solvers.FRAMES`.
    sd: Array | None = None  #: One SD of `values`. (T, 6) [N, N·m]
    #: Least singular value of J, angular rows × .3 m; None: no J. (T,) [m]
    sigma_min: Array | None = None
    masked: Mask | None = None  #: Where the pose cannot tell it. (T,)
    #: Norm of the torque that no flange wrench explains; None for six joints. (T,) [N·m]
    null_space: Array | None = None
    remarks: tuple[Remark, ...] = ()  #: What a reader should know.

    def __post_init__(self) -> None:
        seal(self, "t", "null_space")
        samples = len(self.t)
        check_clock(self.t, self.name)
        if self.masked is None:
            object.__setattr__(self, "masked", np.zeros(samples))
        seal(self, "values", "sd", shape=(samples, 6), called=self.name)
        seal(self, "sigma_min", shape=(samples,), called=self.name)
        seal(self, "masked", shape=(samples,), called=self.name, kind=bool)

    def _headline(self) -> str:
        most = self.size[np.isfinite(self.size)].max(initial=0.0)
        return (
            f"of {self.name}, frame {self.frame}: {len(self.t)} samples, |F| up to {most:.3g} N"
        )

    def _rows(self) -> Iterator[Sequence[object]]:
        yield "axis", "unit", "least", "most", "largest sd"
        sure = np.isfinite(self.known).all(axis=1)
        for k, axis in enumerate(AXES):
            values, sd = self.values[sure, k], None if self.sd is None else self.sd[sure, k]
            figures = (values.min, values.max, None if sd is None else sd.max)
            yield axis, unit_of(axis), *(f() if f and sure.any() else None for f in figures)

    def columns(self, rows: slice = ALL) -> Iterator[tuple[str, Array]]:
        """Every axis, as ``wrench/best/fx``, and its SD."""
        for kind, values in {"wrench": self.values, "wrench_sd": self.sd}.items():
            if values is not None:
                known = np.where(self.hidden[rows, None], np.nan, values[rows])
                yield from per_axis(f"{kind}/{self.name}", known)

    @property
    def hidden(self) -> Mask:
        """Samples with a pose at which the wrench is unknown. (T,)"""
        return np.asarray(self.masked, bool)

    @property
    def known(self) -> Array:
        """The wrench, NaN where unknown. (T, 6) [N, N·m]"""
        hidden = self.hidden
        return np.where(hidden[:, None], np.nan, self.values) if hidden.any() else self.values

    @property
    def force(self) -> Array:
        """The force, NaN where unknown. (T, 3) [N]"""
        return self.known[:, :3]

    @property
    def moment(self) -> Array:
        """The moment about the frame's origin, NaN where unknown. (T, 3) [N·m]"""
        return self.known[:, 3:]

    @property
    def size(self) -> Array:
        """|F|, NaN where unknown. (T,) [N]"""
        return np.asarray(np.linalg.norm(self.force, axis=1))

    @property
    def size_sd(self) -> Array | None:
        """SD of |F|, the axes independent. (T,) [N]

        Without a force it is the largest of the axes', since F may point anywhere.
        """
        if self.sd is None:
            return None
        sd, size = self.sd[:, :3], self.size
        along = self.force / np.where(size > 0.0, size, 1.0)[:, None]
        found: Array = np.sqrt(np.sum((along * sd) ** 2, axis=1))
        found[size == 0.0] = sd[size == 0.0].max(axis=1)
        return found

    def between(self, start: float, stop: float) -> Array:
        """The known samples with start ≤ t ≤ stop. (k, 6) [N, N·m]"""
        inside = (self.t >= start) & (self.t <= stop) & np.isfinite(self.known).all(axis=1)
        return self.values[inside]
