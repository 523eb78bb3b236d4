from pathlib import Path
from uuid import UUID

import numpy as np
import pytest
import rerun.chunk

from vftcli.outputs.plots import Lines, PlotLine, Tab
from vftcli.outputs.rerun_file import (
    drawable,
    finish,
    recording_id,
    rerun_file,
    send_force,
    turn_from_z,
)
from vftcli.signals.errors import OutputError


def lines(path: str, values: np.ndarray) -> Lines:
    shown = [PlotLine(f"line {k}", column, "#102030") for k, column in enumerate(values.T)]
    return Lines(path, "what [N]", shown)


def rows_of(path: Path, entity: str, ending: str) -> list:
    """All values of one component of an entity, in the order of the file."""
    found = []
    for chunk in rerun.chunk.RrdReader(str(path)).stream():
        if chunk.entity_path == entity:
            batch = chunk.to_record_batch()
            for name in batch.schema.names:
                if name.endswith(ending):
                    found += batch.column(name).to_pylist()
    return found


def test_plots_and_words_of_two_clocks_read_back(tmp_path: Path) -> None:
    first = np.arange(8.0).reshape(4, 2)
    tabs = [
        Tab("one", np.arange(4.0), [lines("/one", first)]),
        Tab("two", 0.5 * np.arange(3.0), [lines("/two", first[:3, :1])]),
    ]
    with rerun_file(tmp_path / "r.rrd", "名 title", tabs, {"Summary": "words → here"}):
        pass
    assert rows_of(tmp_path / "r.rrd", "/one", "Scalars:scalars") == first.tolist()
    assert len(rows_of(tmp_path / "r.rrd", "/two", "Scalars:scalars")) == 3
    (text,) = rows_of(tmp_path / "r.rrd", "/summary", "TextDocument:text")
    assert text == ["words -> here"]
    assert len(rerun.chunk.RrdReader(str(tmp_path / "r.rrd")).blueprints()) == 1


def test_an_unknown_force_has_no_arrow(tmp_path: Path) -> None:
    force = np.array([[2.0, 0.0, 0.0], [np.nan, 0.0, 0.0], [0.0, 0.0, -400.0]])
    with rerun_file(tmp_path / "r.rrd", "r", [], {"Summary": ""}) as stream:
        send_force(stream, "/force", np.arange(3.0), np.zeros((3, 3)), force, 0.01)
    # 200 N are a metre
    assert rows_of(tmp_path / "r.rrd", "/force", "Arrows3D:vectors") == [
        [[pytest.approx(0.01), 0.0, 0.0]],
        [],
        [[0.0, 0.0, -2.0]],
    ]


@pytest.mark.parametrize("axis", [(0, 0, 1), (0, 0, -1), (1, 0, 0), (0.6, 0, 0.8), (0, -0.6, -0.8)])
def test_capsules_point_where_they_should(axis: tuple[float, ...]) -> None:
    x, y, z, w = turn_from_z(np.array(axis, dtype=float))
    turned = [2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)]
    np.testing.assert_allclose(turned, axis, atol=1e-12)  # rounding


@pytest.mark.parametrize(
    ("text", "drawn"),
    [
        ("J2 [N·m] ±0.5 τ²", "J2 [N·m] ±0.5 τ²"),
        ("Jᵀ ≤ −1 → √2", "J^T <= -1 -> sqrt 2"),
        ("ṗ = μ", "p = μ"),
        ("日志.csv\t\x00", "??.csv??"),
        ("a\nb", "a\nb"),
    ],
)
def test_the_viewer_gets_letters_it_can_draw(text: str, drawn: str) -> None:
    """Viewer 0.41 stops at a letter its font lacks; Latin-1 and Greek were seen to be drawn."""
    assert drawable(text) == drawn


def test_a_recording_without_its_footer_is_no_recording(tmp_path: Path) -> None:
    """What a full disk leaves: Rerun's writer may end without an error."""

    class Stream:
        def flush(self) -> None: ...
        def disconnect(self) -> None: ...

    (tmp_path / "cut.rrd").write_bytes(b"RRF2" + bytes(1000))
    with pytest.raises(OutputError, match=r"cut\.rrd cannot be written whole"):
        finish(Stream(), tmp_path / "cut.rrd")


def test_a_recording_is_known_by_what_it_holds() -> None:
    """Equal data and words are one recording; another value, line or word is another."""
    t, ramp = np.arange(3.0), np.arange(3.0)

    def identity(values: np.ndarray = ramp, name: str = "gmo", text: str = "sha256 12") -> UUID:
        lines = Lines("/tau_ext/J1", "J1", [PlotLine(name, values, "#000000")])
        return recording_id("log", [Tab("Torque", t, [lines])], {"Summary": text})

    assert identity() == identity(ramp.copy())
    others = [identity(2 * ramp), identity(name="fdo"), identity(text="sha256 13")]
    assert len({identity(), *others}) == 4
