"""One screen: facts, answer, bars, table, whether it can be believed, what was written."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from contact_rows import contact, contact_list

from vftcli.analysis import Analysis
from vftcli.contacts.contact_list import ForceCourse
from vftcli.outputs.believability import Ground
from vftcli.outputs.error_tables import blocks
from vftcli.outputs.screen import (
    FILE_LINES,
    MOST_LINES,
    PLAIN,
    Canvas,
    against,
    belief_lines,
    column_peaks,
    facts,
    force_bars,
    forces_of_list,
    log_screen,
    logs_screen,
    seconds,
    short_screen,
    written_lines,
)
from vftcli.signals.arrays import Array
from vftcli.signals.remarks import caution, fact, warning

CANVAS = Canvas(width=80)


def many(count: int) -> tuple:  # type: ignore[type-arg]
    """So many contacts within the fixture's log, the first the hardest."""
    times = np.linspace(0.2, 4.5, count)
    return tuple(
        contact(number=k + 1, start=t, stop=t + 0.05, peak=t + 0.02, peak_force=90.0 - k)
        for k, t in enumerate(times)
    )


def listed(analysis: Analysis, count: int) -> Analysis:
    return replace(analysis, contacts=contact_list(*many(count), remarks=()))


def test_the_answer_stands_first_and_everything_on_one_screen(analysis: Analysis) -> None:
    text = log_screen(listed(analysis, 4), CANVAS)
    lines = text.splitlines()
    assert len(lines) <= MOST_LINES
    assert "· ur5" in lines[0]
    assert lines[2].strip().startswith("4 contacts. The hardest, at ")
    order = [
        "┤",
        "from – to [s]",
        "Nothing else",
        "Can it be believed?",
        "Against vendor",
    ]
    assert [text.index(word) for word in order] == sorted(text.index(word) for word in order)
    assert "the others" in text or "the paper's gains" in text
    assert "\x1b" not in text


@pytest.mark.parametrize("count", [0, 1, 12, 20, 60])
def test_never_more_than_forty_lines(analysis: Analysis, count: int) -> None:
    odd = [warning("saturation", signal="current") for _ in range(6)]
    (own, *_) = analysis.examinations
    troubled = replace(own, findings=tuple(odd))
    for made in (analysis, replace(analysis, examinations=(troubled,))):
        for most in (MOST_LINES, MOST_LINES - FILE_LINES):
            text = log_screen(listed(made, count), CANVAS, most=most)
            assert len(text.splitlines()) <= most
    assert len(log_screen(listed(analysis, 60), CANVAS, every=True).splitlines()) > MOST_LINES


def test_the_hardest_are_shown_in_the_order_of_time(analysis: Analysis) -> None:
    text = log_screen(listed(analysis, 60), CANVAS)
    rows = [line.split()[0] for line in text.splitlines() if line.rstrip().endswith("good")]
    assert rows == [str(k + 1) for k in range(len(rows))]
    assert f"the {len(rows)} hardest of 60; --details shows all" in text


def test_a_name_that_a_terminal_would_obey_is_shown_as_it_is(analysis: Analysis, as_if) -> None:  # type: ignore[no-untyped-def]
    source = replace(analysis.recording.source, label="\x1b[31mred.csv")
    made = as_if(analysis, replace(analysis.recording, source=source))
    assert "\x1b" not in facts(made)
    assert "\x1b" not in log_screen(listed(made, 3), CANVAS)


def test_ascii_terminals_get_ascii(analysis: Analysis) -> None:
    text = log_screen(listed(analysis, 3), Canvas(unicode=False))
    assert text.isascii()
    assert "+/-" in text


def test_colours_paint_and_change_no_letter(analysis: Analysis) -> None:
    import re

    painted = log_screen(listed(analysis, 3), Canvas(colour=True))
    assert "\x1b[32m" in painted
    assert re.sub(r"\x1b\[\d+m", "", painted) == log_screen(listed(analysis, 3), Canvas())


def test_a_load_has_no_rest(analysis: Analysis) -> None:
    load = contact(start=0.5, stop=4.0, is_load=True, peak_force=27.0)
    found = contact_list(load, remarks=(caution("contact-is-load"),))
    text = log_screen(replace(analysis, contacts=found), CANVAS)
    assert "A load, or a wrong payload" in text
    assert "else: " not in text
    assert "--method payload" in text


def test_against_tells_the_lead_the_others_and_the_floor(analysis: Analysis) -> None:
    (block,) = blocks(analysis.errors)
    means = block.means.errors
    text = against(block, analysis)
    assert text.startswith("Against vendor (floor 0.50): ")
    assert f"({next(iter(means))})" in text
    # Means of the joints, by hand from the tidy table.
    rows = analysis.errors.filter(analysis.errors["observer"] == "best")
    assert means["best"] == pytest.approx(rows["rmse_Nm"].mean())
    paper = replace(analysis, remarks=(fact("paper-gains-measured"),))
    assert "the paper's gains" in against(block, paper)


def test_a_joint_whose_reference_rests_counts_in_no_mean(analysis: Analysis) -> None:
    (block,) = blocks(analysis.errors)
    first = pl.col("joint") == 1
    rests = analysis.errors.with_columns(
        reference_trusted=~first, reference_floor_Nm=pl.when(first).then(9.0).otherwise(0.2)
    )
    (left,) = blocks(rests)
    assert against(left, analysis).startswith("Against vendor without J1 (floor 0.20): ")
    assert left.means.errors["best"] == pytest.approx(block.rmse[0, 1:].mean())
    (every,) = blocks(analysis.errors.with_columns(reference_trusted=pl.lit(value=False)))
    assert every.means == block.means


def test_results_made_anyway_say_so(analysis: Analysis) -> None:
    (own, *_) = analysis.examinations
    bad = warning("effort-sign", signal="current", misfit_percent=190.0, healed_percent=3.0,
                  column="current", width=6)  # fmt: skip
    made = replace(analysis, examinations=(replace(own, findings=(bad,)),))
    assert "MEANINGLESS if this finding is right (you chose --anyway): effort-sign" in log_screen(
        made, CANVAS
    )
    assert "MEANINGLESS" in short_screen(made, CANVAS)


def named(analysis: Analysis, label: str, as_if, count: int = 1) -> Analysis:  # type: ignore[no-untyped-def]
    source = replace(analysis.recording.source, label=label, remarks=())
    made: Analysis = as_if(analysis, replace(analysis.recording, source=source))
    return listed(made, count)


def test_several_logs_are_a_line_each_then_the_worst_three(
    without_reference: Analysis, as_if
) -> None:  # type: ignore[no-untyped-def]
    logs = [named(without_reference, f"log{k}.csv", as_if, k) for k in range(4)]
    load = warning("light-load", load_kg=1.2, sd_kg=0.1, robot="ur5")
    (own, *_) = without_reference.examinations
    logs[2] = replace(logs[2], examinations=(replace(own, findings=(load,)),))
    text = logs_screen(logs, CANVAS, {"bad.csv": "not recognised"})
    lines = text.splitlines()
    assert lines[0] == "5 logs · ur5 · 1 left out"
    assert lines[2].split() == ["log", "span", "contacts", "hardest", "else", "health"]
    assert lines[5].endswith("✗ load")
    assert lines[7].split() == ["bad.csv", "✗", "left", "out"]
    believed = text.partition("Can it be believed?")[2]
    assert believed.strip().startswith("✗ log2.csv: load")


def test_where_room_is_short_good_grounds_share_a_line() -> None:
    log, model = (Ground("good", name, f"{name} is sound") for name in ("log", "model"))
    assert belief_lines([log, model], CANVAS, 0)[1:] == [f"  {log.mark} log · model"]
    assert belief_lines([log], CANVAS, 0)[1].endswith("log is sound")
    assert len(belief_lines([log, model], CANVAS, 1)) == 3


def test_a_hundred_logs_are_one_screen(without_reference: Analysis, as_if) -> None:  # type: ignore[no-untyped-def]
    logs = [named(without_reference, f"log{k}.csv", as_if) for k in range(100)]
    text = logs_screen(logs, CANVAS, {})
    assert len(text.splitlines()) <= MOST_LINES - FILE_LINES
    assert "of 100; --details shows all" in text


def test_several_logs_tell_their_errors_where_there_is_a_reference(analysis: Analysis) -> None:
    text = logs_screen([listed(analysis, 1), listed(analysis, 1)], CANVAS, {})
    assert "error" in text
    assert "N·m" in text


def test_columns_stay_columns_in_ascii(analysis: Analysis) -> None:
    rows = (contact(), contact(number=2, where="cannot tell", places=(2, 6)))
    text = log_screen(
        replace(analysis, contacts=contact_list(*rows, remarks=())), Canvas(unicode=False)
    )
    table = [line for line in text.splitlines() if line.rstrip().endswith(("good", "trust"))]
    assert len({line.rstrip().rindex(" ") for line in table}) == 1
    assert "link 2 ... link 6" in text


def test_the_short_screen_is_facts_and_answer(without_reference: Analysis) -> None:
    made = replace(without_reference, contacts=contact_list(contact(), contact(number=2)))
    text = short_screen(made, Canvas(width=80))
    assert len(text.splitlines()) == 2
    assert "2 contacts" in text


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


T = np.linspace(0.0, 18.0, 1801)


def pushed(*pushes: tuple[float, float, float]) -> tuple[Array, Array]:
    """Time and forces that are constant from and to a time."""
    force = np.zeros(len(T))
    for begin, end, size in pushes:
        force[(begin <= T) & (end >= T)] = size
    return T, force


def test_the_bars_are_as_high_as_the_force_and_stand_where_it_is() -> None:
    canvas = Canvas(width=72)
    lines = force_bars(*pushed((3.0, 6.0, 45.0), (9.0, 12.0, 90.0)), [], canvas)
    unit, top, middle, bottom, axis = lines
    assert unit.split() == ["N"]
    assert [line.split()[0] for line in (top, middle, bottom)] == ["90", "45", "0"]
    bars = [line.partition("┤")[2] for line in (top, middle, bottom)]
    columns = canvas.width - 2 - 8

    def at(row: str, time: float) -> str:
        return row.ljust(columns)[round(time / 18.0 * columns)]

    # Half of the largest force fills one and a half of the three lines.
    assert [at(row, 10.5) for row in bars] == ["█", "█", "█"]
    assert [at(row, 4.5) for row in bars] == [" ", "▄", "█"]
    assert [at(row, 15.0) for row in bars] == [" ", " ", "▁"]
    assert axis.split()[-1] == "s"
    assert max(map(len, lines)) <= canvas.width


def test_a_terminal_of_ascii_gets_ascii() -> None:
    lines = force_bars(*pushed((3.0, 6.0, 45.0)), [], Canvas(unicode=False))
    assert "".join(lines).isascii()
    assert "#" in lines[1]


def test_every_sample_counts_in_a_column_and_a_gap_is_bridged() -> None:
    one = pushed((5.0, 5.001, 70.0))  # a single sample
    assert column_peaks(*one, 60).max() == 70.0
    few = np.array([0.0, 10.0]), np.array([0.0, 20.0])
    assert np.all(np.diff(column_peaks(*few, 8)[:-1]) > 0)


def test_seconds_count_in_round_steps() -> None:
    assert seconds(T, 60).split() == ["0", "2", "4", "6", "8", "10", "12", "14", "16", "18", "s"]
    assert seconds(np.array([0.0, 0.9]), 60).split()[:3] == ["0", "0.1", "0.2"]


def test_numbers_stand_below_the_peaks_where_there_is_room() -> None:
    rows = [contact(number=1, peak=0.0), contact(number=2, peak=9.0), contact(number=3, peak=9.1)]
    *bars, line = force_bars(*pushed((8.0, 10.0, 5.0)), rows, Canvas(width=69))
    assert line.split() == ["#", "1", "2"]  # the third would touch the second
    begins = next(bar.index("┤") for bar in bars if "┤" in bar) + 1
    assert (line.index("1"), line.index("2")) == (begins, begins + 30)


def test_the_forces_are_those_of_the_list(without_reference: Analysis) -> None:
    rows = [
        contact(start=1.0, stop=1.5, course=risen(1.0, 1.5, 30.0)),
        contact(start=2.0, stop=2.2, number=2, course=risen(2.0, 2.2, 12.0)),
    ]
    made = replace(without_reference, contacts=contact_list(*rows))
    force, t = forces_of_list(made), made.t
    assert force is not None
    assert np.isclose(force[(t >= 1.0) & (t <= 1.5)].max(), 30.0, rtol=0.05)  # between samples
    assert np.isclose(force[(t >= 2.0) & (t <= 2.2)].max(), 12.0, rtol=0.1)
    assert not force[(t < 1.0) | (t > 2.2) | ((t > 1.5) & (t < 2.0))].any()


def risen(start: float, stop: float, peak: float) -> ForceCourse:
    """A force that rises to a peak and falls."""
    force = np.array([0.0, peak, 0.0])
    return ForceCourse(np.array([start, (start + stop) / 2, stop]), force, 0.1 * force)


def test_without_forces_there_are_no_bars(without_reference: Analysis) -> None:
    assert forces_of_list(replace(without_reference, contacts=None)) is None
    assert forces_of_list(replace(without_reference, contacts=contact_list())) is None
