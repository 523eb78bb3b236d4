"""Triangles of mesh files: one body in every format, and files that hold none."""

import struct
from pathlib import Path

import numpy as np
import pytest

from vftcli.robots.meshes import read_mesh
from vftcli.robots.robot import Mesh
from vftcli.signals.errors import RobotError
from vftcli.signals.pose import IDENTITY, Pose, rotation_about

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


def put(folder: Path, name: str, contents: bytes) -> Mesh:
    (folder / name).write_bytes(contents)
    return Mesh(name, folder / name, 1, IDENTITY, np.ones(3))


@pytest.mark.parametrize(
    ("name", "contents"),
    [("a.stl", stl()), ("b.STL", stl_text()), ("c.obj", obj()), ("d.dae", dae())],
)
def test_a_body_is_one_in_every_format(tmp_path: Path, name: str, contents: bytes) -> None:
    """A DAE of half metres at double size is as large; its up axis is left as it is."""
    np.testing.assert_allclose(read_mesh(put(tmp_path, name, contents)), BODY, atol=1e-7)


def test_a_face_of_an_obj_is_a_fan(tmp_path: Path) -> None:
    text = b"v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nf 1 2 3 4\nf 1 5 2\n"
    found = read_mesh(put(tmp_path, "a.obj", text))
    areas = np.linalg.norm(np.cross(found[:, 1] - found[:, 0], found[:, 2] - found[:, 0]), axis=1)
    np.testing.assert_allclose(areas, 1.0)  # twice that of half a square
    assert len(found) == 3


def test_the_nodes_of_a_dae_move_what_is_in_them(tmp_path: Path) -> None:
    """Moved by (5, 6, 7) and turned about z by 90° in the file's half metres, then doubled."""
    turned = 2.0 * BODY @ rotation_about("z", 0.5 * np.pi).T + [5.0, 6.0, 7.0]
    for steps in (
        "<translate>5 6 7</translate><rotate>0 0 1 90</rotate>",
        "<matrix>0 -1 0 5 1 0 0 6 0 0 1 7 0 0 0 1</matrix>",
    ):
        found = read_mesh(put(tmp_path, "a.dae", dae(steps)))
        np.testing.assert_allclose(found, 0.5 * turned, atol=1e-12)


def volume(corners: np.ndarray) -> float:
    return float(np.linalg.det(corners).sum() / 6.0)


def test_triangles_face_outwards_where_a_body_is_mirrored_or_inside_out(tmp_path: Path) -> None:
    """The tetrahedron's volume is 2·3·4/6, and its triangles count it with their sign."""
    pose = Pose(rotation_about("x", 0.3), np.array([9.0, 0.0, 0.0]))
    mesh = put(tmp_path, "a.stl", stl())._replace(pose=pose)
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
def test_a_file_without_triangles_is_refused(tmp_path: Path, name: str, contents: bytes) -> None:
    with pytest.raises(RobotError, match=name):
        read_mesh(put(tmp_path, name, contents))


def test_a_file_that_is_gone_is_refused(tmp_path: Path) -> None:
    mesh = put(tmp_path, "a.stl", stl())
    (tmp_path / "a.stl").unlink()
    for lacking in (mesh, mesh._replace(file=None)):
        with pytest.raises(RobotError, match=r"a\.stl"):
            read_mesh(lacking)


@pytest.mark.parametrize("contents", [stl(), stl_text(), obj(), dae()])
def test_a_damaged_file_is_read_or_refused(tmp_path: Path, contents: bytes) -> None:
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
                found = read_mesh(put(tmp_path, f"a.{ending}", bytes(raw)))
            except RobotError:
                continue
            read += 1
            assert found.shape[1:] == (3, 3)
            assert np.isfinite(found).all()
    assert read
