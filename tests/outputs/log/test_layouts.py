"""Layouts name what the MCAP beside them holds, and nothing else."""

import json
import re
from collections.abc import Iterator
from dataclasses import replace
from xml.etree import ElementTree as ET

import pytest

from vftcli.analysis import Analysis
from vftcli.outputs.log.layouts import foxglove_layout, names_of, plotjuggler_layout
from vftcli.outputs.log.mcap_output import events, topics


def known_topics(analysis: Analysis) -> set[str]:
    names = names_of(analysis)
    samples = {topic.name for topic in topics(analysis, names)}
    return samples | {event.topic for event in events(analysis, names, 0)}


def leaves(layout: object) -> Iterator[str]:
    """Names of the panels of a tree."""
    if isinstance(layout, str):
        yield layout
    elif isinstance(layout, dict):
        for side in ("first", "second"):
            yield from leaves(layout[side])


def test_every_path_of_foxglove_is_a_topic(touched: Analysis) -> None:
    layout, known = json.loads(foxglove_layout(touched)), known_topics(touched)
    panels = layout["configById"]
    paths = [p["value"] for panel in panels.values() for p in panel.get("paths", [])]
    assert len(paths) == 4 + 6 * 6  # |F| and three axes; five observers and the reference a joint
    assert {path.partition(".")[0] for path in paths} <= known
    assert panels["RosOut!contacts"]["topicToRender"] in known
    assert panels["3D!arm"]["layers"]["arm"]["topic"] in known
    tabs = [tab["layout"] for tab in panels["Tab!joints"]["tabs"]]
    assert sorted([*leaves(layout["layout"]), *tabs]) == sorted(panels)


def test_every_curve_of_plotjuggler_is_a_series(touched: Analysis) -> None:
    """It names a field by slashes, and a joint's effort by the joint's name."""
    root, known = ET.fromstring(plotjuggler_layout(touched)), known_topics(touched)
    curves = [curve.attrib["name"] for curve in root.iter("curve")]
    assert len(curves) == 6 + 6 * 6
    wrench = re.compile(r"(.*)/wrench/(?:force|torque)/[xyz]")
    effort = re.compile(rf"(.*)/(?:{'|'.join(touched.robot.chain.names)})/effort")
    for curve in curves:
        found = wrench.fullmatch(curve) or effort.fullmatch(curve)
        assert found is not None, curve
        assert found[1] in known
    for splitter in root.iter("DockSplitter"):
        count = int(splitter.attrib["count"])
        assert len(splitter.findall("DockArea")) == count
        shares = [float(share) for share in splitter.attrib["sizes"].split(";")]
        assert len(shares) == count
        assert sum(shares) == pytest.approx(1.0, abs=1e-5)  # six digits each


def test_without_wrench_or_list_the_joints_are_left(touched: Analysis) -> None:
    bare = replace(touched, virtual_sensor=None, contacts=None)
    panels = json.loads(foxglove_layout(bare))["configById"]
    assert "Plot!force" not in panels
    assert "RosOut!contacts" not in panels
    tabs = [tab.attrib["tab_name"] for tab in ET.fromstring(plotjuggler_layout(bare)).iter("Tab")]
    assert tabs == ["joint torques"]
