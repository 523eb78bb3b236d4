"""The variable-parameter law (47), the energy that falls along it, and the printed one that rises.

In the recovery phase an axis has K = αK_d e^{|v|/v₀}, M = M_d e^{−|v|/v₀}/α, B = 2ξ√(MK), so that
B = 2ξ√(M_d K_d) is constant. The traditional controller is the same law with α = 1, no dependence
on speed and B = B_d.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from vftcli.admittance.parameters import Admittance
from vftcli.signals.arrays import Array, check_shape, seal
from vftcli.signals.parsing import check_known

KINDS = ("traditional", "variable")


@dataclass(frozen=True, kw_only=True)
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
    return Controller(
        kind="traditional",
        alpha=np.ones(6),
        rate=np.zeros(6),
        damping=parameters.damping,
        parameters=parameters,
    )


def variable(parameters: Admittance) -> Controller:
    """The variable law (47) in the recovery phase."""
    return Controller(
        kind="variable",
        alpha=parameters.alpha,
        rate=1.0 / np.asarray(parameters.speed_scale),
        # B_dva = 2ξ√(M_dva K_dva) = 2ξ√(M_d K_d): the same at every speed and every α.
        damping=2.0 * parameters.damping_ratio * np.sqrt(parameters.mass * parameters.stiffness),
        parameters=parameters,
    )


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

    W = ½K_d x² + (M_d v₀²/α²) φ(|v|/v₀), with Ẇ = −B e^{−|v|/v₀} v²/α ≤ 0; for the traditional
    controller ½K_d x² + ½M_d v². For rotation the sum over three axes of equal K_d falls, since x
    is the rotation vector log(R R_dᵀ) and v the angular velocity.

    Args:
        controller: Whose recovery phase it is.
        x: Deviations. (…, 6) [m, rad]
        v: Velocities. (…, 6) [m/s, rad/s]
    """
    p = controller.parameters
    potential = 0.5 * p.stiffness * x**2
    # The traditional controller has no speed scale; its branch below does not use the quotient.
    moving = np.where(controller.rate > 0.0, controller.rate, 1.0)
    varied = kinetic_shape(np.abs(v) * moving) / moving**2
    kinetic = p.mass * np.where(controller.rate > 0.0, varied, 0.5 * v**2) / controller.alpha**2
    return np.asarray(potential + kinetic)


def printed_energy(controller: Controller, x: Array, v: Array) -> Array:
    """V = ½M_dva v² + ½K_dva x² of (52), axis by axis: its proof drops Ṁ and K̇. (…, 6) [J]"""
    p = controller.parameters
    swell = np.exp(np.abs(v) * controller.rate)
    kinetic = 0.5 * p.mass / (controller.alpha * swell) * v**2
    return np.asarray(kinetic + 0.5 * controller.alpha * p.stiffness * swell * x**2)
