from pathlib import Path

import numpy as np
import rerun.chunk

from vftcli.admittance.replay import Replay
from vftcli.outputs.admittance.recording import colours, entering_force, line_groups, write_ghosts
from vftcli.outputs.palette import REFERENCE


def test_every_controller_has_its_arm_its_path_and_its_force(push: Replay, tmp_path: Path) -> None:
    write_ghosts(tmp_path / "r.rrd", push, "push")
    stream = rerun.chunk.RrdReader(str(tmp_path / "r.rrd")).stream()
    entities = {chunk.entity_path for chunk in stream}
    for n, controller in enumerate(push.controllers):
        base = f"/robot/{n}_{controller.name}".replace(" ", "")
        found = {entity.replace("\\", "") for entity in entities}
        assert {f"{base}/path", f"{base}/force", f"{base}/link_6"} <= found
    assert {"/deviation/x", "/force/rz", "/summary"} <= entities


def test_the_arrow_is_the_force_that_enters_the_law(push: Replay) -> None:
    """Below the threshold nothing enters; a hard threshold lets the whole 24 N in."""
    force = entering_force(push, np.array([0.5, 1.3, 3.0]))
    np.testing.assert_allclose(force, [[0, 0, 0], [0, 24.0, 0], [0, 0, 0]])


def test_a_release_has_no_force(release: Replay) -> None:
    np.testing.assert_array_equal(entering_force(release, np.array([0.0, 1.0])), np.zeros((2, 3)))


def test_the_traditional_controller_is_grey(push: Replay) -> None:
    paint = dict(zip([c.kind for c in push.controllers], colours(push, REFERENCE), strict=True))
    assert paint["traditional"] == REFERENCE
    assert paint["variable"] != REFERENCE


def test_plots_bear_units_and_thresholds(push: Replay) -> None:
    groups = line_groups(push, colours(push, REFERENCE))
    assert [lines.title for lines in groups["Deviation"]][2:4] == [
        "z deviation [m]",
        "rx deviation [rad]",
    ]
    force = groups["Force"][5]
    assert force.title.endswith("[N·m]")
    assert force.values[0, 1:].tolist() == [6.0, -6.0]
