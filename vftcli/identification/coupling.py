"""Joints driven through others: found by the friction that a motor shows when another joint turns.

Motor i turns with joint j if its friction follows q̇_i + c q̇_j. The links cannot feign that: theirs
is no dry torque, and what they may leave of the acceleration q̈_j has a coefficient of its own in
both fits that are compared. Friction without coupling is the same one that competes with it.
"""

from typing import NamedTuple

import numpy as np

from vftcli.identification.friction_fit import PLAIN, tellable_terms
from vftcli.identification.friction_shapes import Shape, round_digits, term_values
from vftcli.identification.least_squares import cross_validated, fit_column
from vftcli.identification.processing import with_transmission
from vftcli.identification.training import Training, data_of_joint, prepare_training
from vftcli.robots.transmission import at_motors
from vftcli.signals.arrays import Array
from vftcli.signals.remarks import Remark, Where, caution

LEFT = 0.7
"""Share of a joint's cross-validated error that a coupling may leave at most."""

HINTED = 0.97
"""Share from which down on the other joint's own friction hints at a coupling to be looked for."""

PROMISING = 0.8
"""Share that it may leave on the coarse grid for the finer ones to be worth their while."""

KNOWN = 0.02
"""Standard deviation over value up to which a coupling counts as determined. Where wrong links
feign one in logs of arms without any, it is .07 to .3."""

LEAST = 0.1
"""Smallest coupling that is looked for: less moves the motor too little to matter. [1]"""

REACH = 2
"""A motor sits at most so many joints before its own: those of a wrist in the forearm."""

SPAN, STEPS, FINER = 2.0, 20, (5, 5, 5)
"""Couplings are looked for from −SPAN to SPAN in so many steps to either side, then in a step of
these in so many finer ones each. [1]"""

TERMS = (*PLAIN, "quadratic", "load_coulomb")


class Coupling(NamedTuple):
    """A motor that turns with another joint.

    Attributes:
        motor: Its joint, from 0.
        joint: The joint that it turns with, before it, from 0.
        value: Turns of the motor for one of that joint. [1]
        sd: Standard deviation.
        left: Share of the motor's cross-validated error that is left.
        rubs: Whether its friction then opposes the motor's turning.
    """

    motor: int
    joint: int
    value: float
    sd: float
    left: float
    rubs: bool

    @property
    def is_demanded(self) -> bool:
        """Whether the regression demands it."""
        known = self.sd <= KNOWN * abs(self.value) and abs(self.value) >= LEAST
        return self.rubs and known and self.left <= LEFT


def with_couplings(data: Training) -> tuple[Training, list[Remark]]:
    """The training data in the motors' coordinates, with what was found of couplings.

    What the robot file says of couplings is taken as it is, and without friction nothing tells any.
    Else the strongest is taken until no
    further one is demanded.
    """
    if data.robot.chain.transmission is not None or not data.rubs:
        return data, []
    found = list[Remark]()
    n = data.robot.joints
    T = np.eye(n)
    for _ in range(n):
        demanded = [c for c in couplings(data, T) if c.is_demanded]
        if not demanded:
            break
        best = min(demanded, key=lambda c: c.left)
        T[best.motor, best.joint] = round_digits(best.value)
        robot = with_transmission(data.robot, T.copy())
        processing = data.motions[0].processing
        data = prepare_training(data.recordings, robot, processing, data.fit_constants, data.rubs)
        values = {"motor": best.motor + 1, "coupling": best.value, "sd": best.sd}
        where = Where(joints=(best.joint + 1,))
        found.append(caution("coupled-joint", where, **values, left_percent=100.0 * best.left))
    return data, found


def couplings(data: Training, known: Array) -> list[Coupling]:
    """Each motor's best coupling with each joint before it, where anything hints at one.

    Args:
        data: The training logs.
        known: The transmission known so far; its couplings are not looked for again. (n, n)
    """
    moves = data.excited.moves
    pairs = [(i, j) for i in range(data.robot.joints) for j in range(max(i - REACH, 0), i)]
    tried = [fit_pair(data, i, j) for i, j in pairs if moves[i] and moves[j] and not known[i, j]]
    return [found for found in tried if found is not None]


class MotorRow:
    """One motor's equations with its friction at q̇_i + c q̇_j, c to be found.

    Args:
        data: The training logs.
        i: The motor, from 0.
        j: The joint that it may turn with, from 0.
    """

    def __init__(self, data: Training, i: int, j: int) -> None:
        weights = [motion.usable.astype(float) for motion in data.motions]
        self.given, self.data, self.i, self.j = data_of_joint(data, i, weights, False), data, i, j
        self.shape = Shape(tellable_terms(TERMS, self.given))
        other = np.concatenate([motion.ddq[:, j] for motion in data.motions])
        self.accelerations = np.column_stack([self.given.fixed, other])
        self.weights, self.parts = self.robust_weights(0.0), self.given.parts(i)

    def robust_weights(self, c: float) -> Array:
        """Weights of the samples, outliers of the fit at a coupling c held down. (M,)"""
        return fit_column(self.columns(c), self.given.y, self.given.weights).weights

    def friction(self, c: float) -> Array:
        """The friction's columns at a coupling c. (M, k)"""
        rows = []
        for motion, columns in zip(self.data.motions, self.data.columns, strict=True):
            dq = motion.recording.require("dq")
            speed = at_motors(motion.transmission, dq)[:, self.i] + c * dq[:, self.j]
            load = columns.load[:, self.i]
            terms = [term_values(term, self.shape, speed, load) for term in self.shape.terms]
            rows.append(motion.filtered(np.column_stack(terms)))
        return np.concatenate(rows)

    def columns(self, c: float) -> Array:
        """All columns at a coupling c. (M, k + f)"""
        return np.hstack([self.friction(c), self.accelerations])

    def error(self, A: Array) -> float:
        """What columns miss of stretches left out. [N·m]"""
        return cross_validated(A, self.given.y, self.weights, self.parts)

    def hint(self) -> Array:
        """What the other joint's own friction adds to the columns without coupling. (M, 2)"""
        rows = [
            columns.column(term, self.j, self.shape)
            for columns in self.data.columns
            for term in ("coulomb", "viscous")
        ]
        pairs = [np.column_stack(rows[k : k + 2]) for k in range(0, len(rows), 2)]
        return np.concatenate(pairs)


def fit_pair(data: Training, i: int, j: int) -> Coupling | None:
    """The best coupling of motor i with joint j (from 0), None where nothing hints at any."""
    row = MotorRow(data, i, j)
    plain = row.columns(0.0)
    before = row.error(plain)
    if not before > 0.0 or row.error(np.hstack([plain, row.hint()])) > HINTED * before:
        return None
    # Sign changes make the error rough: it is searched on finer and finer grids.
    c, step = 0.0, SPAN / STEPS
    for size in (STEPS, *FINER):
        grid = c + step * np.arange(-size, size + 1)
        c = float(min(grid, key=lambda at: row.error(row.columns(at))))
        if row.error(row.columns(c)) > PROMISING * row.error(plain):
            return None
        step /= size
        row.weights = row.robust_weights(c)
    A = row.columns(c)
    fit = fit_column(A, row.given.y, row.given.weights)
    # The friction's slope along c, beside the other columns, tells how well c is known.
    width = 0.01
    slope = (row.columns(c + width) - row.columns(c - width)) @ fit.values / (2.0 * width)
    sd = fit_column(np.column_stack([A, slope]), row.given.y, row.given.weights).sd[-1]
    rubs = bool(np.all(fit.values[:2] > 0.0))  # Coulomb and viscous friction
    return Coupling(i, j, c, float(sd), row.error(A) / row.error(plain), rubs)
