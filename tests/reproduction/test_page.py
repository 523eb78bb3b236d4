"""How a reproduction reads: spreads, ratios, failures, and the same tables on page and in text."""

from pathlib import Path

import pytest

from vftcli.outputs.files import OutputFolder
from vftcli.outputs.grid import DASH, terminal
from vftcli.reproduction.experiments import (
    beside_print,
    files_of,
    gather,
    jobs_of,
    overview,
    render_markdown,
    render_page,
    run_jobs,
    spread,
    write_reproduction,
)


@pytest.fixture
def made(cheap):
    jobs = jobs_of(cheap, tuple(cheap.items), fast=False)
    results = run_jobs(jobs, workers=0)
    return gather(cheap, tuple(cheap.items), results), jobs


@pytest.mark.parametrize(
    ("values", "text"),
    [
        ([1.2345], "1.23"),
        ([1.0, 2.5, 4.0], "2.50 (1 … 4)"),
        ([-0.5, -0.5], "−0.500"),
        ([0.25, None], "0.250, 1 of 2"),
        ([None, None], DASH),
        ([], DASH),
        ([18.0], "18"),
    ],
)
def test_a_mean_stands_with_its_range(values, text) -> None:
    assert spread(values) == text


def test_ours_stands_over_the_print_and_in_the_terminal(made) -> None:
    """Means 4 and −1 over printed 2 and −1: 2 and 1, median 1.5."""
    found, _ = made
    assert beside_print(found["fig1"]) == "1.5 (1.0 … 2.0)"
    assert beside_print(found["fig2"]) == DASH
    _, *worked, failed, left_out = terminal(overview(found)).splitlines()
    assert [line[:6] for line in (*worked, failed)] == ["Fig. 1", "Fig. 2", "Fig. 3"]
    assert "1.5 (1.0 … 2.0)" in worked[0]
    assert max(map(len, worked)) <= 80
    assert "nothing moved" in failed
    assert left_out == "No room for: what it shows, ours."


def test_page_and_text_have_every_item_and_what_failed(made, cheap) -> None:
    found, jobs = made
    page, text = (
        render_page(cheap, found, jobs),
        render_markdown(cheap, found, jobs, "vftcli reproduce cheap"),
    )
    for name in found:
        assert f'<h2 id="{name}">' in page
        assert f"## {cheap.items[name].label}:" in text
    assert "A &lt;figure&gt;" in page
    assert page.count("nothing moved with 2") == 2  # in its row and at its item
    assert "**Failed:** what fails, seed 2: nothing moved with 2" in text
    assert "| alpha | N | 2 | 3 | 4 (3 … 5) | 0.500 |" in text
    assert "- what works: seeds 1, 2, 3" in text
    assert "Made by `vftcli reproduce cheap`." in text
    assert "src=" not in page  # nothing is loaded from anywhere
    assert "- what takes the time\n" in text


def test_all_that_is_written_was_reported_before(made, cheap, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib", reason="no figure is drawn without matplotlib")
    found, jobs = made
    names = files_of(cheap, tuple(cheap.items), "svg")
    with OutputFolder(tmp_path / "out", False, names) as folder:
        write_reproduction(folder, cheap, found, jobs, "command", "svg")
    there = {p.relative_to(tmp_path / "out").as_posix() for p in (tmp_path / "out").rglob("*.*")}
    assert there == set(names)
    assert "figures/fig1-single.svg" in there
