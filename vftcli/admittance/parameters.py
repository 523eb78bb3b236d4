"""Admittance parameters: one number for each Cartesian axis, as in Tables III and IV."""

from collections.abc import Mapping, Sequence
from dataclasses import MISSING, dataclass, field, fields, replace
from typing import Any

import numpy as np

from vftcli.signals.arrays import Array, frozen
from vftcli.signals.errors import ParameterError
from vftcli.signals.parsing import assignment, check_known, numbers
from vftcli.signals.schema import NUMBER, set_value, spread

#: The six axes: translation of the flange point along the base axes, rotation about them.
AXES = ("x", "y", "z", "rx", "ry", "rz")
#: Section of an assignment or of a robot file → the axes it speaks of.
GROUPS: dict[str, tuple[int, ...]] = {
    "admittance": (0, 1, 2, 3, 4, 5),
    "position": (0, 1, 2),
    "rotation": (3, 4, 5),
    **{axis: (k,) for k, axis in enumerate(AXES)},
}
THRESHOLD_MODES = ("hard", "soft", "literal")


def axis(*letters: str, positive: bool = True, endless: bool = False) -> dict[str, Any]:
    """What is known of a field with one number an axis: the paper's letters, its bounds."""
    return {"letters": letters, "positive": positive, "endless": endless}


@dataclass(frozen=True, kw_only=True)
class Admittance:
    """What the variable-parameter law (45)–(51) and Algorithm 1 are run with.

    Translational axes are in kg, N·s/m, N/m, N, m/s; rotational ones in kg·m², N·m·s/rad, N·m/rad,
    N·m, rad/s. Every array is (6,), in the order of `AXES`.
    """

    mass: Array = field(metadata=axis("m", "m_d"))  #: M_d.
    damping: Array = field(metadata=axis("b", "b_d", positive=False))  #: B_d.
    stiffness: Array = field(metadata=axis("k", "k_d"))  #: K_d.
    alpha: Array = field(metadata=axis())  #: α of (47).
    #: F_tsd: above it an axis is dragged, below it recovers.
    threshold: Array = field(metadata=axis("f_tsd", positive=False, endless=True))
    #: ξ of (47), which the paper does not print; None takes B_d/(2√(M_d K_d)), the damping ratio of
    #: the drag phase.
    xi: Array | None = field(default=None, metadata=axis())
    #: Share of the threshold by which the force has to fall below it before an axis that is dragged
    #: recovers; 0 is the paper's.
    hysteresis: Array | float = field(default=0.0, metadata=axis(positive=False))
    #: Ẋ_tsd; infinite for none.
    speed_limit: Array | float = field(default=np.inf, metadata=axis("v_tsd", endless=True))
    #: v₀ in e^{|v|/v₀}: 1 m/s and 1 rad/s.
    speed_scale: Array | float = field(default=1.0, metadata=axis("v0"))
    period: float  #: Control period. [s]
    threshold_mode: str = "hard"  #: What of the force enters, see `vftcli.admittance.thresholds`.
    source: str = ""  #: Where the numbers come from, in words.

    def __post_init__(self) -> None:
        for name, key in PER_AXIS.items():
            if getattr(self, name) is None:
                continue
            array = spread(getattr(self, name), 6, "axes", f"admittance.{name}")
            object.__setattr__(self, name, frozen(array))
            fits = array > 0.0 if key.metadata["positive"] else array >= 0.0
            if not key.metadata["endless"]:
                fits &= np.isfinite(array)
            if not np.all(fits):
                k = int(np.argmin(fits))
                needed = "positive" if key.metadata["positive"] else "zero or positive"
                raise ParameterError(
                    f"admittance.{name} of axis {AXES[k]} is {array[k]:g}; it must be {needed}"
                )
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
        return replace(self, alpha=np.full(6, alpha))


PER_AXIS = {key.name: key for key in fields(Admittance) if key.metadata}
#: The paper's letters, accepted beside the words.
LETTERS = {
    **{letter: name for name, key in PER_AXIS.items() for letter in key.metadata["letters"]},
    "ts": "period",
}
#: Keys of ``[admittance]`` that are not one number an axis.
PLAIN = ("period", "threshold_mode", "source", "start", "confidence")


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
    groups = [(name, table.get(name, {})) for name in ("position", "rotation")]
    values = {name: np.full(6, np.nan) for name in PER_AXIS}
    for section, entries in (*groups, *settings.items()):
        axes = list(GROUPS[section])
        for name, value in entries.items():
            if name in PLAIN:
                continue
            check_known(name, PER_AXIS, f"the admittance has no parameter {name!r}")
            values[name][axes] = spread(value, len(axes), "axes", f"{section}.{name}")
    where = "its [admittance]" if table else "an [admittance] section, which it lacks,"
    for name, key in PER_AXIS.items():
        absent = np.isnan(values[name])
        if name != "xi" and key.default is not MISSING:
            values[name][absent] = key.default
        elif name != "xi" and np.any(absent):
            listed = ", ".join(np.array(AXES)[absent])
            section = next(group for group, axes in GROUPS.items() if np.all(absent[list(axes)]))
            raise ParameterError(
                f"{robot}: no admittance {name} for {listed}; give it in {where} or "
                f"with --set {section}.{name}=VALUE"
            )
    plain = {**table, **settings.get("admittance", {})}
    if "period" not in plain:
        raise ParameterError(
            f"{robot}: no admittance.period; give the control period [s] in its [admittance] or "
            "with --set admittance.period=0.008"
        )
    NUMBER.check("admittance.period", plain["period"])
    xi = values.pop("xi")
    found = Admittance(
        **values,
        period=float(plain["period"]),
        threshold_mode=plain.get("threshold_mode", "hard"),
        source=plain.get("source", ""),
    )
    if np.all(np.isnan(xi)):
        return found
    # Axes without a ξ of their own keep that of the drag phase.
    return replace(found, xi=np.where(np.isnan(xi), found.damping_ratio, xi))


def parse_settings(assignments: Sequence[str]) -> dict[str, dict[str, Any]]:
    """Read ``SECTION.PARAMETER=VALUE`` assignments of the admittance; see `GROUPS`.

    ``xi=1`` without a section is ``admittance.xi=1``; the paper's letters are understood.
    """
    settings: dict[str, dict[str, Any]] = {}
    for text in assignments:
        left, value = assignment(text, "--set", "SECTION.PARAMETER=VALUE, as position.stiffness=12")
        section, _, name = (left if "." in left else f"admittance.{left}").rpartition(".")
        name = LETTERS.get(name.lower(), name)
        whole = ("period", "threshold_mode", "source") if section == "admittance" else ()
        if section not in GROUPS or name not in (*PER_AXIS, *whole):
            raise ParameterError(
                f"--set {text!r}: no such admittance parameter. Sections: {', '.join(GROUPS)}; "
                f"parameters: {', '.join((*PER_AXIS, 'period'))}"
            )
        given: Any = value
        if name not in {"threshold_mode", "source"}:
            endless = name == "speed_limit" and value.lower() == "none"
            given = set_value("inf" if endless else value, text)
        settings.setdefault(section, {})[name] = given
    return settings


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
        if axis not in AXES or not value or not np.isfinite(value[0]):
            raise ParameterError(f"--release {part!r} is not {form}")
        x[AXES.index(axis)] = value[0]
    if np.linalg.norm(x[3:]) >= np.pi:
        raise ParameterError(
            f"--release turns by {np.linalg.norm(x[3:]):.3g} rad; it must be less than π"
        )
    return x
