"""Joints that swing by 1 rad, and what is said of them by their signals alone."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from vftcli.doctor import examine
from vftcli.robots import load_robot
from vftcli.signals.arrays import Array
from vftcli.signals.recording import Recording
from vftcli.signals.remarks import Remark

STEP = 0.01
T = STEP * np.arange(4001)
RATES = 2 * np.pi / 10 * np.array([1.0, 2, 3, 4, 5, 6])
"""Whole turns in the 40 s of the log, so forward and backward weigh alike. [rad/s]"""
Q = np.sin(np.outer(T, RATES))


def speed_at(t: Array) -> Array:
    """The velocities at any time. (T, 6) [rad/s]"""
    return np.asarray(RATES * np.cos(np.outer(t, RATES)))


DQ = speed_at(T)


def torque_of(q: Array) -> Array:
    """A torque that changes with the pose, with noise of 0.1 N·m. (T, n) [N·m]"""
    return np.asarray(20 * np.cos(q) + np.random.default_rng(0).normal(0, 0.1, q.shape))


TORQUE = torque_of(Q)


def log_of(**changes: Array | None) -> Recording:
    """The log with some signals changed; its torque goes with its positions."""
    signals = {"t": T, "q": Q, "dq": DQ, **changes}
    return Recording(**{"torque": torque_of(signals["q"]), **signals})


def said_of(log: Recording) -> dict[str, Remark]:
    """dict[str, Remark] by code, each once; an arm of seven joints has no say in a log of fewer."""
    findings = examine(log, load_robot("panda")).findings
    assert len({finding.code for finding in findings}) == len(findings)
    return {finding.code: finding for finding in findings}


def found(**changes: Array | None) -> dict[str, Remark]:
    return said_of(log_of(**changes))


def scaled(x: Array, factor: float, *joints: int) -> Array:
    """A signal with some of its columns, counted from 1, times a factor."""
    scale = np.ones(x.shape[1])
    scale[[j - 1 for j in joints]] = factor
    return x * scale


class Said(NamedTuple):
    """What is to be said of a log; an empty level and empty joints are not compared."""

    code: str
    joints: tuple[int, ...]
    level: str
    values: dict[str, Any]
    beside: frozenset[str] | None = None  # all other codes; None for any

    def check(self, findings: dict[str, Remark]) -> None:
        if self.beside is not None:
            assert set(findings) == {self.code, *self.beside} - {""}
        if self.code:
            finding = findings[self.code]
            assert self.joints in ((), finding.where.joints)
            assert self.level in ("", finding.level)
            assert {name: finding.values[name] for name in self.values} == self.values


class Unsaid(NamedTuple):
    code: str

    def check(self, findings: dict[str, Remark]) -> None:
        assert [code for code in findings if code.startswith(self.code)] == []


def only(code: str = "", *joints: int, level: str = "", beside: str = "", **values: Any) -> Said:
    return Said(code, joints, level, values, frozenset(beside.split()))


def has(code: str, *joints: int, level: str = "", **values: Any) -> Said:
    return Said(code, joints, level, values)


class Case(NamedTuple):
    name: str
    find: Callable[[], dict[str, Remark]]
    said: Said | Unsaid


def only_if(there: bool, code: str, *joints: int, **values: Any) -> Said:
    return only(code, *joints, **values) if there else only()


def has_if(there: bool, code: str, *joints: int, **values: Any) -> Said | Unsaid:
    return has(code, *joints, **values) if there else Unsaid(code)
