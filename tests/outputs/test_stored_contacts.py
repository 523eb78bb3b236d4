"""A list of contacts read again from the record that holds it."""

import json
from pathlib import Path

import pytest
from contact_rows import contact, contact_list

from vftcli.outputs.contacts import contacts_record, stored_list, stored_record
from vftcli.outputs.run_record import to_json
from vftcli.signals.errors import LogError


def test_a_list_survives_its_record() -> None:
    bare = contact(number=2, peak_force=None, peak_band=None, wrench=None, wrench_sd=None,
                   mean_force=None, impulse=None, anywhere=None, is_load=True)  # fmt: skip
    record = json.loads(to_json(contacts_record(contact_list(contact(), bare, free=()))))
    assert json.loads(to_json(contacts_record(stored_list(record)))) == record


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (None, "no run.json of theirs is beside it; give the log"),
        ("{}", "no run.json of theirs is beside it"),
        ('{"contacts": null, "input": {"path": "a.csv", "sha256": ""}}', "log, a.csv"),
    ],
)
def test_without_a_list_the_log_is_asked_for(text: str | None, words: str, tmp_path: Path) -> None:
    if text is not None:
        (tmp_path / "run.json").write_text(text, encoding="utf-8")
    with pytest.raises(LogError, match=words):
        stored_record(tmp_path / "estimates.parquet")
