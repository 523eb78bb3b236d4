"""Unpacks what a page holds, by the format's description alone."""

import base64
import json
import re
import zlib
from html.parser import HTMLParser
from typing import Any

import numpy as np


def page_data(html: str) -> dict[str, Any]:
    """The data that stand in a page."""
    found = re.search(r'<script type="application/json" id="data">(.*?)</script>', html, re.S)
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


class Page(HTMLParser):
    """Collects elements, their attributes and the page's words."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.open: list[str] = []
        self.words: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))
        self.part(tag)
        if tag not in {"meta", "br", "link", "img", "input"}:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag
        self.part(tag)

    def part(self, tag: str) -> None:
        """A span goes on in a word, every other element begins or ends one."""
        self.words.append("" if tag == "span" else " ")

    def handle_data(self, data: str) -> None:
        if not self.open or self.open[-1] not in {"script", "style"}:
            self.words.append(data)

    @property
    def text(self) -> str:
        return " ".join("".join(self.words).split())
