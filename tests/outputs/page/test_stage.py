import re
from dataclasses import replace

import numpy as np
import pytest

from vftcli.analysis import Analysis
from vftcli.contacts.contact_list import OF_FORCES, Contact
from vftcli.outputs.page import stage
from vftcli.outputs.page.packing import Blob, PageClock
from vftcli.outputs.page.shell import part
from vftcli.outputs.shapes import capsules
from vftcli.robots.chain import link_poses


def listing(analysis: Analysis, *contacts: Contact, **changed: object) -> Analysis:
    """The analysis with another list, of some contacts or otherwise changed."""
    changed |= {"contacts": contacts} if contacts else {}
    return replace(analysis, contacts=replace(analysis.contacts, **changed))


def staged(analysis: Analysis) -> dict:
    return stage.stage_data(analysis, stage.view_of(analysis), {}, PageClock(Blob(), analysis.t))


def numbers(path: str) -> np.ndarray:
    """Points of a path that has moves after its first."""
    points = np.array(re.findall(r"-?\d*\.?\d+", path), dtype=float).reshape(-1, 2)
    return np.cumsum(points, axis=0)


def test_the_camera_looks_level_along_y_or_down_on_the_floor() -> None:
    right, up, ahead = stage.axes_of(0.0, 0.0)
    np.testing.assert_allclose([right, up, ahead], [[1, 0, 0], [0, 0, 1], [0, 1, 0]])
    right, up, ahead = stage.axes_of(0.0, 0.5 * np.pi)
    np.testing.assert_allclose([right, up, ahead], [[1, 0, 0], [0, 1, 0], [0, 0, -1]], atol=1e-15)
    turned = stage.axes_of(0.7, 0.3)
    np.testing.assert_allclose(turned @ turned.T, np.eye(3), atol=1e-15)


def test_the_whole_log_is_in_view_and_the_arm_reaches_to_the_right(pushed: Analysis) -> None:
    view = stage.view_of(pushed)
    poses = link_poses(pushed.robot.chain, pushed.recording.q)
    seen = view.seen(poses.translation.reshape(-1, 3))
    assert seen[:, :2].min() > 0.0
    assert (seen[:, 0] < stage.WIDTH).all()
    assert (seen[:, 1] < stage.HEIGHT).all()
    flange, base = view.seen(poses.translation[:, -1]), view.seen(np.zeros((1, 3)))
    assert flange[:, 0].mean() > base[0, 0]


def test_an_arm_that_stands_upright_or_knows_no_pose_has_a_view(pushed: Analysis, as_if) -> None:
    for q in (np.zeros(6), np.full(6, np.nan)):
        log = replace(pushed.recording, q=np.tile(q, (len(pushed.t), 1)))
        view = stage.view_of(replace(as_if(pushed, log), contacts=None))
        assert np.isfinite([*view.centre, *view.span, view.yaw]).all()
        assert min(view.span) > 0.0


def test_an_arrow_ends_where_the_force_acts(pushed: Analysis) -> None:
    view, hardest = stage.view_of(pushed), pushed.contacts.hardest
    tail, tip = stage.arrow_of(pushed, hardest, view.reach)
    at = int(np.argmin(np.abs(pushed.t - hardest.peak)))
    poses = link_poses(pushed.robot.chain, pushed.recording.q[at : at + 1]).translation[0]
    np.testing.assert_allclose(tip, poses[-1], atol=2e-3)  # the peak is between two samples
    along = hardest.wrench[:3] / np.linalg.norm(hardest.wrench[:3])
    np.testing.assert_allclose(tip - tail, sum(stage.SHARES) * view.reach * along, rtol=1e-9)
    link = replace(hardest, places=(2, 3))
    _, tip = stage.arrow_of(pushed, link, view.reach)
    np.testing.assert_allclose(tip, 0.5 * (poses[2] + poses[3]), atol=2e-3)


def test_the_cone_is_that_of_the_band_across_a_force(pushed: Analysis) -> None:
    """Every axis known to ±s: across the force 1.96 s in each of two directions.

    Beyond 45°, where it is as long as the force, it is left out and said.
    """
    one = pushed.contacts.contacts[0]
    wrench = np.array([30.0, -40.0, 0.0, 0.0, 0.0, 0.0])
    even = replace(one, wrench=wrench, peak_force=50.0, wrench_sd=np.full(6, 5.0))
    assert stage.cone_of(even) == pytest.approx(np.arctan(1.96 * 5.0 / 50.0))
    along = replace(even, wrench=50.0 * np.eye(6)[0], wrench_sd=9.0 * np.eye(6)[0])
    assert stage.cone_of(along) == 0.0
    assert stage.cone_of(replace(even, wrench=None, wrench_sd=None)) == 0.0
    for half, words in ((49.0, ""), (51.0, " (± 46°)")):
        even = replace(along, wrench_sd=np.full(6, half / 1.96))
        (row,) = staged(listing(pushed, even))["contacts"]
        assert row["words"] == f"contact 1 · wrist · +x{words}"
        assert row["cone"] == (0 if words else pytest.approx(np.arctan(half / 50.0), abs=1e-3))


@pytest.mark.parametrize(("places", "hit"), [((0,), {6}), ((2, 3), {2, 3}), ((), set())])
def test_hit_links_are_marked(pushed: Analysis, places: tuple[int, ...], hit: set[int]) -> None:
    contact = replace(pushed.contacts.contacts[0], places=places)
    drawn = stage.still_arm(pushed, stage.view_of(pushed), contact)
    parts = sum(len(capsules(pushed.robot.chain)[frame]) for frame in hit)
    assert [kind for _, _, kind in drawn.parts].count("hit") == parts
    assert part("svg/still", drawn, "The arm", "9 N").count('class="shaft"') == 1
    (row,) = staged(listing(pushed, contact))["contacts"]
    assert row["frames"] == sorted(hit)
    assert tuple(row["spot"]) == ((3, 4) if 3 in hit else (7, 7))  # of a link both its ends


def test_the_drawing_holds_the_arm_and_its_arrow(pushed: Analysis) -> None:
    view = stage.view_of(pushed)
    for contact in pushed.contacts.contacts:
        drawn = stage.still_arm(pushed, view, contact)
        shaft, head = map(numbers, drawn.arrow)
        parts = (numbers(path) for path, *_ in drawn.parts)
        places = np.vstack([shaft, head, [drawn.label], *parts])
        assert places.min() > 0.0
        assert (places.max(axis=0) < (stage.WIDTH, stage.HEIGHT)).all()
    bare = replace(pushed.contacts.contacts[0], wrench=None)
    assert stage.still_arm(pushed, view, bare).arrow == []
    assert 'class="shaft"' not in part("svg/still", stage.still_arm(pushed, view, None), "x", "")


def test_the_free_part_is_the_first_round_and_nothing_is_claimed(pushed: Analysis) -> None:
    ((start, stop),) = stage.free_spans(pushed)
    np.testing.assert_allclose((start, stop), (0.0, 4.0), atol=0.02)  # a round of 4 s
    # What is only guessed is not called free.
    guessed, without = listing(pushed, basis="friction"), replace(pushed, contacts=None)
    assert stage.free_spans(guessed) == stage.free_spans(without) == []
    data = staged(without)
    assert (data["contacts"], data["none"]) == ([], ("–", "", ""))
    whole = staged(pushed)
    assert (whole["none"], whole["wrench"]) == (("< 2 N", "", "no contact"), {"flange": True})
    assert staged(guessed)["none"] == ("–", "", "no contact listed")


def test_what_touches_a_loaded_arm_comes_before_its_load(pushed: Analysis) -> None:
    first, *rest = pushed.contacts.contacts
    load = replace(first, is_load=True, start=0.0, stop=20.0)
    rows = staged(listing(pushed, load, *rest))["contacts"]
    assert [row["number"] for row in rows] == [*range(2, 13), 1]
    assert [row["weak"] for row in rows] == [each.trust == "weak" for each in (*rest, load)]
    assert [row["size"] for row in rows] == [round(each.peak_force, 2) for each in (*rest, load)]


def test_few_joints_have_contacts_without_a_force(pushed: Analysis) -> None:
    nothing = dict.fromkeys(OF_FORCES)
    bare = (replace(row, **nothing) for row in pushed.contacts.contacts)
    rows = staged(listing(pushed, *bare))["contacts"]
    assert {(row["size"], row["force"], row["sized"]) for row in rows} == {(None, "", False)}
