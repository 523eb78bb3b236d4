"""What a paper declares: names that can be chosen, and numbers that are numbers."""

import pytest

from vftcli.reproduction.paper import PAPERS, PrintedLine, paper_of
from vftcli.signals.errors import ParameterError

HUANG = PAPERS["huang2025"]


def test_a_bound_is_no_number() -> None:
    assert PrintedLine("k", "label", "N", "9.66").number == 9.66
    assert PrintedLine("k", "label", "N", "< 6").number is None
    assert PrintedLine("k", "label").number is None


def test_a_verdict_is_a_sentence_too() -> None:
    answers = {item.verdict: item.answer for item in HUANG.items.values()}
    assert answers["a picture"] == "A picture."
    assert all(answer[1:] == f"{verdict[1:]}." for verdict, answer in answers.items())


def test_items_come_in_the_papers_order() -> None:
    assert HUANG.chosen("fig7, table1") == ("table1", "fig7")
    assert HUANG.chosen(None) == tuple(HUANG.items)


@pytest.mark.parametrize("words", ["fig14", "table1,nothing", ","])
def test_what_is_not_there_is_reported_with_what_is(words: str) -> None:
    with pytest.raises(
        ParameterError, match="there is table1, table2, guidelines, fig1"
    ) as error:
        HUANG.chosen(words)
    assert "\n" not in str(error.value)


def test_an_unknown_paper_is_reported_with_those_there_are() -> None:
    with pytest.raises(ParameterError, match="no paper 'huang2026'; there is huang2025"):
        paper_of("huang2026")
