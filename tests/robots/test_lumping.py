"""Lumping: what is locked adds its mass, its place and its tensor to the link that carries it."""

from pathlib import Path

import numpy as np
import pytest
from made_urdfs import arm, fixed, joint, link, robot, written

from vftcli.robots import load_robot
from vftcli.robots.chain import improper, nearest_tensor, unphysical
from vftcli.signals.pose import rotation_about


def test_a_locked_point_mass_is_added_by_the_parallel_axes(tmp_path: Path) -> None:
    """2 kg on a rail 0.3 m out of the last link: M = m₁ + m₂, centre and tensor by hand."""
    point = link("point", 2.0, (0, 0, 0, 0, 0, 0)).replace('xyz="0.02 -0.03 0.1"', 'xyz="0 0 0"')
    rail = joint("rail", "link5", "point", "prismatic", axis="1 0 0", xyz="0 0 0.1")
    plain = load_robot(written(tmp_path, robot(link("base"), arm(5)))).chain
    written(tmp_path, "lock = {rail = 0.3}", "railed.toml")
    text = robot(link("base"), arm(5), point, rail)
    loaded = load_robot(written(tmp_path, text, "railed.urdf")).chain
    m1, m2 = plain.mass[-1], 2.0
    assert loaded.mass[-1] == m1 + m2
    # The chain's frame is turned so that its z is the joint's axis; compare what no turn changes.
    own = np.array([0.02, -0.03, 0.1])
    centre = (m1 * own + m2 * np.array([0.3, 0.0, 0.1])) / (m1 + m2)
    assert np.linalg.norm(loaded.com[-1]) == pytest.approx(np.linalg.norm(centre), rel=1e-14)
    apart = np.sum((np.array([0.3, 0.0, 0.1]) - own) ** 2)
    more = 2.0 * m1 * m2 / (m1 + m2) * apart  # the trace of a reduced mass at that distance
    traces = np.trace(loaded.inertia[-1]) - np.trace(plain.inertia[-1])
    assert traces == pytest.approx(more, rel=1e-13)


def test_a_link_that_only_a_locked_branch_gives_mass_has_it(tmp_path: Path) -> None:
    bare = link("link6", 0.0) + joint("joint6", "link5", "link6")
    text = robot(link("base"), arm(5), bare, fixed("hand", "link6", 0.5))
    assert load_robot(written(tmp_path, text)).chain.mass[-1] == 0.5


def test_the_nearest_tensor_is_valid_and_no_farther_than_it_must_be() -> None:
    R = rotation_about("x", 0.4) @ rotation_about("z", -1.1)
    bad = R @ np.diag([1.0, 2.0, 4.0]) @ R.T
    assert "triangle" in unphysical(1.0, bad)
    assert not improper(1.0, bad)
    near = nearest_tensor(bad)
    assert not unphysical(1.0, near)
    np.testing.assert_allclose(near, R @ np.diag([1.5, 2.5, 4.0]) @ R.T, atol=1e-14)
    np.testing.assert_allclose(nearest_tensor(near), near, atol=1e-14)
    good = np.diag([1.0, 2.0, 2.5])
    assert nearest_tensor(good) is good
