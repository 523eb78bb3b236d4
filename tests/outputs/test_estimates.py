import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from vftcli.analysis import Analysis
from vftcli.outputs import OutputChoice
from vftcli.outputs.estimates import estimates_table, write_estimate_folder, write_estimates


def test_parquet_holds_flat_float_columns(analysis: Analysis, tmp_path: Path) -> None:
    write_estimates(tmp_path / "e.parquet", analysis)
    table = pl.read_parquet(tmp_path / "e.parquet")
    # Nobody needs the eighth digit of a band.
    single = {name for name, kind in table.schema.items() if kind == pl.Float32}
    assert single == {name for name in table.columns if name.startswith("band/")} != set()
    assert set(table.drop(single).dtypes) == {pl.Float64}
    assert table.columns[:2] == ["t", "q/1"]
    assert {"dq/6", "tau_ext/fdo/1", "tau_ext/kfo-zoh/6", "sd/kfo-fe/1"} <= set(table.columns)
    for estimate in analysis.estimates:
        for j in range(6):
            column = table[f"tau_ext/{estimate.name}/{j + 1}"].to_numpy()
            np.testing.assert_array_equal(column, estimate.tau[:, j])
    np.testing.assert_array_equal(table["t"].to_numpy(), analysis.t)
    found = json.loads(pl.read_parquet_metadata(tmp_path / "e.parquet")["vftcli"])
    assert {name.partition("/")[0] for name in table.columns} == set(found["columns"])
    assert found["columns"]["wrench"] == "N and N·m, on the robot"
    assert found["columns"]["tau_ext"] == "N·m, on the robot"
    assert found["frames"]["best"] == "flange axes, moment about the flange point"


def test_unknown_is_null_or_no_column(analysis: Analysis, without_reference: Analysis) -> None:
    """The reference of the fixture is unknown in its first 20 samples."""
    column = estimates_table(analysis)["tau_ext/reference/3"]
    assert column.null_count() == 20
    assert not column.is_nan().any()
    assert not [c for c in estimates_table(without_reference).columns if "reference" in c]


def test_csv_has_the_same_columns(analysis: Analysis, tmp_path: Path) -> None:
    write_estimate_folder(tmp_path, analysis, "", OutputChoice(csv=True))
    table = pl.read_csv(tmp_path / "estimates.csv")
    assert {path.suffix for path in tmp_path.iterdir()} == {".csv", ".parquet", ".json"}
    assert table.columns == estimates_table(analysis).columns
    assert table["tau_ext/reference/1"].null_count() == 20
    # nine printed digits
    np.testing.assert_allclose(table["q/2"], analysis.recording.q[:, 1], atol=1e-9)


@pytest.mark.parametrize(("extra", "name", "begins"), [
    ("mcap", "estimates.mcap", b"\x89MCAP0\r\n"),
    pytest.param("rrd", "recording.rrd", b"RRF2", marks=pytest.mark.slow),
])  # fmt: skip
def test_an_extra_is_one_more_file_of_its_format(analysis, tmp_path, extra, name, begins):
    write_estimate_folder(tmp_path, analysis, "", OutputChoice(**{extra: True}))
    assert {path.name for path in tmp_path.iterdir()} == {"estimates.parquet", "run.json", name}
    assert (tmp_path / name).read_bytes().startswith(begins)


def test_every_sample_says_which_contact_it_lies_in(touched: Analysis) -> None:
    t, number = touched.t, estimates_table(touched)["contact"]
    for contact in touched.contacts.contacts:
        inside = (t >= contact.start) & (t <= contact.stop)
        assert number.filter(inside).to_list() == [contact.number] * inside.sum() != []
        number = number.set(pl.Series(inside), None)
    assert number.is_null().all()


def test_what_the_pose_hides_is_apart(analysis: Analysis) -> None:
    """By plain least squares nothing is: it would be anything."""
    sensed, reference, count = analysis.virtual_sensor, analysis.reference, len(analysis.t)
    rising, first = np.arange(float(count)), np.arange(count) < 5
    sd = np.tile(rising[:, None], 6)
    wrench = replace(sensed.wrenches[0], masked=first, null_space=rising, sigma_min=2.0 * rising)
    for solver, apart in (("map", True), ("pinv", False)):
        sensor = replace(sensed.sensor, solver=solver)
        sensing = replace(sensed, wrenches=(wrench,), sensor=sensor)
        made = replace(analysis, virtual_sensor=sensing, reference=replace(reference, sd=sd))
        table = estimates_table(made)
        name = wrench.name
        assert table[f"wrench/{name}/fx"].is_null().to_numpy().tolist() == first.tolist()
        assert (f"wrench_masked/{name}/fx" in table.columns) == apart
        if apart:
            found = table[f"wrench_masked/{name}/fx"]
            assert found.is_null().to_numpy().tolist() == (~first).tolist()
            assert found[:5].to_list() == wrench.values[:5, 0].tolist()
        assert table[f"null_space/{name}"].to_list() == rising.tolist()
        assert table["sigma_min"].to_list() == (2.0 * rising).tolist()
        assert table["sd/reference/6"].to_list() == rising.tolist()


def test_a_log_in_blocks_gives_the_same_folder(analysis: Analysis, tmp_path: Path) -> None:
    choice = OutputChoice(csv=True)
    write_estimate_folder(tmp_path / "whole", analysis, "", choice)
    blocks = [slice(start, start + 250) for start in range(0, len(analysis.t), 250)]
    groups = ((analysis, rows) for rows in (None, *blocks))
    last, _ = write_estimate_folder(tmp_path / "blocks", groups, "", choice)
    assert last is analysis
    one, other = (tmp_path / folder for folder in ("whole", "blocks"))
    assert (one / "estimates.csv").read_bytes() == (other / "estimates.csv").read_bytes()
    tables = (pl.read_parquet(folder / "estimates.parquet") for folder in (one, other))
    assert next(tables).equals(next(tables), null_equal=True)
    groups = ((analysis, rows) for rows in blocks)
    write_estimate_folder(tmp_path / "bare", groups, "")
    names = {path.name for path in (tmp_path / "bare").iterdir()}
    assert names == {"estimates.parquet", "run.json"}
