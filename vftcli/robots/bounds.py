"""Bounds no robot arm leaves: a number beyond them is a slip of the pen or of the unit.

They are wide on purpose, an order of magnitude or more beyond the largest arm built (2.3 t payload,
12 t of its own, 4.7 m reach) and beyond any motion an arm can make: a file inside them may still be
wrong, one outside them cannot be right. A torque computed from numbers inside them is finite.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple


class Bound(NamedTuple):
    """The range of a number of a robot file, its ends included."""

    low: float  #: Smallest value.
    high: float  #: Largest value.
    unit: str  #: What both are in, "" for a pure number.

    def broken(self, key: str, values: Sequence[float]) -> str:
        """Say which of the values of a key lies outside, or "" if none does."""
        for value in values:
            if not self.low <= value <= self.high:
                unit = f" {self.unit}" if self.unit else ""
                return (
                    f"{key} is {value:g}{unit}; on a robot it lies within "
                    f"{self.low:g} to {self.high:g}{unit}"
                )
        return ""


def either_way(size: float, unit: str) -> Bound:
    """The bound of a number that may have either sign."""
    return Bound(-size, size, unit)


LENGTH = either_way(100.0, "m")
ANGLE = either_way(4.0 * math.pi, "rad")  # two turns; degrees written for radians are beyond them
TRAVEL = either_way(1e4, "rad")  # a joint may turn on and on, as a winch does
TORQUE = either_way(1e6, "N·m")
TENSOR = either_way(1e6, "kg·m²")  # the heaviest body at a tenth of the longest lever
#: Smallest value of what is divided by: no drive constant, velocity or rate is smaller.
TINY = 1e-9
#: Key of a robot file → its bound; in a list every number is held to it.
BOUNDS: dict[str, Bound] = {
    "a": LENGTH,
    "d": LENGTH,
    "alpha": ANGLE,
    "theta": ANGLE,
    "xyz": LENGTH,
    "rpy": ANGLE,
    "flange_d": LENGTH,
    "ee_xyz": LENGTH,
    "ee_rpy": ANGLE,
    "com": LENGTH,
    "mass": Bound(0.0, 1e4, "kg"),
    "inertia": TENSOR,
    "rotor_inertia": Bound(0.0, 1e4, "kg·m²"),  # a 1 kg·m² rotor behind a gear of 100
    "torque_constant": Bound(TINY, 1e5, "N·m/A"),  # 100 N·m/A behind a gear of 1000
    "gravity": either_way(100.0, "m/s²"),  # four times Jupiter's
    "sample_rate_hz": Bound(TINY, 1e6, "Hz"),
    "q_min": TRAVEL,
    "q_max": TRAVEL,
    "qd_max": Bound(TINY, 1e4, "rad/s"),
    "qdd_max": Bound(TINY, 1e6, "rad/s²"),
    "tau_max": Bound(TINY, 1e6, "N·m"),
    "noise_current": Bound(0.0, 1e4, "A"),
    "noise_tau": Bound(0.0, 1e4, "N·m"),
    "noise_q": Bound(0.0, 10.0, "rad"),
    "noise_qd": Bound(0.0, 1e3, "rad/s"),
    "coulomb": TORQUE,
    "viscous": either_way(1e6, "N·m·s/rad"),
    "quadratic": either_way(1e6, "N·m·s²/rad²"),
    "offset": TORQUE,
    "amplitude": TORQUE,
    "stribeck": TORQUE,
    "logarithmic": TORQUE,
    "load_coulomb": either_way(10.0, ""),  # a share of the torque that the gear carries
    "smoothing": Bound(TINY, 1e3, "rad/s"),
    "stribeck_velocity": Bound(TINY, 1e3, "rad/s"),
    "logarithmic_velocity": Bound(TINY, 1e3, "rad/s"),
    "presliding": Bound(0.0, 1e6, "N·m"),
    "presliding_length": Bound(1e-7, 0.1, "rad"),  # a gear yields .1 to 10 mrad before it slides
    "speeds": Bound(TINY, 1e3, "rad/s"),
    "torques": TORQUE,
    "temperature": either_way(1e3, ""),
    "temperature_at": Bound(1.0, 100.0, "°C"),
    "slope": either_way(1e6, "s/rad"),
    "shift": either_way(1e3, "rad/s"),
}
UNNAMED = either_way(1e6, "")  #: The bound of a number whose key is not listed.
#: Least mass of all moving bodies together: the lightest arms have servos of a few grams. [kg]
LIGHTEST = 0.05


def out_of_bounds(key: str, values: Sequence[float]) -> str:
    """Say which number of a robot file no robot has, or "" if all may be."""
    return BOUNDS.get(key, UNNAMED).broken(key, values)


def weightless(mass: float) -> str:
    """Say why an arm whose moving bodies weigh `mass` [kg] together is none, or ""."""
    if mass >= LIGHTEST:
        return ""
    return (
        f"all moving bodies together weigh {mass:g} kg, less than {LIGHTEST:g} kg; a model "
        "without mass explains no torque: give the links their mass"
    )
