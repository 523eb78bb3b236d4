"""The error budget: friction is told from other model error, and the largest cause is named."""

import numpy as np
import pytest

from vftcli.refinement.budget import (
    CAUSES,
    SIGN_SPEED,
    STICTION,
    Budget,
    friction_share,
    limits_remark,
)

RNG = np.random.default_rng(8)
DQ = RNG.uniform(-1.0, 1.0, (4000, 2))


def test_pure_friction_is_all_friction() -> None:
    tau = 3.0 * np.tanh(DQ / SIGN_SPEED) + 0.5 * DQ
    np.testing.assert_allclose(friction_share(DQ, tau), 1.0, atol=1e-12)


@pytest.mark.parametrize("size", [0.5, 1.0, 4.0])
def test_friction_beside_another_error_is_its_share_of_the_power(size: float) -> None:
    """tanh has a mean square of nearly 1, the other error `size`²; 4000 samples tell 3 %."""
    other = size * RNG.standard_normal(DQ.shape)
    power = np.mean(np.tanh(DQ / SIGN_SPEED) ** 2, axis=0)
    found = friction_share(DQ, np.tanh(DQ / SIGN_SPEED) + other)
    np.testing.assert_allclose(found, power / (power + size**2), atol=0.03)


def test_no_torque_has_no_friction() -> None:
    assert not friction_share(DQ, np.zeros_like(DQ)).any()


def budget() -> Budget:
    sizes = {
        "noise": [3.0, 0.1],
        "friction": [4.0, 0.2],
        "model": [0.0, 0.1],
        "bandwidth": [0.0, 0.5],
    }
    return Budget(
        "gmo", {**{k: np.array(v) for k, v in sizes.items()}, STICTION: np.array([9.0, 7.0])}
    )


def test_stiction_is_no_part_of_the_sum() -> None:
    assert set(budget().parts) == set(CAUSES)
    np.testing.assert_allclose(budget().total, [5.0, np.sqrt(0.31)])


def test_the_largest_cause_of_each_joint_is_named() -> None:
    free = limits_remark(budget(), np.array([False, False]))
    assert free.values["causes"] == ["friction", "bandwidth"]
    assert free.values["size_Nm"] == [4.0, 0.5]
    stuck = limits_remark(budget(), np.array([True, False]))
    assert stuck.values["causes"] == [STICTION, "bandwidth"]
    assert stuck.values["size_Nm"][0] == 9.0
    # 9 N·m beside the 5 of the other causes, and nothing beside the joint that moves
    np.testing.assert_allclose(stuck.values["total_Nm"], [np.sqrt(9.0**2 + 5.0**2), np.sqrt(0.31)])
    assert str(stuck).startswith("gmo: what limits this log, from J1: stiction at rest, bandwidth")


def test_a_joint_at_rest_without_known_friction_is_not_limited_by_stiction() -> None:
    found = budget()
    found.parts[STICTION][0] = 0.0
    assert limits_remark(found, np.array([True, True])).values["causes"] == ["friction", STICTION]
