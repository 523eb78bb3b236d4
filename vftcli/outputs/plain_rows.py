"""Rows as JSON and CSV, for programs: what is not known is null or empty."""

import csv
import io
import json
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np


def json_rows(rows: Sequence[Mapping[str, Any]]) -> str:
    """Rows as a JSON array of objects; what is not known is null."""
    known = [{k: known_or_none(v) for k, v in row.items()} for row in rows]
    return json.dumps(known, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def csv_rows(rows: Sequence[Mapping[str, Any]], keys: Sequence[str]) -> str:
    """Rows as CSV under a line of keys; what is not known is empty, truth in small letters.

    A text that a spreadsheet would run as a formula, as a file's name may be, begins with "'".
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(keys)
    for row in rows:
        values = (known_or_none(row[key]) for key in keys)
        writer.writerow(csv_cell(value) for value in values)
    return text.getvalue()


#: How a text begins that spreadsheets run: the list of OWASP's "CSV Injection".
FORMULA = ("=", "+", "-", "@", "\t", "\r")


def csv_cell(value: Any) -> Any:  # noqa: ANN401 - whatever a row holds
    """A value as a cell of CSV holds it."""
    if isinstance(value, bool):
        return str(value).lower()
    if not isinstance(value, str):
        return value
    text = value.replace("\r", r"\r")  # unquoted before Python 3.13: it would end the row
    return f"'{text}" if value.startswith(FORMULA) else text


def known_or_none(value: Any) -> Any:  # noqa: ANN401 - whatever a row holds
    """A value, None for a number that is not finite."""
    return None if isinstance(value, float) and not np.isfinite(value) else value
