from dataclasses import replace

from vftcli.analysis import Analysis
from vftcli.outputs.believability import MARKS
from vftcli.outputs.page.index_page import headline, index_line, index_row, render_index


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
    line = index_line("a b", pushed)
    log, robot, span, contacts, hardest, least, error, state = index_row(line)
    assert (log.text, robot, span) == ("ur5_circle.csv", "ur5", "20.0 s")
    assert log.html == '<a href="a%20b/index.html">ur5_circle.csv</a>'
    assert (contacts, hardest, least) == ("12", "95 ± 9 N at 11.3 s", "4 N")
    assert error == "0.273 N·m (best)"  # without J5, which rests
    assert state.text == f"{MARKS[line.standing]} {line.words}"
    bad = line._replace(standing="bad", words="load: heavy <b>", name="<i>")
    assert "load: heavy &lt;b&gt;" in index_row(bad)[-1].html
    assert index_row(bad)[0].html == '<a href="a%20b/index.html">&lt;i&gt;</a>'
    assert (
        index_row(index_line("a", replace(pushed, contacts=None, errors=None)))[3:7] == ("–",) * 4
    )


def test_the_worst_comes_first(pushed: Analysis) -> None:
    hard = index_line("b", pushed)._replace(standing="good")
    lines = [hard._replace(page="a", force=0.0), hard, hard._replace(page="c", standing="bad")]
    assert [line.page for line in sorted(lines, key=lambda line: line.rank)] == [
        "c",
        "b/index.html",
        "a",
    ]
    html = render_index([("first", replace(pushed, contacts=None)), ("second", pushed)])
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
