"""The page over a batch: a line a log, the worst first."""

import polars as pl

from vftcli.batch.rows import SCHEMA
from vftcli.outputs.page.batch_page import batch_lines, render_batch

LINE = {"robot": "ur5", "duration_s": 20.0, "joint": 1, "observer": "gmo", "load": False}
FAILURES = {"log": pl.String, "stage": pl.String, "error": pl.String, "line": pl.String}


def table(*rows: dict[str, object]) -> pl.DataFrame:
    frame = pl.DataFrame([LINE | row for row in rows], schema_overrides={"rmse_Nm": pl.Float64})
    absent = [pl.lit(None, kind).alias(n) for n, kind in SCHEMA.items() if n not in frame.columns]
    return frame.with_columns(absent)


SOUND = {"log": "a.csv", "health": "good", "reason": "sound", "contacts": 2, "rmse_Nm": 0.25}
FORCE = {"hardest_N": 80.4, "hardest_band_N": 6.2, "hardest_s": 11.3}
BAD = {"log": "b<i>.csv", "health": "bad", "reason": "effort: turned", "contacts": 0}


def test_one_line_a_log_the_worst_first_and_what_failed() -> None:
    failures = pl.DataFrame([("c.csv", "reading", "LogError", "empty")], FAILURES, orient="row")
    rows = table(SOUND | FORCE, SOUND | FORCE | {"joint": 2, "rmse_Nm": 0.75}, BAD)
    page = render_batch(list(batch_lines(rows, {"a.csv": "logs/a 1/index.html"})), failures)
    assert page.index("b&lt;i&gt;.csv") < page.index(">a.csv<")
    assert 'href="logs/a%201/index.html"' in page
    # The mean of both joints, and the force rounded.
    assert "0.500 N·m (gmo)" in page
    assert "80 ± 6 N at 11.3 s" in page
    assert "2 logs, 1 of 2 touched." in page
    assert "1 log could not be analysed." in page
    assert "LogError" in page
    assert "aria-sort" in page


def test_a_batch_of_failures_alone_has_a_page() -> None:
    page = render_batch(list(batch_lines(table(SOUND).clear(), {})), pl.DataFrame(schema=FAILURES))
    assert "0 logs." in page
