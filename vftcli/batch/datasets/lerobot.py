"""LeRobot datasets written back: columns, info.json, metadata and statistics."""

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from vftcli.batch.datasets import DataFile, ForceColumns, Forces, OfEpisodes, Single, Statistics
from vftcli.readers.lerobot import dataset_episodes, info_of, text_of
from vftcli.readers.opening import open_log
from vftcli.readers.parquet import EPISODE, ParquetTable, guarded
from vftcli.readers.table import Column
from vftcli.signals.errors import LogError

PREFIX = "observation."  #: Begin of observations' names.
#: Key of a Parquet schema under which `datasets` keeps features.
METADATA = b"huggingface"
#: Keys of the quantiles.
QUANTILES = {"q01": 0.01, "q10": 0.10, "q50": 0.50, "q90": 0.90, "q99": 0.99}
KEYS = ("min", "max", "mean", "std", "count", *QUANTILES)


class LeRobotDataset:
    """A dataset of version 2 (an episode a file) or 3 (many)."""

    has_statistics = True

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def files(self) -> Iterator[DataFile]:
        """The data files with their episodes, in order."""
        numbers: dict[Path, list[int]] = {}
        for number, path in dataset_episodes(self.folder).items():
            numbers.setdefault(path.relative_to(self.folder), []).append(number)
        for place, own in numbers.items():
            yield DataFile(place, self.folder, tuple(own))

    def _opened(self, file: DataFile) -> tuple[Path, Any, Column]:
        """A data file in pyarrow, and each row's episode, empty of one."""
        path = self.folder / file.place
        table = ParquetTable(open_log(path))
        return path, table.file, table.episodes()

    def frames(self, file: DataFile, number: int) -> int:
        """Number of an episode's frames."""
        _, source, numbers = self._opened(file)
        return int(np.sum(numbers == number) if numbers.size else source.metadata.num_rows)

    def check_new(self, file: DataFile, columns: ForceColumns) -> None:
        """Refuse a file that has such columns already."""
        path, source, _ = self._opened(file)
        there = {*source.schema_arrow.names, *info_of(self.folder)["features"]}
        for column in columns:
            if PREFIX + column.name in there:
                raise LogError(
                    f"{path}: has {PREFIX}{column.name} already; annotate the original dataset"
                )

    def write(self, file: DataFile, columns: ForceColumns, forces: Forces, target: Path) -> None:
        """Write a data file with the columns behind its own."""
        import pyarrow as pa
        import pyarrow.parquet as pq

        path, source, numbers = self._opened(file)
        rows, done = source.metadata.num_rows, 0
        whole = [np.zeros((rows, column.width), np.float32) for column in columns]
        for number, own in forces.items():
            place = np.flatnonzero(numbers == number) if numbers.size else np.arange(rows)
            done += len(place)
            for column, values in zip(columns, whole, strict=True):
                if len(own[column.name]) != len(place):
                    raise LogError(
                        f"{path}: episode {number} has {len(place)} rows, {len(own[column.name])} "
                        "were read; it was edited in between"
                    )
                values[place] = own[column.name]
        if done != rows:
            raise LogError(f"{path}: has rows of episodes that the table of episodes lacks")
        schema, added = source.schema_arrow, []
        for column, flat in zip(columns, map(pa.array, map(np.ravel, whole)), strict=True):
            several = column.width > 1
            lists = pa.FixedSizeListArray.from_arrays(flat, column.width) if several else flat
            schema = schema.append(pa.field(PREFIX + column.name, lists.type))
            added.append(lists)
        schema = schema.with_metadata(with_features(schema.metadata or {}, columns))
        first = 0
        with pq.ParquetWriter(target, schema, compression=codec_of(source)) as writer:
            for group in range(source.num_row_groups):
                with guarded(path):
                    table = source.read_row_group(group)
                arrays = [*table.columns, *(each.slice(first, len(table)) for each in added)]
                first += len(table)
                writer.write_table(
                    pa.table(arrays, schema=schema), row_group_size=len(table) or 1
                )

    def finish(self, columns: ForceColumns, statistics: OfEpisodes, copy: Path) -> None:
        """Write info.json with the new features, and their statistics."""
        info = info_of(self.folder)
        third = str(info.get("codebase_version", "")).startswith("v3")
        fps = {"fps": info["fps"]} if third and "fps" in info else {}
        for column in columns:
            info["features"][PREFIX + column.name] = {
                "dtype": "float32",
                "shape": [column.width],
                "names": list(column.elements) or None,
                **fps,
                "info": dict(column.about),
            }
        write_json(copy / "meta" / "info.json", info)
        for path in sorted((self.folder / "meta" / "episodes").rglob("*.parquet")):
            self._finish_episodes(path, columns, statistics, copy)
        for name, write in (("stats.json", finish_stats), ("episodes_stats.jsonl", finish_lines)):
            path = self.folder / "meta" / name
            if path.is_file():
                try:
                    write(text_of(path), columns, statistics, copy / "meta" / name)
                except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
                    raise LogError(f"{path}: holds no statistics; mend or remove it") from None

    def _finish_episodes(
        self, path: Path, columns: ForceColumns, statistics: OfEpisodes, copy: Path
    ) -> None:
        """Write a table of episodes, with statistics."""
        import pyarrow as pa
        import pyarrow.parquet as pq

        with guarded(path):
            source = pq.ParquetFile(path)
            table = source.read()
            numbers = table.column(EPISODE).to_pylist()
        if missing := set(numbers) - statistics.keys():
            raise LogError(f"{path}: names episode {min(missing)}, of which data/ has no rows")
        kinds = {n.rpartition("/")[2] for n in table.column_names if n.startswith("stats/")}
        for column in columns:
            for key in (key for key in KEYS if key in kinds):
                values = [statistics[number][column.name][key].tolist() for number in numbers]
                kind = pa.list_(pa.int64() if key == "count" else pa.float64())
                name = f"stats/{PREFIX}{column.name}/{key}"
                table = table.append_column(name, pa.array(values, kind))
        target = copy / path.relative_to(self.folder)
        target.parent.mkdir(parents=True, exist_ok=True)
        pq.write_table(table, target, compression=codec_of(source))


def finish_stats(text: str, columns: ForceColumns, statistics: OfEpisodes, target: Path) -> None:
    """Write stats.json, of the whole dataset."""
    stats = json.loads(text)
    known = next(iter(stats.values()), KEYS)  # older ones have no quantiles
    for column in columns:
        whole = pooled([of_episode[column.name] for of_episode in statistics.values()])
        stats[PREFIX + column.name] = plain(whole, known)
    write_json(target, stats)


def finish_lines(text: str, columns: ForceColumns, statistics: OfEpisodes, target: Path) -> None:
    """Write episodes_stats.jsonl, the statistics of version 2.1."""
    lines = []
    for line in filter(str.strip, text.splitlines()):
        record = json.loads(line)
        known = next(iter(record["stats"].values()), KEYS)
        for column in columns:
            own = statistics[int(record[EPISODE])][column.name]
            record["stats"][PREFIX + column.name] = plain(own, known)
        lines.append(json.dumps(record, ensure_ascii=False) + "\n")
    target.write_text("".join(lines), "utf-8")


def codec_of(source: Any) -> str:  # noqa: ANN401 - a ParquetFile
    """Compression of a file, as pyarrow writes it."""
    codec: str = source.metadata.row_group(0).column(0).compression.lower()
    return "none" if codec == "uncompressed" else codec


def plain(statistics: Statistics, known: Iterable[str]) -> dict[str, list[Any]]:
    """The statistics of some keys as JSON holds them."""
    return {key: statistics[key].tolist() for key in known if key in statistics}


def write_json(path: Path, value: Any) -> None:  # noqa: ANN401 - what JSON holds
    """Write a description as LeRobot writes it."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(value, indent=4, ensure_ascii=False), "utf-8")


def with_features(metadata: Mapping[bytes, bytes], columns: ForceColumns) -> dict[bytes, bytes]:
    """A Parquet schema's metadata with the new features."""
    try:
        library = json.loads(metadata.get(METADATA, b"null"))
        features = library["info"]["features"]
        # Lists are called List since its version 4, and Sequence before.
        lists = [f for f in features.values() if isinstance(f, dict) and "length" in f]
    except (ValueError, TypeError, KeyError, AttributeError):
        return dict(metadata)
    number = {"dtype": "float32", "_type": "Value"}
    kind = lists[0]["_type"] if lists else "Sequence"
    for column in columns:
        several = {"feature": number, "length": column.width, "_type": kind}
        features[PREFIX + column.name] = number if column.width == 1 else several
    return dict(metadata) | {METADATA: json.dumps(library).encode()}


def statistics_of(values: Single) -> Statistics:
    """Statistics of an episode (frames, k). (k,) each, count (1,)"""
    exact = values.astype(np.float64)
    found = {
        "min": exact.min(axis=0),
        "max": exact.max(axis=0),
        "mean": exact.mean(axis=0),
        "std": exact.std(axis=0),
        "count": np.array([len(exact)]),
    }
    each = np.quantile(exact, list(QUANTILES.values()), axis=0)
    return found | dict(zip(QUANTILES, each, strict=True))


def pooled(episodes: Sequence[Statistics]) -> Statistics:
    """Statistics of several episodes together, by LeRobot's rules.

    Mean and standard deviation are of all frames (law of total variance), quantiles are
    means of the episodes' quantiles, weighted by frames.
    """
    table = {key: np.array([one[key] for one in episodes]) for key in episodes[0]}
    count = table.pop("count")
    share = count / count.sum()
    mean = np.sum(share * table["mean"], axis=0)
    variance = np.sum(share * (table["std"] ** 2 + (table["mean"] - mean) ** 2), axis=0)
    whole = {key: np.sum(share * values, axis=0) for key, values in table.items()}
    return whole | {
        "min": table["min"].min(axis=0),
        "max": table["max"].max(axis=0),
        "mean": mean,
        "std": np.sqrt(variance),
        "count": np.array([count.sum()]),
    }
