"""Mesh files that a URDF names: where they are looked for, and where on the arm they are."""

import struct
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from made_urdfs import arm, fingered, link, robot, written

from vftcli.robots import load_robot
from vftcli.robots.chain import link_poses
from vftcli.robots.meshes import LARGEST, read_mesh
from vftcli.robots.robot import Mesh
from vftcli.signals.errors import RobotError
from vftcli.signals.pose import IDENTITY, Pose, rotation_about

ORIGIN = '<origin xyz="0.1 -0.2 0.3" rpy="0.4 0.5 -0.6"/>'


def shape(file: str, more: str = "", kind: str = "visual", origin: str = ORIGIN) -> str:
    return f'<{kind}>{origin}<geometry><mesh filename="{file}"{more}/></geometry></{kind}>'


def shaped(text: str, name: str, shapes: str) -> str:
    before, after = text.split(f'<link name="{name}">')
    return f'{before}<link name="{name}">{shapes}{after}'


def meshes_of(folder: Path, shapes: str) -> tuple[Mesh, ...]:
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
def test_a_mesh_is_found_by_its_name(tmp_path, name, place):
    for folder, package in (("some_folder", "held"), ("other", "beside")):
        manifest = put(tmp_path / "ws" / folder / "package.xml")
        manifest.write_text(f"<name>{package}</name>", "utf-8")
    (tmp_path / "ws/some_folder/urdf").mkdir()
    named = name.format(folder=tmp_path)
    put(tmp_path / (place or "ws/meshes/f.txt"))
    text = shaped(robot(link("base"), arm(6)), "link2", shape(named))
    found = load_robot(written(tmp_path / "ws/some_folder/urdf", text))
    (mesh,) = found.meshes
    assert (mesh.name, mesh.link) == (named, 2)
    if place is not None:
        assert mesh.file.resolve() == (tmp_path / place).resolve()
    said = [str(remark) for remark in found.remarks if remark.code == "meshes-not-found"]
    one = f"mesh files not found or not readable: 1, first {named}; simple shapes are drawn"
    assert said == ([one] if place is None else [])


def test_a_mesh_is_where_pinocchio_has_its_link(tmp_path):
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


def test_a_dae_without_triangles_cannot_be_shown(tmp_path):
    """Rerun reads nothing else of it; the collision shape is there instead."""
    (tmp_path / "a.dae").write_bytes(b"<COLLADA><polylist/></COLLADA>")
    put(tmp_path / "b.stl")
    (mesh,) = meshes_of(tmp_path, shape("a.dae") + shape("b.stl", kind="collision"))
    assert mesh.name == "b.stl"


def test_collision_shapes_replace_those_for_show_that_are_not_all_found(tmp_path):
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
def test_what_an_arm_looks_like_does_not_refuse_it(tmp_path, wrong):
    put(tmp_path / "a.stl")
    (mesh,) = meshes_of(tmp_path, wrong)
    assert mesh.file is None


def test_meshes_that_no_recording_has_room_for_are_left_out(tmp_path):
    """Files of holes: what counts is what would be read."""
    for name in ("a.stl", "b.stl"):
        with (tmp_path / name).open("wb") as file:
            file.truncate(LARGEST // 2 + 1)
    meshes = meshes_of(tmp_path, shape("a.stl") + shape("b.stl"))
    assert [bool(mesh.file) for mesh in meshes] == [True, False]


# Triangles of mesh files: one body in every format, and files that hold none


CORNERS = np.array([[0, 0, 0], [2, 0, 0], [0, 3, 0], [0, 0, 4]], dtype=float)
FACES = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])  # counter-clockwise from outside
BODY = CORNERS[FACES]
DAE = """<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema"><asset><unit meter="0.5"/>
<up_axis>Y_UP</up_axis></asset><library_geometries><geometry id="g"><mesh>
<source id="p"><float_array id="pa" count="12">{points}</float_array></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<triangles count="3" material="a"><input semantic="VERTEX" source="#v" offset="1"/>
<input semantic="NORMAL" source="#n" offset="0"/><p>{first}</p></triangles>
<triangles count="1" material="b"><input semantic="VERTEX" source="#v" offset="0"/>
<p>{second}</p></triangles></mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s"><node>{steps}<node><scale>2 2 2</scale>
<instance_geometry url="#g"/></node></node></visual_scene></library_visual_scenes></COLLADA>"""


def stl() -> bytes:
    rows = (struct.pack("<12fH", 0, 0, 1, *face.ravel(), 0) for face in BODY)
    return b"solid but of bytes".ljust(80) + struct.pack("<I", 4) + b"".join(rows)


def stl_text() -> bytes:
    lines = ("vertex {:e} {} {}\n".format(*corner) for corner in BODY.reshape(-1, 3))
    return "solid a\nfacet normal 0 0 1\nouter loop\n{}endsolid a".format("".join(lines)).encode()


def obj() -> bytes:
    """A corner is counted from the front or, below zero, from behind."""
    points = "".join("v {} {} {}\n".format(*corner) for corner in CORNERS)
    return f"# a\n{points}vn 0 0 1\nf 1/1/1 3//1 2\nf 1 2 -1\nf -4 4 3\nf 2 3 4\n".encode()


def dae(steps: str = "") -> bytes:
    first = " ".join(f"7 {corner}" for corner in FACES[:3].ravel())
    points, second = (" ".join(map(str, each.ravel())) for each in (CORNERS, FACES[3]))
    return DAE.format(points=points, first=first, second=second, steps=steps).encode()


def put_body(folder: Path, name: str, contents: bytes) -> Mesh:
    (folder / name).write_bytes(contents)
    return Mesh(name, folder / name, 1, IDENTITY, np.ones(3))


@pytest.mark.parametrize(
    ("name", "contents"),
    [("a.stl", stl()), ("b.STL", stl_text()), ("c.obj", obj()), ("d.dae", dae())],
)
def test_a_body_is_one_in_every_format(tmp_path, name, contents):
    """A DAE of half metres at double size is as large; its up axis is left as it is."""
    np.testing.assert_allclose(read_mesh(put_body(tmp_path, name, contents)), BODY, atol=1e-7)


def test_a_face_of_an_obj_is_a_fan(tmp_path):
    text = b"v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nf 1 2 3 4\nf 1 5 2\n"
    found = read_mesh(put_body(tmp_path, "a.obj", text))
    areas = np.linalg.norm(np.cross(found[:, 1] - found[:, 0], found[:, 2] - found[:, 0]), axis=1)
    np.testing.assert_allclose(areas, 1.0)  # twice that of half a square
    assert len(found) == 3


def test_the_nodes_of_a_dae_move_what_is_in_them(tmp_path):
    """Moved by (5, 6, 7) and turned about z by 90° in the file's half metres, then doubled."""
    turned = 2.0 * BODY @ rotation_about("z", 0.5 * np.pi).T + [5.0, 6.0, 7.0]
    for steps in (
        "<translate>5 6 7</translate><rotate>0 0 1 90</rotate>",
        "<matrix>0 -1 0 5 1 0 0 6 0 0 1 7 0 0 0 1</matrix>",
    ):
        found = read_mesh(put_body(tmp_path, "a.dae", dae(steps)))
        np.testing.assert_allclose(found, 0.5 * turned, atol=1e-12)


def volume(corners: np.ndarray) -> float:
    return float(np.linalg.det(corners).sum() / 6.0)


def test_triangles_face_outwards_where_a_body_is_mirrored_or_inside_out(tmp_path):
    """The tetrahedron's volume is 2·3·4/6, and its triangles count it with their sign."""
    pose = Pose(rotation_about("x", 0.3), np.array([9.0, 0.0, 0.0]))
    mesh = put_body(tmp_path, "a.stl", stl())._replace(pose=pose)
    assert volume(BODY) == pytest.approx(4.0)
    for scale in ([1.0, 1.0, 1.0], [1.0, -1.0, 1.0]):
        found = read_mesh(mesh._replace(scale=np.array(scale)))
        assert volume(found) == pytest.approx(4.0)
        placed = (CORNERS * scale) @ pose.rotation.T + pose.translation
        np.testing.assert_allclose(sorted(map(tuple, {*map(tuple, found.reshape(-1, 3))})),
                                   sorted(map(tuple, placed)), atol=1e-6)  # fmt: skip


NOWHERE = struct.pack("<12f", *[float("nan")] * 12) + b"\0\0"


@pytest.mark.parametrize(
    ("name", "contents"),
    [
        ("empty.stl", b""),
        ("none.stl", b"\0" * 84),
        ("words.stl", b"vertex a b c\n" * 3),
        ("two.stl", b"vertex 0 0 1\n" * 2),
        ("nowhere.stl", b"\0" * 80 + struct.pack("<I", 1) + NOWHERE),
        ("far.stl", b"vertex 1e300 0 0\nvertex 0 1e300 0\nvertex 0 0 1\n"),
        ("no_point.obj", b"f 1 2 3\n"),
        ("flat.obj", b"v 0 0\nv 1 0\nv 0 1\nf 1 2 3\n"),
        ("empty.dae", b""),
        ("other.dae", b"<COLLADA><triangles/></COLLADA>"),
        ("cut.dae", dae()[:-200]),
        ("lost.dae", dae().replace(b'source="#v"', b'source="#w"')),
        ("beyond.dae", dae().replace(b"<p>7 0", b"<p>7 99")),
        ("letters.dae", dae().replace(b"<p>7 0", b"<p>7 x")),
        ("short.dae", dae("<translate>5 6</translate>")),
        ("odd.dae", dae("<matrix>1 2 3</matrix>")),
        ("a.glb", b"glTF"),
    ],
)
def test_a_file_without_triangles_is_refused(tmp_path, name, contents):
    with pytest.raises(RobotError, match=name):
        read_mesh(put_body(tmp_path, name, contents))


def test_a_file_that_is_gone_is_refused(tmp_path):
    mesh = put_body(tmp_path, "a.stl", stl())
    (tmp_path / "a.stl").unlink()
    for lacking in (mesh, mesh._replace(file=None)):
        with pytest.raises(RobotError, match=r"a\.stl"):
            read_mesh(lacking)


@pytest.mark.parametrize("contents", [stl(), stl_text(), obj(), dae()])
def test_a_damaged_file_is_read_or_refused(tmp_path, contents):
    """Bytes cut off, left out or changed at random (seed 7), 60 files of each format."""
    rng, read = np.random.default_rng(7), 0
    for k in range(60):
        raw, at = bytearray(contents), int(rng.integers(len(contents)))
        if k % 3 == 0:
            raw = raw[:at]
        elif k % 3 == 1:
            raw[at] = int(rng.integers(256))
        else:
            del raw[at : at + 5]
        for ending in ("stl", "obj", "dae"):
            try:
                found = read_mesh(put_body(tmp_path, f"a.{ending}", bytes(raw)))
            except RobotError:
                continue
            read += 1
            assert found.shape[1:] == (3, 3)
            assert np.isfinite(found).all()
    assert read
