"""The paper's own numeric method, eqs. (7)–(16): everything from a black-box inverse dynamics.

It is slow (n + 3 calls of RNEA a sample) and good to about 5e-6 N·m, because (11) differentiates
numerically. It stays for three purposes: an oracle that shares no code with the kernels, the
``--as-printed`` path, and the baseline of the benchmark.
"""

from typing import Any

import numpy as np

from vftcli.robots.kernels import MomentumTerms
from vftcli.signals.arrays import Array
from vftcli.signals.packages import needed

STEP = 1e-7  #: Δq of (10). [rad]


def literal_momentum_terms(model: Any, q: Array, dq: Array) -> MomentumTerms:  # noqa: ANN401
    r"""Evaluate p, Cᵀq̇ and g as the paper prints them.

    p = rnea(q, 0, q̇, 0) (8); Ṁq̇ ≈ Σᵢ [rnea(q+Δqᵢ, 0, q̇, 0) − p]/Δq · q̇ᵢ (11);
    Cq̇ = rnea(q, q̇, 0, 0) (12); Cᵀq̇ = Ṁq̇ − Cq̇ (14); G = rnea(q, 0, 0, g₀) (16).

    Args:
        model: Pinocchio model; its rotor inertia (`armature`) counts in M.
        q: Joint positions. (T, n) [rad]
        dq: Joint velocities. (T, n) [rad/s]
    """
    pin = needed("pinocchio", "the paper's numeric method")

    weightless = model.copy()
    weightless.gravity.linear = np.zeros(3)
    data, free = model.createData(), weightless.createData()
    samples, n = q.shape
    zero = np.zeros(n)
    p, coriolis, gravity = (np.empty((samples, n)) for _ in range(3))
    for k in range(samples):
        p[k] = pin.rnea(weightless, free, q[k], zero, dq[k])
        rate = np.zeros(n)
        for i in range(n):
            moved = q[k].copy()
            moved[i] += STEP
            rate += (pin.rnea(weightless, free, moved, zero, dq[k]) - p[k]) / STEP * dq[k, i]
        coriolis[k] = rate - pin.rnea(weightless, free, q[k], dq[k], zero)
        gravity[k] = pin.rnea(model, data, q[k], zero, zero)
    return MomentumTerms(p, coriolis, gravity)
