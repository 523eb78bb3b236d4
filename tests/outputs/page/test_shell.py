import errno
import json
import re
import shutil
import sys
from html import unescape

import numpy as np
import pytest
from jinja2 import FileSystemBytecodeCache, UndefinedError

from vftcli.outputs.charts import QUIET, Chart, ChartLine, Span, families_of
from vftcli.outputs.page import shell
from vftcli.outputs.page.shell import page, part, script_json
from vftcli.signals import remarks as remarks_module
from vftcli.signals.remarks import fact, warning

HOSTILE = "<b>&</script>\u2028"


@pytest.mark.parametrize("html", [
    part("parts/top", (HOSTILE,), HOSTILE, part("parts/lead", HOSTILE)),
    part("parts/pairs", {HOSTILE: HOSTILE}),
    part("parts/bullets", [HOSTILE]),
    part("parts/section", HOSTILE, "x", HOSTILE),
    page("page.html", HOSTILE),
    part("parts/provenance", {"command": HOSTILE, "versions": {HOSTILE: HOSTILE}}),
])  # fmt: skip
def test_no_word_from_outside_becomes_an_element(html: str) -> None:
    assert "<b>" not in html
    assert "&lt;b&gt;&amp;" in html


def test_data_reads_back_and_cannot_end_its_element() -> None:
    text = script_json({"a": HOSTILE, "b": [1.5, None]})
    assert "<" not in text
    assert json.loads(text) == {"a": HOSTILE.replace("\u2028", " "), "b": [1.5, None]}
    with pytest.raises(ValueError, match="JSON compliant"):
        script_json({"a": float("nan")})


def test_what_is_not_there_is_not_shown() -> None:
    assert "<script" not in page("page.html", "t")
    assert part("parts/all_remarks", []) == ""
    assert part("parts/section", "more", "") == ""
    assert part("parts/lead", "") == ""
    made = {"command": "", "input": None, "robot": {"name": "ur5"}, "versions": {}}
    html = part("parts/provenance", made)
    assert "Log sha256" not in html
    assert "through the Python interface" in html
    assert "ur5 (built in)" in html


def test_a_remark_is_said_once_at_length_the_worst_first(monkeypatch: pytest.MonkeyPatch) -> None:
    words = '[test-code]\nshort = "in short {a_s:.1f} s"\nlong = "at length {a_s:.2f} s"\n'
    own = remarks_module.catalogue()
    monkeypatch.setattr(remarks_module, "catalogue", lambda: (words, *own))
    turned, cut = fact("test-code", a_s=0.25), warning("topic-too-short", signal="a", topic="/b")
    html = part("parts/all_remarks", [turned, cut, turned])
    assert html.count("<li>") == 2
    assert html.index("/b") < html.index("at length 0.25 s")


def test_a_name_that_could_end_a_rule_has_no_swatch() -> None:
    styles = {"gmo": ("#112233", "2 2"), 'x"]{}</style>': ("#445566", "")}
    html = page("page.html", "t", styles=styles)
    assert '[data-swatch="gmo"]::before{border-top:3px dotted #112233}' in html
    assert "#445566" not in html


def test_an_option_is_one_word_and_the_text_stays() -> None:
    text = "Name it (--free a-b.csv, -o x_-y) or --no-contacts <i>--a</i>."
    html = part("parts/lead", text)
    options = re.findall(r'<span class="option">([^<]*)</span>', html)
    assert options == ["--free", "-o", "--no-contacts", "--a"]
    assert unescape(re.sub(r"<[^>]*>", "", html)) == text


def test_what_a_template_misses_is_an_error_and_none_is_loaded_without_a_page(loaded) -> None:
    assert "jinja2" not in loaded("vftcli.outputs.report")
    with pytest.raises(UndefinedError, match="examinations"):
        page("logs.html", "t", failed={})


@pytest.mark.parametrize("room", [True, False])
def test_compiled_templates_are_kept_and_a_full_disk_costs_no_page(room, tmp_path, monkeypatch):
    """As Python's own, beside their texts; what cannot be kept is compiled again."""

    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "no space left on device")

    there = shutil.copytree(shell.HERE, tmp_path / "page", ignore=lambda *_: {"__pycache__"})
    monkeypatch.setattr(shell, "HERE", there)
    monkeypatch.setattr(sys, "dont_write_bytecode", False)
    if not room:
        monkeypatch.setattr(FileSystemBytecodeCache, "dump_bytecode", full)
    for _ in range(2):  # compiled, then read
        assert shell.templates.__wrapped__().get_template("page.html").name == "page.html"
    assert len([*there.glob("templates/__pycache__/*.cache")]) == room


# Charts as still drawings: places, ticks, lines, ribbons and what stands beside them.

SCALES = shell.Scales(
    shell.Box(128, 112, left=20, bottom=5, top=7, right=8), Span(2.0, 12.0), Span(-1.0, 4.0)
)
"""A plot of 100 by 100 with another room on each side."""


def test_values_have_their_places_and_stripes_stay_in_the_plot() -> None:
    np.testing.assert_allclose(SCALES.across(np.array([2.0, 7.0, 12.0])), [20, 70, 120])
    np.testing.assert_allclose(SCALES.up(np.array([-1.0, 4.0])), [107, 7])
    flat = SCALES._replace(x=Span(3.0, 3.0), y=Span(1.0, 1.0))
    assert (flat.across(3.0), flat.up(1.0)) == (20.0, 107.0)
    assert SCALES.inside((7.0, 99.0)).tolist() == [70.0, 120.0]
    found = shell.stripes(SCALES, [(2.0, 3.0), (7.0, 7.0)])
    assert found == "M20.0 7h10.0v100h-10.0zM70.0 7h0.5v100h-0.5z"


def test_ticks_are_round_and_never_few() -> None:
    np.testing.assert_allclose(shell.ticks(Span(0.0, 18.4), 9), np.arange(0.0, 20.0, 2.0))
    np.testing.assert_allclose(shell.ticks(Span(-7.0, 12.0), 3), [-5.0, 0.0, 5.0, 10.0])
    assert shell.ticks(Span(1.0, 1.0), 3) == pytest.approx([1.0])
    for high in (1.0, 1.7, 3.3, 6.1, 14.0):
        assert 3 <= len(shell.ticks(Span(-0.4 * high, high), 3)) <= 7
    assert (shell.label(-0.5), shell.label(-0.0), shell.label(1e6)) == ("−0.5", "0", "1e+06")


def test_a_line_breaks_where_nothing_is_known_and_stays_near() -> None:
    t = np.arange(5.0)
    assert shell.path_of(SCALES, t, np.array([0.0, 5.0, np.nan, 5.0, 0.0])).count("M") == 2
    assert shell.path_of(SCALES, t, np.array([np.nan, 1.0, np.nan, 5.0, 0.0])).count("h.01") == 1
    half = shell.ribbon(SCALES, t, np.zeros(5), np.array([1.0, 1.0, np.nan, 1.0, 1.0]))
    assert half.count("Z") == 2
    t = np.array([2.0, 3.0])
    assert shell.path_of(SCALES, t, np.array([-1.0, 1e9])) == "M20 107l10-200"
    assert shell.path_of(SCALES, t, np.array([-1.0, -1e9])) == "M20 107l10 100"


def test_a_path_is_drawn_to_a_tenth_without_its_errors_adding_up() -> None:
    """Moves of 0.04 are nothing, ten of them 0.4."""
    assert shell.polyline([[0.0, 0.0], [0.5, -1.1], [0.6, 9.0]]) == "M0 0l.5-1.1 .1 10.1"
    points = np.column_stack([0.04 * np.arange(11), np.zeros(11)])
    moves = re.findall(r"-?[\d.]+", shell.polyline(points).partition("l")[2])[::2]
    assert sum(map(float, moves)) == pytest.approx(0.4)
    assert shell.polyline([[3.0, 4.0]]) == "M3 4h.01"


def chart(t: np.ndarray, *lines: ChartLine, **kind: object) -> Chart:
    n = lines[0].values.shape[1]
    return Chart("k", "K", ("N",) * n, tuple("abcdef"[:n]), t, lines, **kind)  # type: ignore[arg-type]


def test_a_ribbon_goes_along_both_edges_and_is_grey_where_no_contact_is_listed() -> None:
    """Between two level lines it fills its whole box: the area of its outline, by Gauss."""
    line = ChartLine("best", np.zeros((6, 1)), "#112233", half=np.full((6, 1), 2.0))
    html = shell.part("svg/multiples", chart(np.arange(6.0), line))
    assert QUIET not in html
    (outline,) = set(re.findall(r'"(M[^"]*)Z"', html))
    steps = np.array([float(number) for number in re.findall(r"-?\d*\.?\d+", outline)])
    x, y = np.cumsum(steps.reshape(-1, 2), axis=0).T
    area = 0.5 * abs(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))
    assert 1.0 < area == pytest.approx(np.ptp(x) * np.ptp(y))
    quiet = line._replace(quiet=np.array([True, True, False, False, True, True]))
    html = shell.part("svg/multiples", chart(np.arange(6.0), quiet))
    assert html.count('class="rim"/>') == 1 + 1  # one more in the legend
    assert html.count('class="floor"/>') == 1
    assert QUIET in html


def test_a_scale_holds_ribbons_and_bands_and_neighbours_of_one_drive_size_share_it() -> None:
    assert families_of(np.array([150.0, 150.0, 28.0, 28.0, 150.0])) == (1, 1, 2, 2, 3)
    assert families_of(np.array([np.nan, np.nan])) == (1, 1)
    t, values = np.arange(2.0), np.array([[1.0, 40.0, 3.0], [-1.0, 0.0, 0.0]])
    shown = chart(t, ChartLine("a", values), families=(1, 1, 2))
    assert shown.ends(0) == shown.ends(1)
    assert shown.ends(0).high > 40.0
    assert shown.ends(2).high < 4.0
    ones = np.ones((2, 1))
    # Lines that are constant or unknown have no scale of their own.
    flat = (chart(t, ChartLine("a", x * ones)).ends(0) for x in (4.0, 0.0, np.nan))
    assert [*flat] == [Span(0.0, 8.0), Span(-1.0, 1.0), Span(-1.0, 1.0)]
    ends = chart(t, ChartLine("a", ones, half=5.0 * ones)).ends(0)
    assert (ends.low < -4.0, ends.high > 6.0) == (True, True)
    ends = chart(t, ChartLine("a", ones), band=np.array([9.0])).ends(0)
    assert (ends.low < -9.0, ends.high > 9.0) == (True, True)


def test_only_what_is_shown_stands_in_the_small_pictures_and_names_are_words() -> None:
    t, ones = np.arange(3.0), np.ones((3, 2))
    named = {"first": "#112233", "<i>": "#445566", "later": "#778899"}
    lines = [ChartLine(name, ones, paint, shown=name != "later") for name, paint in named.items()]
    html = shell.part("svg/multiples", chart(t, *lines))
    assert html.count("<figure") == 2
    # Each line has a switch, those that are shown a place in the legend.
    assert html.count('stroke="#112233"') == 2 + 1 + 1
    assert html.count('stroke="#778899"') == 1
    assert html.count('aria-pressed="false"') == 1
    assert "legend" in html
    assert "legend" not in shell.part("svg/multiples", chart(t, lines[0]))  # one line needs none
    doubtful = chart(t, lines[0])._replace(panels=("J1†", "J2"))
    assert "†: the joint rests most of the time" in shell.part("svg/multiples", doubtful)
    axes = shell.part("svg/axes", SCALES, "<i>")
    for text in (html, axes, shell.part("svg/svg", shell.Box(), "<i>", "<g/>")):
        assert "<i>" not in text
        assert "&lt;i&gt;" in text
