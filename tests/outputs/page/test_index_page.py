from dataclasses import replace

import pytest

from vftcli.analysis import Analysis
from vftcli.outputs.believability import Ground
from vftcli.outputs.page import index_page
from vftcli.outputs.page.index_page import (
    headline,
    index_line,
    index_row,
    link,
    page_in,
    rank,
    render_index,
)


def test_the_index_links_every_report(pushed: Analysis, without_reference: Analysis) -> None:
    html = render_index([("a b", pushed), ('"><script>', without_reference)])
    assert 'href="a%20b/index.html"' in html
    assert 'href="%22%3E%3Cscript%3E/index.html"' in html
    assert '"><script>/' not in html
    assert "RMSE in N·m" in html


def test_a_log_that_is_left_out_is_named(pushed: Analysis) -> None:
    html = render_index([("a", pushed)], {"<bad>.csv": "no log"})
    assert "✗ &lt;bad&gt;.csv is left out: no log" in html
    assert "2 logs" in html


def test_a_line_says_how_many_how_hard_and_how_sound(pushed: Analysis) -> None:
    sound = Ground(standing="good", subject="clock", sentence="no gap")
    log, robot, span, contacts, hardest, least, error, state = index_row(
        index_line("a", pushed, sound)
    )
    assert (log.text, robot, span) == ("ur5_circle.csv", "ur5", "20.0 s")
    assert (contacts, hardest, least) == ("12", "95 ± 9 N at 11.3 s", "4 N")
    assert error == "0.273 N·m (best)"  # without J5, which rests
    assert state.text == "✓ sound"
    bad = Ground(standing="bad", subject="load", sentence="heavy <b>")
    assert "load: heavy &lt;b&gt;" in index_row(index_line("a", pushed, bad))[-1].html
    assert (
        index_row(index_line("a", replace(pushed, contacts=None, errors=None), bad))[3:7]
        == ("–",) * 4
    )


def test_the_worst_comes_first(pushed: Analysis, monkeypatch: pytest.MonkeyPatch) -> None:
    bare = replace(pushed, contacts=None)
    good, bad = (Ground(standing=s, subject="s", sentence="x") for s in ("good", "bad"))
    lines = [("a", bare, good), ("b", pushed, good), ("c", bare, bad)]
    worst = sorted((index_line(*line) for line in lines), key=rank)
    assert [line.page for line in worst] == ["c/index.html", "b/index.html", "a/index.html"]
    found = iter([good, bad])
    monkeypatch.setattr(index_page, "health", lambda _: next(found))
    html = render_index([("first", pushed), ("second", bare)])
    assert html.index("second/index.html") < html.index("first/index.html")


def test_the_headline_counts_logs(pushed: Analysis) -> None:
    assert pushed.contacts is not None
    quiet = replace(pushed, contacts=replace(pushed.contacts, contacts=()))
    load = replace(pushed.contacts.contacts[0], is_load=True)
    loaded = replace(pushed, contacts=replace(pushed.contacts, contacts=(load,)))
    title, words = headline([("a", pushed), ("b", quiet), ("c", loaded)])
    assert title == "Something pushed the arm in 1 of 3 logs."
    assert words == (
        "Hardest in ur5_circle.csv: 95 ± 9 N at 11.3 s. "
        "1 more bears a load, or a wrong payload or model."
    )
    title, words = headline([("b", quiet), ("b", quiet)])
    assert (title, words) == ("Nothing pushed the arm, as far as these logs can tell.", "")
    none = replace(pushed, contacts=None)
    assert headline([("a", none)]) == ("External joint torques from 1 logs.", "")


def test_a_link_may_hold_any_letter() -> None:
    assert link(page_in("a b"), "<i>") == '<a href="a%20b/index.html">&lt;i&gt;</a>'
