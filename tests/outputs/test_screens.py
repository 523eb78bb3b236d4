"""docs/screens.md shows what the terminal shows."""

import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from screens import ROOT, SCREENS, printed, shown

NUMBER = re.compile(r"[−-]?\d+(?:\.\d+)?")


def words(text: str) -> Iterator[str]:
    """The words of a screen without its bars, wherever its lines break."""
    for line in text.splitlines():
        yield from line.partition("┤")[0].split()


@pytest.mark.slow
@pytest.mark.parametrize("name", SCREENS)
def test_a_screen_is_what_the_command_prints(
    name: str, request: pytest.FixtureRequest, tmp_path: Path
) -> None:
    screen = SCREENS[name]
    logs: Path = request.getfixturevalue("logs") if screen.real else ROOT / "fixtures"
    ours = list(words(shown(screen, logs, tmp_path)))
    theirs = list(words(printed()[screen.command]))
    # Another platform's last digit may turn a rounded number by one; nothing else differs.
    assert [NUMBER.sub("0", word) for word in ours] == [NUMBER.sub("0", word) for word in theirs]
    for mine, said in zip(ours, theirs, strict=True):
        pairs = zip(NUMBER.findall(mine), NUMBER.findall(said), strict=True)
        for a, b in ((float(x.replace("−", "-")), float(y.replace("−", "-"))) for x, y in pairs):
            assert abs(a - b) <= max(1.0, 0.05 * abs(b)), (mine, said)
