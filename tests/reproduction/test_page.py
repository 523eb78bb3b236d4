"""How a reproduction reads: spreads, ratios, failures, and the page."""

import json
import re
from pathlib import Path

import pytest

from vftcli.outputs.files import OutputFolder
from vftcli.outputs.grid import DASH, terminal
from vftcli.reproduction.experiments import (
    beside_print,
    experiments_of,
    files_of,
    gather,
    overview,
    run_jobs,
    spread,
    write_reproduction,
)


@pytest.fixture
def made(cheap):
    experiments = experiments_of(cheap, tuple(cheap.items), fast=False)
    results = run_jobs(experiments, workers=0)
    return gather(cheap, tuple(cheap.items), results), experiments


@pytest.mark.parametrize(("values", "text"), [
    ([1.2345], "1.23"),
    ([1.0, 2.5, 4.0], "2.50 (1 … 4)"),
    ([-0.5, -0.5], "−0.500"),
    ([0.25, None], "0.250, 1 of 2"),
    ([None, None], DASH),
    ([], DASH),
    ([18.0], "18"),
])  # fmt: skip
def test_a_mean_stands_with_its_range(values, text) -> None:
    assert spread(values) == text


def test_ours_stands_over_the_print_and_in_the_terminal(made) -> None:
    """Means 4 and −1 over printed 2 and −1: 2 and 1, median 1.5."""
    found, _ = made
    assert beside_print(found["fig1"]) == "1.5 (1.0 … 2.0)"
    assert beside_print(found["fig2"]) == DASH
    *lines, left_out = terminal(overview(found)).splitlines()
    # What failed is wider than the screen: it goes on below.
    assert lines[:4] == [
        "item       ours / print",
        "Fig. 1  1.5 (1.0 … 2.0)",
        "Fig. 2                –",
        "Fig. 3                –",
    ]
    assert lines[-3:-1] == ["Fig. 1  in size", "Fig. 2  a picture"]
    assert "nothing moved" in lines[-1]
    assert left_out == "A wider terminal also shows: what it shows, ours."


def test_the_page_has_every_item_and_what_failed(made, cheap, tmp_path: Path) -> None:
    found, experiments = made
    with OutputFolder(tmp_path / "out", False, files_of(cheap, (), None)) as folder:
        write_reproduction(folder, cheap, found, experiments, "vftcli reproduce cheap")
    page = (tmp_path / "out" / "index.html").read_text("utf-8")
    for name, item in cheap.items.items():
        assert f'<h2 id="{name}">{item.label}: ' in page
    assert '<span class="wrapped">A &lt;figure&gt;</span>' in page
    assert ".wrapped{" in page  # so that the words may break
    assert "<strong>In size.</strong> Because." in page
    assert page.count("nothing moved with 2") == 2  # in its row and at its item
    (row,) = re.findall('<th scope="row">alpha</th>(.*?)</tr>', page, re.DOTALL)[:1]
    texts = re.findall("<td.*?>(.*?)</td>", row)
    assert texts == ["N", "2", "3", "4 (3 … 5)", "0.500"]
    assert "what works: seeds 1, 2, 3<" in page
    assert "what takes the time<" in page
    assert "src=" not in page  # nothing is loaded from anywhere
    text = (tmp_path / "out" / "reproduction.md").read_text("utf-8")
    assert "**Fig. 1: A \\<figure\\>**" in text
    assert "| alpha | N | 2 | 3 | 4 (3 … 5) | 0.500 |" in text
    record = json.loads((tmp_path / "out" / "run.json").read_text("utf-8"))
    assert record["command"] == "vftcli reproduce cheap"
    assert record["runs"][-1] == {"experiment": "timed", "seed": 0}
    assert record["values"]["fig1"]["a"]["corrected"] == [3.0, 4.0, 5.0]
    assert len(record["failures"]["fig3"]) == 2


def test_all_that_is_written_was_reported_before(made, cheap, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib", reason="no figure is drawn without matplotlib")
    found, experiments = made
    names = files_of(cheap, tuple(cheap.items), "svg")
    with OutputFolder(tmp_path / "out", False, names) as folder:
        write_reproduction(folder, cheap, found, experiments, "command", "svg")
    there = {p.relative_to(tmp_path / "out").as_posix() for p in (tmp_path / "out").rglob("*.*")}
    assert there == set(names)
    assert "figures/fig1-single.svg" in there
