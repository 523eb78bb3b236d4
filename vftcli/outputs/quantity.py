"""Quantity: a number with its unit as text, for screen, tables and page."""

from collections.abc import Iterable

import numpy as np

DASH = "–"  #: Sign for an unknown number.


def significant(value: float, digits: int = 3) -> str:
    """A number with three significant digits, with an exponent only below 1e-4."""
    if not np.isfinite(value):
        return DASH
    if value == 0.0:
        return "0"
    # Rounded first: 9.996 is 10.0.
    exponent = int(np.floor(np.log10(abs(float(f"{value:.{digits - 1}e}")))))
    if exponent < -4:
        return f"{value:.{digits - 1}e}"
    return f"{value:.{max(digits - 1 - exponent, 0)}f}"


def minus(text: str) -> str:
    """A number's text with a true minus sign."""
    return text.replace("-", "−")


def signed(value: float) -> str:
    """Three significant digits with a true minus sign, for the page."""
    return minus(significant(value))


def banded(value: float | None, band: float | None, form: str = ".0f", unit: str = " N") -> str:
    """A value with the half width of its 95 % band."""
    return f"{minus(format(value, form))} ± {band:{form}}{unit}"


def at_least_shown(force: float) -> str:
    """The least force that shows, never rounded down to none. [N]"""
    return f"{force:.0f} N" if force >= 0.95 else f"{force:.1g} N"


def ranged(low: float, high: float, unit: str = " N") -> str:
    """The smallest and the largest of some forces. [N]"""
    return f"{low:.0f}–{high:.0f}{unit}"


def vector(values: Iterable[float]) -> str:
    """Numbers with one decimal, without a negative zero."""
    return ", ".join(minus(f"{x + 0.0:.1f}") for x in np.round(list(values), 1))


def percent(share: float) -> str:
    """A share in per cent, with one decimal, or one significant digit."""
    value = 100.0 * share
    if 0.0 < value < 0.001:
        return "<0.001 %"
    return f"{value:.1f} %" if value >= 0.095 else f"{value:.1g} %"
