"""Published error tables, to set beside one's own."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import polars as pl

from vftcli.observers.observer import Observer, Tuning
from vftcli.signals.arrays import Array
from vftcli.signals.errors import ParameterError


@dataclass(frozen=True, kw_only=True)
class Published:
    """An RMSE table from print.

    Attributes:
        title: What it is.
        source: Where it stands.
        rmse: Observer's name here → printed RMSE of each joint. [N·m]
        reasons: Why a computation need not give these numbers: each says so, or "" if it does not
            apply to what was run.
    """

    title: str
    source: str
    rmse: Mapping[str, tuple[float, ...]]
    reasons: tuple[Callable[["Comparison"], str], ...]


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """Printed numbers beside computed ones.

    Attributes:
        published: The printed table.
        recording: The log's name.
        ours: Observer → computed RMSE of each joint, NaN where it is not known. (n,) [N·m]
        floor: The reference's own error. (n,) [N·m]
        observers: The observers that ran, by name.
        tunings: What their gains mean at the log's sample time, by name.
    """

    published: Published
    recording: str
    ours: Mapping[str, Array]
    floor: Array
    observers: Mapping[str, Observer]
    tunings: Mapping[str, Tuning]

    @property
    def names(self) -> tuple[str, ...]:
        """Observers that are both printed and computed."""
        return tuple(name for name in self.published.rmse if name in self.ours)

    def printed(self, name: str) -> Array:
        """Printed RMSE of an observer. (n,) [N·m]"""
        return np.array(self.published.rmse[name])

    @property
    def remarks(self) -> tuple[str, ...]:
        """Where the two differ and why, one sentence each."""
        found = [winners(self), sizes(self), *(reason(self) for reason in self.published.reasons)]
        return tuple(text for text in found if text)


def winners(found: Comparison) -> str:
    """Who wins each joint in print and here."""
    if not found.names:
        return ""
    printed = np.array([found.printed(n) for n in found.names])
    ours = np.array([found.ours[n] for n in found.names])
    same: list[str] = []
    other: list[str] = []
    for j in range(printed.shape[1]):
        best = found.names[int(np.argmin(printed[:, j]))]
        here = found.names[int(np.nanargmin(np.where(np.isfinite(ours[:, j]), ours[:, j], np.inf)))]
        (same if best == here else other).append(f"J{j + 1} ({best} in print, {here} here)")
    agree = f"the best of a joint is the same on {len(same)} of {printed.shape[1]} joints"
    return f"{agree}; it differs on {', '.join(other)}" if other else agree


def sizes(found: Comparison) -> str:
    """How large the computed errors are against the printed ones."""
    if not found.names:
        return ""
    ratio = np.array([found.ours[n] / found.printed(n) for n in found.names])
    return (
        f"computed over printed RMSE: median {np.nanmedian(ratio):.2f}, from "
        f"{np.nanmin(ratio):.2f} to {np.nanmax(ratio):.2f}; an RMSE grows with the force of the "
        "contacts, which the paper does not print, so sizes compare between observers, not between "
        "experiments"
    )


def one_filter(found: Comparison) -> str:
    """FDO and GMO of equal gain are one filter."""
    if not {"fdo", "gmo"} <= set(found.names):
        return ""
    gap = np.abs(found.ours["fdo"] - found.ours["gmo"])
    alike = [j + 1 for j in np.flatnonzero(gap <= 1e-6 * np.maximum(found.ours["fdo"], 1e-9))]
    if not alike:
        return ""
    print_gap = np.abs(found.printed("fdo") - found.printed("gmo"))[[j - 1 for j in alike]]
    listed = ", ".join(f"J{j}" for j in alike)
    return (
        f"fdo and gmo agree here on {listed}: with equal gains the bilinear filters are identical, "
        f"so the printed differences there (up to {print_gap.max():.2f} N·m) are not the method's; "
        "the printed k₃, with 1 + 2a in its denominator, leaks momentum into the FDO"
    )


def kalman_delay(found: Comparison) -> str:
    """The noise convention sets the Kalman filters' bandwidth, and with it the ranking."""
    tuning = found.tunings.get("kfo-fe")
    if tuning is None or "kfo-fe" not in found.names:
        return ""
    convention = getattr(found.observers.get("kfo-fe"), "noise_convention", "density")
    delay = 1e3 * tuning.delay[0]
    text = f"kfo runs with noise_convention={convention}: a delay of {delay:.0f} ms on J1"
    if convention == "discrete":
        return text + "; under this reading the Kalman filters win J1–J3 as in print"
    return (
        f"{text}; print wins J1–J3 with it only if R is a discrete covariance "
        "(--set kfo.noise_convention=discrete: 39 ms)"
    )


def alike_at_floor(found: Comparison) -> str:
    """J6 is at the reference's noise in print."""
    printed = np.array([found.printed(n)[5] for n in found.published.rmse])
    return (
        f"J6 in print is {printed.min():.2f} to {printed.max():.2f} for all observers: the noise "
        "of an unfiltered two-cycle difference, √2·K·σ_i at σ_i = 0.071 A, is 0.93 N·m, which "
        f"hides what the observers do; the floor here is {found.floor[5]:.2f} N·m (--low-pass none "
        "for the unfiltered difference)"
    )


TABLE_1 = Published(
    title="Table I of the paper: RMSE of the observers on a UR5",
    source="Huang et al., IEEE/ASME T-Mech 2025, doi 10.1109/TMECH.2025.3595612, Table I",
    rmse={
        "fdo": (5.6601, 4.2443, 4.6620, 1.5379, 1.2137, 0.9443),
        "gmo": (5.2106, 3.8767, 5.1080, 1.2939, 1.1976, 0.9322),
        "kfo-fe": (4.7472, 3.6219, 4.0874, 1.3828, 1.3221, 0.9355),
        "kfo-zoh": (4.8555, 3.6475, 4.1538, 1.3345, 1.3164, 0.9440),
    },
    reasons=(one_filter, kalman_delay, alike_at_floor),
)

TABLES = {"table1": TABLE_1}
"""Name at the command line → printed table."""


def check_published(name: str, reference: str | None) -> None:
    """Raise unless there is such a table and a reference to make errors with.

    Raises:
        ParameterError: If either is missing.
    """
    if name not in TABLES:
        raise ParameterError(f"no published table {name!r}; there is {', '.join(TABLES)}")
    if reference is None:
        raise ParameterError(
            f"--published {name} sets errors beside the paper's; add --reference two-cycle"
        )


def compare_with(
    name: str,
    errors: pl.DataFrame,
    observers: Sequence[Observer],
    tunings: Mapping[str, Tuning],
) -> Comparison:
    """Set a printed table beside computed errors.

    Args:
        name: A key of `TABLES`.
        errors: The tidy error table of one log.
        observers: The observers that ran.
        tunings: What their gains mean, by name.

    Raises:
        ParameterError: If the table is of an arm with another number of joints.
    """
    published = TABLES[name]
    rows = errors.filter(pl.col("joint").is_not_null())
    joints = int(str(rows["joint"].max()))
    wanted = len(next(iter(published.rmse.values())))
    if joints != wanted:
        raise ParameterError(
            f"--published {name} is of an arm with {wanted} joints, the log has {joints}"
        )
    ours: dict[str, Array] = {}
    floor = np.full(joints, np.nan)
    for row in rows.iter_rows(named=True):
        values = ours.setdefault(str(row["observer"]), np.full(joints, np.nan))
        if row["rmse_Nm"] is not None:
            values[row["joint"] - 1] = row["rmse_Nm"]
        if row["reference_floor_Nm"] is not None:
            floor[row["joint"] - 1] = row["reference_floor_Nm"]
    return Comparison(
        published=published,
        recording=str(rows["recording"][0]),
        ours=ours,
        floor=floor,
        observers={observer.name: observer for observer in observers},
        tunings=tunings,
    )
