import json

import pytest

from vftcli.outputs.page.shell import (
    bullets,
    chart_places,
    document,
    fact_list,
    folded,
    headline,
    pairs,
    provenance,
    remarks,
    script_json,
)
from vftcli.signals import remarks as remarks_module
from vftcli.signals.remarks import fact

HOSTILE = "<b>&</script>\u2028"


@pytest.mark.parametrize(
    "html",
    [
        headline(HOSTILE, HOSTILE),
        fact_list({HOSTILE: HOSTILE}),
        pairs({HOSTILE: HOSTILE}),
        bullets([HOSTILE]),
        remarks([HOSTILE]),
        folded(HOSTILE, "x"),
        document(HOSTILE, ""),
        provenance({"command": HOSTILE, "notes": [HOSTILE], "versions": {HOSTILE: HOSTILE}}),
    ],
)
def test_no_word_from_outside_becomes_an_element(html: str) -> None:
    assert "<b>" not in html
    assert "&lt;b&gt;&amp;" in html


def test_data_reads_back_and_cannot_end_its_element() -> None:
    text = script_json({"a": HOSTILE, "b": [1.5, None]})
    assert "<" not in text
    assert json.loads(text) == {"a": HOSTILE.replace("\u2028", " "), "b": [1.5, None]}
    with pytest.raises(ValueError, match="JSON compliant"):
        script_json({"a": float("nan")})


def test_a_page_without_charts_has_no_script() -> None:
    assert "<script" not in document("t", "body")
    assert document("t", "body", {"a": 1}).count("<script") == 2


def test_nothing_to_say_is_nothing_shown() -> None:
    assert remarks([]) == ""
    assert folded("more", "") == ""


def test_a_remark_shows_its_long_words(monkeypatch: pytest.MonkeyPatch) -> None:
    words = '[test-code]\nshort = "in short {a_s:.1f} s"\nlong = "at length {a_s:.2f} s"\n'
    monkeypatch.setattr(remarks_module, "catalogue", lambda: (words,))
    assert "at length 0.25 s" in bullets([fact("test-code", a_s=0.25)])


def test_buttons_choose_joints_or_axes() -> None:
    assert 'aria-label="Axis"' in chart_places("Axis", "Controller")
    assert "choose its axis" in chart_places("Axis", "Controller")
    assert "choose its joint" in chart_places()


def test_provenance_without_a_log_names_none() -> None:
    html = provenance({"command": "", "input": None, "robot": {"name": "ur5"}, "versions": {}})
    assert "Log sha256" not in html
    assert "through the Python interface" in html
    assert "ur5 (built in)" in html
