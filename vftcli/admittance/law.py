"""The variable-parameter law (47): parameters (Tables III, IV), energy, stability.

In the recovery phase an axis has K = αK_d e^{|v|/v₀}, M = M_d e^{−|v|/v₀}/α, B = 2ξ√(MK),
so that B = 2ξ√(M_d K_d) is constant. The traditional controller has α = 1, no v in K and
M, and B = B_d. The printed energy (52) rises; W falls.

Semi-implicit Euler (49)–(51) is stable if 2TsB/M + Ts²K/M < 4. Without a speed limit the
law escapes: from far enough it becomes infinitely fast in finite time.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from vftcli.robots.robot_file import NUMBER
from vftcli.signals.arrays import Array, frozen, one_each
from vftcli.signals.errors import ParameterError
from vftcli.signals.option import assignment, set_value
from vftcli.signals.parsing import check_known
from vftcli.signals.remarks import Remark, Where, warning

#: Translation of the flange along the base axes, rotation about them.
AXES = ("x", "y", "z", "rx", "ry", "rz")
#: Section of an assignment or of a robot file → the axes it speaks of.
GROUPS: dict[str, tuple[int, ...]] = {
    "admittance": (0, 1, 2, 3, 4, 5),
    "position": (0, 1, 2),
    "rotation": (3, 4, 5),
    **{axis: (k,) for k, axis in enumerate(AXES)},
}
THRESHOLD_MODES = ("hard", "soft", "literal")
#: Parameters with one number an axis.
PER_AXIS = (
    "mass", "damping", "stiffness", "alpha", "threshold", "xi", "hysteresis", "speed_limit",
    "speed_scale",
)  # fmt: skip
#: Every number of every group of axes, as ``--set`` names it.
NUMBERS = tuple(f"{group}.{name}" for group in GROUPS for name in PER_AXIS)
MAY_BE_ZERO = ("damping", "threshold", "hysteresis")
MAY_BE_ENDLESS = ("threshold", "speed_limit")
#: Keys of ``[admittance]`` that are not one number an axis.
PLAIN = ("period", "threshold_mode", "source", "start", "confidence")
#: 2TsB/M + Ts²K/M below it: both roots of det(zI − A) in |z| = 1.
DISCRETE_BOUND = 4.0
UNITS = ("m", "m", "m", "rad", "rad", "rad")


@dataclass(frozen=True, kw_only=True)
class Admittance:
    """Parameters of the variable-parameter law (45)–(51) and of Algorithm 1.

    Units are kg, N·s/m, N/m, N, m/s, with N·m and rad for rotations. Arrays are (6,), as
    `AXES`; one number is that of all axes.
    """

    mass: Array  #: M_d.
    damping: Array  #: B_d.
    stiffness: Array  #: K_d.
    alpha: Array  #: α of (47).
    threshold: Array  #: F_tsd: above it an axis is dragged, below it recovers.
    #: ξ of (47), not in the paper; NaN: the drag phase's, B_d/(2√(M_d K_d)).
    xi: Array | float = np.nan
    #: A dragged axis recovers below 1 − this share of the threshold; the paper's is 0.
    hysteresis: Array | float = 0.0
    speed_limit: Array | float = np.inf  #: Ẋ_tsd; infinite for none.
    speed_scale: Array | float = 1.0  #: v₀ in e^{|v|/v₀}: 1 m/s and 1 rad/s.
    period: float  #: Control period. [s]
    threshold_mode: str = "hard"  #: Rule for the entering force, see `motion.phases`.
    source: str = ""  #: Where the numbers come from, in words.

    def __post_init__(self) -> None:
        for name in PER_AXIS:
            array = one_each(getattr(self, name), 6, f"admittance.{name}", "axes")
            if name == "xi":
                ratio = self.damping / (2.0 * np.sqrt(self.mass * self.stiffness))
                array = np.where(np.isnan(array), ratio, array)
            object.__setattr__(self, name, frozen(array))
            zero, endless = name in MAY_BE_ZERO, name in MAY_BE_ENDLESS
            fits = ((array > 0.0) | (zero & (array == 0.0))) & (np.isfinite(array) | endless)
            if not fits.all():
                k = fits.argmin()
                raise ParameterError(
                    f"admittance.{name} of axis {AXES[k]} is {array[k]:g}; it must be "
                    f"{'zero or ' * zero}positive"
                )
        if (most := np.max(self.hysteresis)) >= 1.0:
            raise ParameterError(
                "admittance.hysteresis is a share of the threshold and must be below 1; "
                f"it is {most:g}"
            )
        if not 0.0 < self.period < np.inf:
            raise ParameterError(
                f"admittance.period is {self.period:g} s; the control period must be positive"
            )
        check_known(
            self.threshold_mode, THRESHOLD_MODES, f"no threshold mode {self.threshold_mode!r}"
        )


def from_table(
    table: Mapping[str, Any], robot: str, settings: Mapping[str, Mapping[str, Any]]
) -> Admittance:
    """Parameters of a robot file's ``[admittance]``; the user's settings go first.

    Settings are section (a key of `GROUPS`) → parameter → value.

    Raises:
        ParameterError: If a parameter is missing for an axis, unknown or out of range.
    """
    groups = [(name, table.get(name, {})) for name in ("position", "rotation")]
    # Parameters start at their defaults, else at NaN.
    values: dict[str, Any] = {
        name: np.full(6, getattr(Admittance, name, np.nan)) for name in PER_AXIS
    }
    for section, entries in (*groups, *settings.items()):
        axes = list(GROUPS[section])
        for name, value in entries.items():
            if name not in PLAIN:
                check_known(name, PER_AXIS, f"the admittance has no parameter {name!r}")
                values[name][axes] = one_each(value, len(axes), f"{section}.{name}", "axes")
    where = "its [admittance]" if table else "an [admittance] section, which it lacks,"
    for name, found in values.items():
        absent = np.isnan(found)
        if name != "xi" and absent.any():
            listed = ", ".join(np.array(AXES)[absent])
            section = next(group for group, axes in GROUPS.items() if absent[list(axes)].all())
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
    return Admittance(**values, period=float(plain["period"]), **words)


def parse_settings(assignments: Sequence[str]) -> dict[str, dict[str, Any]]:
    """Settings by ``SECTION.PARAMETER=VALUE``, a key of `GROUPS` first."""
    settings: dict[str, dict[str, Any]] = {}
    for text in assignments:
        left, value = assignment(
            text, "--set", "SECTION.PARAMETER=VALUE, as position.stiffness=12"
        )
        section, _, name = (left if "." in left else f"admittance.{left}").rpartition(".")
        whole = ("period", "threshold_mode", "source") if section == "admittance" else ()
        if section not in GROUPS or name not in (*PER_AXIS, *whole):
            raise ParameterError(
                f"--set {text!r}: no such admittance parameter. Sections: {', '.join(GROUPS)}; "
                f"parameters: {', '.join((*PER_AXIS, 'period'))}"
            )
        endless = name == "speed_limit" and value.lower() == "none"
        is_word = name in {"threshold_mode", "source"}
        given = value if is_word else set_value("inf" if endless else value, text)
        settings.setdefault(section, {})[name] = given
    return settings


@dataclass(frozen=True)
class Controller:
    """One controller of a comparison: its recovery phase. Arrays are (6,)."""

    kind: str  #: "traditional" or "variable".
    alpha: Array  #: α; 1 for the traditional one.
    rate: Array  #: 1/v₀; 0 for the traditional one. [s/m, s/rad]
    damping: Array  #: Damping of the recovery phase. [N·s/m, N·m·s/rad]
    parameters: Admittance  #: Its parameters.

    @property
    def name(self) -> str:
        """``traditional``, ``α = 1.6``, or ``α = 6 / 3`` (position / rotation)."""
        if self.kind == "traditional":
            return "traditional"
        distinct = list(dict.fromkeys(f"{a:g}" for a in self.alpha))
        return f"α = {' / '.join(distinct)}"

    @property
    def xi(self) -> Array:
        """Damping ratio ξ of the recovery phase. (6,)"""
        p = self.parameters
        return self.damping / (2.0 * np.sqrt(p.mass * p.stiffness))

    @cached_property
    def drag(self) -> Array:
        """2TsB/M + Ts²K/M of the drag phase. (6,)"""
        p = self.parameters
        return discrete_number(p.mass, p.damping, p.stiffness, p.period)

    @cached_property
    def recovery(self) -> Array:
        """2TsB/M + Ts²K/M of the recovery at the speed limit, or ∞. (6,)"""
        p, limit = self.parameters, self.parameters.speed_limit
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            swell = self.alpha * np.exp(np.where(self.rate > 0, limit * self.rate, 0))
        return discrete_number(p.mass / swell, self.damping, p.stiffness * swell, p.period)

    @cached_property
    def escape(self) -> Array:
        """Largest deviation from which a release from rest returns, or ∞. (6,) [m, rad]"""
        p = self.parameters
        distinct, each = np.unique(self.xi, return_inverse=True)
        factor = np.array([escape_factor(xi) for xi in distinct.tolist()])[each]
        scale = np.sqrt(p.mass / p.stiffness) / self.alpha
        with np.errstate(divide="ignore"):
            return factor * scale / self.rate

    def complaints(self, size: Array | float = np.inf) -> Iterator[Remark]:
        """Instabilities of releases of a size (6,) [m, rad], or of all motion."""
        where, limited = Where(self.name), np.isfinite(self.parameters.speed_limit)
        # Without a speed limit it is infinite; the escape says why.
        at_limit = np.where(limited, self.recovery, 0.0)
        numbers = {"law-unstable-in-drag": self.drag, "law-unstable-at-limit": at_limit}
        for code, number in numbers.items():
            for k in np.flatnonzero(number >= DISCRETE_BOUND):
                yield warning(code, where, axis=AXES[k], number=number[k])
        risky = ~limited & np.isfinite(self.escape) & (size > self.escape)
        for k in np.flatnonzero(risky):
            bound = self.escape[k]
            yield warning("law-escapes", where, axis=AXES[k], bound=bound, unit=UNITS[k])


def traditional(parameters: Admittance) -> Controller:
    """Constant parameters (45) in both phases."""
    one, damping = np.ones(6), parameters.damping
    return Controller("traditional", one, 0.0 * one, damping, parameters)


def variable(parameters: Admittance, alpha: float | None = None) -> Controller:
    """The variable law (47) in the recovery phase, with another α if given."""
    # B_dva = 2ξ√(M_dva K_dva) = 2ξ√(M_d K_d): the same at every speed and every α.
    damping = 2.0 * parameters.xi * np.sqrt(parameters.mass * parameters.stiffness)
    rate = 1.0 / np.asarray(parameters.speed_scale)
    given = parameters if alpha is None else replace(parameters, alpha=np.full(6, alpha))
    return Controller("variable", given.alpha, rate, damping, parameters)


def controllers(
    parameters: Admittance, kind: str | None = None, alphas: Sequence[float] = ()
) -> tuple[Controller, ...]:
    """Controllers, the traditional one first; of one kind if given."""
    every = [variable(parameters, alpha) for alpha in dict.fromkeys(alphas) or (None,)]
    return tuple(c for c in (traditional(parameters), *every) if kind in {None, c.kind})


def energy(controller: Controller, x: Array, v: Array) -> Array:
    """The Lyapunov function of each axis in a recovery phase. (…, 6) [J]

    Of deviations x (…, 6) [m, rad] and velocities v (…, 6) [m/s, rad/s] it is W = ½K_d
    x² + (M_d v₀²/α²) φ(|v|/v₀), with Ẇ = −B e^{−|v|/v₀} v²/α ≤ 0; for the traditional
    controller ½K_d x² + ½M_d v². For rotation the sum over three axes of equal K_d falls,
    since x is the rotation vector log(R R_dᵀ) and v the angular velocity.
    """
    p, varies = controller.parameters, controller.rate > 0.0
    # The traditional controller does not use this quotient.
    rate = np.where(varies, controller.rate, 1.0)
    u = abs(v) * rate
    # φ(u) = ¼[1 − (1 + 2u)e^{−2u}], which is ½u² for small u and never exceeds ¼.
    phi = 0.25 * (1.0 - (1.0 + 2.0 * u) * np.exp(-2.0 * u))
    phi = np.where(u < 1e-3, u**2 * (0.5 - u * (2.0 / 3.0 - 0.5 * u)), phi)
    shape = np.where(varies, phi / rate**2, 0.5 * v**2)
    return 0.5 * p.stiffness * x**2 + p.mass * shape / controller.alpha**2


def printed_energy(controller: Controller, x: Array, v: Array) -> Array:
    """V = ½M_dva v² + ½K_dva x² of (52), per axis; its proof drops Ṁ, K̇. (…, 6) [J]"""
    p = controller.parameters
    swell = np.exp(abs(v) * controller.rate)
    kinetic = 0.5 * p.mass / (controller.alpha * swell) * v**2
    return kinetic + 0.5 * controller.alpha * p.stiffness * swell * x**2


class UnstableError(ParameterError):
    """The law would not be stable with these parameters."""


def discrete_number(mass: Array, damping: Array, stiffness: Array, period: float) -> Array:
    """2TsB/M + Ts²K/M, below 4 where semi-implicit Euler is stable. [1]"""
    return (2.0 * period * damping + period**2 * stiffness) / mass


def escape_factor(xi: float) -> float:
    """Y*(ξ): the release Y*·v₀√(M_d/K_d)/α from rest is the last that does not escape.

    In y = xα√(K_d/M_d)/v₀ and u = |v|/v₀ the law without force is
    du/ds = e^u(e^u y − 2ξu), dy/ds = −u. With z = e^u y its paths obey
    dz/du = z − u/(z − 2ξu); the one between those that turn back and those that escape
    comes from infinity along z(z − 2ξu) = u. Followed back to u = 0, where it attracts
    its neighbours, it ends at z = y = Y*. Y*(0) = 1/√2, the bound that holds for every ξ.
    """
    far = 12.0 * min(1.0, 5.0 / max(xi, 1e-12))
    steps = int(max(2000.0, 8.0 * (xi * far) ** 2))  # it attracts at up to 4ξ²u
    h = -far / steps
    z = xi * far + np.sqrt((xi * far) ** 2 + far)

    def slope(u: float, z: float) -> float:
        return z - u / max(z - 2.0 * xi * u, 1e-300)

    for k in range(steps):
        u = far + k * h
        k1 = slope(u, z)
        k2 = slope(u + h / 2, z + h / 2 * k1)
        k3 = slope(u + h / 2, z + h / 2 * k2)
        k4 = slope(u + h, z + h * k3)
        z += h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return float(z)


def check_stable(
    controllers: Sequence[Controller], *, anyway: bool = False, release: Array | None = None
) -> tuple[Remark, ...]:
    """Remarks on controllers before they run; unstable ones are refused.

    A `release` (6,) [m, rad] inside the escape bound needs no speed limit.
    """
    size = np.inf if release is None else abs(release)
    grave = [remark for controller in controllers for remark in controller.complaints(size)]
    if grave and not anyway:
        more = f" (and {len(grave) - 1} more)" if len(grave) > 1 else ""
        raise UnstableError(
            f"unstable: {grave[0]}{more}. Change the parameters, or study it with --anyway."
        )
    return tuple(remark for controller in controllers for remark in controller.complaints())
