"""huang2025.md beside it is what the code gives: Table I anew, the rest under `statistical`."""

import re
from pathlib import Path

import pytest

from vftcli.reproduction.experiments import experiments_of, gather, item_grid, run_jobs, spread
from vftcli.reproduction.paper import AS_PRINTED, PAPERS

HUANG = PAPERS["huang2025"]
DOCUMENT = Path(__file__).parent / "huang2025.md"

TIMED = re.compile(r"time\b|KFO-ZOH over")
"""Lines that tell how fast this machine is."""

WANDERING = {"fig6", "fig7", "fig9", "fig10"}
"""Items of which the loop as printed runs astray: the last bit of a sum turns into another path.

One commit on two processors gave .0400 and .0672 s to the turn.
"""


def documented(name: str) -> dict[str, list[str]]:
    """Label of a line → what the document's table of an item has of ours."""
    text = DOCUMENT.read_text("utf-8").partition(f"## {HUANG.items[name].label}: ")[2]
    text = text.partition("\n## ")[0]
    rows = [line.strip("| ").split(" | ") for line in text.splitlines() if line.startswith("| ")]
    return {row[0].replace("\\", ""): row[3:] for row in rows[2:]}


def computed(names: tuple[str, ...], *, fast: bool):
    experiments = experiments_of(HUANG, names, fast=fast)
    return gather(HUANG, names, run_jobs(experiments, workers=2))


def ends(text: str) -> tuple[float, float]:
    """The range that stands in an entry."""
    numbers = [float(x.replace("−", "-")) for x in re.findall(r"[-−]?\d+\.?\d*", text)]
    return (numbers[1], numbers[2]) if "…" in text else (numbers[0], numbers[0])


@pytest.mark.slow
def test_items_without_a_seed_are_the_documents_digit_by_digit() -> None:
    for name, shown in computed(("table3", "table4"), fast=True).items():
        rows = {row[0].text: [cell.text for cell in row[3:]] for row in item_grid(shown).cells}
        assert rows == documented(name)


@pytest.mark.slow
def test_the_first_seed_lies_in_the_documents_range() -> None:
    """The range holds every seed's value, rounded to three digits: half of the last is let pass.

    The tapped circle, the sensor, the dragged loop and the bearing: an experiment each.
    """
    names = ("table1", "fig3", "fig4", "fig6", "fig7", "fig12")
    for name, shown in computed(names, fast=True).items():
        document, compared = documented(name), 0
        for line in shown.lines:
            kinds = (*shown.variants, "floor")
            for kind, text in zip(kinds, document[line.label], strict=False):
                values = shown.values.get(line.key, {}).get(kind)
                wanders = kind == AS_PRINTED and name in WANDERING
                if wanders or not values or values[0] is None or not re.search(r"\d", text):
                    continue
                low, high = ends(text)
                least, most = low - 0.005 * abs(low), high + 0.005 * abs(high)
                assert least <= values[0] <= most, f"{name}, {line.label}, {kind}"
                compared += 1
        assert compared >= len(shown.lines)


@pytest.mark.statistical
def test_the_whole_document_is_what_the_code_gives() -> None:
    """Same seeds, same code: the printed digits, but for what tells the machine's speed."""
    for name, shown in computed(tuple(HUANG.items), fast=False).items():
        if not shown.lines:
            continue
        document = documented(name)
        first = int(name in WANDERING and shown.variants[0] == AS_PRINTED)
        for row in item_grid(shown).cells:
            if not TIMED.search(row[0].text):
                texts = [cell.text for cell in row[3:]]
                assert texts[first:] == document[row[0].text][first:], (name, row[0])


def test_an_entry_of_the_document_reads_back() -> None:
    assert ends(spread([1.0, 2.0, 4.5])) == (1.0, 4.5)
    assert ends(spread([-0.25])) == (-0.25, -0.25)
