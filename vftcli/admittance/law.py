"""The variable-parameter law (47), its energy, the printed one, which rises, and its stability.

In the recovery phase an axis has K = αK_d e^{|v|/v₀}, M = M_d e^{−|v|/v₀}/α, B = 2ξ√(MK), so that
B = 2ξ√(M_d K_d) is constant. The traditional controller has α = 1, no v in K and M, and B = B_d.

Semi-implicit Euler (49)–(51) is stable if 2TsB/M + Ts²K/M < 4, and M falls and K rises with speed.
Without a speed limit the law escapes: from far enough it becomes infinitely fast in finite time.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from vftcli.admittance.parameters import AXES, Admittance
from vftcli.signals.arrays import Array, check_shape, seal
from vftcli.signals.errors import ParameterError
from vftcli.signals.parsing import check_known
from vftcli.signals.remarks import Remark, Where, warning

KINDS = ("traditional", "variable")
#: Where 2TsB/M + Ts²K/M has to stay below: det(zI − A) = 0 then has both roots inside |z| = 1.
DISCRETE_BOUND = 4.0

UNITS = ("m", "m", "m", "rad", "rad", "rad")


@dataclass(frozen=True)
class Controller:
    """One controller of a comparison: what its recovery phase is made of. Arrays are (6,)."""

    kind: str  #: "traditional" or "variable".
    alpha: Array  #: α; 1 for the traditional one.
    rate: Array  #: 1/v₀; 0 for the traditional one. [s/m, s/rad]
    damping: Array  #: Damping of the recovery phase. [N·s/m, N·m·s/rad]
    parameters: Admittance  #: What it was built from.

    def __post_init__(self) -> None:
        seal(self, "alpha", "rate", "damping")
        for name in ("alpha", "rate", "damping"):
            check_shape(getattr(self, name), (6,), name, "the controller")

    @property
    def name(self) -> str:
        """A label: ``traditional``, ``α = 1.6``, or ``α = 6 / 3`` for position and rotation."""
        if self.kind == "traditional":
            return "traditional"
        distinct = list(dict.fromkeys(f"{a:g}" for a in self.alpha))
        return f"α = {' / '.join(distinct)}"

    @property
    def xi(self) -> Array:
        """Damping ratio ξ of the recovery phase. (6,)"""
        p = self.parameters
        return np.asarray(self.damping / (2.0 * np.sqrt(p.mass * p.stiffness)))


def traditional(parameters: Admittance) -> Controller:
    """Constant parameters (45) in both phases."""
    one, damping = np.ones(6), parameters.damping
    return Controller("traditional", one, 0.0 * one, damping, parameters)


def variable(parameters: Admittance) -> Controller:
    """The variable law (47) in the recovery phase."""
    # B_dva = 2ξ√(M_dva K_dva) = 2ξ√(M_d K_d): the same at every speed and every α.
    damping = 2.0 * parameters.damping_ratio * np.sqrt(parameters.mass * parameters.stiffness)
    rate = 1.0 / np.asarray(parameters.speed_scale)
    return Controller("variable", parameters.alpha, rate, damping, parameters)


def controllers(
    parameters: Admittance, kinds: Sequence[str] = (), alphas: Sequence[float] = ()
) -> tuple[Controller, ...]:
    """The controllers of a comparison, the traditional one first."""
    check_kinds(kinds)
    wanted = kinds or KINDS
    found = [traditional(parameters)] if "traditional" in wanted else []
    if "variable" in wanted:
        each = [replace(parameters, alpha=np.full(6, a)) for a in dict.fromkeys(alphas)]
        found += map(variable, each or [parameters])
    return tuple(found)


def check_kinds(kinds: Sequence[str]) -> None:
    """Raise a ParameterError that lists the kinds if one is not in `KINDS`."""
    for kind in kinds:
        check_known(kind, KINDS, f"no controller {kind!r}")


def kinetic_shape(u: Array) -> Array:
    """φ(u) = ¼[1 − (1 + 2u)e^{−2u}], which is ½u² for small u and never exceeds ¼."""
    small = u < 1e-3
    shape = 0.25 * (1.0 - (1.0 + 2.0 * u) * np.exp(-2.0 * u))
    return np.where(small, u**2 * (0.5 - u * (2.0 / 3.0 - 0.5 * u)), shape)


def energy(controller: Controller, x: Array, v: Array) -> Array:
    """The Lyapunov function of each axis in a recovery phase. (…, 6) [J]

    Of deviations x (…, 6) [m, rad] and velocities v (…, 6) [m/s, rad/s] it is
    W = ½K_d x² + (M_d v₀²/α²) φ(|v|/v₀), with Ẇ = −B e^{−|v|/v₀} v²/α ≤ 0; for the traditional
    controller ½K_d x² + ½M_d v². For rotation the sum over three axes of equal K_d falls, since x
    is the rotation vector log(R R_dᵀ) and v the angular velocity.
    """
    p, varies = controller.parameters, controller.rate > 0.0
    # The traditional controller has no speed scale; its branch below does not use the quotient.
    rate = np.where(varies, controller.rate, 1.0)
    shape = np.where(varies, kinetic_shape(np.abs(v) * rate) / rate**2, 0.5 * v**2)
    return np.asarray(0.5 * p.stiffness * x**2 + p.mass * shape / controller.alpha**2)


def printed_energy(controller: Controller, x: Array, v: Array) -> Array:
    """V = ½M_dva v² + ½K_dva x² of (52), axis by axis: its proof drops Ṁ and K̇. (…, 6) [J]"""
    p = controller.parameters
    swell = np.exp(np.abs(v) * controller.rate)
    kinetic = 0.5 * p.mass / (controller.alpha * swell) * v**2
    return np.asarray(kinetic + 0.5 * controller.alpha * p.stiffness * swell * x**2)


class UnstableError(ParameterError):
    """The law would not be stable with these parameters."""


class Verdict(NamedTuple):
    """Stability of one controller. Arrays are (6,)."""

    controller: Controller  #: The controller.
    drag: Array  #: 2TsB/M + Ts²K/M of the drag phase.
    recovery: Array  #: The same in the recovery phase at the speed limit; infinite without one.
    #: Largest deviation from which a release at rest does not escape if there is no speed limit;
    #: infinite for the traditional controller. [m, rad]
    escape: Array

    def complaints(self, size: Array | float = np.inf) -> tuple[Remark, ...]:
        """Its instabilities, in releases from rest of a size (6,) [m, rad] or in all motion."""
        where, found = Where(self.controller.name), list[Remark]()
        limited = np.isfinite(self.controller.parameters.speed_limit)
        # Without a speed limit the number is infinite, and the escape says what that means.
        at_limit = np.where(limited, self.recovery, 0.0)
        numbers = {"law-unstable-in-drag": self.drag, "law-unstable-at-limit": at_limit}
        for code, number in numbers.items():
            for k in np.flatnonzero(number >= DISCRETE_BOUND):
                found.append(warning(code, where, axis=AXES[k], number=float(number[k])))
        risky = ~limited & np.isfinite(self.escape) & (size > self.escape)
        for k in np.flatnonzero(risky):
            bound, unit = float(self.escape[k]), UNITS[k]
            found.append(warning("law-escapes", where, axis=AXES[k], bound=bound, unit=unit))
        return tuple(found)


def discrete_number(mass: Array, damping: Array, stiffness: Array, period: float) -> Array:
    """2TsB/M + Ts²K/M, below 4 where semi-implicit Euler is stable. [1]"""
    return np.asarray((2.0 * period * damping + period**2 * stiffness) / mass)


def escape_factor(xi: float) -> float:
    """Y*(ξ): the release Y*·v₀√(M_d/K_d)/α from rest is the last that does not escape.

    In y = xα√(K_d/M_d)/v₀ and u = |v|/v₀ the law without force is du/ds = e^u(e^u y − 2ξu),
    dy/ds = −u. With z = e^u y its paths obey dz/du = z − u/(z − 2ξu); the one between those that
    turn back and those that escape comes from infinity along z(z − 2ξu) = u. Followed back to u =
    0, where it attracts its neighbours, it ends at z = y = Y*. Y*(0) = 1/√2, the bound that holds
    for every ξ.
    """
    far = 12.0 * min(1.0, 5.0 / max(xi, 1e-12))
    steps = int(max(2000.0, 8.0 * (xi * far) ** 2))  # the path attracts at up to 4ξ²u
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


def judge(controller: Controller) -> Verdict:
    """Everything that can be said of a controller before it runs."""
    p = controller.parameters
    distinct, each = np.unique(controller.xi, return_inverse=True)
    factor = np.array([escape_factor(xi) for xi in distinct.tolist()])[each]
    scale = np.sqrt(p.mass / p.stiffness) / controller.alpha
    limit, rate = np.asarray(p.speed_limit), controller.rate
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        escape = factor * scale / rate
        swell = controller.alpha * np.exp(np.where(rate > 0, limit * rate, 0))
    drag = discrete_number(p.mass, p.damping, p.stiffness, p.period)
    recovery = discrete_number(p.mass / swell, controller.damping, p.stiffness * swell, p.period)
    return Verdict(controller, drag, recovery, escape)


def check_stable(
    controllers: Sequence[Controller], *, anyway: bool = False, release: Array | None = None
) -> tuple[tuple[Verdict, ...], tuple[Remark, ...]]:
    """Verdicts on controllers before they run and all that is wrong; what is unstable is refused.

    An axis that starts a release (6,) [m, rad] inside the escape bound needs no speed limit.
    """
    verdicts = tuple(map(judge, controllers))
    # Under a hand any deviation can come about; only a release has a size.
    size = np.inf if release is None else np.abs(release)
    grave = [remark for verdict in verdicts for remark in verdict.complaints(size)]
    if grave and not anyway:
        more = f" (and {len(grave) - 1} more)" if len(grave) > 1 else ""
        raise UnstableError(
            f"unstable: {grave[0]}{more}. Change the parameters, or study it with --anyway."
        )
    return verdicts, tuple(remark for verdict in verdicts for remark in verdict.complaints())
