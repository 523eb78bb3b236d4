"""The harness of mutants refuses a table of tests that has gone stale."""

import importlib.util
import sys
from pathlib import Path

import pytest

SPEC = importlib.util.spec_from_file_location("mutants", Path(__file__).with_name("run.py"))
assert SPEC is not None
assert SPEC.loader is not None
mutants = importlib.util.module_from_spec(SPEC)
sys.modules["mutants"] = mutants  # where its tuples' types are looked up
SPEC.loader.exec_module(mutants)


def test_every_test_of_the_table_is_there():
    assert mutants.absent_tests() == []


def test_an_absent_test_is_said_and_nothing_is_run(monkeypatch, capsys):
    monkeypatch.setitem(mutants.ROOMS, "cli", "cli test_gone.py")
    monkeypatch.setattr(sys, "argv", ["run.py", "--mutants", "1"])
    with pytest.raises(SystemExit):
        mutants.main()
    assert "not there: test_gone.py" in capsys.readouterr().err
