"""Stability before motion: what can be said of a law's parameters without running it.

Two things can go wrong. Semi-implicit Euler (49)–(51) is stable for mass M, damping B and
stiffness K only if 2TsB/M + Ts²K/M < 4, and the variable law's M shrinks and its K grows with
speed. And without a speed limit the law itself escapes: K grows with e^{|v|}, M shrinks, and from a
deviation large enough the speed becomes infinite in finite time, at any control period.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from vftcli.admittance.law import Controller
from vftcli.admittance.parameters import AXES
from vftcli.signals.arrays import Array
from vftcli.signals.errors import ParameterError
from vftcli.signals.remarks import Remark, Where, warning

#: Where 2TsB/M + Ts²K/M has to stay below: det(zI − A) = 0 then has both roots inside |z| = 1.
DISCRETE_BOUND = 4.0

UNITS = ("m", "m", "m", "rad", "rad", "rad")


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
        """What makes it unstable, with the number that breaks.

        Args:
            size: Deviations of a release from rest; an axis without a speed limit that starts
                inside the escape bound is left out. (6,) [m, rad]
        """
        where = Where(self.controller.name)
        limited = np.isfinite(self.controller.parameters.speed_limit)
        # Without a speed limit the number is infinite, and the escape says what that means.
        at_limit = (self.recovery >= DISCRETE_BOUND) & limited
        found = [
            warning(code, where, axis=AXES[k], number=float(number[k]))
            for code, wrong, number in (
                ("law-unstable-in-drag", self.drag >= DISCRETE_BOUND, self.drag),
                ("law-unstable-at-limit", at_limit, self.recovery),
            )
            for k in np.flatnonzero(wrong)
        ]
        risky = ~limited & np.isfinite(self.escape) & (size > self.escape)
        found += [
            warning("law-escapes", where, axis=AXES[k], bound=float(self.escape[k]), unit=UNITS[k])
            for k in np.flatnonzero(risky)
        ]
        return tuple(found)


def discrete_number(mass: Array, damping: Array, stiffness: Array, period: float) -> Array:
    """2TsB/M + Ts²K/M, below 4 where semi-implicit Euler is stable.

    Args:
        mass: M. [kg, kg·m²]
        damping: B. [N·s/m, N·m·s/rad]
        stiffness: K. [N/m, N·m/rad]
        period: Ts. [s]
    """
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
    factors = {xi: escape_factor(xi) for xi in set(controller.xi.tolist())}
    factor = np.array([factors[xi] for xi in controller.xi.tolist()])
    scale = np.sqrt(p.mass / p.stiffness) / controller.alpha
    limit, rate = np.asarray(p.speed_limit), controller.rate
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        escape = factor * scale / rate
        swell = controller.alpha * np.exp(np.where(rate > 0, limit * rate, 0))
    drag = discrete_number(p.mass, p.damping, p.stiffness, p.period)
    recovery = discrete_number(p.mass / swell, controller.damping, p.stiffness * swell, p.period)
    return Verdict(controller, drag, recovery, escape)


def check_stable(
    controllers: Sequence[Controller], *, force_unstable: bool = False, release: Array | None = None
) -> tuple[tuple[Verdict, ...], tuple[Remark, ...]]:
    """Judge controllers before they run, and refuse what would be unstable.

    Args:
        controllers: The controllers.
        force_unstable: Run them all the same, for study.
        release: The deviation of a release from rest, if that is all they are run for: an axis
            without a speed limit is let pass where it starts inside the escape bound.
            (6,) [m, rad]

    Returns:
        A verdict for each, and what is wrong with them, also where that is let pass.
    """
    verdicts = tuple(map(judge, controllers))
    # Under a hand any deviation can come about; only a release has a size.
    size = np.inf if release is None else np.abs(release)
    grave = [remark for verdict in verdicts for remark in verdict.complaints(size)]
    if grave and not force_unstable:
        more = f" (and {len(grave) - 1} more)" if len(grave) > 1 else ""
        raise UnstableError(
            f"unstable: {grave[0]}{more}. Change the parameters, or study it with --force-unstable."
        )
    return verdicts, tuple(remark for verdict in verdicts for remark in verdict.complaints())
