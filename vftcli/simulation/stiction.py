"""One time step of an arm with dry friction: which joints stick, and the velocities after it.

After Moreau: given the impulse balance M̃ (v⁺ − v) = g − λ with |λ_j| ≤ ℓ_j, a sliding joint has
λ_j = ℓ_j sign(v⁺_j), a sticking one has v⁺_j = 0 exactly. M̃ is positive definite, so the solution
exists and is unique. (J. J. Moreau, "Unilateral contact and dry friction in finite freedom
dynamics", 1988.)
"""

import numpy as np

from vftcli.signals.arrays import Array

GUESSES = 12  #: Active-set guesses before the slower sweeps that always converge take over.
SWEEPS = 2000


def slide_or_stick(
    M: Array, impulse: Array, v: Array, limit: Array, signs: Array
) -> tuple[Array, Array, Array]:
    """Velocities after the step, friction impulses, and the direction each joint slides in.

    Args:
        M: Joint-space inertia with the implicit damping, M̃. (n, n) [kg·m²]
        impulse: Impulse g of everything but dry friction. (n,) [N·m·s]
        v: Velocities before the step. (n,) [rad/s]
        limit: Largest dry friction impulses ℓ. (n,) [N·m·s]
        signs: Directions guessed: those of the step before; 0 sticks. (n,)

    Returns:
        v⁺ (n,) [rad/s], λ (n,) [N·m·s] and the directions (n,).
    """
    from scipy.linalg.lapack import dposv

    for _ in range(GUESSES):
        # While every joint slides, one Cholesky solve settles the step; it is by far most of them.
        if signs.all():
            _, step, _ = dposv(M, impulse - limit * signs)
            after = v + step
            wrong = (after * signs < 0.0) & (limit > 0.0)
            if not wrong.any():
                return after, limit * signs, signs
            signs = np.where(wrong, 0.0, signs)
            continue
        after, friction, better = step_with_stuck_joints(M, impulse, v, limit, signs)
        if np.array_equal(better, signs):
            return after, friction, signs
        signs = better
    return gauss_seidel(M, impulse, v, limit)


def step_with_stuck_joints(
    M: Array, impulse: Array, v: Array, limit: Array, signs: Array
) -> tuple[Array, Array, Array]:
    """The step if exactly the joints with sign 0 stick, and the directions that result."""
    stuck, free = signs == 0.0, signs != 0.0
    stop = -v[stuck]
    after, friction = np.zeros_like(v), limit * signs
    step = np.zeros(int(free.sum()))
    if step.size:
        rows = M[free]
        right = impulse[free] - friction[free] - rows[:, stuck] @ stop
        step = np.linalg.solve(rows[:, free], right)
        after[free] = v[free] + step
    rows = M[stuck]
    friction[stuck] = impulse[stuck] - rows[:, free] @ step - rows[:, stuck] @ stop
    better = signs.copy()
    better[free & (after * signs < 0.0) & (limit > 0.0)] = 0.0
    breaks = stuck & (np.abs(friction) > limit)
    better[breaks] = np.where(friction[breaks] < 0.0, -1.0, 1.0)
    return after, friction, better


def gauss_seidel(M: Array, impulse: Array, v: Array, limit: Array) -> tuple[Array, Array, Array]:
    """The same step by projected Gauss–Seidel, which converges for every positive definite M̃."""
    A = np.linalg.inv(M)
    free = v + A @ impulse
    friction = np.zeros_like(v)
    for _ in range(SWEEPS):
        before = friction.copy()
        for j in range(len(v)):
            slip = free[j] - A[j] @ friction
            friction[j] = np.clip(friction[j] + slip / A[j, j], -limit[j], limit[j])
        if np.max(np.abs(friction - before)) <= 1e-14 * (1.0 + np.max(np.abs(friction))):
            break
    after = free - A @ friction
    after[np.abs(friction) < limit] = 0.0
    signs = np.where(np.abs(friction) < limit, 0.0, np.where(friction < 0.0, -1.0, 1.0))
    return after, friction, signs
