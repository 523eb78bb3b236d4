import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import polars as pl
import pytest

from vftcli.analysis import Analysis
from vftcli.outputs import NONE, OutputChoice
from vftcli.outputs.contacts import contacts_latex
from vftcli.outputs.estimates import ERROR_TABLES, FILES, SUMMARY_FILES
from vftcli.outputs.files import digests
from vftcli.outputs.report import write_report
from vftcli.signals.errors import OutputError


def test_a_report_holds_its_files(analysis: Analysis, tmp_path: Path) -> None:
    text = write_report(tmp_path / "out", [analysis], command="vftcli report x")
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == sorted(FILES)
    written = json.loads((tmp_path / "out/run.json").read_text(encoding="utf-8"))
    assert written.pop("files") | {"run.json": ""} == digests(tmp_path / "out") | {"run.json": ""}
    assert written == json.loads(text)
    assert written["command"] == "vftcli report x"
    assert "rerun-sdk" in written["versions"]  # which wrote the recording
    assert "vftcli report x" in (tmp_path / "out/index.html").read_text(encoding="utf-8")


def test_contacts_are_written_beside_an_mcap(touched: Analysis, tmp_path: Path) -> None:
    choice = OutputChoice(mcap=True)
    write_report(tmp_path, [touched], command="", choice=choice)
    assert {p.name for p in tmp_path.iterdir()} == {*FILES, "estimates.mcap"}
    record = json.loads((tmp_path / "contacts.json").read_text(encoding="utf-8"))
    assert [row["number"] for row in record["contacts"]] == [1, 2]
    rows = pl.read_csv(tmp_path / "contacts.csv")
    assert rows["start_s"].to_list() == [1.0, 2.2]


@pytest.mark.slow
def test_the_table_of_contacts_is_beside_the_figures(touched: Analysis, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib", reason="no figure is drawn without matplotlib")
    empty = replace(touched, contacts=replace(touched.contacts, contacts=()))
    for name, analysis in (("some", touched), ("none", empty)):
        write_report(tmp_path / name, [analysis], command="", form="svg")
    table = tmp_path / "some/figures/contacts.tex"
    assert table.read_text("utf-8") == contacts_latex(touched.contacts)
    assert "figures/contacts.tex" in digests(tmp_path / "some")
    assert {path.suffix for path in (tmp_path / "none/figures").iterdir()} == {".svg"}


def labelled(analysis: Analysis, label: str, as_if: Callable) -> Analysis:
    """The same run under another label, as a second log of the command would have one."""
    source = replace(analysis.recording.source, label=label)
    errors = analysis.errors.with_columns(recording=pl.lit(label))
    recording = replace(analysis.recording, source=source)
    return replace(as_if(analysis, recording), errors=errors)


def test_one_that_is_left_is_one_of_several_logs(touched: Analysis, tmp_path: Path) -> None:
    write_report(tmp_path, [touched], command="", failed={"bad.csv": "no log"})
    (place,) = (p for p in tmp_path.iterdir() if p.is_dir())
    assert {p.name for p in tmp_path.iterdir() if p.is_file()} <= set(SUMMARY_FILES)
    texts = ((at / "contacts.json").read_text("utf-8") for at in (tmp_path, place))
    record, own = map(json.loads, texts)
    own["versions"] = record["versions"]  # the recording between them loads rerun-sdk
    assert record == own
    with pytest.raises(OutputError, match="exists"):
        write_report(tmp_path, [touched], command="")


def test_several_logs_get_folders(analysis: Analysis, as_if: Callable, tmp_path: Path) -> None:
    """Two logs of one file name: folders are numbered, rows bear the labels."""
    labels = ["a/run.csv", "b/run.csv"]
    analyses = [labelled(analysis, label, as_if) for label in labels]
    text = write_report(tmp_path / "out", analyses, command="vftcli report a b")
    folders = sorted(p.name for p in (tmp_path / "out").iterdir() if p.is_dir())
    assert folders == ["run", "run-2"]
    for folder in folders:
        assert sorted(p.name for p in (tmp_path / "out" / folder).iterdir()) == sorted(FILES)
    assert [log["folder"] for log in json.loads(text)["logs"]] == folders
    errors = pl.read_csv(tmp_path / "out/errors.csv")
    assert errors["recording"].unique(maintain_order=True).to_list() == labels
    assert len(errors) == 2 * len(pl.read_csv(tmp_path / "out" / folders[0] / "errors.csv"))
    contacts = json.loads((tmp_path / "out/contacts.json").read_text(encoding="utf-8"))
    assert len(contacts["logs"]) == 2
    assert (tmp_path / "out/errors.md").read_text(encoding="utf-8").count("run.csv against") == 2


def test_a_report_replaces_another_by_force(without_reference: Analysis, tmp_path: Path) -> None:
    first = replace(without_reference, contacts=None)
    write_report(tmp_path, [without_reference], command="")
    found = {p.name for p in tmp_path.iterdir()}
    assert found == set(FILES) - set(ERROR_TABLES)
    with pytest.raises(OutputError, match="--force"):
        write_report(tmp_path, [first], command="second")
    assert {p.name for p in tmp_path.iterdir()} == found
    none = OutputChoice(detail=NONE)
    write_report(tmp_path, [first], command="second", force=True, choice=none)
    gone = {"recording.rrd", "contacts.json", "contacts.csv"}
    assert {p.name for p in tmp_path.iterdir()} == found - gone
    assert json.loads((tmp_path / "run.json").read_text())["command"] == "second"
