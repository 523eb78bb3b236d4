"""docs/formats.md says of every signal its aliases, and every name of the clock."""

from pathlib import Path

import pytest

from vftcli.readers.aliases import ALIASES, CLOCKS
from vftcli.readers.columns import SIGNALS

DOCUMENT = Path(__file__).parents[2] / "docs" / "formats.md"


def rows() -> dict[str, str]:
    lines = [line for line in DOCUMENT.read_text("utf-8").splitlines() if line.startswith("| `")]
    return {line.split("`")[1]: line for line in lines}


@pytest.mark.parametrize("field", ALIASES)
def test_every_signal_has_its_aliases(field: str) -> None:
    name = next(name for name, target in SIGNALS.items() if target == field)
    assert all(f"`{alias}`" in rows()[name] for alias in ALIASES[field])


def test_every_name_of_the_clock_is_there() -> None:
    text = DOCUMENT.read_text("utf-8")
    assert all(f"`{name}`" in text for name in CLOCKS)
