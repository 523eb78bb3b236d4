"""Columns written into LeRobot's files: everything else stays, and every description tells them."""

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest

from vftcli.batch.annotation import open_dataset
from vftcli.batch.datasets import ForceColumn
from vftcli.batch.datasets.lerobot import LeRobotDataset, statistics_of, with_features
from vftcli.signals.errors import LogError

FIXTURE = Path(__file__).parents[3] / "fixtures" / "panda_episodes"
TORQUE = ForceColumn(
    "external_torque", tuple(f"j{k}.external_torque" for k in range(7)), {"a": 1}
)
VALID = ForceColumn("valid", (), {})
COLUMNS = [TORQUE, VALID]
ADDED = "observation.external_torque"


def forces(episodes: Any, seed: int = 1) -> dict[int, dict[str, Any]]:
    rng, frames = np.random.default_rng(seed), (200, 160, 180)
    return {
        k: {
            "external_torque": rng.standard_normal((frames[k], 7)).astype(np.float32),
            "valid": np.ones((frames[k], 1), np.float32),
        }
        for k in episodes
    }


def statistics(episodes: Any) -> dict[int, dict[str, Any]]:
    made = forces(episodes).items()
    return {k: {name: statistics_of(x) for name, x in own.items()} for k, own in made}


@pytest.mark.parametrize("codec", ["none", "snappy", "zstd"])
def test_the_other_columns_rows_in_any_order_their_groups_and_packing_stay(
    codec: str, tmp_path: Path
) -> None:
    """An episode's rows may stand apart: its values go to its own rows, in their order."""
    dataset = tmp_path / "set"
    shutil.copytree(FIXTURE, dataset)
    path = dataset / "data" / "chunk-000" / "file-000.parquet"
    table = pq.read_table(path)
    turned = table.take(np.r_[200:360, 0:200])
    pq.write_table(turned, path, row_group_size=50, compression=codec)
    opened = LeRobotDataset(dataset)
    file = next(iter(opened.files()))
    own = forces(file.episodes)
    opened.write(file, COLUMNS, own, tmp_path / "out.parquet")
    made = pq.ParquetFile(tmp_path / "out.parquet")
    assert made.num_row_groups == 8
    packed = [made.metadata.row_group(k).column(0).compression.lower() for k in range(8)]
    assert packed == ["uncompressed" if codec == "none" else codec] * 8
    after = made.read()
    written = np.array(after.column(ADDED).to_pylist(), np.float32)
    np.testing.assert_array_equal(written[:160], own[1]["external_torque"])
    np.testing.assert_array_equal(written[160:], own[0]["external_torque"])
    assert after.select(table.column_names).equals(turned)
    assert after.column_names[-2:] == [ADDED, "observation.valid"]
    assert str(after.schema.field(ADDED).type) == "fixed_size_list<element: float>[7]"
    reported = json.loads(after.schema.metadata[b"huggingface"])["info"]["features"]
    assert list(reported) == after.column_names
    assert reported[ADDED]["length"] == 7


def test_what_was_edited_in_between_is_refused(tmp_path: Path) -> None:
    dataset = LeRobotDataset(FIXTURE)
    file = next(iter(dataset.files()))
    own = forces(file.episodes)
    own[0]["external_torque"] = own[0]["external_torque"][1:]
    with pytest.raises(LogError, match="episode 0 has 200 rows, 199 were read"):
        dataset.write(file, COLUMNS, own, tmp_path / "out.parquet")
    with pytest.raises(LogError, match="rows of episodes that the table"):
        dataset.write(file, COLUMNS, forces([0]), tmp_path / "out.parquet")


def test_the_descriptions_tell_the_columns(tmp_path: Path) -> None:
    """Statistics of an episode are exact, those of the dataset are of all frames, but quantiles."""
    LeRobotDataset(FIXTURE).finish(COLUMNS, statistics(range(3)), tmp_path)
    info = json.loads((tmp_path / "meta" / "info.json").read_text())
    feature = info["features"].pop(ADDED)
    assert feature == {
        "dtype": "float32", "shape": [7], "names": list(TORQUE.elements), "fps": 25,
        "info": {"a": 1},
    }  # fmt: skip
    assert info["features"].pop("observation.valid")["names"] is None
    assert info == json.loads((FIXTURE / "meta" / "info.json").read_text())
    stats = json.loads((tmp_path / "meta" / "stats.json").read_text())[ADDED]
    each = [own["external_torque"].astype(float) for own in forces(range(3)).values()]
    whole = np.concatenate(each)
    for key in ("min", "max", "mean", "std"):
        # float32 values, sums in double, in another order
        np.testing.assert_allclose(stats[key], getattr(np, key)(whole, axis=0), atol=1e-12)
    assert stats["count"] == [540]
    medians = [len(own) * np.median(own, axis=0) for own in each]
    np.testing.assert_allclose(stats["q50"], sum(medians) / 540, atol=1e-12)
    place = Path("meta", "episodes", "chunk-000", "file-000.parquet")
    before, after = pq.read_table(FIXTURE / place), pq.read_table(tmp_path / place)
    assert after.select(before.column_names).equals(before)
    added = [name for name in after.column_names if name not in before.column_names]
    assert len(added) == 2 * 10
    for name in added:
        counts = name.endswith("/count")
        assert str(after.schema.field(name).type.value_type) == ("int64" if counts else "double")
    known = {"count": len, "q10": lambda own: np.quantile(own, 0.1, axis=0),
             "std": lambda own: own.std(axis=0)}  # fmt: skip
    for key, statistic in known.items():
        of_episodes = after.column(f"stats/{ADDED}/{key}").to_pylist()
        for found, own in zip(of_episodes, each, strict=True):
            np.testing.assert_array_equal(found, np.atleast_1d(statistic(own)))


def test_version_2_1_has_its_statistics_a_line_an_episode(tmp_path: Path) -> None:
    dataset = tmp_path / "set"
    (dataset / "meta").mkdir(parents=True)
    info = json.loads((FIXTURE / "meta" / "info.json").read_text())
    (dataset / "meta" / "info.json").write_text(json.dumps(info | {"codebase_version": "v2.1"}))
    keys = ("min", "max", "mean", "std", "count")
    line = {"episode_index": 1, "stats": {"action": {key: [0.0] for key in keys}}}
    (dataset / "meta" / "episodes_stats.jsonl").write_text(json.dumps(line) + "\n")
    LeRobotDataset(dataset).finish(COLUMNS, statistics([1]), tmp_path / "copy")
    text = (tmp_path / "copy" / "meta" / "episodes_stats.jsonl").read_text()
    assert tuple(json.loads(text)["stats"]["observation.valid"]) == keys
    reported = json.loads((tmp_path / "copy" / "meta" / "info.json").read_text())["features"]
    assert "fps" not in reported["observation.valid"]  # as version 2 has it
    assert not (tmp_path / "copy" / "meta" / "stats.json").exists()


@pytest.mark.parametrize("name", ["stats.json", "episodes_stats.jsonl"])
@pytest.mark.parametrize("text", ["{", '{"action": 3}', "[[1]]", "[" * 100_000])
def test_damaged_statistics_are_one_line(tmp_path: Path, name: str, text: str) -> None:
    (tmp_path / "meta").mkdir()
    shutil.copyfile(FIXTURE / "meta" / "info.json", tmp_path / "meta" / "info.json")
    (tmp_path / "meta" / name).write_text(text)
    with pytest.raises(LogError, match=f"{name}: holds no statistics"):
        LeRobotDataset(tmp_path).finish(COLUMNS, statistics([1]), tmp_path / "copy")
    # Features without names are one line too.
    (tmp_path / "meta" / "info.json").write_text('{"features": [["action"]]}')
    with pytest.raises(LogError, match=r"info\.json: not a readable description"):
        LeRobotDataset(tmp_path).finish(COLUMNS, {}, tmp_path / "copy")


def test_metadata_of_other_kinds_is_left_alone() -> None:
    assert with_features({}, COLUMNS) == {}
    assert with_features({b"huggingface": b"[]"}, COLUMNS) == {b"huggingface": b"[]"}
    new = {
        "n": {"dtype": "int64", "_type": "Value"},
        "a": {"feature": {"dtype": "float32"}, "length": 3, "_type": "List"},
    }
    described = json.dumps({"info": {"features": new}}).encode()
    reported = with_features({b"huggingface": described}, COLUMNS)
    features = json.loads(reported[b"huggingface"])["info"]["features"]
    assert features[ADDED]["_type"] == "List"


def test_a_column_that_is_there_and_what_is_no_dataset_are_refused(tmp_path: Path) -> None:
    dataset = LeRobotDataset(FIXTURE)
    file = next(iter(dataset.files()))
    dataset.check_new(file, COLUMNS)
    with pytest.raises(LogError, match=r"has observation\.effort already"):
        dataset.check_new(file, [ForceColumn("effort", (), {})])
    (tmp_path / "log.csv").write_text("t,q\n")
    for path in (tmp_path, tmp_path / "log.csv"):
        with pytest.raises(LogError, match="neither a LeRobot dataset"):
            open_dataset(path)
