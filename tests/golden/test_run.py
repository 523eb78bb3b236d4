"""The comparison of what users see: it finds what moved, and nothing where nothing did."""

import importlib.util
import json
from pathlib import Path

import polars as pl
import pytest

spec = importlib.util.spec_from_file_location("golden", Path(__file__).with_name("run.py"))
assert spec is not None
assert spec.loader is not None
golden = importlib.util.module_from_spec(spec)
spec.loader.exec_module(golden)

CONTACTS = {
    "peak": [{"force_N": 88.4, "where": "wrist"}, {"force_N": 52.6, "where": "link 3"}],
    "remarks": [
        {"code": "at-rest", "message": "J5 stands still: pushes below 1.5 N·m do not show"}
    ],
    "samples": 2501,
    "free_s": None,
}


def moves(new: object, rtol: float = 1e-9) -> list[str]:
    return golden.moves(leaves(CONTACTS), leaves(new), rtol)


def leaves(tree: object) -> dict[str, list[object]]:
    found: dict[str, list[object]] = golden.Leaves(list)
    golden.add_tree(tree, "log", found)
    return json.loads(json.dumps(found))  # as it is kept


def test_a_moved_number_is_found_by_its_size_and_nothing_moves_by_itself() -> None:
    assert moves(CONTACTS) == []
    moved = json.loads(json.dumps(CONTACTS))
    moved["peak"][1]["force_N"] *= 1 + 1e-6
    assert [line.split(":")[0] for line in moves(moved)] == ["log.peak[].force_N"]
    assert moves(moved, rtol=1e-5) == []


@pytest.mark.parametrize(
    ("key", "value"), [("samples", 2500), ("samples", 2501.0), ("free_s", 0.0)]
)
def test_whole_numbers_and_empty_values_are_exact(key: str, value: float) -> None:
    assert [line.split(":")[0] for line in moves(CONTACTS | {key: value}, rtol=1.0)] == [
        f"log.{key}"
    ]


def test_a_vanished_code_is_found_and_a_sentence_may_be_reworded() -> None:
    assert moves(CONTACTS | {"remarks": [{"code": "at-rest", "message": "other words"}]}) == []
    (code, count) = moves(CONTACTS | {"remarks": []})
    assert (code, count) == (
        "log.remarks[].code: gone",
        "log.remarks[] count: 1 → 0, 1 of 1 values",
    )
    assert moves(CONTACTS | {"remarks": [{"code": "stuck"}]}) == [
        "log.remarks[].code: at-rest → stuck, 1 of 1 values"
    ]


def test_a_new_row_is_found() -> None:
    row = {"force_N": 9.9, "where": "elbow"}
    found = moves(CONTACTS | {"peak": [*CONTACTS["peak"], row]})
    assert {line.split(":")[0] for line in found} == {
        "log.peak[] count", "log.peak[].force_N", "log.peak[].where"
    }  # fmt: skip
    assert any("+elbow" in line for line in found)


def test_a_column_counts_in_all_of_its_rows(tmp_path: Path) -> None:
    found = []
    for k in (None, 1234):  # not among the rows that are kept
        x = [0.001 * row for row in range(2500)]
        if k is not None:
            x[k] += 1.0
        pl.DataFrame({"x": x}).write_parquet(tmp_path / "x.parquet")
        found.append(golden.Leaves(list))
        golden.add_columns(tmp_path / "x.parquet", "", found[-1])
    assert [line.split(":")[0] for line in golden.moves(*found, 1e-9)] == ["x"]


def test_what_differs_from_run_to_run_is_left_out() -> None:
    said = "vftcli 0.3.0, 2026-11-22: <b>a0484c6c35dde22c</b>\n\n  J5   at rest  "
    assert golden.lines(said) == ["vftcli VERSION, DATE:", "HASH", "J5 at rest"]


def test_every_item_has_a_place_of_its_own() -> None:
    listed = golden.items(golden.FIXTURES, golden.MORE, Path("fixtures"))
    assert Path("fixtures/ur5_circle/compare_zero.json") in listed
    assert not [line for line in listed.values() if "LOG" in line]
