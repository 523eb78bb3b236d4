"""What a shell is offered behind the words that were typed."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

PROGRAM = "import sys; sys.argv[0] = 'vftcli'; from vftcli.cli import launch; launch()"
LOG = str(Path(__file__).parents[2] / "fixtures" / "ur5_circle.csv")


@pytest.mark.parametrize(
    ("words", "values"),
    [
        (("rep",), {"report", "reproduce"}),
        (("report", "--fr"), {"--free", "--frame"}),
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
    asked = {
        "_VFTCLI_COMPLETE": "complete_bash",
        "COMP_WORDS": " ".join(("vftcli", *words)),
        "COMP_CWORD": str(len(words)),
    }
    shell = {"capture_output": True, "text": True, "env": {**os.environ, **asked}}
    done = subprocess.run([sys.executable, "-c", PROGRAM], check=False, **shell)
    assert (set(done.stdout.split()), done.stderr) == (values, "")
