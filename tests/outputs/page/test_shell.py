import errno
import json
import re
import shutil
import sys
from html import unescape

import pytest
from jinja2 import FileSystemBytecodeCache, UndefinedError

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
