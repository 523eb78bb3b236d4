"""Names from files are shown whole, on one line, and as nothing that a terminal obeys."""

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vftcli.signals.letters import printable, printable_lines, whole

ANY_TEXT = st.text(st.characters(codec=None, exclude_categories=[]))
"""All that a Python text can hold, halves of letters too."""


@pytest.mark.parametrize(
    ("name", "shown"),
    [
        ("log.csv", "log.csv"),
        ("ログ é 10 N·m – «x»", "ログ é 10 N·m – «x»"),
        ("bad\udcff.csv", r"bad\xff.csv"),
        ("half\ud800", r"half\ud800"),
        ("red\x1b[31m", r"red\x1b[31m"),
        ("two\nlines\r\t", r"two\nlines\r\t"),
        ("turned\u202etxt", r"turned\u202etxt"),
        ("end\u2028", r"end\u2028"),
    ],
)
def test_what_is_hidden_is_spelled(name: str, shown: str) -> None:
    assert printable(name) == shown


@given(ANY_TEXT)
def test_every_text_is_printable_and_fits_utf_8(text: str) -> None:
    shown = printable(text)
    shown.encode("utf-8")
    assert len(shown.splitlines()) <= 1
    assert printable(shown) == shown
    assert json.loads(json.dumps(whole(text), ensure_ascii=False).encode()) == whole(text)


@given(ANY_TEXT)
def test_lines_stay_lines(text: str) -> None:
    assert printable_lines(text).count("\n") == text.count("\n")
