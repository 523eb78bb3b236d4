"""What the vendor's own controller says of the run: targets, and its estimate of contact.

The estimates are what the vendors' are: the measured torque less the nominal model's, low-passed.
"""

from dataclasses import dataclass

import numpy as np

from vftcli.robots import Robot
from vftcli.robots.friction import friction_torque
from vftcli.robots.kernels import momentum_terms
from vftcli.signals.arrays import Array
from vftcli.simulation.arm import Arm
from vftcli.simulation.motion import Reference
from vftcli.simulation.sensing import Measured, Samples, log_rate
from vftcli.simulation.servo import rigid_torque


@dataclass(frozen=True, kw_only=True)
class Vendor:
    """The controller's own quantities at each sample."""

    target_torque: Array  #: Nominal rigid-body torque of the reference. (M, n) [N·m]
    #: That and the nominal friction as current, None without drive constants. (M, n) [A]
    target_current: Array | None
    tau_ext: Array  #: Its estimate of the external torque ON the robot. (M, n) [N·m]


def vendor_view(arm: Arm, samples: Samples, measured: Measured) -> Vendor:
    """Evaluate the controller's nominal model along a run.

    Its friction knows load and temperature, as the controllers' of Universal Robots do, and no
    presliding.
    """
    nominal: Robot = arm.true.nominal
    target = Reference(samples.target_q, samples.target_dq, samples.target_ddq)
    still, warm = np.zeros_like(samples.target_q), measured.temperature
    load = momentum_terms(nominal.loaded_chain, samples.target_q, still).gravity
    target_torque = rigid_torque(nominal.model, target)
    target_current = None
    if nominal.torque_constant is not None:
        rubs = friction_torque(nominal.friction, samples.target_dq, load, temperature=warm)
        target_current = (target_torque + rubs) / nominal.torque_constant
    motion = Reference(measured.q, measured.dq, samples.target_ddq)
    model_torque = rigid_torque(nominal.model, motion)
    model_torque += friction_torque(nominal.friction, measured.dq, load, temperature=warm)
    spec = arm.scenario.sensing
    step = 1.0 / log_rate(spec, arm.robot)
    residual = first_order_low_pass(measured.torque - model_torque, spec.vendor_cutoff, step)
    return Vendor(target_torque=target_torque, target_current=target_current, tau_ext=-residual)


def first_order_low_pass(signal: Array, cutoff: float, step: float) -> Array:
    """First-order low-pass at `cutoff` [Hz] of a signal (M, n) sampled every `step` [s]."""
    # Exact discretisation of the first-order filter for an input held over the step.
    share = 1.0 - np.exp(-2.0 * np.pi * cutoff * step)
    out = np.empty_like(signal)
    state = signal[0].copy()
    for k, row in enumerate(signal):
        state = state + share * (row - state)
        out[k] = state
    return out
