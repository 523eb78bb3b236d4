"""Unpacks what a page holds, by the format's description alone."""

import base64
import json
import re
import zlib
from typing import Any

import numpy as np


def page_data(html: str) -> dict[str, Any]:
    """The data that stand in a page."""
    found = re.search(r'<script type="application/json" id="data">(.*?)</script>', html, re.S)
    assert found is not None
    return json.loads(found[1])


def unpacked(data: dict[str, Any]) -> list[np.ndarray]:
    """Rows of values, NaN where unknown."""
    planes = zlib.decompress(base64.b64decode(data["blob"]), -zlib.MAX_WBITS)
    half = len(planes) // 2
    words = [high << 8 | low for high, low in zip(planes[:half], planes[half:], strict=True)]
    rows, at = [], 0
    for size, step in zip(data["sizes"], data["steps"], strict=True):
        value, row = 0, []
        for word in words[at : at + size]:
            # Zigzag back, in sixteen bits.
            value = (value + ((word >> 1) ^ -(word & 1)) + 32768) % 65536 - 32768
            row.append(np.nan if value == -32768 else value * step)
        rows.append(np.array(row))
        at += size
    return rows


def clock_of(data: dict[str, Any], rows: list[np.ndarray], number: int = 0) -> np.ndarray:
    """Times of a clock. [s]"""
    low, high = data["clocks"][number]["t"]
    return np.cumsum(rows[low] + rows[high])


def line_of(data: dict[str, Any], chart: str, name: str) -> dict[str, Any]:
    """A line of a chart."""
    (found,) = (c for c in data["charts"] if c["key"] == chart)
    return next(line for line in found["lines"] if line["name"] == name)
