"""RefinementChoice: bands, and what is taken off."""

import pytest

from vftcli.refinement import bias
from vftcli.refinement.choice import NOTHING, REMOVALS, RefinementChoice
from vftcli.signals.errors import ParameterError


def test_nothing_said_needs_no_free_part() -> None:
    assert RefinementChoice.parsed() == RefinementChoice()
    assert not RefinementChoice().looks_back


def test_bands_and_removal_look_back() -> None:
    assert RefinementChoice(bands=True).looks_back
    assert all(
        RefinementChoice(remove_bias=name).looks_back for name in REMOVALS if name != NOTHING
    )


def test_the_table_makes_what_may_be_chosen() -> None:
    assert tuple(bias.REMOVALS) == REMOVALS


def test_another_removal_is_refused_before_a_log_is_read() -> None:
    with pytest.raises(ParameterError, match="there is none, free-cycle, model"):
        RefinementChoice(remove_bias="all")


def test_what_is_taken_off() -> None:
    model = RefinementChoice.parsed(remove_bias="model")
    assert (model.removes_bias, model.at_phase) == (True, False)
    assert RefinementChoice(remove_bias="free-cycle").at_phase
    assert not RefinementChoice(bands=True).removes_bias
