"""The truth beside a simulated log."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from vftcli.signals.arrays import Array
from vftcli.signals.packages import needed
from vftcli.simulation.arm import Arm
from vftcli.simulation.sensing import Samples, interpolate
from vftcli.simulation.touch import Mounted, joint_jacobian

AXES = ("fx", "fy", "fz", "mx", "my", "mz")


@dataclass(frozen=True, kw_only=True)
class Truth:
    """What really happened at each sample, on the log's clock."""

    t: Array  #: Time since the log's first sample, on its clock without jitter. (M,) [s]
    tau_ext: Array  #: External torque on the robot, Σ Jᵢᵀ wᵢ over the contacts. (M, n) [N·m]
    wrench: Array  #: Wrench of all contacts on the flange, about its origin, in base axes. (M, 6)
    #: Name → wrench of each contact elsewhere, about its own point, in base axes. (M, 6)
    contacts: dict[str, Array]
    walks: dict[str, Array]  #: Name → joint torque of each random walk. (M, n) [N·m]
    q: Array  #: True positions, velocities, accelerations. (M, n)
    dq: Array
    ddq: Array
    torque: Array  #: True drive torque in the log's sampling (average or instant). (M, n) [N·m]
    friction: Array  #: True friction torque. (M, n) [N·m]

    def columns(self) -> dict[str, Array]:
        """The columns of the truth file, flat, in order, t from the first sample. (M,) each"""
        table = {"t": self.t}
        table |= {f"tau_ext/{j}": c for j, c in enumerate(self.tau_ext.T, start=1)}
        table |= {f"wrench/{a}": c for a, c in zip(AXES, self.wrench.T, strict=True)}
        for name, values in self.contacts.items():
            pairs = zip(AXES, values.T, strict=True)
            table |= {f"contact/{name}/{axis}": column for axis, column in pairs}
        for name, values in self.walks.items():
            table |= {f"contact/{name}/{j}": c for j, c in enumerate(values.T, start=1)}
        return table


def truth_of(arm: Arm, samples: Samples) -> Truth:
    """Evaluate the contacts at the log's sampling instants."""
    history, touching = arm.history.until(arm.made), arm.touching
    middle = (np.arange(arm.made, dtype=float) + 0.5) * history.step
    wrenches = interpolate(samples.time, middle, history.wrenches)
    walk = interpolate(samples.time, middle, history.walk)
    model = arm.plant.model
    data = model.createData()
    tau_ext, wrench = walk.copy(), np.zeros((len(samples.time), 6))
    for k in np.flatnonzero(np.any(wrenches != 0.0, axis=(1, 2))):
        tau, flange = torque_and_wrench(model, data, samples.q[k], touching.mounted, wrenches[k])
        tau_ext[k] += tau
        wrench[k] = flange
    contacts = {m.name: wrenches[:, c] for c, m in enumerate(touching.mounted) if not m.on_flange}
    walks = {
        w.name: interpolate(samples.time, middle, w.torque[: arm.made]) for w in touching.walks
    }
    return Truth(
        t=samples.stamp,
        tau_ext=tau_ext,
        wrench=wrench,
        contacts=contacts,
        walks=walks,
        q=samples.q,
        dq=samples.v,
        ddq=samples.a,
        torque=samples.tau,
        friction=samples.friction,
    )


def torque_and_wrench(
    model: Any,  # noqa: ANN401 - Pinocchio is untyped
    data: Any,  # noqa: ANN401
    q: Array,
    mounted: list[Mounted],
    wrenches: Array,
) -> tuple[Array, Array]:
    """Joint torque of all contacts (n,) [N·m] and the wrench of those on the flange (6,)."""
    pin = needed("pinocchio", "a simulation")

    pin.computeJointJacobians(model, data, q)
    tau, flange = np.zeros(len(q)), np.zeros(6)
    for contact, wrench in zip(mounted, wrenches, strict=True):
        R = data.oMi[contact.joint].rotation
        if contact.on_flange:
            flange += at_other_point(wrench, R @ contact.turn @ contact.lever)
        else:
            J = joint_jacobian(model, data, contact.joint)
            tau += J.T @ at_other_point(wrench, R @ contact.point)
    last = len(q)
    offset = (
        data.oMi[last].rotation @ model.frames[model.getFrameId("flange")].placement.translation
    )
    return tau + joint_jacobian(model, data, last).T @ at_other_point(flange, offset), flange


def at_other_point(wrench: Array, lever: Array) -> Array:
    """A wrench referred to a point from which its own point lies `lever` (3,) [m] away. (6,)"""
    return np.concatenate([wrench[:3], wrench[3:] + np.cross(lever, wrench[:3])])
