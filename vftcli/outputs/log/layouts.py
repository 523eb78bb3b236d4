"""Layouts for estimates.mcap: one file for Foxglove, one for PlotJuggler, made for its topics.

Foxglove: Layouts, Import from file. PlotJuggler: ``plotjuggler -d estimates.mcap -l FILE``. Both
formats are those that the programs themselves write; they read what is left out as their default.
"""

import json
from collections.abc import Iterable, Sequence
from typing import Any
from xml.etree import ElementTree as ET

from vftcli.analysis import Analysis
from vftcli.observers.table import BEST
from vftcli.outputs.log.mcap_output import ros_name
from vftcli.outputs.palette import COLOURS, REFERENCE, SPARE, colours_of

#: A line of a plot: its path in the program's own words, its name, its colour.
LinePath = tuple[str, str, str]


def lead_wrench(analysis: Analysis) -> str | None:
    """Name of the wrench that is shown: that of `best`, else the first, None without any."""
    names = [wrench.name for wrench in analysis.wrenches]
    return BEST if BEST in names else next(iter(names), None)


def names_of(analysis: Analysis) -> Sequence[str]:
    """The joints' names, as the topics have them."""
    return analysis.recording.joint_names or analysis.robot.chain.names


def torque_topics(analysis: Analysis) -> list[tuple[str, str, str]]:
    """Name, topic and colour of every external torque, the reference last."""
    colours = colours_of(analysis.estimates)
    found = [(name, ros_name(name), colour) for name, colour in colours.items()]
    if analysis.reference is not None:
        found.append(("reference", "reference", REFERENCE))
    return [(name, f"/vftcli/external/{topic}", colour) for name, topic, colour in found]


def foxglove_layout(analysis: Analysis) -> str:
    """The arm, |F| and its axes, the joint torques, and the log of contacts, as JSON."""
    panels: dict[str, Any] = {"3D!arm": arm_panel()}
    right: list[str] = []
    if (name := lead_wrench(analysis)) is not None:
        force = f"/vftcli/wrench/{ros_name(name)}.wrench.force"
        lines = [(f"{force}.@norm", "|F|", COLOURS[BEST])]
        lines += [(f"{force}.{axis}", f"f{axis}", SPARE[k]) for k, axis in enumerate("xyz")]
        panels["Plot!force"] = plot_panel("Force on the robot [N]", lines)
        right.append("Plot!force")
    for j, joint in enumerate(names_of(analysis)):
        lines = [
            (f"{topic}.effort[{j}]", own, colour) for own, topic, colour in torque_topics(analysis)
        ]
        panels[f"Plot!J{j + 1}"] = plot_panel(f"J{j + 1} {joint}: external torque [N·m]", lines)
    joints = [f"Plot!J{j + 1}" for j in range(len(names_of(analysis)))]
    panels["Tab!joints"] = {
        "activeTabIdx": 0,
        "tabs": [{"title": key.partition("!")[2], "layout": key} for key in joints],
    }
    right.append("Tab!joints")
    left = ["3D!arm"]
    if analysis.contacts is not None:
        panels["RosOut!contacts"] = {"topicToRender": "/vftcli/contacts/log", "minLogLevel": 1}
        left.append("RosOut!contacts")
    layout = {
        "configById": panels,
        "globalVariables": {},
        "userNodes": {},
        "playbackConfig": {"speed": 1},
        "layout": beside(stacked(left), stacked(right)),
    }
    return json.dumps(layout, indent=2, ensure_ascii=False) + "\n"


def arm_panel() -> dict[str, Any]:
    """The arm that the description draws, moved by the joint states."""
    return {
        "foxglovePanelTitle": "Arm",
        "followTf": "base",
        "cameraState": {"distance": 3, "phi": 65, "thetaOffset": 45, "perspective": True},
        "layers": {
            "arm": {
                "layerId": "foxglove.Urdf",
                "instanceId": "arm",
                "label": "Arm",
                "sourceType": "topic",
                "topic": "/robot_description",
                "visible": True,
            }
        },
    }


def plot_panel(title: str, lines: Iterable[LinePath]) -> dict[str, Any]:
    """One plot over time."""
    return {
        "foxglovePanelTitle": title,
        "paths": [
            {"value": path, "label": name, "color": colour, "enabled": True, "showLine": True}
            for path, name, colour in lines
        ],
        "xAxisVal": "timestamp",
        "isSynced": True,
        "showLegend": True,
        "showXAxisLabels": True,
        "showYAxisLabels": True,
    }


def stacked(panels: Sequence[str]) -> Any:  # noqa: ANN401 - a panel's name, or a tree of them
    """One or two panels, one above the other."""
    if len(panels) == 1:
        return panels[0]
    return {"direction": "column", "first": panels[0], "second": panels[1], "splitPercentage": 60}


def beside(left: Any, right: Any) -> dict[str, Any]:  # noqa: ANN401 - panels
    """Panels side by side."""
    return {"direction": "row", "first": left, "second": right, "splitPercentage": 35}


def plotjuggler_layout(analysis: Analysis) -> str:
    """A tab with the force and its moment, one with every joint's torque, as XML."""
    tabs: dict[str, list[list[tuple[str, str]]]] = {}
    if (name := lead_wrench(analysis)) is not None:
        topic = f"/vftcli/wrench/{ros_name(name)}/wrench"
        tabs["wrench"] = [
            [(f"{topic}/{part}/{axis}", SPARE[k]) for k, axis in enumerate("xyz")]
            for part in ("force", "torque")
        ]
    tabs["joint torques"] = [
        [(f"{topic}/{joint}/effort", colour) for _, topic, colour in torque_topics(analysis)]
        for joint in names_of(analysis)
    ]
    root = ET.Element("root")
    widget = ET.SubElement(root, "tabbed_widget", {"name": "Main Window", "parent": "main_window"})
    for title, plots in tabs.items():
        tab = ET.SubElement(widget, "Tab", tab_name=title, containers="1")
        container = ET.SubElement(tab, "Container")
        share = ";".join([f"{1 / len(plots):.6f}"] * len(plots))
        splitter = ET.SubElement(
            container, "DockSplitter", orientation="-", sizes=share, count=str(len(plots))
        )
        for curves in plots:
            area = ET.SubElement(splitter, "DockArea", name="...")
            plot = ET.SubElement(area, "plot", mode="TimeSeries", style="Lines")
            for path, colour in curves:
                ET.SubElement(plot, "curve", name=path, color=colour)
    ET.SubElement(widget, "currentTabIndex", index="0")
    ET.SubElement(root, "use_relative_time_offset", enabled="1")
    ET.indent(root, " ")
    return f"<?xml version='1.0' encoding='UTF-8'?>\n{ET.tostring(root, encoding='unicode')}\n"
