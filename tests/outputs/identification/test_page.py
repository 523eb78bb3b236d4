"""The page of an identification: whole, self-contained, with its tables and its plots."""

import json
import re
from html.parser import HTMLParser

import numpy as np

from vftcli.doctor import examine
from vftcli.outputs.identification import (
    identification_record,
    render_identification,
    shown_trace,
    torque_charts,
)


class Balance(HTMLParser):
    """Checks that every element is closed in its turn."""

    VOID = frozenset({"meta", "br", "hr", "img", "input", "link", "path"})

    def __init__(self):
        super().__init__()
        self.open = []

    def handle_starttag(self, tag, attrs):
        del attrs
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        if tag not in self.VOID:
            assert self.open.pop() == tag


def test_the_page_is_whole_and_loads_nothing(found):
    result, log = found
    page = render_identification(
        result, identification_record(result, [examine(log)], "vftcli identify")
    )
    checker = Balance()
    checker.feed(page)
    assert checker.open == []
    assert "<b>log" not in page
    assert "&lt;b&gt;log &amp; co" in page
    assert not re.search(r"(src|href)\s*=\s*[\"']?https?:", page)
    assert page.count("<title>Residual over velocity, J") == 6
    data = re.search(r'<script type="application/json" id="data">(.*?)</script>', page, re.DOTALL)
    assert len(json.loads(data.group(1))["charts"][0]["panels"]) == 6
    for heading in ("How much torque is left unexplained", "Residual over velocity"):
        assert f"<h2>{heading}</h2>" in page
    assert "<summary>Identified numbers" in page


def test_the_held_out_log_is_drawn_over_time(found):
    result, _ = found
    assert [trace.role for trace in result.traces] == ["train", "held-out"]
    trace = shown_trace(result)
    assert trace.role == "held-out"
    torque, left = torque_charts(result)
    assert torque.x is trace.motion.t
    assert (torque.key, left.key) == ("torque", "left")
    assert [line.name for line in torque.series] == ["measured", "predicted"]
    np.testing.assert_array_equal(left.series[0].values, trace.residual)


def test_dots_stay_inside_their_plot(found):
    result, log = found
    page = render_identification(result, identification_record(result, [examine(log)], ""))
    dots = np.array(re.findall(r"M(-?[\d.]+) (-?[\d.]+)h\.01", page), dtype=float)
    assert len(dots) > 1000
    assert dots[:, 0].min() >= 38.0  # right of the room for the numbers
    assert dots[:, 0].max() <= 460.0
    assert dots[:, 1].min() >= 0.0
    assert dots[:, 1].max() <= 180.0


def test_the_page_draws_its_charts(found, opened):
    result, log = found
    record = identification_record(result, [examine(log)], "")
    tab = opened(render_identification(result, record))
    tab.unfold()
    assert tab.blank_charts() == []
    assert tab.errors == []
    assert tab.overflow <= 0
