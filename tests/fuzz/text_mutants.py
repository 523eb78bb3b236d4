"""Mutations of logs that are text: delimited tables and JSON lines."""

import gzip
import json
from pathlib import Path
from typing import Any

from bytes_mutants import bytes_mutant, mutate_bytes
from tokens import NUMBERS, WORDS, Mutant, Rng, Seed, pick, some

Cells = list[list[str]]


def table_mutant(seed: Seed, rng: Rng, path: Path) -> Mutant:
    """A delimited table with one thing changed."""
    data = seed.path.read_bytes()
    if data[:2] == b"\x1f\x8b":
        data = gzip.decompress(data)
    if rng.random() < 0.15:
        data, how = mutate_bytes(data, rng)
        path.write_bytes(data)
        return Mutant(how, None)
    text = data.decode(errors="replace")
    end = "\r\n" if "\r\n" in text else "\n"
    separator = max(", ;\t", key=text.split(end, 1)[0].count)
    cells = [line.split(separator) for line in text.split(end) if line]
    headed = 0 if seed.columns else 1
    change = pick(rng, CHANGES)
    cells = change(cells, rng, headed) or [[""]]
    rows = max(0, sum(any(c.strip() for c in row) for row in cells) - headed)
    text = end.join(separator.join(row) for row in cells) + end
    how = change.__name__
    if rng.random() < 0.25:
        dress = pick(rng, DRESSES)
        text, how = dress(text, separator), f"{how}+{dress.__name__}"
        rows = rows if dress in KEEP_ROWS else None
    data = text.encode("utf-8", "surrogatepass")
    path.write_bytes(gzip.compress(data, mtime=0) if rng.random() < 0.05 else data)
    clear = change in {cell, time_column, column_constant, swap_columns, rename}
    return Mutant(how, rows if clear else None)


def width(cells: Cells) -> int:
    return max(1, len(cells[-1]))


def value(rng: Rng) -> str:
    return pick(rng, WORDS) if rng.random() < 0.4 else str(pick(rng, NUMBERS))


def cell(cells: Cells, rng: Rng, headed: int) -> Cells:
    """One cell, or some of a column."""
    k, put = int(rng.integers(width(cells))), value(rng)
    for row in some(rng, max(1, len(cells) - headed)):
        if row + headed < len(cells) and k < len(cells[row + headed]):
            cells[row + headed][k] = put
    return cells


CLOCKS = ("constant", "whole", "back", "repeat", "jump", "huge", "scale", "reset", "tiny")


def time_column(cells: Cells, rng: Rng, headed: int) -> Cells:
    """The first column as other clocks would have it."""
    kind = pick(rng, CLOCKS)
    rows = cells[headed:]
    for i, row in enumerate(rows):
        try:
            t = float(row[0])
        except ValueError:
            continue
        row[0] = repr({
            "constant": 5.0, "whole": float(int(t)), "back": -t,
            "repeat": float(rows[i // 2 * 2][0]),
            "jump": t + (1e6 if i > len(rows) // 2 else 0), "huge": t + 1e18, "scale": t * 1e9,
            "reset": t if i < len(rows) // 2 else t - float(rows[len(rows) // 2][0] or 0),
            "tiny": 5e-324 * i,
        }[kind])  # fmt: skip
    return cells


def column_constant(cells: Cells, rng: Rng, headed: int) -> Cells:
    k, put = int(rng.integers(width(cells))), str(pick(rng, NUMBERS))
    for row in cells[headed:]:
        if k < len(row):
            row[k] = put
    return cells


def columns_scaled(cells: Cells, rng: Rng, headed: int) -> Cells:
    """Several columns by a factor: degrees, milliamperes, turned, tiny, huge."""
    factor = pick(rng, (57.29577951308232, 1000.0, -1.0, 1e-12, 1e12, 0.0, 1e-310, 1e300))
    first = int(rng.integers(width(cells)))
    last = first + int(rng.integers(1, 8))
    for row in cells[headed:]:
        for k in range(first, min(last, len(row))):
            try:
                row[k] = repr(float(row[k]) * factor)
            except ValueError:
                continue
    return cells


def swap_columns(cells: Cells, rng: Rng, headed: int) -> Cells:
    a, b = rng.integers(0, width(cells), 2)
    for row in cells[headed:]:
        if max(a, b) < len(row):
            row[a], row[b] = row[b], row[a]
    return cells


def rename(cells: Cells, rng: Rng, headed: int) -> Cells:
    """Another name, or the name of another column."""
    names = cells[0]
    if headed and names:
        other = pick(rng, names) if rng.random() < 0.4 else pick(rng, WORDS)
        names[int(rng.integers(len(names)))] = other.replace("\n", " ")
    return cells


def drop_column(cells: Cells, rng: Rng, _headed: int) -> Cells:
    k = int(rng.integers(width(cells)))
    return [row[:k] + row[k + 1 :] for row in cells]


def drop_columns(cells: Cells, rng: Rng, _headed: int) -> Cells:
    k = int(rng.integers(width(cells)))
    return [row[:k] for row in cells] if rng.random() < 0.5 else [row[k:] for row in cells]


def repeat_column(cells: Cells, rng: Rng, _headed: int) -> Cells:
    k = int(rng.integers(width(cells)))
    return [row[:k] + row[k : k + 1] + row[k:] for row in cells]


def ragged(cells: Cells, rng: Rng, headed: int) -> Cells:
    """Rows with a cell too few or too many."""
    more = rng.random() < 0.5
    for k in some(rng, len(cells)):
        if k >= headed:
            cells[k] = [*cells[k], value(rng)] if more else cells[k][:-1]
    return cells


def few_rows(cells: Cells, rng: Rng, headed: int) -> Cells:
    return cells[: headed + int(rng.integers(0, 4))]


def move_rows(cells: Cells, rng: Rng, headed: int) -> Cells:
    """Rows lost, repeated, turned round or out of order."""
    head, rows = cells[:headed], cells[headed:]
    kind = int(rng.integers(4))
    if kind == 0:
        gone = set(some(rng, len(rows)))
        return head + [row for k, row in enumerate(rows) if k not in gone]
    if kind == 1:
        twice = set(some(rng, len(rows)))
        return head + [row for k, row in enumerate(rows) for _ in range(1 + (k in twice))]
    if kind == 2:
        return head + rows[::-1]
    return head + [rows[k] for k in rng.permutation(len(rows))]


def header_again(cells: Cells, rng: Rng, headed: int) -> Cells:
    place = int(rng.integers(headed, len(cells)))
    return [*cells[:place], list(cells[0]), *cells[place:]]


def foreign_rows(cells: Cells, rng: Rng, headed: int) -> Cells:
    place = int(rng.integers(headed, len(cells)))
    row = pick(rng, ([""], ["#", "comment"], [pick(rng, WORDS)], [" "] * width(cells)))
    return [*cells[:place], row, *cells[place:]]


CHANGES = (
    cell, cell, cell, time_column, time_column, column_constant, columns_scaled, swap_columns,
    rename,
    rename, drop_column, drop_columns, repeat_column, ragged, few_rows, move_rows, header_again,
    foreign_rows,
)  # fmt: skip


def other_separator(text: str, separator: str) -> str:
    return text.replace(separator, ";")


def decimal_comma(text: str, _separator: str) -> str:
    return text.replace(".", ",")


def carriage_returns(text: str, _separator: str) -> str:
    return text.replace("\r\n", "\n").replace("\n", "\r")


def byte_order_mark(text: str, _separator: str) -> str:
    return "\ufeff" + text


def quoted(text: str, separator: str) -> str:
    lines = text.split("\n")
    return "\n".join(separator.join(f'"{c}"' for c in line.split(separator)) for line in lines)


def headless(text: str, _separator: str) -> str:
    return text.split("\n", 1)[-1]


def no_last_end(text: str, _separator: str) -> str:
    return text.rstrip("\r\n")


def trailing_separator(text: str, separator: str) -> str:
    return text.replace("\n", separator + "\n")


DRESSES = (
    other_separator, decimal_comma, carriage_returns, byte_order_mark, quoted, headless,
    no_last_end,
    trailing_separator,
)  # fmt: skip
KEEP_ROWS = {byte_order_mark, no_last_end}


def lines_mutant(seed: Seed, rng: Rng, path: Path) -> Mutant:
    """JSON lines with one thing changed."""
    if rng.random() < 0.15:
        return bytes_mutant(seed, rng, path)
    lines = seed.path.read_bytes().decode(errors="replace").splitlines()
    records: list[State] = [json.loads(line) for line in lines if line.startswith("{")]
    change = pick(rng, STATE_CHANGES)
    key = pick(rng, list(records[0]))
    chosen = some(rng, len(records))
    for k, record in enumerate(records):
        if k in chosen or change in EVERY:
            change(record, key, rng)
    rows: int | None = len(records)
    if rng.random() < 0.1:
        records, rows = records[: int(rng.integers(0, 3))], None
    lines = [json.dumps(record) for record in records]
    if rng.random() < 0.2:
        place = int(rng.integers(len(lines) + 1))
        lines.insert(place, pick(rng, ("", "{", "[]", "3", "Done.", "{}")))
        rows = None
    path.write_text("\n".join(lines) + "\n", encoding="utf-8", errors="replace")
    return Mutant(f"{change.__name__} {key}", rows)


State = dict[str, Any]


def value_odd(state: State, key: str, rng: Rng) -> None:
    state[key] = odd_value(rng)


def value_gone(state: State, key: str, _rng: Rng) -> None:
    state.pop(key, None)


def item_odd(state: State, key: str, rng: Rng) -> None:
    """One item of a list, or the value as a list."""
    old = state.get(key)
    if isinstance(old, list) and old:
        old[int(rng.integers(len(old)))] = odd_value(rng)
    else:
        state[key] = [old]


def length_odd(state: State, key: str, _rng: Rng) -> None:
    old = state.get(key)
    state[key] = old[:-1] if isinstance(old, list) else [old, old]


def key_odd(state: State, key: str, rng: Rng) -> None:
    state[pick(rng, WORDS)] = state.pop(key, None)


STATE_CHANGES = (value_odd, value_gone, item_odd, length_odd, key_odd)
EVERY = {value_gone, key_odd}


def odd_value(rng: Rng) -> Any:
    """A value of another type or size."""
    deep: Any = []
    for _ in range(50):
        deep = [deep]
    odd = (None, True, {}, [], [[]], {"a": 1}, [1] * 9, ["a"], [None], deep, "x")
    kind = rng.random()
    return pick(rng, odd) if kind < 0.5 else pick(rng, NUMBERS if kind < 0.8 else WORDS)
