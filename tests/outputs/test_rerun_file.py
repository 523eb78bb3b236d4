import subprocess
import sys
from pathlib import Path
from uuid import UUID

import numpy as np
import pytest
import rerun.chunk
from rerun_rows import rows_of

from vftcli.outputs.charts import Chart, ChartLine
from vftcli.outputs.rerun_file import (
    ArmPoses,
    LogLine,
    Tab,
    blueprint,
    drawable,
    grid_of,
    recording_id,
    rerun_file,
)

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
