"""The pages over several logs, and over a batch: a line a log, the worst first."""

from dataclasses import replace

import polars as pl

from vftcli.analysis import Analysis
from vftcli.batch.log_work import SCHEMA
from vftcli.outputs.believability import MARKS
from vftcli.outputs.page.pages import (
    batch_lines,
    index_headline,
    index_line,
    overview_row,
    render_batch,
    render_index,
)

LINE = {"robot": "ur5", "duration_s": 20.0, "joint": 1, "observer": "gmo", "load": False}
FAILURES = {"log": pl.String, "stage": pl.String, "error": pl.String, "line": pl.String}


def table(*rows: dict[str, object]) -> pl.DataFrame:
    frame = pl.DataFrame([LINE | row for row in rows], schema_overrides={"rmse_Nm": pl.Float64})
    absent = [pl.lit(None, kind).alias(n) for n, kind in SCHEMA.items() if n not in frame.columns]
    return frame.with_columns(absent)


SOUND = {"log": "a.csv", "health": "good", "reason": "sound", "contacts": 2, "rmse_Nm": 0.25}
FORCE = {"hardest_N": 80.4, "hardest_band_N": 6.2, "hardest_s": 11.3}
BAD = {"log": "b<i>.csv", "health": "bad", "reason": "effort: turned", "contacts": 0}


def test_the_index_links_every_report_and_names_what_is_left_out(
    pushed: Analysis, without_reference: Analysis
) -> None:
    reports = [("a b", pushed), ('"><script>', without_reference)]
    html = render_index(reports, {"<bad>.csv": "no log"})
    assert 'href="a%20b/index.html"' in html
    assert 'href="%22%3E%3Cscript%3E/index.html"' in html
    assert '"><script>/' not in html
    assert "RMSE in N·m" in html
    assert "3 logs · Universal Robots UR5 (CB3)</p>" in html
    assert "✗ &lt;bad&gt;.csv is left out: no log" in html


def test_a_line_says_how_many_how_hard_and_how_sound(pushed: Analysis) -> None:
    line = index_line("a b", pushed)
    log, robot, span, contacts, hardest, least, error, state = overview_row(line)
    assert (log.text, robot, span) == ("ur5_circle.csv", "ur5", "20.0 s")
    assert log.html == '<a href="a%20b/index.html">ur5_circle.csv</a>'
    assert (contacts, hardest, least) == ("12", "91 ± 7 N at 5.1 s", "2 N")
    assert error == "0.273 N·m (best)"  # without J5, which rests
    assert state.text == f"{MARKS[line.standing]} {line.words}"
    bad = line._replace(standing="bad", words="load: heavy <b>", name="<i>")
    assert "load: heavy &lt;b&gt;" in overview_row(bad)[-1].html
    assert overview_row(bad)[0].html == '<a href="a%20b/index.html">&lt;i&gt;</a>'
    assert (
        overview_row(index_line("a", replace(pushed, contacts=None, errors=None)))[3:7]
        == ("–",) * 4
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
    quiet = replace(pushed, contacts=replace(pushed.contacts, contacts=()))
    load = replace(pushed.contacts.contacts[0], is_load=True)
    loaded = replace(pushed, contacts=replace(pushed.contacts, contacts=(load,)))
    title, words = index_headline([pushed, quiet, loaded])
    assert "1 of 3 logs" in title
    assert "ur5_circle.csv: 91 ± 7 N at 5.1 s. 1 more bears a load" in words
    assert index_headline([quiet, quiet])[0].startswith("Nothing pushed the arm")
    none = replace(pushed, contacts=None)
    assert index_headline([none]) == ("External joint torques from 1 logs.", "")


def test_one_line_a_log_the_worst_first_and_what_failed() -> None:
    failures = pl.DataFrame([("c.csv", "reading", "LogError", "empty")], FAILURES, orient="row")
    rows = table(SOUND | FORCE, SOUND | FORCE | {"joint": 2, "rmse_Nm": 0.75}, BAD)
    lines = list(batch_lines(rows, {"a.csv": "logs/a 1/index.html"}))
    sound, bad = ("a.csv", "ur5", 20.0), ("b<i>.csv", "ur5", 20.0)
    # The mean of both joints, and the force rounded.
    assert lines == [
        (*sound, "2", "80 ± 6 N at 11.3 s", 80.4, None, "good", "sound", "logs/a 1/index.html",
         "0.500 N·m (gmo)"),
        (*bad, "0", "–", 0.0, None, "bad", "effort: turned", "", "–"),
    ]  # fmt: skip
    wide = FORCE | {"hardest_band_N": 80.4, "load": True, "log": "d.csv", "detectable_N": 4.0}
    (load,) = batch_lines(table(SOUND | wide), {})
    assert load[3:7] == ("load", "unknown (80 ± 80 N at 11.3 s)", 80.4, 4.0)
    page = render_batch(lines, failures)
    assert page.index("b&lt;i&gt;.csv") < page.index(">a.csv<")
    assert 'href="logs/a%201/index.html"' in page
    assert "2 logs, 1 of 2 touched." in page
    assert ">3 logs · ur5<" in page
    assert "1 log could not be analysed." in page
    assert "LogError" in page
    assert "ariaSort" in page


def test_a_batch_of_failures_alone_has_a_page() -> None:
    page = render_batch(
        list(batch_lines(table(SOUND).clear(), {})), pl.DataFrame(schema=FAILURES)
    )
    assert "0 logs." in page
