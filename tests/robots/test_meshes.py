"""Mesh files that a URDF names: where they are looked for, and where on the arm they are."""

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from made_urdfs import arm, fingered, link, robot, written

from vftcli.robots import load_robot
from vftcli.robots.chain import link_poses
from vftcli.robots.meshes import LARGEST
from vftcli.robots.robot import Mesh

ORIGIN = '<origin xyz="0.1 -0.2 0.3" rpy="0.4 0.5 -0.6"/>'


def shape(file: str, more: str = "", kind: str = "visual", origin: str = ORIGIN) -> str:
    return f'<{kind}>{origin}<geometry><mesh filename="{file}"{more}/></geometry></{kind}>'


def shaped(text: str, name: str, shapes: str) -> str:
    """The URDF with shapes on a link of it."""
    before, after = text.split(f'<link name="{name}">')
    return f'{before}<link name="{name}">{shapes}{after}'


def meshes_of(folder: Path, shapes: str) -> tuple[Mesh, ...]:
    """The meshes of an arm with shapes on its second link."""
    text = shaped(robot(link("base"), arm(6)), "link2", shapes)
    return load_robot(written(folder, text)).meshes


def put(file: Path) -> Path:
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_bytes(b"<triangles/>")
    return file


@pytest.mark.parametrize(
    ("name", "place"),
    [
        ("package://held/meshes/a.stl", "ws/some_folder/meshes/a.stl"),  # by its manifest
        ("package://ws/b.DAE", "ws/b.DAE"),  # by its folder
        ("package://beside/c.obj", "ws/other/c.obj"),
        ("../meshes/d.glb", "ws/some_folder/meshes/d.glb"),
        ("file://{folder}/e.stl", "e.stl"),
        ("package://ws/meshes/f.txt", None),  # no mesh
        ("package://unknown/g.stl", None),
        ("http://held/meshes/a.stl", None),
        ("x" * 5000 + ".stl", None),
        ("", None),
    ],
)  # fmt: skip
def test_a_mesh_is_found_by_its_name(tmp_path: Path, name: str, place: str | None) -> None:
    for folder, package in (("some_folder", "held"), ("other", "beside")):
        put(tmp_path / "ws" / folder / "package.xml").write_text(
            f"<name>{package}</name>", "utf-8"
        )
    (tmp_path / "ws/some_folder/urdf").mkdir()
    named = name.format(folder=tmp_path)
    put(tmp_path / (place or "ws/meshes/f.txt"))
    text = shaped(robot(link("base"), arm(6)), "link2", shape(named))
    found = load_robot(written(tmp_path / "ws/some_folder/urdf", text))
    (mesh,) = found.meshes
    assert (mesh.name, mesh.link) == (named, 2)
    if place is not None:
        assert mesh.file is not None
        assert mesh.file.resolve() == (tmp_path / place).resolve()
    said = [str(remark) for remark in found.remarks if remark.code == "meshes-not-found"]
    one = f"mesh files not found or not readable: 1, first {named}; simple shapes are drawn"
    assert said == ([one] if place is None else [])


def test_a_mesh_is_where_pinocchio_has_its_link(tmp_path: Path) -> None:
    """On the base, within the arm, and on what is fixed or locked behind it."""
    put(tmp_path / "a.stl")
    text = fingered()
    numbers = {"base": 0, "link1": 1, "link3": 3, "link6": 6, "hand": 7, "finger2": 7}
    for name in numbers:
        text = shaped(text, name, shape("a.stl", ' scale="0.001 0.002 -0.003"'))
    found = load_robot(written(tmp_path, text))
    model = pin.buildModelFromXML(text)
    data, q = model.createData(), pin.neutral(model)
    q[:7] = np.linspace(-1.0, 1.0, 7)
    pin.framesForwardKinematics(model, data, q)
    ours = link_poses(found.chain, q[None, :7])
    own = pin.SE3(pin.rpy.rpyToMatrix(0.4, 0.5, -0.6), np.array([0.1, -0.2, 0.3]))
    assert sorted(mesh.link for mesh in found.meshes) == sorted(numbers.values())
    left = list(found.meshes)
    for name, number in numbers.items():
        # Links of one joint are in the tree's order: the hand is above its finger.
        mesh = next(one for one in left if one.link == number)
        left = [one for one in left if one is not mesh]
        base = pin.SE3.Identity()
        if number:
            base = pin.SE3(ours.rotation[0, number - 1], ours.translation[0, number - 1])
        placed = base * pin.SE3(mesh.pose.rotation, mesh.pose.translation)
        expected = data.oMf[model.getFrameId(name, pin.FrameType.BODY)] * own
        np.testing.assert_allclose(placed.homogeneous, expected.homogeneous, atol=1e-12)
        assert mesh.scale.tolist() == [0.001, 0.002, -0.003]


def test_a_dae_without_triangles_cannot_be_shown(tmp_path: Path) -> None:
    """Rerun reads nothing else of it; the collision shape is there instead."""
    (tmp_path / "a.dae").write_bytes(b"<COLLADA><polylist/></COLLADA>")
    put(tmp_path / "b.stl")
    (mesh,) = meshes_of(tmp_path, shape("a.dae") + shape("b.stl", kind="collision"))
    assert mesh.name == "b.stl"


def test_collision_shapes_replace_those_for_show_that_are_not_all_found(tmp_path: Path) -> None:
    put(tmp_path / "there.stl")
    gone, there = shape("gone.dae"), shape("there.stl")
    simple = shape("there.stl", kind="collision")
    for shapes, count in (
        (there + simple, 1),
        (there + gone + simple, 1),
        (there + gone + shape("gone.stl", kind="collision"), 2),
    ):
        meshes = meshes_of(tmp_path, shapes)
        assert [mesh.name for mesh in meshes if mesh.file is not None] == ["there.stl"]
        assert len(meshes) == count


@pytest.mark.parametrize(
    "wrong",
    [
        shape("a.stl", ' scale="1 x 1"'),
        shape("a.stl", ' scale="1e999 1 1"'),
        shape("a.stl", origin='<origin xyz="0 0"/>'),
        shape("a.stl", origin='<origin rpy="900 0 0"/>'),
    ],
)
def test_what_an_arm_looks_like_does_not_refuse_it(tmp_path: Path, wrong: str) -> None:
    put(tmp_path / "a.stl")
    (mesh,) = meshes_of(tmp_path, wrong)
    assert mesh.file is None


def test_meshes_that_no_recording_has_room_for_are_left_out(tmp_path: Path) -> None:
    """Files of holes: what counts is what would be read."""
    for name in ("a.stl", "b.stl"):
        with (tmp_path / name).open("wb") as file:
            file.truncate(LARGEST // 2 + 1)
    meshes = meshes_of(tmp_path, shape("a.stl") + shape("b.stl"))
    assert [bool(mesh.file) for mesh in meshes] == [True, False]
