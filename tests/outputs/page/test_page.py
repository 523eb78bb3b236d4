import re
from dataclasses import replace

import polars as pl
import pytest
from unpacking import Page, page_data

from vftcli.analysis import Analysis
from vftcli.outputs.believability import Ground
from vftcli.outputs.contacts import contact_grid
from vftcli.outputs.page import pages
from vftcli.outputs.page.pages import render
from vftcli.outputs.run_record import run_record
from vftcli.signals.remarks import caution, sentence


@pytest.fixture(scope="module")
def html(analysis: Analysis) -> str:
    return render(analysis)


@pytest.fixture(scope="module")
def page(html: str) -> Page:
    return Page(html)


def test_every_element_is_closed_and_nothing_is_loaded(page: Page, html: str) -> None:
    assert page.open == []
    for tag, attributes in page.elements:
        assert not {"src", "srcset", "action", "data"} & set(attributes), tag
        assert tag not in {"link", "iframe", "img", "object", "embed", "base"}
        assert not str(attributes.get("href", "")).startswith(("http", "//"))
    # A part of the page itself may be named, as the pattern of a fill.
    assert not re.search(r"@import|url\((?!#)|fetch\(|XMLHttpRequest|import\(", html)
    policy = next(a["content"] for t, a in page.elements if "http-equiv" in a)
    assert policy.startswith("default-src 'none'")


def test_hostile_names_are_words(page: Page, html: str) -> None:
    assert [tag for tag, _ in page.elements].count("script") == 2
    assert "<script>alert" not in html
    assert "<b>one</b>" not in html
    assert "turned the sign of <b>one</b> (--columns)" in page.text
    assert '<script>alert("x")</script>&_%.csv' in page.text
    assert "&amp;_%.csv · Universal Robots UR5 (CB3) · 5.2 s at 125 Hz<" in html


@pytest.mark.slow
def test_the_answer_comes_first(pushed: Analysis) -> None:
    page = Page(render(pushed))
    text = page.text
    order = (
        "ur5_circle.csv · Universal Robots UR5",
        "12 contacts. The hardest, at 5.1 s: 91 ± 7 N on the wrist.",
        "10 on the wrist, 2 at an unknown place. The size of 9 is uncertain.",
        "Nothing else above 2 N. Weaker pushes would not show.",
        "91 ± 7 N contact 1",
        "91 ± 7 N wrist",
        "Can it be believed?",
        "vftcli identify",
        "Joint torques",
        "Errors against the reference",
    )
    places = [text.index(words, 0 if k == 0 else 1) for k, words in enumerate(order)]
    assert places == sorted(places)
    details = [attributes for tag, attributes in page.elements if tag == "details"]
    assert [each["id"] for each in details if "open" in each] == ["torques"]


@pytest.mark.slow
def test_without_contacts_the_page_says_why(
    pushed: Analysis, without_reference: Analysis
) -> None:
    reason = caution("contacts-not-listed", reason="a hostile <b>")
    bare = replace(pushed, contacts=None, remarks=(*pushed.remarks, reason))
    page = Page(render(bare))
    assert "External torque of 6 joints by " in page.text
    assert "a hostile <b>" in page.text
    ids = [attributes.get("id") for _, attributes in page.elements]
    assert "arm" in ids
    assert not {"contacts", "force"} & set(ids)
    assert "contacts-not-listed" not in {r.code for r in without_reference.remarks}


@pytest.mark.slow
def test_nothing_is_said_twice(pushed: Analysis) -> None:
    made = replace(pushed, run=run_record(pushed, "vftcli report"))
    # The grounds above name the few that an answer rests on.
    text = Page(render(made)).text.partition("Joint torques")[2]
    for remark in made.run["remarks"]:
        assert text.count(sentence(remark, "long")) == 1, remark.code


def test_values_at_the_floor_are_marked(analysis: Analysis) -> None:
    note = "*: within 1.2 × the floor; the reference is no more accurate than that"
    assert note not in render(analysis)
    near = analysis.errors.with_columns(reference_floor_Nm=pl.col("rmse_Nm") / 1.1)
    page = render(replace(analysis, errors=near))
    assert note in page
    assert re.search(r"<td[^>]*>[\d.]+\*</td>", page)


def test_the_script_gets_every_chart_with_its_gap(html: str) -> None:
    data = page_data(html)
    assert [chart["key"] for chart in data["charts"]] == ["force", "tau", "wrench"]
    torques = data["charts"][1]
    names = [line["name"] for line in torques["lines"]]
    assert names == ["reference (vendor)", "fdo", "gmo", "kfo-fe", "kfo-zoh", "best"]
    assert [line["shown"] for line in torques["lines"]] == [True, *[False] * 4, True]
    assert torques["lines"][-1]["colour"] == "var(--force)"
    assert torques["band"] == [0.5] * 6
    assert data["clocks"][0]["gaps"] == [400]


def test_without_a_reference_the_page_says_so_and_no_command_breaks_in_an_option(
    without_reference: Analysis,
) -> None:
    run = run_record(without_reference, "vftcli report a --free b")
    html = render(replace(without_reference, run=run))
    assert "Nothing was given that measures the force" in html
    names = [line["name"] for line in page_data(html)["charts"][1]["lines"]]
    assert names == ["fdo", "gmo", "kfo-fe", "kfo-zoh", "best"]
    commands = re.findall(r"(?s)<(code|pre)[^>]*>(.*?)</\1>", html)
    texts = [re.sub(r'<span class="option">--?[a-z-]+</span>', "", text) for _, text in commands]
    assert "vftcli report a  b" in texts
    assert not [text for text in texts if re.search(r"(?<!\w)-", text)]


def test_every_contact_has_its_span_range_and_place(pushed: Analysis) -> None:
    """In the table, which needs no script, and in the line of the chosen contact."""
    html = render(pushed)
    text = Page(html).text
    table = text.partition("Contacts in numbers")[2]
    assert '<div class="why live">' in html
    contacts = pushed.contacts.contacts
    for c, row in zip(contacts, contact_grid(contacts).cells, strict=True):
        low, high = c.anywhere
        assert f"Contact {c.number}, {c.start:.2f}–{c.stop:.2f} s" in text
        assert f" {c.number} {c.start:.2f} – {c.stop:.2f} {low:.0f}–{high:.0f} " in table
        shown = html.partition(f'<tr id="contact-{c.number}"')[2].partition("</tr>")[0]
        assert f"<td>{row[-2].text}</td>" in shown
        assert f'href="#mark-{c.number}"' in shown
    nothing = replace(pushed.contacts, contacts=())
    assert 'id="contacts"' not in render(replace(pushed, contacts=nothing))


def test_the_files_beside_it_are_named_with_their_sizes(analysis: Analysis) -> None:
    html = render(analysis, {"recording.rrd": 3_512_000, "run.json": None, "other.txt": 3})
    assert '<a href="recording.rrd" download>recording.rrd</a>' in html
    assert "3-D recording for Rerun · 3.5 MB<" in html
    assert "settings, versions, remarks<" in html
    assert "other.txt" not in html
    assert '<section id="files">' not in render(analysis)


def test_a_ground_has_its_sign_and_remedy_and_a_file_keeps_its_letters(
    analysis: Analysis, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What nothing is known of is no caution."""
    found = (
        Ground("bad", "load", "heavy <b>", "vftcli x '<i>'"),
        Ground("caution", "free motion", "free_14harm.csv is short"),
        Ground("caution", "free motion", "--free names nothing"),
        Ground("unknown", "free motion", "the sizes are unchecked"),
        Ground("good", "clock of the UR", "vendor's own, ur5.toml"),
    )
    monkeypatch.setattr(pages, "grounds", lambda _: found)
    html = render(analysis)
    text = Page(html).text
    assert "3 cautions, 1 check passed" in text
    pieces = (
        "Load Heavy <b> vftcli x '<i>'",
        "Free motion free_14harm.csv is short",
        "Free motion --free names",
        "Free motion The sizes",
        "Clock of the UR Vendor's own, ur5.toml",
    )
    places = [text.index(words) for words in pieces]
    assert places == sorted(places)
    assert '<b class="sign bad">✗</b>' in html
    assert '<code class="remedy">vftcli x &#x27;&lt;i&gt;&#x27;</code>' in html
    assert html.count('class="remedy"') == 1
