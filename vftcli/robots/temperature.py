"""What a joint's temperature makes of its friction: a cold gear rubs more than a warm one.

The law is that of Universal Robots' controllers, a sum of two exponentials that falls with the
temperature T of the joint in °C,

    s(T) = p₁ e^(p₂ T) + p₃ e^(p₄ T),

by joint size. Friction stated at a reference temperature T₀ is multiplied with s(T)/s(T₀). Logs
with target current and target torque follow it within 1 % on joints that carry nothing, at 28 to
38 °C; the numbers themselves were measured for friction at 44 to 45 °C.
"""

from collections.abc import Sequence

import numpy as np

from vftcli.robots.robot import JointFriction
from vftcli.signals.arrays import Array
from vftcli.signals.recording import Recording

#: Temperatures that a joint can have; a reading beyond them, as a constant zero, is none. [°C]
COLDEST, WARMEST = 1.0, 100.0


def warmth(law: Sequence[float], temperature: Array | float) -> Array:
    """s(T) = p₁ e^(p₂ T) + p₃ e^(p₄ T). Like `temperature` [1]

    Args:
        law: p₁, p₂, p₃, p₄; p₂ and p₄ in 1/K.
        temperature: Joint temperatures T. [°C]
    """
    p1, p2, p3, p4 = law
    T = np.asarray(temperature, dtype=np.float64)
    share: Array = p1 * np.exp(p2 * T) + p3 * np.exp(p4 * T)
    return share


def lawless(law: Sequence[float]) -> str:
    """Say why no joint's friction follows a law, or "" where one may."""
    if not law:
        return ""
    with np.errstate(over="ignore", invalid="ignore"):
        share = warmth(law, np.linspace(COLDEST, WARMEST, 100))
        least, most = float(np.min(share)), float(np.max(share))
    if np.isfinite(most) and least > 0.0 and most < 1e3 * least:
        return ""
    return (
        f"temperature makes friction {most:.3g} / {least:.3g} times between {COLDEST:g} and "
        f"{WARMEST:g} °C; p1 e^(p2 T) + p3 e^(p4 T) stays positive and within a factor of 1000"
    )


def friction_factor(friction: Sequence[JointFriction], temperature: Array) -> Array | None:
    """What each joint's friction is multiplied with, None where no joint has a law. (T, n) [1]

    Args:
        friction: One model a joint.
        temperature: Joint temperatures, NaN where they were not measured: there the factor is 1,
            friction as at its reference temperature. (T, n) [°C]
    """
    joints = [j for j, joint in enumerate(friction) if joint.temperature]
    if not joints:
        return None
    factor = np.ones(temperature.shape, order="F")
    for j in joints:
        law = friction[j].temperature
        share = warmth(law, temperature[:, j])
        share /= warmth(law, friction[j].reference_temperature)
        factor[:, j] = np.where(np.isnan(share), 1.0, share)
    return factor


def measured_temperature(recording: Recording) -> Array | None:
    """A log's joint temperatures, NaN where they are none; None where none are. (T, n) [°C]

    Controllers that do not measure them write zeros.
    """
    if recording.temperature is None:
        return None
    T = recording.temperature
    plausible = (T >= COLDEST) & (T <= WARMEST)
    if not plausible.any():
        return None
    return T if plausible.all() else np.where(plausible, T, np.nan)
