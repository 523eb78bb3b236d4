"""Names and words from files as letters that can be shown: they may hold anything."""

import re
import unicodedata

#: What no UTF-8 holds: a byte of a file name that is no letter, or half a letter from JSON.
HALVES = re.compile(r"[\ud800-\udfff]")
#: Unicode categories that a terminal would act on, or show as nothing: control characters, marks
#: that turn the direction of writing, ends of lines.
HIDDEN = {"Cc", "Cf", "Co", "Zl", "Zp"}


def whole(text: str) -> str:
    r"""A text that UTF-8 can hold: a file name's byte that is no letter becomes ``\xff``."""
    return text if text.isascii() else HALVES.sub(half, text)


def half(found: re.Match[str]) -> str:
    """What stands for one half: the byte that it is, or its number."""
    number = ord(found[0])
    # Python reads byte xx of a name as U+DCxx (PEP 383).
    return f"\\x{number - 0xDC00:02x}" if 0xDC80 <= number <= 0xDCFF else f"\\u{number:04x}"


def printable(text: str) -> str:
    r"""A text on one line, every letter seen: ``\x1b`` for what a terminal would obey."""
    if text.isprintable():
        return text
    return "".join(
        letter.encode("unicode_escape").decode()
        if unicodedata.category(letter) in HIDDEN
        else letter
        for letter in whole(text)
    )


def printable_lines(text: str) -> str:
    """The same for a text of several lines, which stay."""
    return "\n".join(map(printable, text.split("\n")))
