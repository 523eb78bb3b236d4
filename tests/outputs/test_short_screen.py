"""The short screen: facts, the answer, and what was written."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from contact_rows import contact, contact_list

from vftcli.analysis import Analysis
from vftcli.outputs.canvas import Canvas
from vftcli.outputs.short_screen import facts, short_screen, written_lines


def test_the_short_screen_is_facts_answer_and_files(without_reference: Analysis) -> None:
    made = replace(without_reference, contacts=contact_list(contact(), contact(number=2)))
    text = short_screen(made, ["out/  run.json"], Canvas(width=80))
    assert len(text.splitlines()) == 3
    assert "2 contacts" in text
    assert text.endswith("out/  run.json\n")


def test_only_paths_that_exist_are_printed(tmp_path: Path) -> None:
    (tmp_path / "run.json").write_text("{}")
    lines = written_lines(tmp_path, ["index.html", "run.json"], Canvas(width=100))
    assert "run.json" in "".join(lines)
    assert "index.html" not in "".join(lines)
    (tmp_path / "index.html").write_text("")
    lines = written_lines(tmp_path, ["index.html"], Canvas(width=100), several=True)
    assert "one folder a log" in " ".join(" ".join(lines).split())  # wherever the line breaks
    assert any(line.startswith("Open: ") for line in lines)


def test_a_page_that_this_run_did_not_write_is_not_offered(tmp_path: Path) -> None:
    for name in ("index.html", "run.json"):
        (tmp_path / name).write_text("")
    lines = written_lines(tmp_path, ["run.json"], Canvas(width=100))
    assert "index.html" not in "".join(lines)


def test_a_thousand_samples_a_second_are_written_out(analysis: Analysis) -> None:
    t = np.arange(analysis.recording.samples) * 1e-3
    fast = replace(analysis.recording, t=t)
    run = replace(analysis.motion.log, recording=fast)
    assert facts(replace(analysis, motion=replace(analysis.motion, log=run))).endswith("at 1000 Hz")
