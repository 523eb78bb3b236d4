import base64
import json
import re
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest

from vftcli.analysis import Analysis
from vftcli.outputs.page.page import render, render_index
from vftcli.outputs.page.payload import payload
from vftcli.outputs.page.sections import joint_values
from vftcli.outputs.page.shell import script_json

HOSTILE = "</script><script>alert(1)</script>\u2028"


class Page(HTMLParser):
    """Collects elements, their attributes and the page's words."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.open: list[str] = []
        self.words: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))
        if tag not in {"meta", "br", "link", "img"}:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if not self.open or self.open[-1] not in {"script", "style"}:
            self.words.append(data)

    @property
    def text(self) -> str:
        return " ".join(" ".join(self.words).split())


@pytest.fixture(scope="module")
def html(analysis: Analysis) -> str:
    return render(analysis)


@pytest.fixture(scope="module")
def page(html: str) -> Page:
    return Page(html)


def embedded(html: str) -> dict:
    found = re.search(r'<script type="application/json" id="data">(.*?)</script>', html, re.S)
    assert found is not None
    return json.loads(found.group(1))


def floats(text: str) -> np.ndarray:
    return np.frombuffer(base64.b64decode(text), dtype="<f4")


def test_every_element_is_closed(page: Page) -> None:
    assert page.open == []


def test_nothing_is_loaded_from_anywhere(page: Page, html: str) -> None:
    for tag, attributes in page.elements:
        assert not {"src", "srcset", "action", "data"} & set(attributes), tag
        assert tag not in {"link", "iframe", "img", "object", "embed", "base"}
        assert not str(attributes.get("href", "")).startswith(("http", "//"))
    assert not re.search(r"@import|url\(|fetch\(|XMLHttpRequest|import\(", html)
    policy = next(a["content"] for t, a in page.elements if "http-equiv" in a)
    assert policy is not None
    assert policy.startswith("default-src 'none'")


def test_hostile_names_are_words(page: Page, html: str) -> None:
    assert [tag for tag, _ in page.elements].count("script") == 2
    assert "<script>alert" not in html
    assert "<b>one</b>" not in html
    assert "turned the sign of <b>one</b> (--columns)" in page.text
    assert '<script>alert("x")</script>&_%.csv' in page.text


def test_sections_and_units_are_there(page: Page) -> None:
    for words in (
        "Errors against the reference",
        "RMSE in N·m",
        "Torques over time",
        "Observers",
        "Frequency response",
        "Conventions",
        "ON the robot",
        "Provenance",
        "ab" * 32,
        "left out look & feel of /odd",
    ):
        assert words in page.text, words


def test_values_at_the_floor_are_marked(analysis: Analysis) -> None:
    assert "at the floor</span>" not in render(analysis)
    assert analysis.reference is not None
    assert analysis.errors is not None
    import polars as pl

    near = analysis.errors.with_columns(reference_floor_Nm=pl.col("rmse_Nm") / 1.1)
    assert "at the floor</span>" in render(replace(analysis, errors=near))


def test_the_script_gets_every_chart(html: str, analysis: Analysis) -> None:
    data = embedded(html)
    assert [chart["key"] for chart in data["charts"]] == ["tau", "error", "drive", "q", "dq"]
    names = [series["name"] for series in data["charts"][0]["series"]]
    assert names == ["reference (vendor)", "best", "fdo", "gmo", "kfo-fe", "kfo-zoh"]
    assert data["charts"][1]["band"] == [0.5] * 6
    assert [chart["key"] for chart in data["responses"]] == ["gain", "phase", "delay"]
    lines = data["charts"][0]["series"][2]["lines"]
    assert len(lines) == 6
    drawn = floats(lines[3]["y"])
    kept = drawn[np.isfinite(drawn)]
    # float32 holds seven digits
    np.testing.assert_allclose(kept, analysis.estimates[1].tau[:, 3], rtol=1e-6, atol=1e-6)


def test_the_gap_of_the_log_breaks_the_line(html: str) -> None:
    line = embedded(html)["charts"][3]["series"][0]["lines"][0]
    x, y = floats(line["x"]), floats(line["y"])
    (at,) = np.flatnonzero(np.isnan(y))
    assert 399 * 0.008 < x[at] < 400 * 0.008 + 0.4


def test_a_first_order_response_is_3_db_down_at_its_cutoff(html: str) -> None:
    """fdo.omega of the UR5 is 10 rad/s: 1.59 Hz."""
    gain = embedded(html)["responses"][0]["series"][1]
    x, y = floats(gain["lines"][0]["x"]), floats(gain["lines"][0]["y"])
    # the bilinear rule warps 1.59 Hz by 0.05 % at 125 Hz; interpolation adds less than 0.01 dB
    assert np.interp(10.0 / (2.0 * np.pi), x, y) == pytest.approx(-3.01, abs=0.02)


def test_data_cannot_end_the_script(analysis: Analysis) -> None:
    assert "<" not in script_json({**payload(analysis), "hostile": HOSTILE})


def test_without_a_reference_the_page_says_so(without_reference: Analysis) -> None:
    html = render(without_reference)
    assert "No reference was given" in html
    assert [c["key"] for c in embedded(html)["charts"]] == ["tau", "drive", "q", "dq"]


def test_wrenches_have_a_chart_an_axis(with_wrench: Analysis, html: str) -> None:
    shown = render(with_wrench)
    charts = embedded(shown)["wrenches"]
    assert [c["key"] for c in charts] == ["fx", "fy", "fz", "mx", "my", "mz", "sigma_min"]
    assert [chart["unit"] for chart in charts[:6]] == ["N"] * 3 + ["N·m"] * 3
    drawn = floats(charts[2]["series"][0]["lines"][0]["y"])
    expected = with_wrench.wrenches[0].known[:, 2]
    kept, known = drawn[np.isfinite(drawn)], expected[np.isfinite(expected)]
    np.testing.assert_allclose(kept, known, rtol=1e-6)  # float32 holds seven digits
    assert 'id="wrenches"' in shown
    assert 'id="wrenches"' not in html


def test_joints_that_agree_share_a_line() -> None:
    assert joint_values(np.array([10.0, 10.0])) == "10.0"
    text = joint_values(np.array([5.0, 10.0, 10.0, 7.0]))
    assert re.sub(r"<[^>]*>", " ", text).split() == ["J1", "5.00", "J2–J3", "10.0", "J4", "7.00"]


def test_the_index_links_every_report(analysis: Analysis, without_reference: Analysis) -> None:
    html = render_index([("a b", analysis), ('"><script>', without_reference)])
    links = [a.get("href") for tag, a in Page(html).elements if tag == "a"]
    assert "a%20b/index.html" in links
    assert "%22%3E%3Cscript%3E/index.html" in links
    assert "<script>alert" not in html
