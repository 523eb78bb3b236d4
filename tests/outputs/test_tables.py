import csv
import io
import json
from collections.abc import Callable

import polars as pl
import pytest

from vftcli.evaluation import SCHEMA
from vftcli.outputs import error_tables as tables
from vftcli.outputs.grids import pairs_text


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


def test_terminal_table(errors: pl.DataFrame) -> None:
    """0.55 is within 1.2 × 0.5: a star; the mean is over the joints that are known."""
    assert tables.to_terminal(errors) == (
        "a_b.csv against two-cycle, 100 samples, RMSE in N·m\n"
        "observer     J1     J2    mean\n"
        "fdo       0.550*  12.3    6.45\n"
        "gmo        2.00      –    2.00\n"
        "------------------------------\n"
        "floor     0.500   1.00   0.750\n"
        "floor: RMSE that the reference itself is known to have\n"
        "*: within 1.2 × the floor; the reference can tell no more\n"
        "–: no sample where the reference is known\n"
    )


def test_one_block_a_recording(errors: pl.DataFrame) -> None:
    other = errors.with_columns(recording=pl.lit("b.csv"))
    text = tables.to_terminal(pl.concat([errors, other]))
    assert text.count("observer ") == 2
    assert text.index("a_b.csv") < text.index("b.csv against")


@pytest.mark.parametrize("show", [tables.to_terminal, tables.to_markdown, tables.to_latex])
def test_two_logs_of_one_label_stay_two_tables(errors: pl.DataFrame, show: Callable) -> None:
    """The second log's numbers took the place of the first's."""
    other = errors.with_columns(rmse_Nm=pl.col("rmse_Nm") * 10.0)
    text = show(pl.concat([errors, other]))
    assert text.count("12.3") == 1
    assert text.count("123") == 1
    assert text.count("a_b.csv against") + text.count(r"a\_b.csv against") == 2


def test_pairs_name_the_better_first() -> None:
    rows = pl.DataFrame(
        {
            "recording": ["a.csv"] * 2,
            "joint": [1, 2],
            "observer": ["fdo", "fdo"],
            "other": ["gmo", "gmo"],
            "difference_Nm": [0.5, -0.25],
            "low_Nm": [0.1, -0.5],
            "high_Nm": [0.9, 0.1],
            "p": [0.01, 0.2],
        }
    )
    lines = pairs_text(rows).splitlines()
    assert lines[1].split() == [
        "a.csv",
        "J1",
        "gmo",
        "fdo",
        "0.500",
        "0.100",
        "to",
        "0.900",
        "0.010*",
    ]
    assert lines[2].split() == [
        "a.csv",
        "J2",
        "fdo",
        "gmo",
        "0.250",
        "-0.100",
        "to",
        "0.500",
        "0.200",
    ]
    assert lines[3] == "*: p below 0.05"


def test_what_is_for_details_can_be_left_out(errors: pl.DataFrame) -> None:
    known = errors.with_columns(
        rmse_low_Nm=pl.lit(0.4), rmse_high_Nm=pl.lit(0.7), p_vs_best=pl.lit(1.0)
    )
    assert "95 % interval" in tables.to_terminal(known)
    assert "95 % interval" not in tables.to_terminal(known, every=False)
    assert tables.to_terminal(errors, every=False) == tables.to_terminal(errors)


def test_no_errors_are_said() -> None:
    assert "no errors to show" in tables.to_terminal(pl.DataFrame(schema=SCHEMA))


def test_a_floor_nobody_knows_is_left_out(errors: pl.DataFrame) -> None:
    unknown = errors.with_columns(reference_floor_Nm=pl.lit(None, dtype=pl.Float64))
    assert "floor" not in tables.to_terminal(unknown)


def test_json_has_null_for_unknown(errors: pl.DataFrame) -> None:
    rows = json.loads(tables.FORMS["json"](errors.with_columns(bias_Nm=float("nan"))))
    assert [r["rmse_Nm"] for r in rows] == [0.55, 12.346, 2.0, None]
    assert {r["bias_Nm"] for r in rows} == {None}
    assert set(rows[0]) >= {"recording", "observer", "joint", "reference", "reference_floor_Nm"}


def test_csv_reads_back(errors: pl.DataFrame) -> None:
    rows = list(csv.DictReader(io.StringIO(tables.FORMS["csv"](errors))))
    assert [r["rmse_Nm"] for r in rows] == ["0.55", "12.346", "2.0", ""]


def test_markdown_marks_the_best_and_escapes(errors: pl.DataFrame) -> None:
    text = tables.to_markdown(errors)
    assert "| fdo | **0.550** | **12.3** | 6.45 |" in text
    assert "| gmo | 2.00 | – | 2.00 |" in text
    assert r"a\_b.csv" in text


def test_latex(errors: pl.DataFrame) -> None:
    text = tables.to_latex(errors.with_columns(observer=pl.col("observer") + "_%&"))
    assert r"\caption{a\_b.csv against two-cycle, 100 samples, RMSE in N\,m}" in text
    assert r"\begin{tabular}{lrrr}" in text
    assert (
        r"fdo\_\%\& & \textbf{0.550}\rlap{$^{*}$} & \textbf{12.3}\phantom{0} & 6.45\phantom{0} \\"
    ) in text
    assert text.index(r"\toprule") < text.index(r"\midrule") < text.index(r"\bottomrule")
    assert r"floor & 0.500 & 1.00 & 0.750 \\" in text
    assert text.index("floor: RMSE that") < text.index(r"\end{table}")


def test_logs_share_a_latex_table_and_a_dagger_goes_with_its_log(errors: pl.DataFrame) -> None:
    other = errors.with_columns(recording=pl.lit("b.csv"), reference_trusted=pl.col("joint") != 2)
    text = tables.to_latex(pl.concat([errors, other]))
    assert text.count(r"\begin{table}") == 1
    assert r"\textit{b.csv against two-cycle, 100 samples, J2$\dagger$}" in text
    assert r"\multicolumn{1}{c}{$J_{2}$}" in text
    alone = tables.to_latex(other)
    assert r"\multicolumn{1}{c}{$J_{2}$$^\dagger$}" in alone


def test_a_name_is_no_command_of_latex(errors: pl.DataFrame) -> None:
    text = tables.to_latex(errors.with_columns(recording=pl.lit("a\n\\input{b}")))
    assert r"\input" not in text
