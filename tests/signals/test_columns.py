"""What the columns of our tables say of themselves, read back from Parquet."""

from pathlib import Path

import polars as pl
import pyarrow.parquet as pq
import pytest

from vftcli.signals.columns import StatedFrame, column_facts, described_schema

FLANGE = "flange axes, moment about the flange point"
FRAMES = {"wrench/best": StatedFrame(FLANGE), "wrench": StatedFrame("base axes", "by-robot")}


@pytest.mark.parametrize(
    ("name", "unit", "more"),
    [
        ("t", "s", {}),
        ("t_src_ns", "ns", {}),
        ("q/3", "rad", {"joint": "3"}),
        ("tau_ext/kfo-fe/6", "N·m", {"joint": "6", "sign": "on the robot"}),
        ("wrench/best/fx", "N", {"sign": "on the robot", "frame": FLANGE}),
        ("wrench/mz", "N·m", {"sign": "by-robot", "frame": "base axes"}),
        ("wrench/gmo/mz", "N·m", {}),
        ("wrench_sd/best/mx", "N·m", {}),
        ("sigma_min", "m", {}),
        ("contact", "1", {}),
        ("contact/hand/fy", "N", {}),
        ("contact/drift/2", "N·m", {"joint": "2"}),
    ],
)
def test_a_column_says_what_it_holds(name: str, unit: str, more: dict[str, str]) -> None:
    facts = column_facts(name, FRAMES)
    assert facts.pop("meaning")
    assert facts == {"unit": unit} | more


def test_an_unknown_column_says_nothing() -> None:
    assert column_facts("odd/1", {}) == {}
    assert column_facts("", {}) == {}


def test_the_file_says_it(tmp_path: Path) -> None:
    table = pl.DataFrame({"t": [0.0, 0.1], "odd": ["a", "b"], "t_src_ns": [1, 2]})
    table.write_parquet(tmp_path / "x.parquet", arrow_schema=described_schema(table))
    schema = pq.read_schema(tmp_path / "x.parquet")
    assert schema.field("t").metadata == {b"unit": b"s", b"meaning": b"time"}
    assert schema.field("odd").metadata is None
    assert schema.field("t_src_ns").metadata[b"unit"] == b"ns"
    assert pl.read_parquet(tmp_path / "x.parquet").equals(table)
