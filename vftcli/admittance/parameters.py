"""Admittance parameters: one number for each Cartesian axis, as in Tables III and IV."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from vftcli.signals.arrays import Array, check_shape, frozen
from vftcli.signals.errors import ParameterError
from vftcli.signals.parsing import assignment, numbers

#: The six axes: translation of the flange point along the base axes, rotation about them.
AXES = ("x", "y", "z", "rx", "ry", "rz")
#: Section of an assignment or of a robot file → the axes it speaks of.
GROUPS: dict[str, tuple[int, ...]] = {
    "admittance": (0, 1, 2, 3, 4, 5),
    "position": (0, 1, 2),
    "rotation": (3, 4, 5),
    **{axis: (k,) for k, axis in enumerate(AXES)},
}
#: Parameters with one number an axis.
PER_AXIS = (
    "mass",
    "damping",
    "stiffness",
    "alpha",
    "xi",
    "threshold",
    "hysteresis",
    "speed_limit",
    "speed_scale",
)

REQUIRED = ("mass", "damping", "stiffness", "alpha", "threshold")

#: The paper's letters, accepted beside the words.
LETTERS = {
    "m": "mass",
    "b": "damping",
    "k": "stiffness",
    "m_d": "mass",
    "b_d": "damping",
    "k_d": "stiffness",
    "f_tsd": "threshold",
    "v_tsd": "speed_limit",
    "v0": "speed_scale",
    "ts": "period",
}

THRESHOLD_MODES = ("hard", "soft", "literal")


@dataclass(frozen=True, kw_only=True)
class Admittance:
    """What the variable-parameter law (45)–(51) and Algorithm 1 are run with.

    Translational axes are in kg, N·s/m, N/m, N, m/s; rotational ones in kg·m², N·m·s/rad, N·m/rad,
    N·m, rad/s. Every array is (6,), in the order of `AXES`.
    """

    mass: Array  #: M_d.
    damping: Array  #: B_d.
    stiffness: Array  #: K_d.
    alpha: Array  #: α of (47).
    threshold: Array  #: F_tsd: above it an axis is dragged, below it recovers.
    #: ξ of (47), which the paper does not print; None takes B_d/(2√(M_d K_d)), the damping ratio of
    #: the drag phase.
    xi: Array | None = None
    #: Share of the threshold by which the force has to fall below it before an axis that is dragged
    #: recovers; 0 is the paper's.
    hysteresis: Array | float = 0.0
    speed_limit: Array | float = np.inf  #: Ẋ_tsd; infinite for none.
    speed_scale: Array | float = 1.0  #: v₀ in e^{|v|/v₀}: 1 m/s and 1 rad/s.
    period: float  #: Control period. [s]
    threshold_mode: str = "hard"  #: What of the force enters, see `vftcli.admittance.thresholds`.
    source: str = ""  #: Where the numbers come from, in words.

    def __post_init__(self) -> None:
        for name in PER_AXIS:
            if (value := getattr(self, name)) is not None:
                array = np.asarray(value, dtype=np.float64)
                array = np.broadcast_to(array, (6,)) if array.ndim == 0 else array
                check_shape(array, (6,), name, "the admittance")
                object.__setattr__(self, name, frozen(array))
        for name in ("mass", "stiffness", "alpha", "xi", "speed_scale", "speed_limit"):
            self._check(name, positive=True)
        for name in ("damping", "threshold", "hysteresis"):
            self._check(name, positive=False)
        if np.any(np.asarray(self.hysteresis) >= 1.0):
            raise ParameterError(
                "admittance.hysteresis is a share of the threshold and must be below 1; "
                f"it is {np.max(self.hysteresis):g}"
            )
        if not (np.isfinite(self.period) and self.period > 0.0):
            raise ParameterError(
                f"admittance.period is {self.period:g} s; the control period must be positive"
            )
        if self.threshold_mode not in THRESHOLD_MODES:
            raise ParameterError(
                f"threshold mode {self.threshold_mode!r}; there is {', '.join(THRESHOLD_MODES)}"
            )

    def _check(self, name: str, *, positive: bool) -> None:
        value = getattr(self, name)
        if value is None:
            return
        wrong = ~(value > 0.0) if positive else ~(value >= 0.0)
        if name not in {"speed_limit", "threshold"}:
            wrong |= ~np.isfinite(value)
        if np.any(wrong):
            k = int(np.argmax(wrong))
            needed = "positive" if positive else "zero or positive"
            raise ParameterError(
                f"admittance.{name} of axis {AXES[k]} is {value[k]:g}; it must be {needed}"
            )

    @property
    def damping_ratio(self) -> Array:
        """ξ as it is used: given, or B_d/(2√(M_d K_d)). (6,)"""
        if self.xi is not None:
            return self.xi
        ratio: Array = self.damping / (2.0 * np.sqrt(self.mass * self.stiffness))
        return ratio

    @property
    def recovery_damping(self) -> Array:
        """B_dva = 2ξ√(M_dva K_dva) = 2ξ√(M_d K_d): the same at every speed and every α. (6,)"""
        damping: Array = 2.0 * self.damping_ratio * np.sqrt(self.mass * self.stiffness)
        return damping

    def with_alpha(self, alpha: float) -> "Admittance":
        """The same with one α for all axes."""
        return replace(self, alpha=np.full(6, float(alpha)))


def from_table(
    table: Mapping[str, Any], robot: str, settings: Mapping[str, Mapping[str, Any]]
) -> Admittance:
    """Build the parameters from a robot file's ``[admittance]`` and the user's assignments.

    Args:
        table: The section, empty if the file has none.
        robot: The robot's name, for messages.
        settings: Section (a key of `GROUPS`) → parameter → value; they win over the file.

    Raises:
        ParameterError: If a parameter is missing for an axis, unknown or out of range.
    """
    given = [(name, table.get(name, {})) for name in ("position", "rotation")]
    values: dict[str, Array] = {}
    for section, entries in (*given, *settings.items()):
        for name, value in entries.items():
            if name not in PLAIN:
                assign(values, section, name, value)
    plain = {name: table[name] for name in PLAIN if name in table}
    plain |= {k: v for k, v in settings.get("admittance", {}).items() if k in PLAIN}
    check_complete(values, plain, robot, has_table=bool(table))
    xi = values.pop("xi", None)
    found = Admittance(
        **values,
        period=number(plain["period"], "admittance.period"),
        threshold_mode=str(plain.get("threshold_mode", "hard")),
        source=str(plain.get("source", "")),
    )
    if xi is None:
        return found
    # Axes without a ξ of their own keep that of the drag phase.
    return replace(found, xi=np.where(np.isnan(xi), found.damping_ratio, xi))


#: Keys of ``[admittance]`` that are not one number an axis.
PLAIN = ("period", "threshold_mode", "source", "start", "confidence")


def assign(values: dict[str, Array], section: str, name: str, value: Any) -> None:  # noqa: ANN401
    """Put one number, or one an axis, of a section into its place among the six."""
    if name not in PER_AXIS:
        raise ParameterError(
            f"the admittance has no parameter {name!r}; it has {', '.join((*PER_AXIS, 'period'))}"
        )
    axes = GROUPS[section]
    what = f"{section}.{name}"
    try:
        array = np.atleast_1d(np.asarray(value, dtype=np.float64))
    except (TypeError, ValueError):
        raise ParameterError(f"{what} is {value!r}; it must be a number or one an axis") from None
    if array.ndim != 1 or array.size not in {1, len(axes)}:
        raise ParameterError(f"{what} has {array.size} values; give one, or {len(axes)}")
    row = values.setdefault(name, np.full(6, np.nan))
    row[list(axes)] = array


#: What holds for an axis that is given no such number; a missing speed limit is none.
DEFAULTS = {"hysteresis": 0.0, "speed_limit": np.inf, "speed_scale": 1.0}


def check_complete(
    values: dict[str, Array], plain: Mapping[str, Any], robot: str, *, has_table: bool
) -> None:
    """Fill what has a default, and raise a ParameterError for what has none."""
    for name, default in DEFAULTS.items():
        row = values.setdefault(name, np.full(6, np.nan))
        row[np.isnan(row)] = default
    for name in REQUIRED:
        row = values.get(name, np.full(6, np.nan))
        if np.any(np.isnan(row)):
            absent = np.flatnonzero(np.isnan(row))
            listed = ", ".join(AXES[k] for k in absent)
            section = next(key for key, axes in GROUPS.items() if set(axes) <= set(absent))
            where = "its [admittance]" if has_table else "an [admittance] section, which it lacks,"
            raise ParameterError(
                f"{robot}: no admittance {name} for {listed}; give it in {where} or "
                f"with --set {section}.{name}=VALUE"
            )
    if "period" not in plain:
        raise ParameterError(
            f"{robot}: no admittance.period; give the control period [s] in its [admittance] or "
            "with --set admittance.period=0.008"
        )


def number(value: Any, what: str) -> float:  # noqa: ANN401 - TOML is untyped
    """One number."""
    try:
        return float(value)
    except (TypeError, ValueError):
        raise ParameterError(f"{what} is {value!r}; it must be a number") from None


def parse_settings(assignments: Sequence[str]) -> dict[str, dict[str, Any]]:
    """Read ``SECTION.PARAMETER=VALUE`` assignments of the admittance; see `GROUPS`.

    ``xi=1`` without a section is ``admittance.xi=1``; the paper's letters are understood.
    """
    settings: dict[str, dict[str, Any]] = {}
    for text in assignments:
        form = "SECTION.PARAMETER=VALUE, as position.stiffness=12"
        left, value = assignment(text, "--set", form)
        section, dot, name = left.rpartition(".")
        section = section if dot else "admittance"
        name = LETTERS.get(name.lower(), name)
        if section not in GROUPS or name not in (*PER_AXIS, *PLAIN):
            raise ParameterError(
                f"--set {text!r}: no such admittance parameter. Sections: {', '.join(GROUPS)}; "
                f"parameters: {', '.join((*PER_AXIS, 'period'))}"
            )
        settings.setdefault(section, {})[name] = parse_value(name, value, text)
    return settings


def parse_value(name: str, text: str, whole: str) -> Any:  # noqa: ANN401
    """A word, a number, or a list of numbers; ``none`` is no speed limit."""
    if name in {"threshold_mode", "source"}:
        return text
    if name == "speed_limit" and text.lower() == "none":
        return float("inf")
    values = numbers(text)
    if values is None:
        raise ParameterError(f"--set {whole!r}: {text!r} is not a number or a list")
    return values[0] if len(values) == 1 else list(values)


def is_admittance_setting(assignment: str) -> bool:
    """Whether an assignment of the command line speaks of the admittance, not of an observer."""
    section, dot, _ = assignment.partition("=")[0].strip().rpartition(".")
    return not dot or section in GROUPS


def release_deviation(assignments: Sequence[str]) -> Array:
    """Deviation of a release from ``axis=value`` assignments. (6,) [m, rad]"""
    x = np.zeros(6)
    form = f"AXIS=VALUE with an axis of {', '.join(AXES)}, as x=0.3 [m] or rz=0.5 [rad]"
    for part in ",".join(assignments).split(","):
        axis, text = assignment(part, "--release", form)
        value = numbers(text)
        if axis not in AXES or value is None or not np.isfinite(value[0]):
            raise ParameterError(f"--release {part!r} is not {form}")
        x[AXES.index(axis)] = value[0]
    if np.any(np.linalg.norm(x[3:]) >= np.pi):
        raise ParameterError(
            f"--release turns by {np.linalg.norm(x[3:]):.3g} rad; it must be less than π"
        )
    return x
