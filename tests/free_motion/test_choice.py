"""What a user may choose of free motion: parsed and checked once, alike in every command."""

from pathlib import Path

import numpy as np
import pytest

from vftcli.free_motion import ALIGNMENTS, FreeChoice, cutoff, cycle_numbers
from vftcli.free_motion.difference import RUNGS
from vftcli.signals.errors import ReferenceTorqueError


def test_a_span_of_free_is_the_free_part_and_a_log_may_hold_a_colon() -> None:
    choice = FreeChoice.parsed(free=["2:4", "run.csv", ":1", "./2:4", "C:/run.csv"])
    assert choice.spans == ((2.0, 4.0), (-np.inf, 1.0))
    assert choice.logs == tuple(map(Path, ("run.csv", "./2:4", "C:/run.csv")))


def test_what_counts_as_given() -> None:
    assert not FreeChoice().is_given
    assert not FreeChoice(period=4.0).is_given
    assert FreeChoice(period=4.0).period == 4.0
    for choice in ({"logs": (Path("a"),)}, {"spans": ((0.0, 1.0),)}, {"cycles": (1,)}):
        assert FreeChoice(**choice).is_given  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"two-cycle.alignment": "best"}, "commanded, period, phase, model"),
        ({"two-cycle.alignment": "commanded"}, "add --set two-cycle.period=S"),
        ({"two-cycle.period": "0"}, "two-cycle.period=0 is not a positive time"),
        ({"two-cycle.period": "nan"}, "is not a positive time"),
        ({"two-cycle.low-pass": "-3"}, "not a positive cutoff"),
        ({"two-cycle.low-pass": "nan"}, "not a positive cutoff"),
        ({"two-cycle.low-pass": "all"}, "not a positive cutoff"),
    ],
)
def test_choices_that_exclude_each_other_or_do_not_exist(
    options: dict[str, object], message: str
) -> None:
    with pytest.raises(ReferenceTorqueError, match=message):
        FreeChoice.parsed(**options)


def test_lists_of_cycles_cutoffs_and_names_of_rungs() -> None:
    assert cycle_numbers("1") == (1,)
    assert cycle_numbers("1, 3-5,3") == (1, 3, 4, 5)
    for text in ("first", "", "0", "3-2", "1-999999999", "9" * 5000):
        with pytest.raises(ReferenceTorqueError, match="free-cycles"):
            cycle_numbers(text)
    assert (cutoff("auto"), cutoff("none"), cutoff("12")) == ("auto", None, 12.0)
    assert tuple(RUNGS) == ALIGNMENTS
