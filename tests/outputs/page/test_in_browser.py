"""The pages in a real browser: one moment everywhere, by pointer and keys, on paper, without JS."""

import csv
import io
import re
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from example_logs import BEARING
from made_runs import analyse_log
from test_shapes import sphere

from vftcli.analysis import Analysis
from vftcli.outputs.believability import log_line
from vftcli.outputs.charts import Chart, ChartLine
from vftcli.outputs.page import shell
from vftcli.outputs.page.pages import render, render_logs
from vftcli.outputs.page.shell import part
from vftcli.outputs.page.stage import HEIGHT, WIDTH, arrow_of, pose_at, view_of
from vftcli.outputs.shapes import capsules
from vftcli.pipeline import AnalysisChoice
from vftcli.robots import RobotChoice
from vftcli.robots.chain import link_poses
from vftcli.robots.robot import Mesh
from vftcli.signals.pose import IDENTITY

FOCUSED = """() => { const x = document.activeElement; const style = getComputedStyle(x);
  return { words: x.textContent.trim(), id: x.id, tag: x.tagName,
           seen: style.outlineStyle !== "none" } }"""
#: Contrast of every text with what is behind it, the least first. (WCAG 2.2, 1.4.3)
CONTRASTS = """() => {
  const parse = (text) => (text.match(/[\\d.]+/g) || []).map(Number);
  const light = ([r, g, b]) => [r, g, b].map((v) => { v /= 255;
    return v <= .04045 ? v / 12.92 : ((v + .055) / 1.055) ** 2.4; })
    .reduce((sum, v, k) => sum + v * [.2126, .7152, .0722][k], 0);
  const behind = (x) => { for (; x; x = x.parentElement) {
    const colour = parse(getComputedStyle(x).backgroundColor);
    if (colour.length === 3 || colour[3] === 1) return colour; } return [255, 255, 255]; };
  const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT), found = [];
  for (let at = walker.nextNode(); at; at = walker.nextNode()) {
    const x = at.parentElement;
    if (!at.data.trim() || !x.checkVisibility() || x.closest("svg, script, style")) continue;
    const [a, b] = [light(parse(getComputedStyle(x).color)), light(behind(x))].sort();
    found.push([(b + .05) / (a + .05), at.data.trim().slice(0, 40)]);
  }
  return found.sort(([a], [b]) => a - b).slice(0, 5);
}"""


@pytest.fixture(scope="module")
def html(pushed: Analysis) -> str:
    return render(pushed, {"estimates.parquet": 1000})


def live(tab: Any) -> Any:
    """The page when its script has unpacked the data."""
    tab.page.wait_for_selector("html.js")
    tab.page.wait_for_timeout(50)  # a frame or two
    return tab.page


def number(page: Any) -> str:
    """The large number beside the arm."""
    return " ".join(page.locator(".now b").inner_text().split())


@pytest.fixture
def page(opened: Callable, html: str) -> Any:
    return live(opened(html))


def click(page: Any, place: str) -> None:
    page.locator(place).click()
    page.wait_for_timeout(60)


def pointed(page: Any, x: float, y: float) -> None:
    page.mouse.move(x, y)
    page.wait_for_timeout(60)


def said(page: Any) -> str:
    """What stands beside the large number: the contact."""
    return page.locator(".now span").inner_text()


def settled(page: Any) -> None:
    """Wait until nothing glides."""
    page.wait_for_function("() => !vftcli.clock.way")
    page.wait_for_timeout(50)


def place_of(page: Any, chart: str, t: float, panel: int = 0) -> tuple[float, float]:
    """Where a time is on a panel, in the window."""
    figure = page.locator(f"{chart} .box").nth(panel)
    figure.scroll_into_view_if_needed()
    box = figure.bounding_box()
    low, high = page.evaluate("vftcli.clock.view")
    # Numbers take 44 pixels on the left, 10 are free on the right.
    x = box["x"] + 44 + (t - low) / (high - low) * (box["width"] - 54)
    return x, box["y"] + box["height"] / 2


@pytest.mark.slow
@pytest.mark.parametrize("name", ["pushed", "analysis", "with_wrench", "touched", "unlisted"])
def test_nothing_is_asked_for_and_everything_is_drawn(opened, request, name, without_reference):
    unlisted = replace(without_reference, contacts=None, virtual_sensor=None)
    text = render(unlisted if name == "unlisted" else request.getfixturevalue(name))
    words = text.partition('<script type="module">')[0]
    assert not re.search(r"(?<![\w+/])NaN(?![\w+/])", words)  # base64 may hold its letters
    assert "{{" not in text
    tab = opened(text)
    asked: list[str] = []
    tab.page.on("request", lambda request: asked.append(request.url))
    tab.page.reload()
    page = live(tab)
    tab.unfold()
    page.wait_for_timeout(100)
    assert tab.blank_charts() == []
    assert tab.errors == []
    assert [url for url in asked if not url.startswith("blob:")] == [page.url]


def test_the_page_is_small(html: str) -> None:
    """20 s of five observers and a reference, with script and style."""
    assert len(html.encode()) <= 400_000


def test_it_opens_at_the_hardest_contact(page: Any, pushed: Analysis) -> None:
    assert number(page) == "91 ± 7 N"
    assert number(page) in " ".join(page.locator("h1").inner_text().split())
    (row,) = page.locator("tr[aria-current]").all()
    assert "91 ± 7 N" in row.inner_text()
    t, peak = pushed.recording.t, pushed.contacts.contacts[0].peak
    assert page.locator("#clock").inner_text() == f"{t[abs(t - peak).argmin()]:.2f} s"


@pytest.mark.slow
def test_a_row_goes_there_everywhere(page: Any, pushed: Analysis) -> None:
    rows = page.locator(".contacts tbody tr")
    assert rows.count() == len(pushed.contacts.contacts)
    for k, contact in enumerate(pushed.contacts.contacts):
        rows.nth(k).click()
        settled(page)
        assert number(page) == " ".join(rows.nth(k).locator(".force").inner_text().split())
        assert page.evaluate("vftcli.clock.head") == pytest.approx(contact.peak, abs=0.0041)
        (current,) = page.locator("tr[aria-current]").all()
        assert current.get_attribute("id") == f"contact-{contact.number}"


@pytest.mark.slow
@pytest.mark.parametrize("name", ["pushed", "recording_of_a_panda"])
def test_the_arm_has_poses(opened: Callable, request: pytest.FixtureRequest, name: str) -> None:
    """At 20 times, within 1 mm: positions are held to 2e-4 rad."""
    analysis: Analysis = request.getfixturevalue(name)
    page = live(opened(render(analysis)))
    samples = np.linspace(0, len(analysis.t) - 1, 20).astype(int)
    poses = link_poses(analysis.robot.chain, analysis.recording.q[samples])
    asked = "times => times.map((t) => vftcli.arm.poses(t))"
    found = page.evaluate(asked, analysis.t[samples].tolist())
    for k in range(len(samples)):
        origins = np.array([origin for _, origin in found[k]])[1:]
        np.testing.assert_allclose(origins, poses.translation[k], atol=1e-3)
        rotations = np.array([turned for turned, _ in found[k]])[1:].reshape(-1, 3, 3)
        # Seven joints, half a step of 2e-4 rad each.
        np.testing.assert_allclose(rotations, poses.rotation[k], atol=7e-4)


@pytest.fixture(scope="session")
def recording_of_a_panda() -> Analysis:
    """Seven joints of the simulated Panda that lifts a bearing."""
    return analyse_log(BEARING, AnalysisChoice(robot=RobotChoice(name="panda"), contacts=False))


#: Calls of the canvas in a frame of play: of the charts, and of the arm with what goes along.
CALLS = """() => {
  const { clock } = vftcli, own = CanvasRenderingContext2D.prototype, kept = {};
  let calls = 0;
  for (const name of Object.getOwnPropertyNames(own)) {
    if (typeof Object.getOwnPropertyDescriptor(own, name).value !== "function") continue;
    kept[name] = own[name];
    own[name] = function (...a) { calls++; return kept[name].apply(this, a); };
  }
  clock.head = 5;
  for (const plot of clock.plots) plot.draw(1);
  const charts = calls;
  clock.moved();
  Object.assign(own, kept);
  return [charts, calls - charts];
}"""

#: Draws and gives every stroke: its width, and of each piece of it the points on the canvas.
STROKES = """() => {
  const found = [], own = CanvasRenderingContext2D.prototype, kept = {};
  let pieces = [];
  const hook = (name, act) => { kept[name] = own[name]; own[name] = function (...a) {
    act(this, a); return kept[name].apply(this, a); }; };
  hook("beginPath", () => { pieces = []; });
  hook("moveTo", (c, a) => pieces.push([a]));
  hook("lineTo", (c, a) => pieces.at(-1)?.push(a));
  hook("stroke", (c) => found.push([c.lineWidth, pieces]));
  DRAW;
  Object.assign(own, kept);
  return found;
}"""


@pytest.fixture(scope="module")
def shaped(pushed: Analysis, as_if: Callable, tmp_path_factory) -> Analysis:
    """The log on an arm of seven meshes of 400 triangles, and an eighth that is not there."""
    file = tmp_path_factory.mktemp("mesh") / "ball.stl"
    file.write_text("\n".join("vertex {} {} {}".format(*x) for x in sphere(0.06).reshape(-1, 3)))
    ball = Mesh("ball.stl", file, 0, IDENTITY, np.ones(3))
    gone = ball._replace(link=6, name="package://gone/wrist.stl", file=None)
    made, robot = as_if(pushed, pushed.recording), pushed.robot
    meshes = (*(ball._replace(link=link) for link in range(6)), gone)
    log = replace(made.motion.log, robot=replace(robot, meshes=meshes))
    return replace(made, motion=replace(made.motion, log=log))


#: Draws the arm: the corners of every triangle, the farthest first, and the number of capsules.
TRIANGLES = """() => {
  const found = [], { arm } = vftcli;
  let capsules = 0;
  Object.assign(arm, { triangle: (one) => found.push(one.seen), capsule: () => { capsules++; } });
  arm.draw();
  delete arm.triangle;
  delete arm.capsule;
  return { found, capsules, size: [arm.canvas.clientWidth, arm.canvas.clientHeight] };
}"""


@pytest.mark.slow
def test_meshes_are_drawn_where_the_links_are(opened: Callable, shaped: Analysis) -> None:
    """Balls of 6 cm about the origins of the links; the link without its file is capsules."""
    html = render(shaped)
    assert html.count("package://gone/wrist.stl; simple shapes are drawn") == 1
    drawn = live(opened(html, reduced_motion="reduce")).evaluate(TRIANGLES)
    assert drawn["capsules"] == len(capsules(shaped.robot.chain)[6])
    corners = np.array(drawn["found"])
    assert 6 * 100 < len(corners) < 6 * 250  # of 400 at most, half face the eye
    assert (np.diff(corners[:, :, 2].sum(axis=1)) <= 1e-9).all()
    pose = pose_at(shaped, shaped.contacts.hardest.peak)
    view, size = view_of(shaped), np.array(drawn["size"])
    x, y, _, near = view.seen(np.vstack([np.zeros(3), *pose.translation[0, :5]])).T
    middle = np.array([WIDTH, HEIGHT]) / 2
    ratio = min(size / view.span) / min(2 * middle / view.span)
    origins = ratio * (np.stack([x, y], axis=1) - middle) + size / 2
    # How far its outermost corner is from each origin, in metres there; weak perspective.
    apart = np.linalg.norm(corners[:, :, None, :2] - origins, axis=-1).max(axis=1)
    apart /= ratio * near
    assert apart.min(axis=1).max() == pytest.approx(0.06, rel=0.05)
    assert apart.min(axis=0).max() < 0.03  # each has some that face the eye


@pytest.mark.slow
@pytest.mark.parametrize("number", [6, 1])
def test_the_force_has_arrow(opened: Callable, html: str, pushed: Analysis, number: int) -> None:
    """The projection of the still drawing, for the size of the canvas."""
    page = live(opened(html, reduced_motion="reduce"))
    click(page, f"#contact-{number}")
    drawn = page.evaluate(STROKES.replace("DRAW", "vftcli.arm.draw()"))
    ((shaft,),) = (pieces for wide, pieces in drawn if abs(wide - 3.2) < 1e-6)
    view, contact = view_of(pushed), pushed.contacts.contacts[number - 1]
    tail, tip = view.seen(arrow_of(pushed, contact, view.reach))[:, :2]
    canvas = "[vftcli.arm.canvas.clientWidth, vftcli.arm.canvas.clientHeight]"
    size, middle = np.array(page.evaluate(canvas)), np.array([WIDTH, HEIGHT]) / 2
    ratio = min(size / view.span) / min(2 * middle / view.span)
    tail, tip = (ratio * (place - middle) + size / 2 for place in (tail, tip))
    # The peak is half a sample away at most, 2 mm; the shaft ends 9 pixels before its tip.
    np.testing.assert_allclose(shaft[0], tail, atol=1.5)
    ahead = (tip - tail) / np.linalg.norm(tip - tail)
    np.testing.assert_allclose(shaft[1], tip - 9.0 * ahead, atol=1.5)


@pytest.mark.slow
def test_a_command_is_copied_and_play_has_four_speeds(page: Any) -> None:
    copy = page.locator("button.copy").first
    command = page.locator("code.remedy").first.inner_text()
    copy.click()
    page.wait_for_timeout(60)
    assert copy.inner_text() in {"copied", "selected"}  # what the browser allows a file
    assert page.evaluate("getSelection().toString()").strip() == command
    for speed in (0.25, 0.1, 4, 1):
        page.locator("#speed").click()
        assert page.locator("#speed").inner_text() == f"{speed:g} ×"
        assert page.evaluate("vftcli.clock.speed") == speed


@pytest.mark.slow
def test_a_line_is_broken_at_a_gap_of_the_clock(opened: Callable, analysis: Analysis) -> None:
    """600 samples with one gap: two pieces of `best`, 400 and 200 points."""
    page = live(opened(render(analysis)))
    plot = "vftcli.clock.plots.find((each) => each.chart.key === 'tau')"
    drawn = page.evaluate(STROKES.replace("DRAW", f"{plot}.draw(2)"))
    assert [400, 200] in [[len(piece) for piece in pieces] for _, pieces in drawn]


def test_a_look_shows_one_moment_and_ends(page: Any, pushed: Analysis) -> None:
    before = number(page), page.locator("#clock").inner_text()
    t = 13.0
    pointed(page, *place_of(page, "#torques", t, 2))
    now = page.evaluate("vftcli.clock.now")
    pixel = np.diff(page.evaluate("vftcli.clock.view"))[0] / 400.0
    assert abs(now - t) < pixel
    at = int(np.argmin(np.abs(pushed.t - now)))
    best = next(e for e in pushed.estimates if e.name == "best")
    heads = page.locator("#torques .head").all_inner_texts()
    for joint, head in enumerate(heads):
        shown = float(head.split()[0].replace("−", "-"))
        # Two or three digits, half a step of 0.01 N·m below them.
        assert shown == pytest.approx(best.tau[at, joint], abs=0.056)
    assert page.locator("#clock").inner_text() == f"{now:.2f} s"
    contact = pushed.contacts.contacts[6]
    assert contact.start < now < contact.stop
    assert "contact 7" in said(page)
    force = np.interp(now, contact.course.t, contact.course.force)
    assert float(number(page).split()[0]) == pytest.approx(force, abs=3.0)  # 8 ms of a push
    pointed(page, 5, 5)
    assert (number(page), page.locator("#clock").inner_text()) == before


@pytest.mark.slow
def test_a_click_stays_a_drag_zooms(page: Any, pushed: Analysis) -> None:
    x, y = place_of(page, "#force", 6.3)
    page.mouse.click(x, y)
    pointed(page, 5, 5)
    assert page.evaluate("vftcli.clock.now") == pytest.approx(6.3, abs=0.02)
    (left, y), (right, _) = (place_of(page, "#force", t) for t in (6.0, 8.0))
    page.mouse.move(left, y)
    page.mouse.down()
    page.mouse.move(0.5 * (left + right), y)
    assert page.locator("#force .chosen").is_visible()
    page.mouse.move(right, y)
    page.mouse.up()
    assert page.evaluate("vftcli.clock.view") == pytest.approx([6.0, 8.0], abs=0.02)
    low, high = page.evaluate("vftcli.clock.view")
    page.locator("#torques .chip", has_text="gmo").click()
    with page.expect_download() as waited:
        page.locator("#torques .csv").click()
    comment, _, table = waited.value.path().read_text("utf-8").partition("\n")
    assert comment.startswith("# ur5_circle.csv · sha256 ")
    head, *lines = csv.reader(io.StringIO(table))
    assert head[0] == "t [s]"
    assert "J3 gmo [N·m]" in head
    assert "J3 best ± [N·m]" in head
    inside = (pushed.t >= low) & (pushed.t <= high)
    values = np.array([[float(x or "nan") for x in line] for line in lines])
    np.testing.assert_allclose(values[:, 0], pushed.t[inside], atol=1e-4)
    gmo = next(e for e in pushed.estimates if e.name == "gmo")
    found = values[:, head.index("J3 gmo [N·m]")]
    np.testing.assert_allclose(found, gmo.tau[inside, 2], atol=0.0051)
    with page.expect_download() as waited:
        page.locator("#torques .png").click()
    image = waited.value.path().read_bytes()
    assert image.startswith(b"\x89PNG")
    assert len(image) > 20_000  # a blank sheet of this size has 5 kB
    assert page.locator("#torques .whole").is_visible()
    page.keyboard.press("Escape")
    assert page.evaluate("vftcli.clock.view") == [0.0, pytest.approx(20.0)]
    assert not page.locator("#torques .whole").is_visible()


def test_the_plain_wheel_scrolls_and_with_ctrl_it_zooms(page: Any) -> None:
    x, y = place_of(page, "#force", 10.0)
    page.mouse.move(x, y)
    page.keyboard.down("Control")
    page.mouse.wheel(0, -100)
    page.keyboard.up("Control")
    page.wait_for_timeout(60)
    low, high = page.evaluate("vftcli.clock.view")
    assert high - low == pytest.approx(20.0 / 1.2, rel=1e-3)
    assert (10.0 - low) / (high - low) == pytest.approx(0.5, abs=0.01)
    page.mouse.wheel(0, 300)
    page.wait_for_timeout(300)
    assert page.evaluate("scrollY") > 0
    assert page.evaluate("vftcli.clock.view") == [low, high]


@pytest.mark.slow
def test_the_keyboard_reaches_and_does_everything(opened: Callable, html: str) -> None:
    page = live(opened(html, reduced_motion="reduce"))
    order = []
    for _ in range(9 + 12):
        page.keyboard.press("Tab")
        order.append(page.evaluate(FOCUSED))
    assert all(each["seen"] for each in order)
    ids = [each["id"] or each["words"] for each in order]
    assert ids[1:6] == ["reset", "play", "speed", "previous", "next"]
    assert ids[6:9] == ["CSV", "PNG", "slider"]
    assert ids[9:] == [str(k) for k in range(1, 13)]


@pytest.mark.slow
def test_keys_go_play_zoom_and_turn(opened: Callable, html: str) -> None:
    page = live(opened(html, reduced_motion="reduce"))
    page.locator(".contacts a").nth(4).focus()
    for key, number in (("Enter", 5), ("n", 6), ("p", 5)):
        page.keyboard.press(key)
        page.wait_for_timeout(60)
        assert f"contact {number}" in said(page)
    page.keyboard.press("+")
    low, high = page.evaluate("vftcli.clock.view")
    assert high - low == pytest.approx(0.67 * 20.0, rel=1e-6)
    page.keyboard.press("Escape")
    assert page.evaluate("vftcli.clock.view") == [0.0, pytest.approx(20.0)]
    page.evaluate("vftcli.clock.zoom(6, 8)")
    click(page, "#contact-10")
    low, high = page.evaluate("vftcli.clock.view")
    assert high - low == pytest.approx(2.0)
    assert low < 16.9 < high  # what is zoomed in follows a contact
    page.locator("#arm canvas").focus()
    yaw = page.evaluate("vftcli.arm.yaw")
    page.keyboard.press("ArrowLeft")
    assert page.evaluate("vftcli.arm.yaw") == pytest.approx(yaw + 0.12)
    page.keyboard.press("0")
    assert page.evaluate("vftcli.arm.yaw") == yaw
    before = page.evaluate("vftcli.clock.head")
    page.keyboard.press(" ")
    page.wait_for_timeout(200)
    assert page.evaluate("vftcli.clock.running")
    assert page.evaluate("vftcli.clock.head") > before


def test_the_slider_goes_by_samples_and_says_what_it_reads(page: Any) -> None:
    page.locator("#slider").focus()
    before = page.evaluate("vftcli.clock.head")
    page.keyboard.press("ArrowRight")
    assert page.evaluate("vftcli.clock.head") == pytest.approx(before + 0.008)
    page.keyboard.press("PageUp")
    assert page.evaluate("vftcli.clock.head") == pytest.approx(before + 1.008)
    page.wait_for_timeout(60)
    assert re.match(r"6\.0\d s, < 2 N\s+no contact", page.evaluate("slider.ariaValueText"))


def test_nothing_glides_where_motion_is_unwanted(opened: Callable, html: str) -> None:
    page = live(opened(html, reduced_motion="reduce"))
    page.locator("#contact-6").click()
    there = pytest.approx(11.344, abs=0.0041)  # half a sample
    assert page.evaluate("[vftcli.clock.way, vftcli.clock.head]") == [None, there]
    page = live(opened(html))
    # At once: on a busy machine the way may be over before the next question.
    row = "document.querySelector('#contact-6')"
    assert page.evaluate(f"{row}.click(), vftcli.clock.way !== null")


def test_a_finger_goes_to_the_time_it_touches(opened: Callable, html: str) -> None:
    page = live(opened(html, 400, has_touch=True))
    page.touchscreen.tap(*place_of(page, "#force", 7.3))
    page.wait_for_timeout(60)
    assert page.evaluate("vftcli.clock.head") == pytest.approx(7.3, abs=0.06)  # a pixel
    # A finger leaves nothing behind that only looks.
    assert page.evaluate("vftcli.clock.look") is None
    assert "contact 3" in said(page)


def test_the_arm_docks_covers_no_button_and_stays_shut(page: Any) -> None:
    """The file button of the torques is where the arm is docked, at 1280 by 900."""
    dock, button = page.locator("#dock"), page.locator("#torques .csv")
    assert not dock.is_visible()
    page.evaluate(f"scrollTo(0, {button.bounding_box()['y'] - 780})")
    page.wait_for_timeout(150)
    inner, outer = button.bounding_box(), dock.bounding_box()
    assert (round(outer["width"]), round(outer["height"])) == (300, 230)
    assert outer["x"] < inner["x"] < outer["x"] + outer["width"]
    assert outer["y"] < inner["y"] < outer["y"] + outer["height"]
    at = [inner["x"] + inner["width"] / 2, inner["y"] + inner["height"] / 2]
    assert page.evaluate("([x, y]) => document.elementFromPoint(x, y).className", at) == "csv"
    page.mouse.move(*place_of(page, "#torques", 5.12, 4))
    page.wait_for_timeout(150)
    assert "contact 1" in dock.inner_text()
    page.locator("#undock").click()
    for y in (0, 5000):
        page.evaluate(f"scrollTo(0, {y})")
        page.wait_for_timeout(100)
    assert not dock.is_visible()
    assert page.locator("#arm canvas").count() == 1


def test_the_arm_is_grabbed_while_it_is_turned(page: Any) -> None:
    cursor = "getComputedStyle(vftcli.arm.canvas).cursor"
    box = page.locator("#arm canvas").bounding_box()
    page.mouse.move(box["x"] + 200, box["y"] + 200)
    assert page.evaluate(cursor) == "grab"
    page.mouse.down()
    page.mouse.move(box["x"] + 220, box["y"] + 200)
    assert page.evaluate(cursor) == "grabbing"
    page.mouse.up()
    assert page.evaluate(cursor) == "grab"


def test_a_long_list_is_shaded_below(opened: Callable, html: str, pushed: Analysis) -> None:
    page = live(opened(html, reduced_motion="reduce"))
    box = page.locator("#contacts").bounding_box()

    def piece(y: float) -> bytes:
        """A few pixels beside the rows."""
        return page.screenshot(clip={"x": box["x"] + 2, "y": y, "width": 4, "height": 3})

    plain, foot = piece(box["y"] + 4), box["y"] + box["height"] - 5
    click(page, "#contact-1")
    assert piece(foot) != plain
    for contact in (pushed.contacts.contacts[0], pushed.contacts.contacts[-1]):
        click(page, f"#contact-{contact.number}")
        (line,) = (each for each in page.locator(".why p").all() if each.is_visible())
        assert f"{contact.start:.2f}–{contact.stop:.2f} s" in line.inner_text()
        place, stage = line.bounding_box(), page.locator("#arm").bounding_box()
        assert place["y"] + place["height"] <= stage["y"] + stage["height"]
    page.evaluate("document.querySelector('#contacts').scrollTop = 1e4")
    page.locator("#contact-6").evaluate("row => vftcli.clock.go(0)")
    page.wait_for_timeout(60)
    box = page.locator("#contacts").bounding_box()
    assert piece(box["y"] + box["height"] - 5) == plain


def test_printed_everything_is_there(page: Any, pushed: Analysis) -> None:
    printed = page.pdf(format="A4")
    assert 2 <= len(re.findall(rb"/Type\s*/Page\b", printed)) <= 4
    assert len(printed) > 100_000  # a page of words and charts; a blank one is below 2 kB
    page.emulate_media(media="print", color_scheme="dark")
    if page.locator("details:not([open])").count():
        boxes = [svg.bounding_box() for svg in page.locator("details figure svg").all()]
        assert all(box and box["height"] > 20 for box in boxes)
    # The drawings are there, what a pointer moves is not.
    for still in page.locator("figure > svg, .view > svg").all():
        assert still.evaluate("x => getComputedStyle(x).visibility") == "visible"
    assert not any(x.is_visible() for x in page.locator(".live").all())
    words = " ".join(page.locator("body").inner_text().split())
    for contact in pushed.contacts.contacts:
        assert f"{contact.peak:.1f} s" in words
    assert page.evaluate("getComputedStyle(document.body).color") == "rgb(0, 0, 0)"


def test_without_a_script_the_page_answers(opened: Callable, html: str) -> None:
    page = opened(html, java_script_enabled=False).page
    assert "12 contacts" in page.locator("h1").inner_text()
    for place in ("#force svg", "#arm svg", "#contacts", "#believed"):
        assert page.locator(place).is_visible()
    assert [each.is_visible() for each in page.locator("#torques figure svg").all()] == [True] * 6
    assert not any(each.is_visible() for each in page.locator(".live").all())
    page.locator(".contacts a").nth(6).click()
    assert page.url.endswith("#mark-7")
    page.locator("#force a", has_text="9").first.click()
    assert page.url.endswith("#contact-9")


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [400, 1280])
def test_it_fits_and_can_be_read(opened: Callable, html: str, width: int, scheme: str) -> None:
    tab = opened(html, width, color_scheme=scheme)
    live(tab)
    assert tab.overflow <= 0
    tab.unfold()
    assert tab.overflow <= 0
    least = tab.page.evaluate(CONTRASTS)
    assert least[0][0] >= 4.5, least
    paper = tab.page.evaluate("getComputedStyle(document.body).backgroundColor")
    bright = sum(map(int, re.findall(r"\d+", paper)[:3])) > 380
    assert bright == (scheme == "light")
    option = "getComputedStyle(document.querySelector('.option')).whiteSpace"
    assert tab.page.evaluate(option) == "nowrap"  # "--no-contacts" is not broken


@pytest.mark.slow
def test_a_change_of_scheme_redraws(page: Any) -> None:
    before = page.locator("#force canvas").screenshot()
    page.emulate_media(color_scheme="dark")
    page.wait_for_timeout(100)
    assert page.locator("#force canvas").screenshot() != before
    assert page.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(15, 19, 23)"


@pytest.mark.slow
def test_hostile_names_stay_words(opened: Callable, analysis: Analysis) -> None:
    name = "</script><b id=evil>x</b>"
    best, first, *others = analysis.estimates
    log = replace(analysis.motion.log, robot=replace(analysis.robot, title=name))
    renamed = (best, replace(first, name=name), *others)
    motion = replace(analysis.motion, log=log)
    tab = opened(render(replace(analysis, motion=motion, estimates=renamed)))
    page = live(tab)
    assert page.locator("#evil").count() == 0
    assert name in page.locator(".eyebrow").inner_text()
    page.locator("#torques .chip", has_text="</script>").click()
    page.wait_for_timeout(60)
    assert tab.errors == []


@pytest.mark.slow
@pytest.mark.parametrize("name", ["pushed", "shaped"])
def test_a_frame_of_play_is_little_work(opened, request, name):
    """Charts copy a picture of their lines; of 3000 triangles each costs at most five calls."""
    charts, arm = live(opened(render(request.getfixturevalue(name)))).evaluate(CALLS)
    assert 0 < charts <= 10
    assert 0 < arm <= 15_000


@pytest.mark.slow
def test_a_long_log_reads_and_keeps_its_extremes(opened: Callable) -> None:
    """200 s at 1 kHz with one sample of 77: its stretch says so, on the head and in the file."""
    t = 1e-3 * np.arange(200_000)
    y = np.sin(t)[:, None]
    y[123_456] = 77.0
    long = Chart("long", "Long", ("N",), ("fx",), t, (ChartLine("best", y, leads=True),))
    html = shell.page("page.html", "A – long", [long])
    page = live(opened(html.replace("<body>", f"<body>{part('svg/multiples', long)}")))
    box = page.locator(".box").bounding_box()
    # Numbers take 44 pixels on the left, 10 are free on the right.
    width, middle = box["width"] - 54, box["y"] + box["height"] / 2
    page.mouse.move(box["x"] + 44 + 0.6 * width, middle)
    page.mouse.down()
    page.mouse.move(box["x"] + 44 + 0.65 * width, middle, steps=3)
    page.mouse.up()
    # The view is 120 to 130 s now, to a pixel of 0.4 s; a stretch has 49 samples, 3 pixels.
    heads = []
    for step in range(-20, 21):
        page.mouse.move(box["x"] + 44 + 0.3456 * width + step, middle)
        page.wait_for_timeout(25)
        heads.append(page.locator(".head").inner_text().removesuffix(" N"))
    (spike,) = {head for head in heads if "…77" in head}
    low, _ = spike.split("…")
    assert float(low.replace("−", "-")) == pytest.approx(np.sin(123.456), abs=0.1)
    with page.expect_download() as waited:
        page.locator(".csv").click()
    _, head, *rows = waited.value.path().read_text("utf-8").splitlines()
    assert head == "t [s],fx best min [N],fx best max [N]"
    assert len(rows) == pytest.approx(4096 / 20, abs=3)
    assert max(float(row.split(",")[2]) for row in rows) == pytest.approx(77.0, abs=0.1)


def test_the_index_sorts(opened: Callable, pushed: Analysis, without_reference: Analysis) -> None:
    tab = opened(render_logs([log_line(pushed), log_line(without_reference)]), 400)
    assert tab.errors == []
    assert tab.overflow <= 0
    head = tab.page.locator(".sorts thead th").nth(2)  # the span: 20.0 and 5.2 s
    rows = tab.page.locator(".sorts tbody tr")
    head.click()
    assert "5.2 s" in rows.nth(0).inner_text()
    head.focus()
    tab.page.keyboard.press("Enter")
    assert "20.0 s" in rows.nth(0).inner_text()
    assert head.get_attribute("aria-sort") == "descending"
