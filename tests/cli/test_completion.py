"""What a shell is offered behind the words that were typed."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

PROGRAM = "import sys; sys.argv[0] = 'vftcli'; from vftcli.cli import launch; launch()"
LOG = str(Path(__file__).parents[2] / "fixtures" / "ur5_circle.csv")


def offered(*words: str) -> set[str]:
    """What bash is offered for the last word."""
    asked = {
        "_VFTCLI_COMPLETE": "complete_bash",
        "COMP_WORDS": " ".join(("vftcli", *words)),
        "COMP_CWORD": str(len(words)),
    }
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, **asked},
    )
    assert done.stderr == ""
    return set(done.stdout.split())


@pytest.mark.parametrize(
    ("words", "values"),
    [
        (("contacts", "--robot", "ur1"), {"ur10", "ur10e", "ur16e"}),
        ((LOG, "--robot", "ur10"), {"ur10", "ur10e"}),
        (("--robot", "ur5", LOG, "--arm", "l"), {"left"}),
        (("report", "--observer", "kfo-"), {"kfo-auto", "kfo-fe", "kfo-rts", "kfo-zoh"}),
        (("compare", "--reference", "ze"), {"zero"}),
        (("report", "--gains", "p"), {"paper"}),
        (("report", "--frame", "f"), {"flange"}),
        (("report", "--figures", "s"), {"svg"}),
        (("batch", "--do", "co"), {"compare", "contacts"}),
        (("simulate", "--as", "lib"), {"libfranka"}),
        (("report", "--set", "two-cycle.l"), {"two-cycle.low-pass="}),
        (("report", "--set", "gmo."), {"gmo.gain="}),
        (("admit", "--set", "rz.thr"), {"rz.threshold="}),
        (("contacts", "--set", "bench"), set()),
        (("help", "fr"), {"frames"}),
        (("help", "co"), {"columns", "config", "contacts", "compare", "convert"}),
        (("report", "--robot", "my_"), set()),  # the shell offers files
    ],
)
def test_values_are_offered(words: tuple[str, ...], values: set[str]) -> None:
    assert offered(*words) == values
