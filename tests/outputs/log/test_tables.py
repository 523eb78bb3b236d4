import csv
import io
import json

import polars as pl
import pytest

from vftcli.evaluation import SCHEMA
from vftcli.outputs.log import tables


def row(observer: str, joint: int, rmse: float | None, **changed: object) -> dict[str, object]:
    return {
        "recording": "a_b.csv",
        "observer": observer,
        "joint": joint,
        "rmse_Nm": rmse,
        "bias_Nm": 0.1,
        "max_Nm": 1.0,
        "correlation": None,
        "reference": "two-cycle",
        "reference_floor_Nm": 0.5 * joint,
        "samples": 100,
    } | changed


@pytest.fixture
def errors() -> pl.DataFrame:
    return pl.DataFrame(
        [row("fdo", 1, 0.55), row("fdo", 2, 12.346), row("gmo", 1, 2.0), row("gmo", 2, None)],
        schema=SCHEMA,
    )


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.42649, "0.426"),
        (12.346, "12.3"),
        (1234.5, "1234"),
        (0.0027812, "0.00278"),
        (0.9996, "1.00"),
        (9.996, "10.0"),
        (0.0, "0"),
        (-1.234, "-1.23"),
        (1.5e-7, "1.50e-07"),
        (float("nan"), "–"),
    ],
)
def test_three_significant_digits(value: float, text: str) -> None:
    assert tables.significant(value) == text


def test_terminal_table(errors: pl.DataFrame) -> None:
    """0.55 is within 1.2 × 0.5: a star; the mean is over the joints that are known."""
    assert tables.terminal(errors) == (
        "a_b.csv against two-cycle, 100 samples, RMSE in N·m\n"
        "observer     J1     J2    mean\n"
        "fdo       0.550*  12.3    6.45\n"
        "gmo        2.00      –    2.00\n"
        "------------------------------\n"
        "floor     0.500   1.00   0.750\n"
        "floor: RMSE that the reference itself is known to have\n"
        "*: within 1.2 × the floor; the reference can tell no more\n"
        "–: no sample where both the estimate and the reference are known\n"
    )


def test_one_block_a_recording(errors: pl.DataFrame) -> None:
    other = errors.with_columns(recording=pl.lit("b.csv"))
    text = tables.terminal(pl.concat([errors, other]))
    assert text.count("observer ") == 2
    assert text.index("a_b.csv") < text.index("b.csv against")


def test_no_errors_are_said() -> None:
    assert "no errors to show" in tables.terminal(pl.DataFrame(schema=SCHEMA))


def test_a_floor_nobody_knows_is_left_out(errors: pl.DataFrame) -> None:
    unknown = errors.with_columns(reference_floor_Nm=pl.lit(None, dtype=pl.Float64))
    assert "floor" not in tables.terminal(unknown)


def test_json_has_null_for_unknown(errors: pl.DataFrame) -> None:
    rows = json.loads(tables.to_json(errors.with_columns(bias_Nm=float("nan"))))
    assert [r["rmse_Nm"] for r in rows] == [0.55, 12.346, 2.0, None]
    assert {r["bias_Nm"] for r in rows} == {None}
    assert set(rows[0]) >= {"recording", "observer", "joint", "reference", "reference_floor_Nm"}


def test_csv_reads_back(errors: pl.DataFrame) -> None:
    rows = list(csv.DictReader(io.StringIO(tables.to_csv(errors))))
    assert [r["rmse_Nm"] for r in rows] == ["0.55", "12.346", "2.0", ""]


def test_markdown_marks_the_best_and_escapes(errors: pl.DataFrame) -> None:
    text = tables.to_markdown(errors)
    assert "| fdo | **0.550** | **12.3** | 6.45 |" in text
    assert "| gmo | 2.00 | – | 2.00 |" in text
    assert r"a\_b.csv" in text


def test_latex(errors: pl.DataFrame) -> None:
    text = tables.to_latex(errors.with_columns(observer=pl.col("observer") + "_%&"))
    assert text.startswith("% a_b.csv")
    assert r"\begin{tabular}{lrrr}" in text
    assert r"RMSE [N\,m]" in text
    assert r"fdo\_\%\& & \textbf{0.550} & \textbf{12.3} & 6.45 \\" in text
    assert text.index(r"\toprule") < text.index(r"\midrule") < text.index(r"\bottomrule")
    assert r"floor & 0.500 & 1.00 & 0.750 \\" in text


def test_latex_comment_stays_one_line(errors: pl.DataFrame) -> None:
    text = tables.to_latex(errors.with_columns(recording=pl.lit("a\n\\input{b}")))
    assert "\n\\input" not in text
