"""The options that a log calls for, and the text they are kept as."""

import tomllib
from dataclasses import replace

import numpy as np

from vftcli.proposal import ProposedOption, config_text, reasons
from vftcli.signals.recording import Recording
from vftcli.signals.wrench import WrenchFrame


def test_the_text_holds_what_holds_and_shows_the_rest() -> None:
    """Settings come last, each group in one table."""
    text = config_text([
        ProposedOption("why", "sensor.delay", 0),
        ProposedOption("why", "contacts.least", 1),
        ProposedOption("why\nso", "robot", "ur5"),
        ProposedOption('a \\ and a " in it', "columns", 'a"b\\c'),
        ProposedOption("two of them", "free", ["a.csv", "b.csv"]),
        ProposedOption("or this " * 40, "reference", "zero", holds=False),
        ProposedOption("a remark\x07"),
        ProposedOption("why", "sensor.cutoff", 3),
    ])  # fmt: skip
    assert tomllib.loads(text) == {
        "robot": "ur5", "columns": 'a"b\\c', "free": ["a.csv", "b.csv"],
        "sensor": {"delay": 0, "cutoff": 3}, "contacts": {"least": 1},
    }  # fmt: skip
    assert "# why so\nrobot = " in text
    assert '\n# reference = "zero"\n' in text
    assert max(map(len, text.splitlines())) <= 100


def test_a_controller_s_wrench_comes_after_a_difference_of_cycles() -> None:
    bare = Recording(t=np.arange(3.0), q=np.zeros((3, 6)))
    assert list(reasons(bare)) == ["sensor", "two-cycle", "vendor"]
    frame = WrenchFrame("base", "base", "by-robot")
    stated = replace(bare, wrench=np.zeros((3, 6)), wrench_frame=frame)
    assert list(reasons(stated)) == ["two-cycle", "sensor", "vendor"]
    assert "estimate" in reasons(stated)["sensor"]
