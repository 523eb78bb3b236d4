"""What a paper declares: names that can be chosen, and numbers that are numbers."""

import pytest

from vftcli.reproduction.paper import PAPERS, PrintedLine, paper_of
from vftcli.signals.errors import ParameterError

HUANG = PAPERS["huang2025"]


def test_a_bound_is_no_number() -> None:
    assert PrintedLine("k", "label", "N", "9.66").number == 9.66
    assert PrintedLine("k", "label", "N", "< 6").number is None
    assert PrintedLine("k", "label").number is None


def test_items_come_in_the_papers_order_and_what_is_not_there_is_reported() -> None:
    assert HUANG.chosen("fig7, table1") == ("table1", "fig7")
    assert HUANG.chosen(None) == tuple(HUANG.items)
    for words in ("fig14", "table1,nothing", ","):
        with pytest.raises(ParameterError, match="there is table1, table2, fig1"):
            HUANG.chosen(words)
    with pytest.raises(ParameterError, match="no paper 'huang2026'; there is huang2025"):
        paper_of("huang2026")
