"""Mutations of texts: delimited tables, JSON lines, and files of settings line by line."""

import gzip
import json
import re
from pathlib import Path

import numpy as np
from changes import SAME_LENGTH, bytes_changed, list_changed, numbers_changed, tree_changed
from tokens import NUMBERS, WORDS, Mutant, Rng, Seed, pick, some


def bytes_mutant(seed: Seed, rng: Rng, path: Path) -> Mutant:
    data, how = bytes_changed(seed.path.read_bytes(), rng)
    path.write_bytes(data)
    return Mutant(how)


def table_mutant(seed: Seed, rng: Rng, path: Path) -> Mutant:
    """A delimited table with one thing changed: in its rows, in its columns, or its dress."""
    if rng.random() < 0.15:
        return bytes_mutant(seed, rng, path)
    data = seed.path.read_bytes()
    text = (gzip.decompress(data) if data[:2] == b"\x1f\x8b" else data).decode(errors="replace")
    end = "\r\n" if "\r\n" in text else "\n"
    separator = max(", ;\t", key=text.split(end, 1)[0].count)
    cells = [line.split(separator) for line in text.split(end) if line]
    headed = 0 if seed.columns else 1
    rows: int | None = len(cells) - headed
    if rng.random() < 0.65 and len(set(map(len, cells))) == 1:
        columns = [list(column) for column in zip(*cells, strict=True)]
        # The clock goes first, and has the most ways to be wrong.
        if rng.random() < 0.3:
            columns[0], kind = column_changed(columns[0], rng, headed), "changed"
        else:
            kind = list_changed(columns, rng, lambda c, rng: column_changed(c, rng, headed))
        cells, how = [list(row) for row in zip(*columns, strict=True)], f"columns {kind}"
    else:
        head, body = cells[:headed], cells[headed:]
        foreign = rng.random() < 0.2
        kind = "foreign" if foreign else list_changed(body, rng, row_changed)
        if foreign:
            odd = ([""], ["#", "comment"], [pick(rng, WORDS)], [" "] * len(body[0]), *head)
            body.insert(int(rng.integers(len(body))), pick(rng, odd))
        cells, how = [*head, *body], f"rows {kind}"
    clear = how.startswith("columns") and kind in SAME_LENGTH
    text = end.join(separator.join(row) for row in cells or [[""]]) + end
    if rng.random() < 0.25:
        name = pick(rng, list(DRESSES))
        text, how, clear = DRESSES[name](text, separator), f"{how} {name}", clear and name in KEPT
    data = text.encode("utf-8", "surrogatepass")
    path.write_bytes(gzip.compress(data, mtime=0) if rng.random() < 0.05 else data)
    return Mutant(how, rows if clear else None)


def column_changed(column: list[str], rng: Rng, headed: int) -> list[str]:
    """A column under another name, with other numbers, or with odd cells."""
    head, cells, kind = column[:headed], column[headed:], rng.random()
    if head and kind < 0.2:
        return [pick(rng, WORDS).replace("\n", " "), *cells]
    try:
        if kind < 0.6:
            return head + [repr(float(x)) for x in numbers_changed(np.array(cells, float), rng)]
    except ValueError:
        pass
    odd = cell_changed("", rng)
    for k in some(rng, len(cells)):
        cells[k] = odd
    return head + cells


def cell_changed(_cell: str, rng: Rng) -> str:
    return pick(rng, WORDS) if rng.random() < 0.4 else str(pick(rng, NUMBERS))


def row_changed(row: list[str], rng: Rng) -> list[str]:
    """A row with a cell changed, too few or too many."""
    row = list(row)
    list_changed(row, rng, cell_changed)
    return row


DRESSES = {
    "semicolons": lambda text, separator: text.replace(separator, ";"),
    "decimal comma": lambda text, _: text.replace(".", ","),
    "carriage returns": lambda text, _: text.replace("\r\n", "\n").replace("\n", "\r"),
    "byte order mark": lambda text, _: "\ufeff" + text,
    "quoted": lambda text, separator: re.sub(rf"[^{separator}\r\n]+", r'"\g<0>"', text),
    "headless": lambda text, _: text.split("\n", 1)[-1],
    "no last end": lambda text, _: text.rstrip("\r\n"),
    "trailing separator": lambda text, separator: text.replace("\n", separator + "\n"),
}
"""Name → another dress of the same table: text and separator to text."""
KEPT = {"byte order mark", "no last end"}
"""Those in which all rows are there."""


def lines_mutant(seed: Seed, rng: Rng, path: Path) -> Mutant:
    if rng.random() < 0.15:
        return bytes_mutant(seed, rng, path)
    lines = seed.path.read_bytes().decode(errors="replace").splitlines()
    records = [json.loads(line) for line in lines if line.startswith("{")]
    rows: int | None = len(records)
    kind = list_changed(records, rng, tree_changed)
    lines = [json.dumps(record) for record in records]
    if foreign := rng.random() < 0.2:
        lines.insert(int(rng.integers(len(lines) + 1)), pick(rng, ("", "{", "[]", "3", "Done.")))
    path.write_text("\n".join(lines) + "\n", encoding="utf-8", errors="replace")
    odd = foreign or any(not isinstance(record, dict) for record in records)
    return Mutant(f"lines {kind}", rows if kind == "changed" and not odd else None)


VALUES = (
    "true", "[]", "{}", "[[]]", "{a = 1}", '""', '"x"', '"1.0"', "nan", "inf", "-inf", "1e308",
    "1e20", "-1", "0", "1e-320", "99999999999999999999", "9" * 5000, "2026-01-02", "03:04:05",
    "[1, 2]", '["a", "b"]', "[nan, nan, nan]", "[0, 0, 0, 0, 0, 0]", "[1e20, 0, 0]", "[" * 3000,
    "[true, 1]", '"\\u0000"', '"<b>"', "0x10", "1_000", "[{a = 1}]", "[[1, 2], [3]]",
    "180.0", "-0.0", "1e5", "", "x", "null", "*a", "!!python/x", "'",
)  # fmt: skip
"""What TOML or YAML may hold behind a key."""

HEADERS = ("[joints]", "[[payload]]", "[payload]", "[observers.gmo]", "[a.b]")


def settings_changed(text: str, rng: Rng) -> tuple[str, str]:
    """TOML or YAML with a value, a key, a line or a table changed; and the line that was."""
    lines = text.split("\n")
    keyed = [k for k, line in enumerate(lines) if re.match(r"[-\s]*[-\w\"'.]+\s*[=:]", line)]
    k = int(pick(rng, keyed or [0]))
    was, kind = lines[k], rng.random()
    key, sign, old = re.match(r"([-\s]*[-\w\"'.]*)(\s*[=:]\s*|)(.*)", was).groups()  # type: ignore[union-attr]
    headers = [k for k, line in enumerate(lines) if line.startswith("[")]
    if kind < 0.55:
        lines[k] = f"{key}{sign}{new_value(old, rng)}"
    elif kind < 0.65:
        other = lines[int(pick(rng, keyed or [0]))].partition("=")[0].strip()
        lines[k] = was.replace(key.strip(), other, 1)
    elif kind < 0.8 and headers:
        lines[int(pick(rng, headers))] = pick(rng, ("", *HEADERS))
    else:
        list_changed(lines, rng, lambda line, _: " " + line)
    return "\n".join(lines), was.strip()[:40]


def new_value(old: str, rng: Rng) -> str:
    """Another value: of another type, or one of its numbers changed."""
    numbers = list(re.finditer(r"-?\d+\.?\d*(e-?\d+)?", old))
    if not numbers or rng.random() < 0.4:
        return pick(rng, VALUES)
    spot = pick(rng, numbers)
    scaled = float(spot[0]) * pick(rng, (-1.0, 57.3, 1e3, 1e-3, 0.0, 1e9))
    return old[: spot.start()] + repr(pick(rng, (pick(rng, NUMBERS), scaled))) + old[spot.end() :]


def settings_mutant(seed: Seed, rng: Rng, path: Path) -> Mutant:
    if rng.random() < 0.1:
        return bytes_mutant(seed, rng, path)
    text, how = settings_changed(seed.path.read_text("utf-8"), rng)
    if rng.random() < 0.25:
        text, _ = settings_changed(text, rng)
    path.write_text(text, encoding="utf-8")
    return Mutant(how)
