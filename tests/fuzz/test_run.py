"""The fuzzer: that it runs, that its inputs can be made again, and that it sees a failure."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import run as fuzz
from child import BROKEN, MUTATORS, Attempt
from seed_logs import SEEDS
from tokens import Seed

INPUTS = 20


@pytest.mark.slow
def test_a_short_run_finds_nothing() -> None:
    """The long ones are documented in tests/README.md."""
    words = [sys.executable, fuzz.__file__, "--seed", "7", "--inputs", str(INPUTS)]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert f"{INPUTS} inputs of seed 7" in done.stdout
    read = next(line for line in done.stdout.splitlines() if line.split()[:1] == ["all"])
    assert int(read.split()[2]) > 0  # some are read: it does not only meet refusals


@pytest.mark.parametrize(
    ("name", "family"), [("table", "table"), ("npz", "npz"), ("mcap", "mcap")]
)
def test_the_same_seed_makes_the_same_input(tmp_path: Path, name: str, family: str) -> None:
    from message_mutants import mcap_messages

    seed = Seed(name, family, SEEDS[name][0](tmp_path / "sound"))
    if family == "mcap":
        seed = seed._replace(model=mcap_messages(seed.path))
    made = []
    for k in (1, 1, 2):
        path = tmp_path / "mutant"
        how = MUTATORS[family](seed, np.random.default_rng([5, k]), path).how
        made.append((how, path.read_bytes()))
    assert made[0] == made[1] != made[2]


def attempt(*words: str, family: str = "table", rows: int | None = None) -> Attempt:
    return Attempt(family, "seed", "how", words, rows)


INSPECT, ESTIMATE = attempt("inspect"), attempt("estimate")
COUNTED = attempt("inspect", "--json", rows=9)
LOST = '{"samples": 8, "repairs": ["one dropped"]}'


@pytest.mark.parametrize(
    ("status", "made", "files", "kind"),
    [
        (1, INSPECT, {"stderr": "error: no log"}, "refused"),
        (1, ESTIMATE, {"stderr": "log health: sound\nerror: no current"}, "refused"),
        (1, ESTIMATE, {"stderr": "note: at 35 °C\nerror: no current"}, "refused"),
        (0, ESTIMATE, {}, "read"),
        (0, COUNTED, {"stdout": '{"samples": 9}'}, "read"),
        (0, COUNTED, {"stdout": '{"samples": 8}'}, "rows lost"),
        (0, COUNTED, {"stdout": LOST}, "read with a word"),
        (0, COUNTED, {"stdout": '{"misfit": Infinity}'}, "json"),
        (0, ESTIMATE, {"numbers": "not finite: tau_ext/gmo/1"}, "numbers"),
        (BROKEN, INSPECT, {"trace": "ValueError"}, "traceback"),
        (-24, INSPECT, {}, "hang"),
        (-11, INSPECT, {}, "signal"),
        (1, INSPECT, {"stderr": "error: out of memory"}, "memory"),
        (1, INSPECT, {"stderr": "Error: C++\nerror: no robot"}, "several lines"),
        (1, ESTIMATE, {"stderr": "error: no", "out": ""}, "left behind"),
        (0, attempt("report"), {"stderr": "a.py:7: RuntimeWarning: overflow"}, "traceback"),
        (1, attempt("batch"), {"stderr": "error: x: no\n1 log: 1 failed", "out": ""}, "refused"),
        (2, INSPECT, {"stderr": "Usage"}, "exit code 2"),
        (2, attempt("inspect", family="options"), {"stderr": "Usage"}, "usage"),
    ],
)
def test_each_kind_of_failure_is_seen(tmp_path, monkeypatch, status, made, files, kind):
    # What ran in this process before is no part of it.
    monkeypatch.setattr(fuzz, "peak_memory", lambda: 0)
    for name, text in {**files, "attempt.json": json.dumps(made._asdict())}.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    assert fuzz.judged(status, 3, tmp_path).kind == kind
