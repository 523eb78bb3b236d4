"""`--figures` and `--latex` as they are typed."""

import json
from collections.abc import Callable
from pathlib import Path

import pytest
from typer.testing import CliRunner

from vftcli.cli import make_app
from vftcli.outputs.files import digests

app = make_app()

pytestmark = pytest.mark.slow

pytest.importorskip("matplotlib", reason="no figure is drawn without matplotlib")

LOG = Path(__file__).parent.parent.parent / "fixtures" / "ur5_circle.csv"


@pytest.fixture
def run() -> Callable[..., str]:
    def run(*words: object, code: int = 0) -> str:
        result = CliRunner().invoke(app, [str(word) for word in words])
        assert result.exit_code == code, result.output
        return result.output

    return run


def test_a_report_holds_its_figures_and_the_seal_lists_them(
    run: Callable[..., str], tmp_path: Path
) -> None:
    out = tmp_path / "out"
    words = ("report", LOG, "--robot", "ur5", "--interval", "0:4", "--observer", "gmo")
    run(*words, "--reference", "zero", "-o", out, "--figures", "svg")
    listed = json.loads((out / "run.json").read_text(encoding="utf-8"))["files"]
    assert {"figures/torque-single.svg", "figures/errors-double.svg"} <= set(listed)
    found = digests(out)
    found.pop("run.json")
    assert found == listed
    # Files of the run before it do not outlive it.
    run(*words, "-o", out, "--force", "--set", "contacts.list=no")
    assert not (out / "figures").exists()


def test_compare_draws_into_a_folder_and_nowhere_else(
    run: Callable[..., str], tmp_path: Path
) -> None:
    words = ("compare", LOG, "--robot", "ur5", "--reference", "zero", "--interval", "0:4")
    out = tmp_path / "out"
    run(*words, "--figures", "svg", "-o", out)
    names = sorted(path.name for path in out.rglob("*.*"))
    assert names == ["errors-double.svg", "errors-single.svg"]
    assert "need each other" in run(*words, "--figures", "svg", code=2)
    assert "need each other" in run(*words, "-o", out, code=2)


def test_admit_prints_tables_three_and_four_for_latex_and_draws_the_release(
    run: Callable[..., str], tmp_path: Path
) -> None:
    words = ("admit", "--release", "x=0.3", "--robot", "ur5", "--alpha", "1,1.9")
    text = run(*words, "--latex")
    assert text.count(r"\begin{table") == 2
    assert r"\caption{Values used; huang2025, Table III" in text
    assert "choose one" in run(*words, "--latex", "--json", code=2)
    assert "give -o too" in run(*words, "--figures", "svg", code=2)
    run(*words, "--figures", "svg", "-o", tmp_path / "out")
    names = {path.name for path in (tmp_path / "out" / "figures").iterdir()}
    assert names == {"release-single.svg", "release-double.svg"}
