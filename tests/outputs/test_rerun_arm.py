"""Arms and forces in a Rerun recording, read back from the file."""

from pathlib import Path

import numpy as np
import pytest
from rerun_rows import rows_of

from vftcli.outputs.arm import motion
from vftcli.outputs.palette import rgb
from vftcli.outputs.rerun_arm import (
    LINK,
    LONGEST,
    PaintedSpan,
    arrow_scale,
    send_arm,
    send_force,
    turn_from_z,
)
from vftcli.outputs.rerun_file import rerun_file
from vftcli.robots import load_robot


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


@pytest.mark.parametrize(("hardest", "scale"), [(2.0, 5.0), (90.0, 200.0), (1e6, 2000.0)])
def test_the_hardest_force_fits(hardest: float, scale: float) -> None:
    assert arrow_scale(hardest) == scale
    assert hardest <= LONGEST * scale or scale == 2000.0


def test_a_link_is_painted_while_it_is_touched(tmp_path: Path) -> None:
    """Its own colour, then that of the span, then its own again; other links keep theirs."""
    chain, t = load_robot("ur5").chain, np.linspace(0.0, 4.0, 201)
    poses = motion(chain, t, np.zeros((201, 6)))
    painted = {2: [PaintedSpan(1.0, 2.0, "#dd6415")]}
    with rerun_file(tmp_path / "r.rrd", "r", [], {"Summary": ""}) as stream:
        send_arm(stream, "/robot", chain, poses, painted=painted)

    def colours(link: int) -> list[list[int]]:
        return rows_of(tmp_path / "r.rrd", f"/robot/link_{link}", "Capsules3D:colors")

    def word(colour: str) -> int:
        red, green, blue = rgb(colour)
        return (red << 24) | (green << 16) | (blue << 8) | 255

    found = [row for row in colours(2) if row is not None]
    assert len(found) == 3
    assert set(found[1]) == {word("#dd6415")}
    assert found[0] == found[2]
    assert word(LINK) in found[0]
    (still,) = [row for row in colours(3) if row is not None]
    assert word("#dd6415") not in still
