"""Which convention a vendor's wrench is in: sign, axes, lag and gain fitted against ours."""

from dataclasses import dataclass
from itertools import permutations

import numpy as np

from vftcli.robots.chain import Chain, link_poses
from vftcli.signals.arrays import Array, seal
from vftcli.signals.lag import Offset, time_offset
from vftcli.signals.recording import Recording
from vftcli.signals.remarks import Remark, caution, fact
from vftcli.signals.series import bridge_unknown, resample_columns
from vftcli.signals.wrench import Wrench, WrenchFrame

#: A correlation that no independent measurement reaches: the field is made from the torques.
DERIVED = 0.9995
RESEMBLES = 0.5  #: Below this correlation no convention explains the field.


@dataclass(frozen=True, kw_only=True)
class AxesFit:
    """How one force reads in terms of another: theirs ≈ gain · matrix · ours."""

    matrix: Array  #: The signed permutation of axes that fits best. (3, 3)
    gain: float  #: Factor on top of it.
    correlation: float  #: Correlation of theirs with it, all axes together.

    def __post_init__(self) -> None:
        seal(self, "matrix")

    @property
    def derived(self) -> bool:
        """Whether theirs is no measurement of its own but computed from the same torques."""
        return self.correlation >= DERIVED

    @property
    def words(self) -> str:
        """Where each of their axes lies in ours, as "+x +z −y"."""
        places = np.argmax(np.abs(self.matrix), axis=1)
        signs = np.where(self.matrix.sum(axis=1) > 0, "+", "−")
        return " ".join(f"{sign}{'xyz'[k]}" for sign, k in zip(signs, places, strict=True))


def fit_axes(ours: Array, theirs: Array) -> AxesFit:
    """Find the order and signs of axes that take our force to theirs. Offsets do not matter.

    The best orthogonal matrix (improper ones allowed, as loggers swap axes freely) is rounded to
    the signed permutation with the largest sum of matching entries.

    Args:
        ours: Force on the robot. (T, 3) [N]
        theirs: The field, in its own axes. (T, 3) [N]
    """
    known = np.all(np.isfinite(ours) & np.isfinite(theirs), axis=1)
    x, y = ours[known] - ours[known].mean(axis=0), theirs[known] - theirs[known].mean(axis=0)
    U, _, Vt = np.linalg.svd(y.T @ x)
    matrix = permutation(U @ Vt)
    z = x @ matrix.T
    power = float(np.sum(z**2))
    gain = float(np.sum(z * y)) / power if power > 0 else float("nan")
    scale = float(np.sqrt(power * np.sum(y**2)))
    correlation = float(np.sum(z * y)) / scale if scale > 0 else float("nan")
    return AxesFit(matrix=matrix, gain=gain, correlation=correlation)


def permutation(Q: Array) -> Array:
    """The signed permutation nearest to an orthogonal matrix. (3, 3)"""
    size = np.abs(Q)
    best = max(permutations(range(3)), key=lambda order: float(np.sum(size[np.arange(3), order])))
    P = np.zeros((3, 3))
    P[np.arange(3), best] = np.sign(Q[np.arange(3), best])
    return P


@dataclass(frozen=True, kw_only=True)
class VendorCheck:
    """What a vendor's wrench field turns out to be."""

    stated_frame: WrenchFrame | None  #: What the log states of it, or None.
    frame: str  #: "base" or "flange": the axes that fit best.
    axes: AxesFit | None  #: Order, sign and gain of its axes in that frame.
    offset: Offset  #: Its lag behind ours, negative where it is earlier.
    zeros: float  #: Share of the samples in which it is exactly zero on all axes.
    at_zeros: float  #: What our force reads there, rms of its norm. [N]

    @property
    def remarks(self) -> tuple[Remark, ...]:
        """The findings."""
        found = []
        if self.zeros == 1.0:
            found.append(caution("log-wrench-all-zero", force_N=self.at_zeros))
        elif self.zeros > 0:
            found.append(caution("log-wrench-zero", share=self.zeros, force_N=self.at_zeros))
        if self.axes is None or not self.axes.correlation > RESEMBLES:
            return (*found, *([caution("log-wrench-unlike")] if self.zeros < 1.0 else []))
        # The trace of a signed permutation is 3 for our own axes and −3 for the opposite ones.
        turn = {3: "log-wrench-fits", -3: "log-wrench-fits-turned"}
        found.append(
            fact(
                turn.get(round(float(np.trace(self.axes.matrix))), "log-wrench-fits-other-axes"),
                stated=str(self.stated_frame or "frame not stated"),
                frame=self.frame,
                axes=self.axes.words,
                gain=self.axes.gain,
                lag_ms=self.offset.lag * 1e3,
                correlation=self.axes.correlation,
            )
        )
        if self.axes.derived:
            found.append(caution("log-wrench-derived", correlation=DERIVED))
        return tuple(found)


def check_vendor(recording: Recording, ours: Wrench, chain: Chain) -> VendorCheck | None:
    """Compare the log's wrench with ours in base and in flange axes; None if the log has none."""
    theirs = recording.wrench
    if theirs is None:
        return None
    stated = recording.wrench_frame
    empty = ~np.any(theirs, axis=1)
    zeros = float(np.mean(empty))
    norm = np.linalg.norm(ours.force[empty & ~ours.hidden], axis=1)
    at_zeros = float(np.sqrt(np.mean(norm**2))) if len(norm) else float("nan")
    shares = {"zeros": zeros, "at_zeros": at_zeros}
    # Zeros may stand for "not known", and would pull every fit towards nothing.
    usable = ~empty & ~ours.hidden
    if np.count_nonzero(usable) < 10:
        nothing = Offset(float("nan"), float("nan"))
        return VendorCheck(stated_frame=stated, frame="base", axes=None, offset=nothing, **shares)
    flange = link_poses(chain, recording.q).rotation[:, -1]
    forces = {"base": ours.force, "flange": np.einsum("tji,tj->ti", flange, ours.force)}
    given = np.where(usable[:, None], theirs[:, :3], np.nan)
    fits = {name: fit_axes(force, given) for name, force in forces.items()}
    frame = max(fits, key=lambda name: fits[name].correlation)
    turned = forces[frame] @ fits[frame].matrix.T
    offset = time_offset(recording.t, given, turned)
    moved = resample_columns(
        recording.t - offset.lag, recording.t, bridge_unknown(recording.t, turned)
    )
    axes = fit_axes(np.where(usable[:, None], moved, np.nan) @ fits[frame].matrix, given)
    return VendorCheck(stated_frame=stated, frame=frame, axes=axes, offset=offset, **shares)
