"""The options that a log calls for, and the text they are kept as."""

import tomllib

import numpy as np

from vftcli.proposal import ProposedOption, config_text, reasons
from vftcli.signals.recording import Recording
from vftcli.signals.wrench import WrenchFrame


def test_the_text_holds_what_holds_and_shows_the_rest() -> None:
    text = config_text(
        [
            ProposedOption("why\nso", "robot", "ur5"),
            ProposedOption('a \\ and a " in it', "columns", 'a"b\\c'),
            ProposedOption("two of them", "free", ["a.csv", "b.csv"]),
            ProposedOption("or this " * 40, "reference", "zero", holds=False),
            ProposedOption("a remark\x07"),
        ]
    )
    assert tomllib.loads(text) == {
        "robot": "ur5",
        "columns": 'a"b\\c',
        "free": ["a.csv", "b.csv"],
    }
    assert "# why so\nrobot = " in text
    assert '\n# reference = "zero"\n' in text
    assert max(map(len, text.splitlines())) <= 100


def test_settings_come_last_each_group_in_one_table() -> None:
    keys = ("sensor.delay", "contacts.least", "robot", "sensor.cutoff")
    text = config_text(ProposedOption("why", key, k) for k, key in enumerate(keys))
    assert tomllib.loads(text) == {
        "robot": 2,
        "sensor": {"delay": 0, "cutoff": 3},
        "contacts": {"least": 1},
    }


def test_a_controller_s_wrench_comes_after_a_difference_of_cycles() -> None:
    t = np.arange(3.0)
    bare = Recording(t=t, q=np.zeros((3, 6)))
    assert list(reasons(bare)) == ["sensor", "two-cycle", "vendor"]
    stated = Recording(
        t=t,
        q=np.zeros((3, 6)),
        wrench=np.zeros((3, 6)),
        wrench_frame=WrenchFrame("base", "base", "by-robot"),
    )
    assert list(reasons(stated)) == ["two-cycle", "sensor", "vendor"]
    assert "estimate" in reasons(stated)["sensor"]
