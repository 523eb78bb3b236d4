"""One screen: facts, answer, bars, table, whether it can be believed, what was written."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from contact_rows import contact, contact_list

from vftcli.analysis import Analysis
from vftcli.cli.console import canvas
from vftcli.contacts.contact_list import Contact, ForceCourse
from vftcli.outputs.believability import MARKS, Ground
from vftcli.outputs.contacts import forces_along
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
    ground_lines,
    list_lines,
    log_screen,
    logs_screen,
    seconds,
    short_screen,
    written_lines,
)
from vftcli.signals.arrays import Array
from vftcli.signals.remarks import warning

CANVAS = Canvas(width=80)


def many(count: int) -> tuple:
    """So many contacts within the fixture's log, the first the hardest."""
    times = np.linspace(0.2, 4.5, count)
    return tuple(
        contact(number=k + 1, start=t, stop=t + 0.05, peak=t + 0.02, peak_force=90.0 - k)
        for k, t in enumerate(times)
    )


def listed(analysis: Analysis, count: int) -> Analysis:
    return replace(analysis, contacts=contact_list(*many(count), remarks=()))


@pytest.mark.parametrize("count", [0, 1, 12, 20, 60])
def test_never_more_than_forty_lines(analysis: Analysis, count: int) -> None:
    odd = [warning("saturation", signal="current") for _ in range(6)]
    (own, *_) = analysis.examinations
    troubled = replace(own, findings=tuple(odd))
    for made in (analysis, replace(analysis, examinations=(troubled,))):
        for most in (MOST_LINES, MOST_LINES - FILE_LINES):
            text = log_screen(listed(made, count), CANVAS, most=most)
            lines = text.splitlines()
            assert len(lines) <= most
            assert all(len(line) <= CANVAS.width or "vftcli" in line for line in lines)
    assert len(log_screen(listed(analysis, 60), CANVAS, every=True).splitlines()) > MOST_LINES


def test_a_name_that_a_terminal_would_obey_is_shown_as_it_is(analysis: Analysis, as_if) -> None:
    source = replace(analysis.recording.source, label="\x1b[31mred.csv")
    fast = replace(analysis.recording, source=source, t=1e-3 * np.arange(600.0))
    made = as_if(analysis, fast)
    assert "\x1b" not in facts(made)
    assert facts(made).endswith("at 1000 Hz")
    assert "\x1b" not in log_screen(listed(made, 3), CANVAS)


def test_a_terminal_gets_its_letters_colours_and_width(analysis: Analysis) -> None:
    text = "".join(map(chr, PLAIN))
    assert Canvas(unicode=True).shown(text) == text
    assert Canvas(unicode=False).shown(text + "ß").isascii()
    rows = (contact(), contact(number=2, where="cannot tell", places=(2, 6)))
    made = replace(analysis, contacts=contact_list(*rows, remarks=()))
    ascii_text = log_screen(made, Canvas(unicode=False))
    assert ascii_text.isascii()
    assert "+/-" in ascii_text
    assert "link 2 ... link 6" in ascii_text
    ends = ("good", "trust")
    table = [line.rstrip() for line in ascii_text.splitlines() if line.rstrip().endswith(ends)]
    assert len({line.rindex(" ") for line in table}) == 1  # columns stay columns
    painted = log_screen(made, Canvas(colour=True))
    assert "\x1b[32m" in painted
    assert re.sub(r"\x1b\[\d+m", "", painted) == log_screen(made, Canvas())
    assert Canvas(colour=True).painted("", "bad") == ""


@pytest.mark.parametrize(("columns", "width"), [(20, 40), (60, 60), (240, 100)])
def test_a_screen_is_as_wide_as_its_terminal(
    columns: int, width: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", str(columns))
    assert canvas().width == width


def test_a_joint_whose_reference_rests_counts_in_no_mean(analysis: Analysis) -> None:
    (block,) = blocks(analysis.errors)
    first = pl.col("joint") == 1
    floor = pl.when(first).then(9.0).otherwise(0.2)
    rests = analysis.errors.with_columns(reference_trusted=~first, reference_floor_Nm=floor)
    (left,) = blocks(rests)
    text = against(left, analysis)
    assert text.startswith("Against vendor without J1 (own error 0.20 N·m): RMSE ")
    paper = replace(analysis, of_robot_file=True)
    assert "the paper's gains" in against(left, paper)
    assert left.means.errors["best"] == pytest.approx(block.rmse[0, 1:].mean())
    (every,) = blocks(analysis.errors.with_columns(reference_trusted=pl.lit(value=False)))
    assert every.means == block.means


def test_results_made_anyway_say_so(analysis: Analysis) -> None:
    (own, *_) = analysis.examinations
    percent = {"misfit_percent": 190.0, "healed_percent": 3.0}
    bad = warning("effort-sign", signal="current", column="current", width=6, **percent)
    made = replace(analysis, examinations=(replace(own, findings=(bad,)),))
    doubt = "MEANINGLESS if this finding is right (you chose --anyway): effort-sign"
    assert doubt in log_screen(made, CANVAS)
    broken = "\n  ".join(doubt.rsplit(" ", 1))  # its lines count
    assert broken in log_screen(made, Canvas(width=71))
    assert "MEANINGLESS" in short_screen(made, CANVAS)


def named(analysis: Analysis, label: str, as_if, count: int = 1) -> Analysis:
    source = replace(analysis.recording.source, path=Path(label), label=label, remarks=())
    made: Analysis = as_if(analysis, replace(analysis.recording, source=source))
    return listed(made, count)


SEVERAL = """\
6 logs · ur5 · 1 left out

  log        span  contacts  hardest            detects above  health
  log0.csv  5.2 s         0  –                            6 N  △ clock
  log1.csv  5.2 s         1  90 ± 7 N at 0.2 s            6 N  △ clock
  log2.csv  5.2 s         2  90 ± 7 N at 0.2 s            6 N  ✗ load
  log3.csv  5.2 s         3  90 ± 7 N at 0.2 s            6 N  △ clock
  log4.csv  5.2 s         4  90 ± 7 N at 0.2 s            6 N  △ clock
  bad.csv                                                      ✗ left out

Can it be believed?
  ✗ log2.csv: load    the arm carries 1.20 ± 0.20 kg unknown to ur5, perhaps a
                      hand or a gripper
    vftcli identify log2.csv --method payload --robot ur5 -o loaded.toml
"""
CLOCK = """\
  △ {0}: clock   1 gap, the longest 0.41 s at 3.2 s, nothing repaired
                      vftcli inspect {0}
"""


def test_several_logs_are_a_line_each_and_the_worst(without_reference: Analysis, as_if) -> None:
    logs = [named(without_reference, f"log{k}.csv", as_if, k) for k in range(5)]
    load = warning("light-load", load_kg=1.2, sd_kg=0.1, robot="ur5")
    (own, *_) = without_reference.examinations
    logs[2] = replace(logs[2], examinations=(replace(own, findings=(load,)),))
    failed = {"bad.csv": "not recognised"}
    text = SEVERAL + "".join(CLOCK.format(f"log{k}.csv") for k in (0, 1))
    assert logs_screen(logs, CANVAS, failed) == f"{text}  and 3 more: --details\n"
    text += "".join(CLOCK.format(f"log{k}.csv") for k in (2, 3, 4))
    assert logs_screen(logs, CANVAS, failed, every=True) == text
    three = logs_screen([logs[k] for k in (0, 1, 3)], CANVAS, {})
    assert three.startswith("3 logs · ur5\n")
    assert three.endswith(CLOCK.format("log3.csv"))


def test_a_hundred_logs_are_one_screen(without_reference: Analysis, as_if) -> None:
    logs = [named(without_reference, f"log{k}.csv", as_if) for k in range(100)]
    lines = logs_screen(logs, CANVAS, {}).splitlines()
    assert len(lines) == 33 <= MOST_LINES - FILE_LINES
    assert lines[:2] == ["100 logs · ur5", ""]
    assert [line.split()[0] for line in lines[3:23]] == [f"log{k}.csv" for k in range(20)]
    more = "  the 20 worst and hardest of 100; --details shows all"
    assert lines[23:26] == [more, "", "Can it be believed?"]
    assert lines[-1] == "  and 97 more: --details"
    lines = logs_screen(logs[:20], CANVAS, {}).splitlines()
    assert lines[23:25] == ["", "Can it be believed?"]


def test_several_logs_tell_their_errors_where_there_is_a_reference(analysis, as_if) -> None:
    log = named(analysis, "log.csv", as_if)
    lines = logs_screen([log, log], CANVAS, {}).splitlines()
    (block,) = blocks(analysis.errors)
    name, least = block.means.least
    assert lines[2].split() == ["detects", "mean", "RMSE"]
    assert lines[3].split()[-3:] == ["above", "[N·m]", "health"]
    assert f" 6 N  {least:.2f} ({name})  △ " in lines[4]


def test_only_paths_that_exist_are_printed(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("run.json").write_text("{}")
    names, out, wide = ["index.html", "run.json"], Path(), Canvas(width=100)
    assert written_lines(out, names, wide) == ["./  run.json"]
    Path("index.html").write_text("")
    assert written_lines(out, names, wide, several=True) == [
        "./  index.html  run.json  one folder a log",
        "Open: index.html        More here: --details",
    ]
    # A page that this run did not write is not offered.
    assert "index.html" not in "".join(written_lines(out, ["run.json"], wide))


def test_a_ground_is_a_mark_a_subject_and_a_sentence_with_its_remedy_below() -> None:
    words = "The clock waits 12 times, for 40 ms at most, which is more than most are seen to."
    ground = Ground("caution", "log", words, "x" * 51)
    assert list(ground_lines(ground, Canvas(width=72), 1, "long_name.csv")) == [
        "  △ long_name.csv: log",
        "                      The clock waits 12 times, for 40 ms at most, …",
        "    " + "x" * 51,
    ]


def test_where_room_is_short_good_grounds_share_a_line() -> None:
    log, model = (Ground("good", name, f"{name} is sound") for name in ("log", "model"))
    assert belief_lines([log, model], CANVAS, 0)[1:] == [f"  {MARKS['good']} log · model"]
    assert belief_lines([log], CANVAS, 0)[1].endswith("log is sound")


HEADS = "  #  from – to [s]    |F| [N]  range [N]  direction  where  trust"
ROW = "  {0}    {0}.00 –   4.78   5{0} ± 7      57–78  +y, down   wrist  fair"
EACH = [*map(ROW.format, (1, 2, 3))]
END = [
    "  Nothing else above 6 N at the flange. Weaker pushes may not show.",
    "  (± 95 %; force ON the robot, base axes; range: over all possible",
    "    places; trust: good within 25 % of |F|, weak beyond 40 % or by little",
    "    evidence)",
]


def test_a_list_is_rows_and_a_word_on_more() -> None:
    *rows, weak = (contact(number=k, start=k * 1.0, peak_force=50.0 + k) for k in (1, 2, 3, 4))
    found, canvas = contact_list(*rows, candidates=(weak,)), Canvas(width=72)
    more = "  the 2 hardest of 3; --details shows all"
    assert list_lines(found, 2, canvas) == [HEADS, *EACH[1:], more, *END]
    weaker = ["", "  Candidates, with too little evidence or force to be listed:", HEADS]
    assert list_lines(found, None, canvas) == [HEADS, *EACH, *weaker, ROW.format(4), *END]


T = np.linspace(2.0, 20.0, 1801)


def pushed(*pushes: tuple[float, float, float]) -> tuple[Array, Array]:
    """Time and forces that are constant from and to a time."""
    force = np.zeros(len(T))
    for begin, end, size in pushes:
        force[(begin <= T) & (end >= T)] = size
    return T, force


BARS = """\
    N
  130 ┤                              ▁▁▁▁▁▁▁▁▁▁▁      ████████
   65 ┤          ▁▁▁▁▁▁▁▁▁▁▁         ███████████      ████████
    0 ┤▁▁▁▁▁▁▁▁▁▁███████████▁▁▁▁▁▁▁▁▁███████████▁▁▁▁▁▁████████▁▁▁▁▁▁
       2      4      6     8      10     12     14    16     18     20 s
    #            1                          2  14                   15"""
"""|F| over 18 s in 61 columns of .295 s: what is pushed from 5 s on begins in column 10.16.

Of 130.4 N in three lines of eight steps, 45 N are 8.3 and 90 N 16.6 steps, rounded up. Number 13,
at 13.3 s, lies beside that of 13 s.
"""


def test_bars_are_as_high_as_the_force_and_stand_where_it_is() -> None:
    force = pushed((5.0, 8.0, 45.0), (11.0, 14.0, 90.0), (16.0, 18.0, 130.4), (18.5, 18.6, 1.0))
    peaks = {1: 5.0, 2: 13.0, 13: 13.3, 14: 14.0, 15: 20.0}
    rows = [contact(number=number, peak=peak) for number, peak in peaks.items()]
    assert force_bars(*force, rows, Canvas(width=72)) == BARS.splitlines()
    plain = BARS.replace("┤", "|").replace("▁", ".").replace("█", "#")
    assert force_bars(*force, rows, Canvas(width=72, unicode=False)) == plain.splitlines()
    assert force_bars(*force, [], Canvas(width=72)) == BARS.splitlines()[:-1]
    # Nine steps at most, of 1, 2 or 5 times a power of ten.
    steps = {0.9: "0.1", 2.0: "0.5", 45.0: "5", 600.0: "100"}
    assert {s: seconds(np.array([0.0, s]), 60).split()[1] for s in steps} == steps
    assert seconds(np.array([0.0, 200.0]), 60).endswith("200 s")
    assert len(seconds(np.array([0.0, 200.0]), 60)) == 60 + 4


def test_every_sample_counts_in_a_column_and_a_gap_is_bridged() -> None:
    one = pushed((5.0, 5.001, 70.0))  # a single sample
    assert column_peaks(*one, 60).max() == 70.0
    few = np.array([0.0, 10.0]), np.array([0.0, 20.0])
    assert np.all(np.diff(column_peaks(*few, 8)[:-1]) > 0)


def test_the_forces_are_those_of_the_list(without_reference: Analysis) -> None:
    rows = [risen(1.0, 1.5, 30.0), risen(2.0, 2.2, 12.0)]
    t = without_reference.t
    force = np.nan_to_num(forces_along(rows, t)[0])
    assert np.isclose(force[(t >= 1.0) & (t <= 1.5)].max(), 30.0, rtol=0.05)  # between samples
    assert np.isclose(force[(t >= 2.0) & (t <= 2.2)].max(), 12.0, rtol=0.1)
    assert not force[(t < 1.0) | (t > 2.2) | ((t > 1.5) & (t < 2.0))].any()
    unknown = replace(rows[0], peak_band=40.0)  # which the list calls unknown: no bar
    for found in (None, contact_list(), contact_list(unknown)):
        assert "┤" not in log_screen(replace(without_reference, contacts=found), Canvas())


def risen(start: float, stop: float, peak: float) -> Contact:
    """A contact: its force rises to a peak and falls."""
    t, force = np.array([start, (start + stop) / 2, stop]), np.array([0.0, peak, 0.0])
    course = ForceCourse(t, force, 0.1 * force)
    return contact(start=start, stop=stop, peak=t[1], peak_force=peak, course=course)
