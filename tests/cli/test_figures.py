"""`--figures` and `--latex` as they are typed."""

import json
from pathlib import Path

import pytest
from example_logs import CIRCLE

from vftcli.outputs.files import digests

pytestmark = pytest.mark.slow

pytest.importorskip("matplotlib", reason="no figure is drawn without matplotlib")

SHORT = ("--robot", "ur5", "--interval", "0:4", "--observer", "gmo")


def test_a_report_holds_its_figures_and_the_seal_lists_them(run, tmp_path: Path) -> None:
    out = tmp_path / "out"
    words = ("report", CIRCLE, *SHORT, "-o", out)
    assert run(*words, "--reference", "zero", "--figures", "svg")[0] == 0
    listed = json.loads((out / "run.json").read_text(encoding="utf-8"))["files"]
    assert {"figures/torque-single.svg", "figures/errors-double.svg"} <= set(listed)
    found = digests(out)
    found.pop("run.json")
    assert found == listed
    # Files of the run before it do not outlive it.
    assert run(*words, "--force", "--set", "contacts.list=no")[0] == 0
    assert not (out / "figures").exists()


def test_compare_draws_into_a_folder_and_nowhere_else(run, tmp_path: Path) -> None:
    words = ("compare", CIRCLE, *SHORT, "--reference", "zero")
    assert run(*words, "--figures", "svg", "-o", tmp_path / "out")[0] == 0
    names = sorted(path.name for path in tmp_path.rglob("*.*"))
    assert names == ["errors-double.svg", "errors-single.svg"]


def test_admit_prints_two_tables_for_latex_and_draws_the_release(run, tmp_path: Path) -> None:
    words = ("admit", "--release", "x=0.3", "--robot", "ur5", "--alpha", "1,1.9")
    code, text, _ = run(*words, "--latex")
    assert (code, text.count(r"\begin{table")) == (0, 2)
    assert r"\caption{Values used; huang2025, Table III" in text
    assert run(*words, "--figures", "svg", "-o", tmp_path)[0] == 0
    names = {path.name for path in (tmp_path / "figures").iterdir()}
    assert names == {"release-single.svg", "release-double.svg"}
