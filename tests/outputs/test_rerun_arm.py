"""Arms and forces in a Rerun recording, read back from the file."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from rerun_rows import rows_of

from vftcli.outputs.rerun_file import (
    LINK,
    LONGEST,
    MOST_POSES,
    Tab,
    arrow_scale,
    collada,
    motion,
    rerun_file,
    rgba,
    send_arm,
    send_force,
)
from vftcli.outputs.shapes import capsules
from vftcli.robots import load_robot
from vftcli.robots.chain import link_poses
from vftcli.robots.robot import Mesh
from vftcli.signals.pose import Pose, rotation_about

ROBOT = load_robot("ur5")
UR5 = ROBOT.chain
POSES = motion(UR5, np.linspace(0.0, 4.0, 201), np.zeros((201, 6)))


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "r.rrd"


def opened(path: Path) -> Any:
    """A recording that nothing is plotted in."""
    return rerun_file(path, "r", [Tab("none", [])], {"Summary": ""}, POSES, "Arm")


def test_an_unknown_force_has_no_arrow(path: Path) -> None:
    force = np.array([[2.0, 0.0, 0.0], [np.nan, 0.0, 0.0], [0.0, 0.0, -400.0]])
    with opened(path) as stream:
        send_force(stream, "/force", np.arange(3.0), np.zeros((3, 3)), force)
    along, down = [[pytest.approx(0.01), 0.0, 0.0]], [[0.0, 0.0, -2.0]]  # 200 N are a metre
    assert rows_of(path, "/force", "Arrows3D:vectors") == [along, [], down]
    radii = np.concatenate(rows_of(path, "/force", "Arrows3D:radii"))
    assert 0.005 < radii.min() == radii.max() < 0.03  # thinner than a link, seen beside it


def test_the_hardest_force_fits() -> None:
    hardest = (SimpleNamespace(peak_force=force) for force in (2.0, 90.0, 1e6))
    scales = [arrow_scale(SimpleNamespace(hardest=contact)) for contact in hardest]
    assert scales == [5.0, 200.0, 2000.0]
    assert LONGEST * 200.0 >= 90.0


def test_a_link_is_painted_while_it_is_touched(path: Path) -> None:
    """Its own colour, then that of the span, then its own again; other links keep theirs."""
    painted = {2: {1.0: "#dd6415", 2.0: ""}}
    with opened(path) as stream:
        send_arm(stream, ROBOT, POSES, painted)

    def colours(link: int) -> list[list[int]]:
        return rows_of(path, f"/robot/link_{link}", "Capsules3D:colors")

    found = [row for row in colours(2) if row is not None]
    assert len(found) == 3
    assert set(found[1]) == {rgba("#dd6415")[0]}
    assert found[0] == found[2]
    assert list(rgba("#0c9fff", "#9cf00a")) == [0x0C9FFFFF, 0x9CF00AFF]
    assert rgba(LINK)[0] in found[0]
    (still,) = [row for row in colours(3) if row is not None]
    assert rgba("#dd6415")[0] not in still
    # Rerun's capsules lie along z of their own axes.
    (turns,) = rows_of(path, "/robot/link_2", "Capsules3D:quaternions")
    for (x, y, z, w), shape in zip(turns, capsules(UR5)[2], strict=True):
        turned = [2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)]
        unit = shape.direction / np.linalg.norm(shape.direction)
        np.testing.assert_allclose(turned, unit, atol=1e-6)  # Rerun holds them in float32


def test_meshes_are_the_arm_where_all_of_a_link_are_found(tmp_path: Path, path: Path) -> None:
    """They are in the recording once, where they are on the link; else its capsules are too."""
    file, pose = tmp_path / "a.stl", Pose(rotation_about("z", 0.5 * np.pi), np.array([0.1, 0, 0]))
    file.write_bytes(b"\0" * 84)
    whole = Mesh("a.stl", file, 2, pose, np.array([1.0, 2.0, 3.0]))
    coloured = whole._replace(link=3, file=tmp_path / "b.dae")
    (tmp_path / "b.dae").write_bytes(b'<COLLADA><unit meter="0.5"/></COLLADA>')
    gone = whole._replace(link=4, file=tmp_path / "gone.stl")
    meshes = (whole, coloured, gone, whole._replace(link=5), whole._replace(link=5, file=None))
    painted = {link: {1.0: "#dd6415", 2.0: ""} for link in (2, 3)}
    with opened(path) as stream:
        send_arm(stream, replace(ROBOT, meshes=meshes), POSES, painted)
    capsules_of = [rows_of(path, f"/robot/link_{j}", "Capsules3D:lengths") for j in range(1, 7)]
    assert list(map(bool, capsules_of)) == [True, False, False, True, True, True]
    (blob,) = rows_of(path, "/robot/link_2/mesh_0", "Asset3D:blob")
    assert bytes(blob[0]) == file.read_bytes()
    assert rows_of(path, "/robot/link_5/mesh_0", "Asset3D:media_type") == [["model/stl"]]
    ((matrix,),) = rows_of(path, "/robot/link_2/mesh_0", "Transform3D:mat3x3")
    ((place,),) = rows_of(path, "/robot/link_2/mesh_0", "Transform3D:translation")
    assert place == [pytest.approx(0.1), 0.0, 0.0]
    # Columns: the file's x goes to y, its y, of double size, to −x.
    np.testing.assert_allclose(matrix, [0, 1, 0, -2, 0, 0, 0, 0, 3], atol=1e-7)  # float32
    ((half,),) = rows_of(path, "/robot/link_3/mesh_0", "Transform3D:mat3x3")
    np.testing.assert_allclose(half, np.array(matrix) / 2, atol=1e-7)
    orange, own = [int(rgba("#dd6415")[0])], [int(rgba(LINK)[0])]
    for name, unpainted in (("link_2", own), ("link_3", [])):  # a DAE has colours of its own
        colours = rows_of(path, f"/robot/{name}/mesh_0", "Asset3D:albedo_factor")
        assert [c for c in colours if c is not None] == [unpainted, orange, unpainted]
    assert rows_of(path, "/robot/link_5/mesh_0", "Asset3D:albedo_factor") == [own]


@pytest.mark.parametrize(("head", "unit"), [
    ('<unit name="mm" meter="0.001"/><up_axis>Y_UP</up_axis>', 0.001),
    ("<unit meter = '0.0254' name='inch'></unit><up_axis> X_UP</up_axis>", 0.0254),
    ("<up_axis>Z_UP</up_axis>", 1.0),
    ('<unit meter="x"/>', 1.0),
    ('<unit meter="nan"/>', 1.0),
    ('<unit meter="0"/>', 1.0),
])  # fmt: skip
def test_a_dae_is_in_metres_with_z_up(head: str, unit: float) -> None:
    """As ROS has it: RViz leaves a file's up axis out and takes its unit."""
    found, metres = collada(f"<asset>{head}</asset><p>Y_UP</p>".encode())
    assert metres == unit
    assert b"<p>Y_UP</p>" in found
    assert b"Y_UP</up" not in found
    assert b"X_UP" not in found
    assert (b"meter" in found) == ("meter" in head)
    assert collada(found) == (found, 1.0)


def test_motion_follows_the_log_at_its_rate_and_of_a_long_one_draws_few_poses() -> None:
    chain = load_robot("panda").chain
    t = 0.001 * np.arange(5000)
    q = np.sin(t[:, None] * np.arange(1, 8))
    poses = motion(chain, t, q)
    np.testing.assert_allclose(np.diff(poses.t), 0.02, atol=1e-9)
    np.testing.assert_array_equal(poses.translation, link_poses(chain, q[::20]).translation)
    t = 0.02 * np.arange(50_001)  # 1000 s at the rate that is drawn
    poses = motion(chain, t, np.zeros((len(t), chain.joints)))
    assert MOST_POSES / 2 < len(poses.t) <= MOST_POSES
