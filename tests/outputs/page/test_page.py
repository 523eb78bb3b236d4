import re
from dataclasses import replace

import numpy as np
import polars as pl
import pytest
from contact_rows import contact, contact_list
from unpacking import Page, page_data

from vftcli.analysis import Analysis
from vftcli.batch.log_work import SCHEMA, rows_of
from vftcli.contacts.contact_list import OF_FORCES
from vftcli.outputs.believability import MARKS, Ground, LogSummary, log_line
from vftcli.outputs.contacts import contact_grid
from vftcli.outputs.page import pages
from vftcli.outputs.page.log_charts import force_chart
from vftcli.outputs.page.pages import (
    batch_lines,
    contact_details,
    joint_values,
    logs_headline,
    model_pairs,
    render,
    render_logs,
)
from vftcli.outputs.page.shell import part
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
        "10 on the wrist, 2 at an unknown place. The size of contact 9 is uncertain.",
        "Nothing else above 2 N at the flange. Weaker pushes may not show.", "91 ± 7 N contact 1",
        "91 ± 7 N wrist", "Can it be believed?", "vftcli identify", "Joint torques",
        "Errors against the reference",
    )  # fmt: skip
    places = [text.index(words, 0 if k == 0 else 1) for k, words in enumerate(order)]
    assert places == sorted(places)
    details = [attributes for tag, attributes in page.elements if tag == "details"]
    assert [each["id"] for each in details if "open" in each] == ["torques"]


@pytest.mark.slow
def test_without_contacts_it_is_said_why(pushed: Analysis, without_reference: Analysis) -> None:
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
    note = "*: within 1.2 × the floor: may be the reference&#39;s own error"
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


def test_without_a_reference_the_page_says_so(without_reference: Analysis) -> None:
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


def test_grounds_have_sign_and_remedy(analysis, monkeypatch):
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
        "Load Heavy <b> vftcli x '<i>'", "Free motion free_14harm.csv is short",
        "Free motion --free names", "Free motion The sizes",
        "Clock of the UR Vendor's own, ur5.toml",
    )  # fmt: skip
    places = [text.index(words) for words in pieces]
    assert places == sorted(places)
    assert '<b class="sign bad">✗</b>' in html
    assert '<code class="remedy">vftcli x &#x27;&lt;i&gt;&#x27;</code>' in html
    assert html.count('class="remedy"') == 1


def test_a_load_is_called_one(pushed: Analysis) -> None:
    load = replace(
        pushed.contacts.contacts[0], peak_force=27.4, peak_band=2.2, place_band=2.2,
        is_load=True, mean_force=np.array([-0.2, 0.4, -27.4]),
    )  # fmt: skip
    table = render(replace(pushed, contacts=replace(pushed.contacts, contacts=(load,))))
    assert '<td class="trust ">load</td>' in table
    assert "△ weak" not in table


def test_few_joints_tell_when_but_not_how_hard(pushed: Analysis) -> None:
    unfelt = dict.fromkeys(OF_FORCES)
    rows = tuple(replace(row, **unfelt) for row in pushed.contacts.contacts)
    bare = replace(pushed.contacts, contacts=rows, smallest_force=None)
    page = render(replace(pushed, contacts=bare))
    listed = page.partition('id="believed"')[0]
    assert listed.count('<td class="force">unknown</td>') == 12
    assert 'id="force"' not in page
    assert 'id="contact-12"' in page
    assert force_chart(pushed, bare) is None
    assert "–" in part("parts/table", contact_details(bare)[0])


def test_the_model_of_a_list_is_told(pushed: Analysis) -> None:
    found = pushed.contacts
    pairs = model_pairs(found)
    assert pairs["basis"] == "free motion"
    assert pairs["free motion"].endswith(" s")
    unknown = replace(found.model, noise_sd=np.full(6, np.nan), prior=None)
    assert "nan" not in str(model_pairs(replace(found, model=unknown)))


def test_joints_of_equal_value_share_a_line() -> None:
    text = joint_values(np.array([5.0, 10.0, 10.0, 7.0]))
    assert re.sub(r"<[^>]*>", " ", text).split() == ["J1", "5.00", "J2–J3", "10.0", "J4", "7.00"]


def test_the_wrench_of_a_row_is_force_moment_mean_and_impulse() -> None:
    """Each the numbers of `contact`, with their 95 % bands behind them."""
    wrench, torque = (grid.rows[0] for grid in contact_details(contact_list(contact())))
    assert wrench == (
        "1", "4.60 – 4.78", "57–78", "0.4, 51.9, −38.8", "3.7, 6.1, 5.5", "0.2, 0.1, 0.0",
        "1.0, 1.0, 1.0", "0.3, 32.0, −24.0", "0.1, 5.6, −4.1", 412.0, 44.0, None, None,
    )  # fmt: skip
    assert torque == ("1", *(f"{joint}.00 ± 1.96" for joint in range(6)), False)


LINE = {"robot": "ur5", "duration_s": 20.0, "joint": 1, "observer": "gmo", "load": False}


def table(*rows: dict[str, object]) -> pl.DataFrame:
    frame = pl.DataFrame([LINE | row for row in rows], schema_overrides={"rmse_Nm": pl.Float64})
    absent = [pl.lit(None, kind).alias(n) for n, kind in SCHEMA.items() if n not in frame.columns]
    return frame.with_columns(absent)


SOUND = {"log": "a.csv", "health": "good", "reason": "sound", "contacts": 2, "rmse_Nm": 0.25}
FORCE = {"hardest_N": 80.4, "hardest_band_N": 6.2, "hardest_s": 11.3}
BAD = {"log": "b<i>.csv", "health": "bad", "reason": "effort: turned", "contacts": 0}


def test_the_index_links_every_report(pushed: Analysis, without_reference: Analysis) -> None:
    reports = [pushed, without_reference]
    pages = ("a b/index.html", '"><script>/index.html')
    html = render_logs(list(map(log_line, reports, pages)), {"<bad>.csv": "no log"}, reports)
    assert 'href="a%20b/index.html"' in html
    assert 'href="%22%3E%3Cscript%3E/index.html"' in html
    assert '"><script>/' not in html
    assert "RMSE in N·m" in html
    assert "3 logs · ur5</p>" in html
    assert "1 log could not be analysed" in html
    assert "✗ &lt;bad&gt;.csv is left out: no log" in html


def shown(*lines: LogSummary) -> list[list[str]]:
    """The entries of every log's row on the page, as HTML."""
    body = render_logs(lines).partition('class="sorts"')[2].partition("</table>")[0]
    rows = re.findall(r"<tr>\s*(<th scope=\"row\".*?)</tr>", body, re.DOTALL)
    return [re.findall(r"<t[hd][^>]*>(.*?)</t[hd]>", row, re.DOTALL) for row in rows]


def test_a_line_says_how_many_how_hard_and_how_sound(pushed: Analysis) -> None:
    line = log_line(pushed, "a b/index.html")
    ((log, robot, span, contacts, hardest, least, error, state),) = shown(line)
    assert (robot, span) == ("ur5", "20.0 s")
    assert log == '<a href="a%20b/index.html">ur5_circle.csv</a>'
    assert (contacts, hardest, least) == ("12", "91 ± 7 N at 5.1 s", "2 N")
    assert error == "0.273 (best)"  # without J5, which rests
    assert re.sub("<.*?>", "", state) == f"{MARKS[line.health]} {line.reason}"
    bad = line._replace(health="bad", reason="load: heavy <b>", log="<i>")
    (row,) = shown(bad)
    assert "load: heavy &lt;b&gt;" in row[-1]
    assert row[0] == '<a href="a%20b/index.html">&lt;i&gt;</a>'
    nothing = log_line(replace(pushed, contacts=None, errors=None))
    assert shown(line, nothing)[1][3:7] == ["–"] * 4
    assert len(shown(nothing)[0]) == 4  # no column for what no log has


def test_a_size_that_goes_with_an_unknown_place_is_a_range(pushed: Analysis) -> None:
    hard = pushed.contacts.hardest
    ends = caution("size-goes-with-place", least_N=20.0, most_N=248.0)
    unsure = replace(hard, anywhere=(20.0, 248.0), remarks=(ends,))
    line = log_line(replace(pushed, contacts=contact_list(unsure)))
    assert line.hardest == f"unknown (20–248 N at {hard.peak:.1f} s)"
    rows = rows_of(replace(pushed, contacts=contact_list(unsure)), "k")
    (told,) = batch_lines(rows.with_columns(log=pl.lit("a.csv")), {})
    assert told.hardest == line.hardest
    assert told.hardness == line.hardness == (False, hard.peak_force)


def test_the_worst_comes_first(pushed: Analysis) -> None:
    hard = log_line(pushed, "b")._replace(health="good")
    weak = hard._replace(log="a", hardest_N=0.0, page="")
    rows = shown(weak, hard, hard._replace(log="c", health="bad", page=""))
    assert [row[0] for row in rows] == ["c", '<a href="b">ur5_circle.csv</a>', "a"]


def test_the_headline_counts_logs(pushed: Analysis) -> None:
    quiet = replace(pushed, contacts=replace(pushed.contacts, contacts=()))
    load = replace(pushed.contacts.contacts[0], is_load=True)
    loaded = replace(pushed, contacts=replace(pushed.contacts, contacts=(load,)))
    title, words = logs_headline([*map(log_line, (pushed, quiet, loaded))])
    assert "1 of 3 logs" in title
    assert "ur5_circle.csv: 91 ± 7 N at 5.1 s. 1 more bears a load" in words
    assert logs_headline([log_line(quiet)] * 2)[0].startswith("Nothing pushed the arm")
    none = replace(pushed, contacts=None)
    title, _ = logs_headline([*map(log_line, (pushed, quiet, none))])
    assert "1 of 2 logs" in title  # what is not listed is not known
    assert logs_headline([log_line(none)]) == ("External joint torques from 1 logs.", "")


def test_one_line_a_log_the_worst_first_and_what_failed() -> None:
    rows = table(SOUND | FORCE, SOUND | FORCE | {"joint": 2, "rmse_Nm": 0.75}, BAD)
    lines = list(batch_lines(rows, {"a.csv": "logs/a 1/index.html"}))
    sound, bad = ("a.csv", "ur5", 20.0), ("b<i>.csv", "ur5", 20.0)
    # The mean of both joints, and the force rounded.
    assert lines == [
        (*sound, "good", "sound", 2, False, 80.4, 6.2, 11.3, None, None, "0.500 (gmo)",
         "logs/a 1/index.html", ()),
        (*bad, "bad", "effort: turned", 0, False, *[None] * 5, "–", "", ()),
    ]  # fmt: skip
    assert [line.hardest for line in lines] == ["80 ± 6 N at 11.3 s", "–"]
    wide = FORCE | {"hardest_band_N": 80.4, "load": True, "log": "d.csv", "detectable_N": 4.0}
    (load,) = batch_lines(table(SOUND | wide), {})
    assert shown(load)[0][3:6] == ["load", "unknown (80 ± 80 N at 11.3 s)", "4 N"]
    page = render_logs(lines, {"c.csv": "empty"})
    assert page.index("b&lt;i&gt;.csv") < page.index(">a.csv<")
    assert 'href="logs/a%201/index.html"' in page
    assert "<h1>Something pushed the arm in 1 of 2 logs.</h1>" in page
    assert ">3 logs · ur5<" in page
    assert "1 log could not be analysed" in page
    assert "c.csv is left out: empty<" in page
    assert "ariaSort" in page
    none = list(batch_lines(table(SOUND).clear(), {}))
    assert "0 logs." in render_logs(none)
