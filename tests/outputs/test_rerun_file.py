import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from uuid import UUID

import numpy as np
import pytest
import rerun.chunk
from rerun_rows import rows_of

from vftcli.outputs.charts import Chart, ChartLine
from vftcli.outputs.rerun_file import (
    LINK,
    LONGEST,
    MOST_POSES,
    ArmPoses,
    LogLine,
    Tab,
    arrow_scale,
    blueprint,
    collada,
    drawable,
    grid_of,
    motion,
    recording_id,
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

POSES = ArmPoses(np.zeros(1), np.ones((1, 2, 3)), np.ones((1, 2, 4)), np.zeros((1, 1)))


def plot(path: str, values: np.ndarray, step: float = 1.0, *, family: int = 0) -> Chart:
    """A plot of one line a column; 0 is no family."""
    shown = [ChartLine(f"line {k}", x[:, None], "#102030") for k, x in enumerate(values.T)]
    t = step * np.arange(float(len(values)))
    return Chart(path, "what", ("N",), ("",), t, tuple(shown), (family,) * (family > 0))


def written(folder: Path, *tabs: Tab) -> Path:
    words, path = {"Summary": "words → here"}, folder / "r.rrd"
    with rerun_file(path, "名 title", tabs, words, POSES, "Arm"):
        return path


def test_plots_and_words_of_two_clocks_read_back(tmp_path: Path) -> None:
    first = np.arange(8.0).reshape(4, 2)
    tabs = [Tab("one", [plot("/one", first)]), Tab("two", [plot("/two", first[:3, :1], 0.5)])]
    path = written(tmp_path, *tabs)
    assert rows_of(path, "/one", "Scalars:scalars") == first.tolist()
    assert len(rows_of(path, "/two", "Scalars:scalars")) == 3
    assert rows_of(path, "/summary", "TextDocument:text") == [["words -> here"]]
    assert len(rerun.chunk.RrdReader(str(path)).blueprints()) == 1


def test_the_viewer_gets_letters_it_can_draw() -> None:
    """Viewer 0.41 stops at a letter its font lacks; Latin-1 and Greek were seen to be drawn."""
    drawn = {
        "J2 [N·m] ±0.5 τ²": "J2 [N·m] ±0.5 τ²", "Jᵀ ≤ −1 → √2": "J^T <= -1 -> sqrt 2",
        "ṗ = μ": "p = μ", "日志.csv\t\x00": "??.csv??", "a\nb": "a\nb",
    }  # fmt: skip
    assert {text: drawable(text) for text in drawn} == drawn


def test_points_and_a_log_stand_beside_the_lines(tmp_path: Path) -> None:
    """Points have a clock of their own; lines of a log are sorted, whatever order they come in."""
    peaks = ChartLine("peaks", np.array([[7.0]]), "#102030", x=np.array([0.5]))
    force = plot("/force", np.arange(4.0)[:, None])
    force = force._replace(series=(*force.series, peaks))
    log = [
        LogLine("/contacts/2", 2.0, "second → end", "#102030"),
        LogLine("/remarks", 3.0, "last", "#102030", "WARN"),
        LogLine("/remarks", 1.0, "first", "#102030"),
    ]
    path = written(tmp_path, Tab("one", [force], log))
    found = rows_of(path, "/force", "Scalars:scalars")
    assert np.ravel(found).tolist() == [0.0, 1.0, 2.0, 3.0]
    assert rows_of(path, "/force/points", "Scalars:scalars") == [[7.0]]
    assert rows_of(path, "/contacts/2", "TextLog:text") == [["second -> end"]]
    assert rows_of(path, "/remarks", "TextLog:text") == [["first"], ["last"]]


def test_the_eye_sees_the_base_and_all_places_of_the_links() -> None:
    """A box of .4 x .8 x 1 m from the floor: half its diagonal is .6708 m, 2.3 of them away."""
    places = np.array([[[0.2, -0.4, 0.6], [-0.2, 0.4, 1.0]]])
    made = blueprint([], {"Summary": ""}, POSES._replace(translation=places), "Arm")
    eye = made.root_container.contents[0].contents[0].properties["EyeControls3D"]
    (place,), (aim,) = (x.as_arrow_array().to_pylist() for x in (eye.position, eye.look_target))
    np.testing.assert_allclose(aim, [0.0, 0.0, 0.5])
    away = 2.3 * 0.6708 * np.array([0.62, -0.66, 0.42])
    np.testing.assert_allclose(np.subtract(place, aim), away, atol=1e-4)


def test_plots_of_a_family_have_one_axis_and_show_points_too() -> None:
    small, large = (plot("/a", np.array([[0.0], [x], [5.0]]), family=1) for x in (1.0, 10.0))
    alone = plot("/b", np.array([[0.0], [1.0]]))
    peak = ChartLine("peaks", np.array([[20.0]]), "#102030", x=np.array([1.0]))
    pointed = alone._replace(series=(*alone.series, peak), units=("m",))
    names = [view.name for view in grid_of(Tab("all", [small, large, alone, pointed])).contents]
    # A twentieth of what is shown on either side.
    ends = ["[N], -0.5 to 10.5"] * 2 + ["[N], -0.05 to 1.05", "[m], -1 to 21"]
    assert names == [f"what {end}" for end in ends]
    few = [view.name for view in grid_of(Tab("few", [small, large, alone])).contents]
    assert few == ["what [N]"] * 3  # only small plots need it


FULL = """
import resource, sys
from pathlib import Path
import numpy as np
from vftcli.outputs.charts import Chart, ChartLine, Span
from vftcli.outputs.rerun_file import ArmPoses, Tab, rerun_file
from vftcli.signals.errors import OutputError
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[2]),) * 2)
values = np.random.default_rng(1).normal(size=(20000, 1))
line, t = ChartLine("line", values, "#102030"), np.arange(20000.0)
tab = Tab("one", [Chart("/one", "what", ("N",), ("",), t, (line,))])
poses = ArmPoses(np.zeros(1), np.ones((1, 2, 3)), np.ones((1, 2, 4)), np.zeros((1, 1)))
try:
    with rerun_file(Path(sys.argv[1]), "r", [tab], {"S": "w"}, poses, "Arm"):
        pass
except OutputError as error:
    print(error)
"""
"""Write a recording of 300 kB where a file may have so many bytes."""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="Windows limits no file's size")
@pytest.mark.parametrize("room", [4096, 60_000])
def test_a_full_disk_is_one_error_at_once_and_no_more(tmp_path: Path, room: int) -> None:
    """Rerun's own writer logged four lines and was waited for without end, its output piped."""
    script = [sys.executable, "-c", FULL, str(tmp_path / "r.rrd"), str(room)]
    ended = subprocess.run(script, capture_output=True, text=True, timeout=60, check=False)
    said = "r.rrd cannot be written: file too large; give another -o\n"
    assert (ended.stdout, ended.stderr) == (said, "")


def test_a_recording_is_known_by_what_it_holds() -> None:
    """Equal data and words are one recording; another value, line or word is another."""
    ramp = np.arange(3.0)[:, None]

    def identity(values: np.ndarray = ramp, name: str = "gmo", text: str = "sha256 12") -> UUID:
        line = ChartLine(name, values, "#000000")
        one = plot("/tau_ext/J1", ramp)._replace(series=(line,))
        return recording_id("log", [Tab("Torque", [one])], {"Summary": text})

    assert identity() == identity(ramp.copy())
    others = [identity(2 * ramp), identity(name="fdo"), identity(text="sha256 13")]
    assert len({identity(), *others}) == 4


# The arm and its forces.

ROBOT = load_robot("ur5")
UR5 = ROBOT.chain
AT_REST = motion(UR5, np.linspace(0.0, 4.0, 201), np.zeros((201, 6)))


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "r.rrd"


def opened(path: Path) -> Any:
    """A recording that nothing is plotted in."""
    return rerun_file(path, "r", [Tab("none", [])], {"Summary": ""}, AT_REST, "Arm")


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
        send_arm(stream, ROBOT, AT_REST, painted)

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
        send_arm(stream, replace(ROBOT, meshes=meshes), AT_REST, painted)
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
