"""Work beside the caller, and modules loaded meanwhile."""

import sys

import pytest

from vftcli.signals.background import Background, load


def test_the_result_or_the_error_comes_when_it_is_asked_for() -> None:
    assert Background(lambda: 3).result() == 3
    failing = Background(lambda: 1 // 0)
    with pytest.raises(ZeroDivisionError):
        failing.result()


def test_what_is_not_installed_is_not_loaded() -> None:
    load("no_such_module", "vftcli.streaming")
    assert "vftcli.streaming" in sys.modules
