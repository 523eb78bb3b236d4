"""Gains in a file of their own: what is read, what is refused, and what goes over what."""

from pathlib import Path

import pytest

from vftcli.observers.gains_file import load_gains, overlay_gains
from vftcli.observers.table import sections
from vftcli.signals.errors import ParameterError


def test_sections_are_read_as_a_robot_file_s(tmp_path: Path) -> None:
    path = tmp_path / "gains.toml"
    path.write_text("[observers.gmo]\ngain = [1.0, 2.0]\n[observers.kfo-rts]\nr_diag = 0.1\n")
    assert load_gains(path, sections()) == {
        "gmo": {"gain": [1.0, 2.0]},
        "kfo-rts": {"r_diag": 0.1},
    }


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("not toml", "not a TOML file of gains"),
        ("gain = 1.0", r"no \[observers"),
        ("[observers]\ngain = 1.0", r"no \[observers"),
        ("[observers.gmoo]\ngain = 1.0", "Did you mean gmo"),
        ("[observers.gmo]\ngian = 1.0", "Did you mean gain"),
    ],
)
def test_what_is_no_gains_file_is_refused(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "gains.toml"
    path.write_text(text)
    with pytest.raises(ParameterError, match=words):
        load_gains(path, sections())


def test_the_upper_layer_wins_parameter_by_parameter() -> None:
    under = {"kfo": {"r_diag": 1.0, "q_p_diag": 2.0}, "fdo": {"omega": 3.0}}
    over = {"kfo": {"r_diag": 9.0}, "gmo": {"gain": 4.0}}
    assert overlay_gains(under, over) == {
        "kfo": {"r_diag": 9.0, "q_p_diag": 2.0},
        "fdo": {"omega": 3.0},
        "gmo": {"gain": 4.0},
    }
    assert under["kfo"]["r_diag"] == 1.0  # the robot's own is left alone
