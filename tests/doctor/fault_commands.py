"""The command line in this process, as tests call it on logs that a fault is planted in."""

import contextlib
import io
import sys
from collections.abc import Sequence
from unittest.mock import patch

from vftcli.cli import main as vftcli


def run(words: Sequence[object]) -> tuple[int, str, str]:
    """Run the command line in this process: exit code, stdout, stderr."""
    out, err = io.StringIO(), io.StringIO()
    code = 0
    with (
        patch.object(sys, "argv", ["vftcli", *map(str, words)]),
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
    ):
        try:
            vftcli()
        except SystemExit as stop:
            code = stop.code if isinstance(stop.code, int) else 1
    return code, out.getvalue(), err.getvalue()
