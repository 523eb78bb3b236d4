"""What may be chosen of where work is done."""

from pathlib import Path

import pytest

import vftcli.batch
from vftcli.batch import WorkersChoice
from vftcli.signals.errors import ParameterError

KEY = Path("key.pem")
OF_TLS = {"cluster.ca": KEY, "cluster.cert": KEY, "cluster.key": KEY}


def test_without_dask_work_is_done_here_unless_workers_are_asked_for(monkeypatch) -> None:
    monkeypatch.setattr(vftcli.batch, "is_installed", lambda: False)
    assert WorkersChoice().in_process
    assert WorkersChoice(jobs=0).in_process
    with pytest.raises(ParameterError, match=r"vftcli\[cluster\]"):
        WorkersChoice(jobs=2)


def test_with_dask_the_cores_are_used() -> None:
    assert not WorkersChoice().in_process
    assert not WorkersChoice(address="tcp://host:8786").in_process


@pytest.mark.parametrize(
    "words",
    [
        {"cluster.address": "host:8786"},
        {"cluster.address": "tcp://host"},
        {"cluster.address": "tls://host:8786"},
        {"cluster.address": "tcp://host:8786", "jobs": 2},
        {"cluster.address": "tls://host:8786", "cluster.ca": KEY},
        {"cluster.address": "tls://host:8786", "cluster.ca": KEY, "cluster.key": KEY},
        {"cluster.address": "tcp://host:8786", **OF_TLS},
    ],
)
def test_what_does_not_go_together_is_refused(words: dict[str, object]) -> None:
    with pytest.raises(ParameterError):
        WorkersChoice.parsed(**words)


def test_a_worker_s_memory_is_in_gigabytes() -> None:
    assert WorkersChoice.parsed(jobs=1, settings={"cluster.memory-gb": "0.6"}).memory_gb == 0.6


def test_a_cluster_that_asks_nobody_for_a_certificate_is_refused_unless_accepted() -> None:
    opened = WorkersChoice(address="tcp://host:8786")
    with pytest.raises(ParameterError, match=r"run code as you; use tls://.* or --anyway"):
        opened.check_closed(anyway=False)
    opened.check_closed(anyway=True)
    WorkersChoice(address="tls://host:8786", ca=KEY, cert=KEY, key=KEY).check_closed(anyway=False)
    WorkersChoice(jobs=0).check_closed(anyway=False)


def test_workers_without_what_makes_certificates_are_refused(monkeypatch) -> None:
    there = {"distributed"}
    monkeypatch.setattr(vftcli.batch, "find_spec", lambda name: name if name in there else None)
    assert WorkersChoice().in_process
    with pytest.raises(ParameterError, match=r"cryptography: pip install 'vftcli\[cluster\]'"):
        WorkersChoice(jobs=2)
