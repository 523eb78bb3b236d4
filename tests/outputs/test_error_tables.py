from collections.abc import Callable

import numpy as np
import polars as pl
import pytest

from vftcli.evaluation.errors import SCHEMA
from vftcli.evaluation.references import WRENCH_SCHEMA
from vftcli.outputs import error_tables
from vftcli.outputs import error_tables as tables
from vftcli.outputs.grid import latex, markdown, terminal
from vftcli.outputs.grids import contact_grids, drift_grid, pairs_text
from vftcli.outputs.page.shell import part
from vftcli.signals.wrench import AXES
from vftcli.wrench.sensor import Drift


def marks(*tables: error_tables.Block) -> str:
    return "\n".join(error_tables.marks_in_words(tables))


def row(observer: str, joint: int, rmse: float | None, **changed: object) -> dict[str, object]:
    """A row of errors with a floor of half a newton metre a joint."""
    known = {"observer": observer, "joint": joint, "rmse_Nm": rmse, "reference": "two-cycle"}
    known |= {"recording": "a_b.csv", "reference_floor_Nm": 0.5 * joint, "samples": 100}
    return known | changed


def errors_of(*changed: dict[str, object]) -> pl.DataFrame:
    """Two observers on two joints, rows changed one by one."""
    base = [("fdo", 1, 0.6), ("fdo", 2, 2.0), ("gmo", 1, 0.5999), ("gmo", 2, 1.0)]
    rows = []
    for k, (observer, joint, rmse) in enumerate(base):
        own = changed[k] if k < len(changed) else {}
        more = {"recording": "run.csv", "reference_floor_Nm": 0.5, "samples": 100 + k}
        rows.append(row(observer, joint, rmse, **(more | own)))
    return pl.DataFrame(rows, schema=SCHEMA)


def test_the_best_is_bold_where_the_reference_can_tell() -> None:
    """Also both of two that print alike; J1: both at the floor of .5; J2: it rests."""
    (block,) = error_tables.blocks(errors_of(*[{"reference_floor_Nm": 0.1}] * 4))
    assert block.best.tolist() == [[True, False], [True, True]]
    rests = {"reference_trusted": False}
    (block,) = error_tables.blocks(errors_of({}, rests, {}, rests))
    assert not block.best.any()
    (block,) = error_tables.blocks(errors_of({"rmse_Nm": None}))
    assert block.best.tolist() == [[False, False], [True, True]]
    assert block.means.errors["fdo"] == 2.0
    assert "no sample" in marks(block)
    (block,) = error_tables.blocks(errors_of({"missing": 0.12}, {"missing": 0.03}))
    assert "fdo: no answer in up to 12 %" in marks(block)
    assert "no answer" not in marks(*error_tables.blocks(errors_of()))


def test_every_output_has_one_mean_and_says_what_it_leaves_out() -> None:
    """J2's reference is not to be trusted: terminal, Markdown, LaTeX and page show J1's error."""
    rests = {"reference_trusted": False}
    (block,) = error_tables.blocks(errors_of({}, rests, {"rmse_Nm": 0.9}, rests))
    grid = error_tables.rmse_grid(block)
    assert block.means.errors == {"fdo": 0.6, "gmo": 0.9}
    for text in (terminal(grid), markdown(grid), latex(grid), part("parts/table", grid)):
        assert "0.600" in text
        assert "1.30" not in text  # the mean of .6 and 2
    assert "mean: without J2" in terminal(grid) + marks(block)
    assert "mean: without J2" in latex(grid)
    assert block.joint_heads == ["J1", "J2†"]
    assert "do not trust it" in marks(block)
    assert "†" not in marks(*error_tables.blocks(errors_of()))


def test_at_the_floor_is_within_a_fifth_of_it_also_of_one_joint() -> None:
    """Joint 1: .6 is 1.2 × .5; joint 2: 1 is twice the floor."""
    (block,) = error_tables.blocks(errors_of())
    assert block.at_floor.tolist() == [[True, False], [True, False]]
    assert block.title == "run.csv against two-cycle, 100 to 103 samples"
    none = {"reference_floor_Nm": None}
    (block,) = error_tables.blocks(errors_of(none, {}, none))
    assert block.has_floor
    assert np.isnan(block.floor[0])
    assert "floor" not in tables.to_terminal(errors_of(*[none] * 4))


@pytest.mark.parametrize(("values", "texts"), [
    ((0.5, 12.34, 0.0604, 0.946), ["0.50–12", "60", "95 %"]),
    ((None, 1.0, 0.0, 1.0), ["–", "0", "100 %"]),
    ((0.5, None, None, None), ["–"] * 3),
])  # fmt: skip
def test_details_as_text(values: tuple[float | None, ...], texts: list[str]) -> None:
    keys = ("rmse_low_Nm", "rmse_high_Nm", "lag_s", "coverage_95")
    assert list(error_tables.details(dict(zip(keys, values, strict=True)))) == texts


def test_a_detail_that_nobody_knows_has_no_table() -> None:
    known = [{"lag_s": 0.01}] * 4
    titles = [grid.title for grid in error_tables.detail_grids(errors_of(*known))]
    assert len(titles) == 1
    assert titles[0].startswith("run.csv: delay")
    assert list(error_tables.detail_grids(errors_of())) == []


@pytest.fixture
def errors() -> pl.DataFrame:
    known = [("fdo", 1, 0.55), ("fdo", 2, 12.346), ("gmo", 1, 2.0), ("gmo", 2, None)]
    return pl.DataFrame([row(*numbers) for numbers in known], schema=SCHEMA)


def test_terminal_table(errors: pl.DataFrame) -> None:
    """0.55 is within 1.2 × 0.5: a star; the mean is over the joints that are known."""
    assert tables.to_terminal(errors) == (
        "a_b.csv against two-cycle, 100 samples, RMSE in N·m\n"
        "observer     J1     J2    mean\n"
        "fdo       0.550*  12.3    6.45\n"
        "gmo        2.00      –    2.00\n"
        "------------------------------\n"
        "floor     0.500   1.00   0.750\n"
        "floor: the reference's own error (RMSE)\n"
        "*: within 1.2 × the floor: may be the reference's own error\n"
        "–: no sample where the reference is known\n"
    )


@pytest.mark.parametrize("show", [tables.to_terminal, tables.to_markdown, tables.to_latex])
def test_two_logs_of_one_label_stay_two_tables(errors: pl.DataFrame, show: Callable) -> None:
    """The second log's numbers took the place of the first's."""
    other = errors.with_columns(rmse_Nm=pl.col("rmse_Nm") * 10.0)
    text = show(pl.concat([errors, other]))
    assert text.count("12.3") == 1
    assert text.count("123") == 1
    assert text.count("a_b.csv against") + text.count(r"a\_b.csv against") == 2
    fewer = errors.filter(pl.col("joint") == 1)
    logs = error_tables.logs_of(pl.concat([errors, fewer]), "joint")
    assert [len(rows) for rows in logs] == [4, 2]


def test_pairs_name_the_better_first() -> None:
    names = ["recording", "joint", "observer", "other", "difference_Nm", "low_Nm", "high_Nm", "p"]
    rows = [("a.csv", 1, "fdo", "gmo", 0.5, 0.1, 0.9, 0.01)]
    rows += [("a.csv", 2, "fdo", "gmo", -0.25, -0.5, 0.1, 0.2)]
    lines = pairs_text(pl.DataFrame(rows, names, orient="row")).splitlines()
    assert " ".join(lines[1].split()) == "a.csv J1 gmo fdo 0.500 0.100 to 0.900 0.010*"
    assert " ".join(lines[2].split()) == "a.csv J2 fdo gmo 0.250 -0.100 to 0.500 0.200"
    assert lines[3] == "*: p below 0.05"


def test_what_is_for_details_can_be_left_out(errors: pl.DataFrame) -> None:
    numbers = {"rmse_low_Nm": 0.4, "rmse_high_Nm": 0.7}
    known = errors.with_columns(**{name: pl.lit(x) for name, x in numbers.items()})
    assert "95 % interval" in tables.to_terminal(known)
    assert "95 % interval" not in tables.to_terminal(known, every=False)
    assert tables.to_terminal(errors, every=False) == tables.to_terminal(errors)
    assert "no errors to show" in tables.to_terminal(pl.DataFrame(schema=SCHEMA))


def test_latex(errors: pl.DataFrame) -> None:
    assert "| fdo | **0.550** | **12.3** | 6.45 |" in tables.to_markdown(errors)
    text = tables.to_latex(errors)
    assert r"\caption{a\_b.csv against two-cycle, 100 samples, RMSE in N\,m}" in text
    assert r"fdo & \textbf{0.550}\rlap{$^{*}$} & \textbf{12.3}\phantom{0} & 6.45" in text
    assert r"floor & 0.500 & 1.00 & 0.750 \\" in text
    assert text.index("floor: the reference") < text.index(r"\end{table}")


def test_logs_share_a_latex_table_where_the_same_joints_rest(errors: pl.DataFrame) -> None:
    other = errors.with_columns(recording=pl.lit("b.csv"))
    trusted = pl.col("joint") != 2
    resting = other.with_columns(recording=pl.lit("c.csv"), reference_trusted=trusted)
    text = tables.to_latex(pl.concat([errors, other, resting], how="diagonal"))
    shared, alone = text.split(r"\end{table}")[:2]
    assert text.count(r"\begin{table}") == 2
    assert shared.count(r"\begin{tabular}") == 1
    assert r"\caption{RMSE in N\,m}" in shared
    assert r"\multicolumn{4}{l}{\textit{b.csv against two-cycle, 100 samples}} \\" in shared
    assert r"\multicolumn{1}{c}{$J_{2}$}" in shared
    assert r"\multicolumn{1}{c}{$J_{2}$$^\dagger$}" in alone
    assert r"$\dagger$: the joint rests" in alone


@pytest.fixture
def wrench_errors() -> pl.DataFrame:
    """gmo against a sensor: 1.5 N on every force axis, .25 N·m on every moment axis."""
    shared = {"recording": "run.csv", "observer": "gmo", "reference": "sensor", "samples": 90}
    sizes = [{"rmse_N": 1.5}] * 3 + [{"rmse_Nm": 0.25}] * 3
    rows = [shared | {"axis": axis} | size for axis, size in zip(AXES, sizes, strict=True)]
    return pl.DataFrame(rows, schema=WRENCH_SCHEMA)


def test_forces_in_newtons_beside_moments_in_newton_metres(wrench_errors: pl.DataFrame) -> None:
    (grid,) = error_tables.axis_grids(wrench_errors)
    assert terminal(grid).splitlines() == [
        "run.csv against sensor, wrench, 90 unmasked samples, RMSE",
        "observer  fx [N]  fy [N]  fz [N]  mx [N·m]  my [N·m]  mz [N·m]",
        "gmo         1.50    1.50    1.50     0.250     0.250     0.250",
    ]


def test_a_pose_that_hides_every_wrench_is_said_in_one_line(wrench_errors: pl.DataFrame) -> None:
    """It was a table of dashes over "0 unmasked samples"."""
    nothing = pl.lit(None, pl.Float64)
    none = wrench_errors.with_columns(samples=pl.lit(0), rmse_N=nothing, rmse_Nm=nothing)
    assert list(error_tables.axis_grids(none)) == []
    (line,) = error_tables.nothing_to_compare(none)
    assert line.startswith("run.csv against sensor, wrench: nothing to compare: ")
    assert "below 0.05" in line
    assert list(error_tables.nothing_to_compare(wrench_errors)) == []


def test_contacts_are_counted_in_whole_numbers(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "200")
    counts = {"contacts": 3, "listed": 4, "found": 3, "missed": 0}
    row: dict[str, object] = {"recording": "run.csv", "observer": "best"}
    row |= {k if k == "contacts" else f"{k}_contacts": count for k, count in counts.items()}
    row |= {"false_alarms": 0, "false_alarms_per_h": 0.0, "detection_delay_s": 0.04}
    row |= {"longest_delay_s": None}
    (grid,) = contact_grids(pl.DataFrame([row, row | {"contacts": None}]))
    assert terminal(grid).splitlines()[2].split() == [
        "run.csv", "best", "3", "4", "3", "0", "0", "0", "0.040", "–",
    ]  # fmt: skip
    assert list(contact_grids(pl.DataFrame({"recording": ["a"]}))) == []


def test_zero_drift_has_five_decimals_as_the_paper_prints_it() -> None:
    mean = np.array([-0.43166, -0.53348, 0.83768, -0.16294, 0.13407, 0.09103])
    shared = {"span": (1.0, 4.5), "sd": np.zeros(6), "samples": 9, "frame": "base"}
    grid = drift_grid([Drift(name="kfo-fe", mean=mean, **shared)])
    _, heads, line = terminal(grid).splitlines()
    assert heads.startswith("observer  span [s]    fx [N]")
    assert len(heads) <= 80
    assert line.split() == [
        "kfo-fe", "1–4.5",
        "−0.43166", "−0.53348", "0.83768", "−0.16294", "0.13407", "0.09103",
    ]  # fmt: skip
