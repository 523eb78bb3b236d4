"""What a user may choose of free motion: parsed and checked once, alike in every command."""

from pathlib import Path

import numpy as np
import pytest

from vftcli.repetition.choice import ALIGNMENTS, FreeChoice, cutoff, cycle_numbers
from vftcli.repetition.ladder import RUNGS
from vftcli.signals.errors import ParameterError, ReferenceTorqueError


def test_a_span_of_free_is_the_free_part() -> None:
    """``--free A:B`` and ``--free-part A:B`` mean the same; a log is a log."""
    told = FreeChoice.parsed(free=["2:4", "run.csv", ":1"], free_part="6:7")
    assert told.spans == ((6.0, 7.0), (2.0, 4.0), (-np.inf, 1.0))
    assert told.logs == (Path("run.csv"),)


def test_a_log_whose_name_holds_a_colon_is_a_log() -> None:
    assert FreeChoice.parsed(free=["./2:4", "C:/run.csv"]).logs == (
        Path("./2:4"),
        Path("C:/run.csv"),
    )


def test_what_counts_as_given() -> None:
    assert not FreeChoice().is_given
    assert not FreeChoice(period=4.0).is_given
    assert FreeChoice(period=4.0).is_asked
    for choice in ({"logs": (Path("a"),)}, {"spans": ((0.0, 1.0),)}, {"cycles": (1,)}):
        assert FreeChoice(**choice).is_given  # type: ignore[arg-type]


def test_the_names_of_alignments_are_those_of_the_ladder() -> None:
    assert tuple(RUNGS) == ALIGNMENTS


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"alignment": "best"}, "commanded, period, phase, model"),
        ({"alignment": "commanded"}, "add --period S"),
        ({"period": 0.0}, "--period 0 is not a positive time"),
        ({"period": float("nan")}, "is not a positive time"),
        ({"free": ["a.csv"], "period": 4.0}, "leave them away with --free"),
        ({"free": ["a.csv"], "free_cycles": "1"}, "leave them away with --free"),
        ({"low_pass": "-3"}, "not a positive cutoff"),
        ({"low_pass": "nan"}, "not a positive cutoff"),
        ({"low_pass": "all"}, "not a positive cutoff"),
    ],
)
def test_choices_that_exclude_each_other_or_do_not_exist(
    options: dict[str, object], message: str
) -> None:
    with pytest.raises(ReferenceTorqueError, match=message):
        FreeChoice.parsed(**options)  # type: ignore[arg-type]


def test_a_malformed_free_part_is_refused() -> None:
    with pytest.raises(ParameterError, match="is not A:B"):
        FreeChoice.parsed(free_part="4")


def test_lists_of_cycles() -> None:
    assert cycle_numbers("1") == (1,)
    assert cycle_numbers("1, 3-5,3") == (1, 3, 4, 5)
    for text in ("first", "", "0", "3-2", "1-999999999", "9" * 5000):
        with pytest.raises(ReferenceTorqueError, match="free-cycles"):
            cycle_numbers(text)


def test_cutoffs() -> None:
    assert (cutoff("auto"), cutoff("none"), cutoff("12")) == ("auto", None, 12.0)
