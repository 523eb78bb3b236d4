"""The pages in a real browser: drawn, printed, linked, by the keyboard, without a script."""

import re
from collections.abc import Callable

import pytest

from vftcli.analysis import Analysis
from vftcli.outputs.page.pages import render, render_index

FOCUSED = """() => { const x = document.activeElement; const style = getComputedStyle(x);
  return { words: x.textContent.trim(), tag: x.tagName, seen: style.outlineStyle !== "none" } }"""


@pytest.fixture(scope="module")
def html(pushed: Analysis) -> str:
    return render(pushed)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["pushed", "analysis", "with_wrench"])
def test_every_chart_is_drawn_and_no_error_is_told(
    opened: Callable, request: pytest.FixtureRequest, name: str
) -> None:
    tab = opened(render(request.getfixturevalue(name)))
    tab.unfold()
    assert tab.page.locator(".large canvas").count() >= 1
    assert tab.blank_charts() == []
    assert tab.errors == []


def test_printed_everything_is_there(opened: Callable, html: str) -> None:
    tab = opened(html)
    tab.page.emulate_media(media="print")
    # What is folded away on the screen is not on paper; large charts have their small ones.
    assert tab.page.locator("details[open]").count() == 0
    folded = tab.page.locator("details .multiples figure svg")
    assert folded.count() >= 12
    for k in range(folded.count()):
        assert (folded.nth(k).bounding_box() or {"height": 0})["height"] > 20
    assert not any(large.is_visible() for large in tab.page.locator(".large").all())
    printed = tab.page.pdf(format="A4")
    assert printed.startswith(b"%PDF")
    assert 3 <= len(re.findall(rb"/Type\s*/Page\b", printed)) <= 15
    # A page of words and charts; a blank one is below 2 kB.
    assert len(printed) > 100_000


def test_rows_and_chart_lead_to_one_another(opened: Callable, html: str, pushed: Analysis) -> None:
    assert pushed.contacts is not None
    tab = opened(html)
    rows = tab.page.locator("table.contacts tbody tr")
    assert rows.count() == len(pushed.contacts.contacts) == 12
    rows.nth(6).locator("a").click()
    assert tab.page.url.endswith("#mark-7")
    assert tab.page.evaluate("document.querySelector(':target').matches('rect.contact')")
    tab.page.locator(".hero .wide a", has_text="9").first.click()
    assert tab.page.url.endswith("#contact-9")
    ninth = pushed.contacts.contacts[8]
    assert (
        f"{ninth.peak_force:.0f} ± {ninth.peak_band:.0f} N"
        in tab.page.locator("tr:target").inner_text()
    )


def test_the_keyboard_reaches_everything_in_the_order_of_the_page(
    opened: Callable, html: str
) -> None:
    tab = opened(html)
    seen = []
    for _ in range(12 + 12 + 3):
        tab.page.keyboard.press("Tab")
        seen.append(tab.page.evaluate(FOCUSED))
    numbers = [str(k) for k in range(1, 13)]
    assert [x["words"] for x in seen[:24]] == [*numbers, *numbers]  # the chart's, then the rows'
    assert [x["tag"] for x in seen[24:]] == ["SUMMARY"] * 3
    assert all(x["seen"] for x in seen)
    tab.page.keyboard.press("Shift+Tab")
    tab.page.keyboard.press("Shift+Tab")
    tab.page.keyboard.press("Enter")
    assert tab.page.locator("#torques[open]").count() == 1


def test_observers_come_on_demand(opened: Callable, html: str) -> None:
    tab = opened(html)
    tab.unfold()
    large = tab.page.locator("#torques .large")
    gmo = large.get_by_role("button", name="gmo")
    assert gmo.get_attribute("aria-pressed") == "false"
    before = large.locator("canvas").screenshot()
    gmo.click()
    assert gmo.get_attribute("aria-pressed") == "true"
    assert large.locator("canvas").screenshot() != before
    large.get_by_role("button", name="J3", exact=True).click()
    assert large.locator(".plot").get_attribute("aria-label").endswith("J3 in N·m")
    large.locator(".plot").focus()
    tab.page.keyboard.press("+")
    assert tab.errors == []


def test_without_a_script_the_page_answers(opened: Callable, html: str) -> None:
    tab = opened(html, java_script_enabled=False)
    assert "12 contacts" in tab.page.locator("h1").inner_text()
    for place in (".hero svg.wide", "#contacts", "#believed"):
        assert tab.page.locator(place).is_visible()
    tab.page.locator("#torques summary").click()
    small = tab.page.locator("#torques .multiples svg")
    assert small.count() == 6
    assert all(each.is_visible() for each in small.all())


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [400, 1280])
def test_nothing_sticks_out(opened: Callable, html: str, width: int, scheme: str) -> None:
    tab = opened(html, width, color_scheme=scheme)
    assert tab.overflow <= 0
    tab.unfold()
    assert tab.overflow <= 0
    paper = tab.page.evaluate("getComputedStyle(document.body).backgroundColor")
    bright = sum(map(int, re.findall(r"\d+", paper)[:3])) > 380
    assert bright == (scheme == "light")


def test_the_index_needs_no_script(
    opened: Callable, pushed: Analysis, without_reference: Analysis
) -> None:
    tab = opened(render_index([("a", pushed), ("b", without_reference)]), 400)
    assert tab.errors == []
    assert tab.overflow <= 0
    assert tab.page.locator("tbody a").count() >= 2
