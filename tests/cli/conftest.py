"""What the tests of the commands share."""

import pytest

from vftcli.cli import main


@pytest.fixture
def run(monkeypatch, capsys):
    """Run the command line as installed; return its exit code, stdout and stderr."""

    def call(*words: object) -> tuple[int, str, str]:
        monkeypatch.setattr("sys.argv", ["vftcli", *map(str, words)])
        try:
            main()
        except SystemExit as stop:
            code = stop.code if isinstance(stop.code, int) else 1
        else:
            code = 0
        out, err = capsys.readouterr()
        return code, out, err

    return call


@pytest.fixture
def ran(run):
    """Run a command that has to work; return its stdout and stderr."""

    def call(*words: object) -> tuple[str, str]:
        code, out, err = run(*words)
        assert code == 0, err
        return out, err

    return call


@pytest.fixture
def refused(run):
    """Run a command that is to fail; return its error, the one line but for notes."""

    def call(*words: object) -> str:
        code, out, err = run(*words)
        assert (code, out) == (1, "")
        assert "Traceback" not in err
        *before, error = err.splitlines()
        assert all(line.startswith("note: ") for line in before), err
        assert error.startswith("error: ")
        return error

    return call


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path
