import base64
import json
import re
from collections.abc import Callable
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest

from vftcli.analysis import Analysis
from vftcli.outputs.believability import Ground
from vftcli.outputs.page import pages
from vftcli.outputs.page.pages import eyebrow, render
from vftcli.outputs.page.shell import HERE, script_json
from vftcli.outputs.run_record import run_record
from vftcli.signals.recording import Recording
from vftcli.signals.remarks import caution, sentence

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


def embedded(html: str) -> list[dict]:
    found = re.search(r'<script type="application/json" id="data">(.*?)</script>', html, re.S)
    assert found is not None
    return json.loads(found.group(1))


def test_every_element_is_closed(page: Page) -> None:
    assert page.open == []


def test_nothing_is_loaded_from_anywhere(page: Page, html: str) -> None:
    for tag, attributes in page.elements:
        assert not {"src", "srcset", "action", "data"} & set(attributes), tag
        assert tag not in {"link", "iframe", "img", "object", "embed", "base"}
        assert not str(attributes.get("href", "")).startswith(("http", "//"))
    # A part of the page itself may be named, as the pattern of a fill.
    assert not re.search(r"@import|url\((?!#)|fetch\(|XMLHttpRequest|import\(", html)
    policy = next(a["content"] for t, a in page.elements if "http-equiv" in a)
    assert policy is not None
    assert policy.startswith("default-src 'none'")


def test_hostile_names_are_words(page: Page, html: str) -> None:
    assert [tag for tag, _ in page.elements].count("script") == 3
    assert "<script>alert" not in html
    assert "<b>one</b>" not in html
    assert "turned the sign of <b>one</b> (--columns)" in page.text
    assert '<script>alert("x")</script>&_%.csv' in page.text


def test_sections_and_units_are_there(page: Page) -> None:
    for words in (
        "Can it be believed?",
        "Joint torques",
        "Errors against a reference",
        "RMSE in N·m",
        "Observers",
        "Frequency response",
        "Conventions",
        "ON the robot",
        "ab" * 32,
        "left out look & feel of /odd",
    ):
        assert words in page.text, words


@pytest.mark.slow
def test_the_answer_comes_first(pushed: Analysis) -> None:
    page = Page(render(pushed))
    text = page.text
    order = (
        "ur5_circle.csv · Universal Robots UR5",
        "12 contacts. The hardest of known size, at 11.3 s: 95 ± 9 N on the wrist.",
        "Nothing else above 4 N. Weaker pushes would not show.",
        "The contacts",
        "Can it be believed?",
        "vftcli identify",
        "Details",
        "Joint torques",
        "Errors against a reference",
    )
    places = [text.index(words, 0 if k == 0 else 1) for k, words in enumerate(order)]
    assert places == sorted(places)
    details = [attributes for tag, attributes in page.elements if tag == "details"]
    assert not any("open" in attributes for attributes in details)


@pytest.mark.slow
def test_without_contacts_the_torques_are_open(
    pushed: Analysis, without_reference: Analysis
) -> None:
    reason = caution("contacts-not-told", reason="a hostile <b>")
    bare = replace(pushed, contacts=None, remarks=(*pushed.remarks, reason))
    page = Page(render(bare))
    assert "External torque of 6 joints by " in page.text
    assert "a hostile <b>" in page.text
    opened = [a.get("id") for tag, a in page.elements if tag == "details" and "open" in a]
    assert opened == ["torques"]
    assert "table.contacts" not in page.text
    assert "contacts-not-told" not in {r.code for r in without_reference.remarks}


@pytest.mark.slow
def test_nothing_is_said_twice(pushed: Analysis) -> None:
    made = replace(pushed, run=run_record(pushed, "vftcli report"))
    # The grounds above name the few that an answer rests on.
    text = Page(render(made)).text.partition("Details")[2]
    for remark in made.run["remarks"]:
        assert text.count(sentence(remark, "long")) == 1, remark.code


def test_values_at_the_floor_are_marked(analysis: Analysis) -> None:
    assert "at the floor</span>" not in render(analysis)
    assert analysis.reference is not None
    assert analysis.errors is not None
    import polars as pl

    near = analysis.errors.with_columns(reference_floor_Nm=pl.col("rmse_Nm") / 1.1)
    assert "at the floor</span>" in render(replace(analysis, errors=near))


def test_no_mark_of_a_table_is_green() -> None:
    """A number at its floor may stand beside a joint that is not to be trusted."""
    rule = re.search(r"td \.mark \{([^}]*)\}", (HERE / "page.css").read_text("utf-8"))
    assert rule is not None
    assert "var(--mute)" in rule[1]
    assert "--good" not in rule[1]


def test_the_script_gets_every_chart(html: str, analysis: Analysis) -> None:
    torques, wrench = embedded(html)
    assert (torques["key"], wrench["key"]) == ("tau", "wrench")
    names = [series["name"] for series in torques["series"]]
    assert names == ["reference (vendor)", "fdo", "gmo", "kfo-fe", "kfo-zoh", "best"]
    assert torques["band"] == [0.5] * 6
    line = torques["series"][1]["lines"][3]
    points = np.frombuffer(base64.b64decode(line["y"]["points"]), dtype="<i2")
    drawn = line["y"]["low"] + line["y"]["step"] * (points[points > -32768] + 32767.0)
    # within half a step of the range in 65534
    np.testing.assert_allclose(
        drawn, analysis.estimates[1].tau[:, 3], atol=0.51 * line["y"]["step"], rtol=0
    )


def test_the_gap_of_the_log_breaks_the_line(html: str) -> None:
    line = embedded(html)[0]["series"][1]["lines"][0]
    x = np.frombuffer(base64.b64decode(line["x"]), dtype="<f4")
    y = np.frombuffer(base64.b64decode(line["y"]["points"]), dtype="<i2")
    (at,) = np.flatnonzero(y == -32768)
    assert 399 * 0.008 < x[at] < 400 * 0.008 + 0.4


def test_data_cannot_end_the_script() -> None:
    assert "<" not in script_json({"hostile": HOSTILE})


def test_without_a_reference_the_page_says_so(without_reference: Analysis) -> None:
    html = render(without_reference)
    assert "Nothing was given that measures the force" in html
    names = [series["name"] for series in embedded(html)[0]["series"]]
    assert names == ["fdo", "gmo", "kfo-fe", "kfo-zoh", "best"]


@pytest.mark.parametrize(
    ("signal", "words"),
    [("none", "nothing else measured the force"), ("tau_ext", "the controller's own estimate")],
)
def test_the_eyebrow_says_what_measured_the_force(
    without_reference: Analysis, recording: Recording, as_if: Callable, signal: str, words: str
) -> None:
    log = recording if signal == "tau_ext" else replace(recording, tau_ext=None)
    name, robot, span, measured = eyebrow(as_if(without_reference, log))
    assert (robot, span) == ("Universal Robots UR5 (CB3)", "5.2 s at 125 Hz")
    assert name == log.name
    assert words in measured


def test_a_ground_is_shown_with_its_sign_and_its_remedy(
    analysis: Analysis, monkeypatch: pytest.MonkeyPatch
) -> None:
    good = Ground(standing="good", subject="clock of the UR", sentence="no gap <b>")
    bad = Ground(standing="bad", subject="load", sentence="heavy", remedy="vftcli x '<i>'")
    monkeypatch.setattr(pages, "grounds", lambda _: (bad, good))
    html = render(analysis)
    assert html.index("Load<small>") < html.index("Clock of the UR")
    assert '<b class="sign bad">✗</b>' in html
    assert '<code class="remedy">vftcli x &#x27;&lt;i&gt;&#x27;</code>' in html
    assert "no gap &lt;b&gt;" in html
    assert html.count('class="remedy"') == 1
