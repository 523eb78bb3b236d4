"""What a terminal can show: width, letters, colours."""

import pytest

from vftcli.outputs.screen import PLAIN, Canvas


@pytest.mark.parametrize(("columns", "width"), [(40, 72), (88, 88), (240, 100)])
def test_a_screen_is_72_to_100_columns_wide(columns: int, width: int) -> None:
    assert Canvas.of(columns=columns, unicode=True, colour=False).width == width


def test_colours_are_there_only_where_the_terminal_has_them() -> None:
    assert Canvas(colour=True).painted("x", "bad") == "\x1b[31mx\x1b[0m"
    assert Canvas(colour=False).painted("x", "bad") == "x"
    assert Canvas(colour=True).painted("", "bad") == ""


def test_every_letter_has_one_of_ascii() -> None:
    text = "".join(PLAIN)
    assert Canvas(unicode=True).shown(text) == text
    assert Canvas(unicode=False).shown(text + "ß").isascii()
    assert Canvas(unicode=False).shown("34 ± 16 N · −y") == "34 +/- 16 N - -y"


def test_a_text_is_wrapped_behind_its_indent_and_cut() -> None:
    canvas = Canvas(width=20)
    lines = canvas.wrapped("one two three four five six", 10)
    assert lines == ["one two", "          three four", "          five six"]
    assert canvas.wrapped("one two three four five six", 10, 2)[-1].endswith("…")
    assert canvas.wrapped("", 10) == [""]
