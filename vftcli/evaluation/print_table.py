"""Published error tables, to set beside one's own."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import polars as pl

from vftcli.observers.observer import Observer, Tuning
from vftcli.signals.arrays import Array
from vftcli.signals.errors import ParameterError
from vftcli.signals.remarks import Remark, Where, fact

#: Errors that differ by less than this share are one filter's, computed in two ways.
SAME_FILTER = 1e-6


@dataclass(frozen=True, kw_only=True)
class Published:
    """An RMSE table from print."""

    title: str  #: What it is.
    source: str  #: Where it stands.
    #: Observer's name here → printed RMSE of each joint. [N·m]
    rmse: Mapping[str, tuple[float, ...]]
    #: Why a computation need not give these numbers: each gives a remark, or None if it does not
    #: apply to what was run.
    reasons: tuple[Callable[["Comparison"], Remark | None], ...]


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """Printed numbers beside computed ones."""

    published: Published  #: The printed table.
    recording: str  #: The log's name.
    #: Observer → computed RMSE of each joint, NaN where it is not known. (n,) [N·m]
    ours: Mapping[str, Array]
    floor: Array  #: The reference's own error. (n,) [N·m]
    observers: Mapping[str, Observer]  #: The observers that ran, by name.
    tunings: Mapping[str, Tuning]  #: What their gains mean at the log's sample time, by name.

    @property
    def names(self) -> tuple[str, ...]:
        """Observers that are both printed and computed."""
        return tuple(name for name in self.published.rmse if name in self.ours)

    def printed(self, name: str) -> Array:
        """Printed RMSE of an observer. (n,) [N·m]"""
        return np.array(self.published.rmse[name])

    @property
    def remarks(self) -> tuple[Remark, ...]:
        """Where the two differ and why."""
        found = [best_of_each(self), sizes(self), *(why(self) for why in self.published.reasons)]
        return tuple(remark for remark in found if remark is not None)


def best_of_each(found: Comparison) -> Remark | None:
    """On which joints another observer is best than in print."""
    if not found.names:
        return None
    printed = np.array([found.printed(n) for n in found.names])
    ours = np.array([found.ours[n] for n in found.names])
    other: list[str] = []
    for j in range(printed.shape[1]):
        best = found.names[int(np.argmin(printed[:, j]))]
        # A joint on which no observer is known has no best of its own: the first stands for it.
        here = found.names[int(np.argmin(np.where(np.isfinite(ours[:, j]), ours[:, j], np.inf)))]
        if best != here:
            other.append(f"J{j + 1} ({best} in print, {here} here)")
    joints = printed.shape[1]
    if not other:
        return fact("print-same-best", joints=joints)
    return fact("print-other-best", same=joints - len(other), joints=joints, differing=other)


def sizes(found: Comparison) -> Remark | None:
    """How large the computed errors are against the printed ones."""
    if not found.names:
        return None
    ratio = np.array([found.ours[n] / found.printed(n) for n in found.names])
    return fact(
        "print-sizes",
        median=float(np.nanmedian(ratio)),
        least=float(np.nanmin(ratio)),
        most=float(np.nanmax(ratio)),
    )


def one_filter(found: Comparison) -> Remark | None:
    """FDO and GMO of equal gain are one filter, so they agree where their gains do."""
    if not {"fdo", "gmo"} <= set(found.names):
        return None
    gap = np.abs(found.ours["fdo"] - found.ours["gmo"])
    alike = np.flatnonzero(gap <= SAME_FILTER * found.ours["fdo"])
    if not len(alike):
        return None
    printed = np.abs(found.printed("fdo") - found.printed("gmo"))[alike]
    joints = tuple(int(j) + 1 for j in alike)
    return fact("print-one-filter", Where(joints=joints), printed_Nm=float(printed.max()))


def kalman_delay(found: Comparison) -> Remark | None:
    """The noise convention sets the Kalman filters' bandwidth, and with it the ranking."""
    tuning = found.tunings.get("kfo-fe")
    if tuning is None or "kfo-fe" not in found.names:
        return None
    convention = getattr(found.observers.get("kfo-fe"), "noise_convention", "density")
    code = "print-kalman-discrete" if convention == "discrete" else "print-kalman-density"
    return fact(code, convention=convention, delay_ms=1e3 * float(tuning.delay[0]))


def alike_at_floor(found: Comparison) -> Remark:
    """J6 is at the reference's noise in print."""
    printed = np.array([found.printed(n)[5] for n in found.published.rmse])
    return fact(
        "print-noise-floor",
        least_Nm=float(printed.min()),
        most_Nm=float(printed.max()),
        floor_Nm=float(found.floor[5]),
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

TABLES = {"table1": TABLE_1}  #: Name at the command line → printed table.


def check_published(name: str, reference: str | None) -> None:
    """Raise unless there is such a table and a reference to make errors with."""
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
    """Set a printed table beside computed errors."""
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
