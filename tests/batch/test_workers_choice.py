"""What may be chosen of where work is done."""

from pathlib import Path

import pytest

from vftcli.batch import choice
from vftcli.batch.choice import WorkersChoice
from vftcli.signals.errors import ParameterError

KEY = Path("key.pem")


def test_without_dask_work_is_done_here_unless_workers_are_asked_for(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(choice, "is_installed", lambda: False)
    assert WorkersChoice().in_process
    assert WorkersChoice(workers=0).in_process
    with pytest.raises(ParameterError, match=r"vftcli\[cluster\]"):
        WorkersChoice(workers=2)


def test_with_dask_the_cores_are_used() -> None:
    assert not WorkersChoice().in_process
    assert not WorkersChoice(scheduler="tcp://host:8786").in_process


@pytest.mark.parametrize(
    "words",
    [
        {"scheduler": "host:8786"},
        {"scheduler": "tcp://host"},
        {"scheduler": "tls://host:8786"},
        {"scheduler": "tcp://host:8786", "workers": 2},
        {"scheduler": "tls://host:8786", "tls_ca": KEY},
        {"scheduler": "tcp://host:8786", "tls_ca": KEY, "tls_cert": KEY, "tls_key": KEY},
    ],
)
def test_what_does_not_go_together_is_refused(words: dict[str, object]) -> None:
    with pytest.raises(ParameterError):
        WorkersChoice.parsed(**words)


def test_a_worker_s_memory_is_in_gigabytes() -> None:
    assert WorkersChoice.parsed(workers=1, worker_memory=0.6).memory == 600_000_000


def test_a_cluster_that_asks_nobody_for_a_certificate_is_refused_unless_accepted() -> None:
    opened = WorkersChoice(scheduler="tcp://host:8786")
    with pytest.raises(ParameterError, match=r"run code as you; use tls://.* or --anyway"):
        opened.check_closed(anyway=False)
    opened.check_closed(anyway=True)
    tls = {"tls_ca": KEY, "tls_cert": KEY, "tls_key": KEY}
    WorkersChoice(scheduler="tls://host:8786", **tls).check_closed(anyway=False)
    WorkersChoice(workers=0).check_closed(anyway=False)


def test_workers_without_what_makes_certificates_are_refused(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(choice, "find_spec", lambda name: None if name == "cryptography" else name)
    assert WorkersChoice().in_process
    with pytest.raises(ParameterError, match=r"cryptography: pip install 'vftcli\[cluster\]'"):
        WorkersChoice(workers=2)
