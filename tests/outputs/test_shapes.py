"""Surfaces of few triangles: how many, and how far they are from the meshes that they replace."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from contact_rows import contact

from vftcli.outputs.page.packing import Blob
from vftcli.outputs.shapes import (
    MOST_TRIANGLES,
    Surface,
    capsules,
    fewer,
    link_surfaces,
    touched_point,
)
from vftcli.robots import load_robot
from vftcli.robots.robot import Mesh
from vftcli.signals.pose import IDENTITY, rpy_matrix


def sphere(radius: float, rings: int = 80) -> np.ndarray:
    """Triangles of a sphere that face outwards. (F, 3, 3)"""
    polar, round_ = np.linspace(0.0, np.pi, rings + 1), np.linspace(0.0, 2 * np.pi, 2 * rings + 1)
    theta, phi = np.meshgrid(polar, round_, indexing="ij")
    round_about = [np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)]
    points = radius * np.stack(round_about, axis=-1)
    a, b, c, d = points[:-1, :-1], points[1:, :-1], points[1:, 1:], points[:-1, 1:]
    return np.concatenate([np.stack([a, b, c], -2), np.stack([a, c, d], -2)]).reshape(-1, 3, 3)


def box(sides: np.ndarray, parts: int = 24) -> np.ndarray:
    """Triangles of a box with a corner at zero, each side cut in squares. (F, 3, 3)"""
    at = np.linspace(0.0, 1.0, parts + 1)
    u, v = np.meshgrid(at, at, indexing="ij")
    found = []
    for axis in range(3):
        for end in (0.0, 1.0):
            points = np.empty((*u.shape, 3))
            points[..., axis] = end
            points[..., axis - 2], points[..., axis - 1] = (u, v) if end else (v, u)
            a, b, c, d = points[:-1, :-1], points[1:, :-1], points[1:, 1:], points[:-1, 1:]
            found += [np.stack([a, b, c], -2), np.stack([a, c, d], -2)]
    return np.concatenate(found).reshape(-1, 3, 3) * sides


def volume(corners: np.ndarray) -> float:
    """The volume that triangles enclose which face outwards."""
    return float(np.linalg.det(corners).sum() / 6.0)


def test_a_sphere_keeps_its_radius_and_nearly_its_volume() -> None:
    """No edge is longer than half a radius r. The middle of a triangle of edge c is c²/6r below
    the sphere, and planes that touch it meet c²/8r above: 4.2 % and 3.1 % of r at most."""
    found = fewer(sphere(0.1))
    assert 200 < len(found.faces) <= MOST_TRIANGLES
    corners = found.corners[found.faces]
    assert np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max() <= 0.05
    np.testing.assert_allclose(np.linalg.norm(found.corners, axis=1), 0.1, atol=0.0031)
    assert volume(corners) == pytest.approx(4 / 3 * np.pi * 0.1**3, rel=3 * 0.042)


def test_a_box_keeps_its_corners_its_sides_and_its_volume() -> None:
    """Where three planes meet is a corner, where two an edge, and on a side all stay on it.

    A corner alone in its cell is lost where its neighbours are in one cell together.
    """
    turned, sides = rpy_matrix((0.3, -0.5, 1.1)), np.array([0.3, 0.2, 0.12])
    found = fewer(box(sides) @ turned.T + [0.5, -0.2, 0.1])
    assert 100 < len(found.faces) <= MOST_TRIANGLES
    inside = (found.corners - [0.5, -0.2, 0.1]) @ turned / sides
    ends = np.array(np.meshgrid([0, 1], [0, 1], [0, 1])).reshape(3, -1).T
    apart = np.linalg.norm(inside[:, None] - ends, axis=2)
    assert (apart.min(axis=0) < 1e-6).sum() >= 7
    # To the nearest of the six sides: what would be outside of its cell is brought back to it.
    to_side = np.abs(inside[..., None] - [0.0, 1.0]).min(axis=(1, 2))
    assert (to_side < 1e-6).mean() > 0.8
    np.testing.assert_allclose(to_side, 0.0, atol=0.02)
    assert inside.min() > -0.02
    assert inside.max() < 1.02
    whole = np.prod(sides)
    centred = found.corners - [0.5, -0.2, 0.1]
    assert volume(centred[found.faces]) == pytest.approx(whole, rel=0.01)
    few = fewer(box(np.ones(3), 1))
    assert len(few.faces) == 12  # of few all are kept
    assert volume(few.corners[few.faces]) == pytest.approx(1.0)


def test_no_corner_moves_farther_than_the_diagonal_of_a_cell() -> None:
    """On a rough surface (seed 3): each new corner has an old one so near, and each old a new."""
    rng = np.random.default_rng(3)
    rough = sphere(0.1, 30)
    rough *= 1.0 + 0.1 * np.sin(23.0 * rough[..., :1] / 0.1 + rng.uniform())
    found = fewer(rough)
    old = rough.reshape(-1, 3)
    apart = np.linalg.norm(old[:, None] - found.corners, axis=2)
    # With cells of an eighth of its size such a surface has more than 400 triangles.
    diagonal = np.sqrt(3.0) * np.ptp(old, axis=0).max() / 2.0**2.5
    assert apart.min(axis=0).max() <= diagonal
    assert apart.min(axis=1).max() <= diagonal
    assert packed(found) < 4000


def test_capsules_are_thick_at_the_base_and_a_joint_lies_along_its_axis() -> None:
    """Radii fall from 4.8 to 3 % of the stretched arm; what is below 2 % of it is a joint alone."""
    chain = load_robot("ur5").chain
    offsets = np.vstack([chain.translation, chain.flange_translation])
    length = np.sqrt((offsets**2).sum(axis=1)).sum()
    found = capsules(chain)
    assert len(found) == 7
    for j, (parts, offset) in enumerate(zip(found, offsets, strict=True)):
        radius = length * (0.048 - 0.018 * j / 6)
        axis = [0.0, 0.0, 2.2 * radius]
        shapes = [([0.0, 0.0, -1.1 * radius], axis, 1.18 * radius, "joint")] if j else []
        if np.linalg.norm(offset) > 0.02 * length:
            shapes.append(([0.0, 0.0, 0.0], offset.tolist(), radius, "link"))
        for part, (start, way, size, kind) in zip(parts, shapes, strict=True):
            np.testing.assert_allclose([*part.start, *part.direction], [*start, *way])
            assert (part.radius, part.kind) == (pytest.approx(size), kind)


def packed(surface: Surface) -> int:
    blob = Blob()
    for row in surface.corners.T:
        blob.add(row, 1e-3)
    for row in surface.faces.T:
        blob.add(row, 1.0)
    return len(blob.data()["blob"])


def written(file: Path, corners: np.ndarray) -> Path:
    lines = (f"vertex {x} {y} {z}" for x, y, z in corners.reshape(-1, 3))
    file.write_text("solid\n" + "\n".join(lines), "utf-8")
    return file


def test_a_link_has_a_surface_where_all_of_its_meshes_are_read(tmp_path: Path) -> None:
    """Two meshes are one surface; what cannot be read is named, and its link has none."""
    file = written(tmp_path / "box.stl", box(np.ones(3), 2))
    (tmp_path / "bad.stl").write_bytes(b"no mesh")
    whole = Mesh("box.stl", file, 2, IDENTITY, 0.1 * np.ones(3))
    aside = whole._replace(pose=IDENTITY._replace(translation=np.array([0.5, 0.0, 0.0])))
    meshes = (
        *(whole, aside),
        *(whole._replace(link=4), whole._replace(link=4, name="gone.stl", file=None)),
        whole._replace(link=5, name="bad.stl", file=tmp_path / "bad.stl"),
    )
    surfaces, lacking = link_surfaces(replace(load_robot("ur5"), meshes=meshes))
    assert lacking == ["gone.stl", "bad.stl"]
    assert list(surfaces) == [2]
    corners = surfaces[2].corners
    np.testing.assert_allclose(corners.min(axis=0), 0.0, atol=1e-9)
    np.testing.assert_allclose(corners.max(axis=0), [0.6, 0.1, 0.1], atol=1e-9)
    assert link_surfaces(load_robot("ur5")) == ({}, [])


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", ["ur_description/urdf/ur5_robot", "panda_description/urdf/panda"]
)
def test_a_makers_arm_has_few_triangles_that_fill_its_meshes(name: str) -> None:
    """The box about each link stays within 10 mm, a third of the widest cell."""
    from test_example_robots import files

    from vftcli.robots.meshes import read_mesh

    robot = load_robot(files()[name])
    surfaces, lacking = link_surfaces(robot)
    assert not lacking
    assert list(surfaces) == list(range(robot.joints + 1))
    for link, surface in surfaces.items():
        assert 200 < len(surface.faces) <= MOST_TRIANGLES
        assert packed(surface) < 2500
        whole = np.vstack([read_mesh(mesh) for mesh in robot.meshes if mesh.link == link])
        ends = [[c.min(axis=0), c.max(axis=0)] for c in (surface.corners, whole.reshape(-1, 3))]
        np.testing.assert_allclose(*ends, atol=0.01)


@pytest.mark.parametrize(("places", "point"), [((0, 6), 6.0), ((2, 3), 2.5), ((), 6.0)])
def test_the_arrow_is_at_the_place(places: tuple[int, ...], point: float) -> None:
    """Link k lies between the origins k − 1 and k; here each origin has its own number as x."""
    origins = np.tile(np.arange(7.0)[None, :, None], (1, 1, 3))
    assert touched_point(contact(places=places), origins)[0, 0] == point
