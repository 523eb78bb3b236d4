"""Admittance parameters: one number for each Cartesian axis, as in Tables III and IV."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from vftcli.signals.arrays import Array, frozen, spread
from vftcli.signals.errors import ParameterError
from vftcli.signals.parsing import NUMBER, assignment, check_known, numbers, set_value

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


#: Parameter with one number an axis → the paper's letters, accepted beside the words.
PER_AXIS = {
    "mass": ("m", "m_d"),
    "damping": ("b", "b_d"),
    "stiffness": ("k", "k_d"),
    "alpha": (),
    "threshold": ("f_tsd",),
    "xi": (),
    "hysteresis": (),
    "speed_limit": ("v_tsd",),
    "speed_scale": ("v0",),
}
#: Every number of every group of axes, as ``--set`` names it.
NUMBERS = tuple(f"{group}.{name}" for group in GROUPS for name in PER_AXIS)
LETTERS = {letter: name for name, letters in PER_AXIS.items() for letter in letters}
LETTERS["ts"] = "period"
MAY_BE_ZERO = ("damping", "threshold", "hysteresis")
MAY_BE_ENDLESS = ("threshold", "speed_limit")
#: Keys of ``[admittance]`` that are not one number an axis.
PLAIN = ("period", "threshold_mode", "source", "start", "confidence")


@dataclass(frozen=True, kw_only=True)
class Admittance:
    """What the variable-parameter law (45)–(51) and Algorithm 1 are run with.

    Translational axes are in kg, N·s/m, N/m, N, m/s; rotational ones in kg·m², N·m·s/rad, N·m/rad,
    N·m, rad/s. Every array is (6,), in the order of `AXES`; one number is that of all axes.
    """

    mass: Array  #: M_d.
    damping: Array  #: B_d.
    stiffness: Array  #: K_d.
    alpha: Array  #: α of (47).
    threshold: Array  #: F_tsd: above it an axis is dragged, below it recovers.
    #: ξ of (47), which the paper does not print; None, and NaN for an axis, is B_d/(2√(M_d K_d)),
    #: the damping ratio of the drag phase.
    xi: Array | None = None
    #: Share of the threshold by which the force has to fall below it before an axis that is dragged
    #: recovers; 0 is the paper's.
    hysteresis: Array | float = 0.0
    speed_limit: Array | float = np.inf  #: Ẋ_tsd; infinite for none.
    speed_scale: Array | float = 1.0  #: v₀ in e^{|v|/v₀}: 1 m/s and 1 rad/s.
    period: float  #: Control period. [s]
    threshold_mode: str = "hard"  #: What of the force enters, see `vftcli.admittance.motion`.
    source: str = ""  #: Where the numbers come from, in words.

    def __post_init__(self) -> None:
        for name in PER_AXIS:
            if getattr(self, name) is None:
                continue
            array = spread(getattr(self, name), 6, "axes", f"admittance.{name}")
            if name == "xi":
                array = np.where(np.isnan(array), self.drag_ratio, array)
            object.__setattr__(self, name, frozen(array))
            zero, endless = name in MAY_BE_ZERO, name in MAY_BE_ENDLESS
            fits = ((array > 0.0) | (zero & (array == 0.0))) & (np.isfinite(array) | endless)
            if not np.all(fits):
                k = int(np.argmin(fits))
                raise ParameterError(
                    f"admittance.{name} of axis {AXES[k]} is {array[k]:g}; it must be "
                    f"{'zero or ' * zero}positive"
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
        check_known(
            self.threshold_mode, THRESHOLD_MODES, f"no threshold mode {self.threshold_mode!r}"
        )

    @property
    def drag_ratio(self) -> Array:
        """Damping ratio of the drag phase, B_d/(2√(M_d K_d)). (6,)"""
        return np.asarray(self.damping / (2.0 * np.sqrt(self.mass * self.stiffness)))

    @property
    def release_threshold(self) -> Array:
        """Force from which down an axis that is dragged recovers. (6,) [N, N·m]"""
        return np.asarray(self.threshold * (1.0 - np.asarray(self.hysteresis)))

    @property
    def damping_ratio(self) -> Array:
        """ξ as it is used. (6,)"""
        return self.drag_ratio if self.xi is None else self.xi


def from_table(
    table: Mapping[str, Any],
    robot: str,
    settings: Mapping[str, Mapping[str, Any]],
) -> Admittance:
    """The parameters of a robot file's ``[admittance]``, over which the user's settings win.

    Settings are section (a key of `GROUPS`) → parameter → value.

    Raises:
        ParameterError: If a parameter is missing for an axis, unknown or out of range.
    """
    groups = [(name, table.get(name, {})) for name in ("position", "rotation")]
    # What has a default begins with it; ξ, which has none of its own, and all else with NaN.
    values: dict[str, Any] = {
        name: np.full(6, getattr(Admittance, name, None), np.float64) for name in PER_AXIS
    }
    for section, entries in (*groups, *settings.items()):
        axes = list(GROUPS[section])
        for name, value in entries.items():
            if name not in PLAIN:
                check_known(name, PER_AXIS, f"the admittance has no parameter {name!r}")
                values[name][axes] = spread(value, len(axes), "axes", f"{section}.{name}")
    where = "its [admittance]" if table else "an [admittance] section, which it lacks,"
    for name, found in values.items():
        absent = np.isnan(found)
        if name != "xi" and np.any(absent):
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
    words = {name: plain[name] for name in ("threshold_mode", "source") if name in plain}
    xi = values.pop("xi")
    own = None if np.all(np.isnan(xi)) else xi
    return Admittance(**values, xi=own, period=float(plain["period"]), **words)


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
