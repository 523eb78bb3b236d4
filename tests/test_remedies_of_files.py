"""Every remedy that an error text names, tried on the command that it refused.

Of the rooms that read files and options: cli, readers, robots, signals, batch, doctor. A row runs a
command that is refused, reads the option out of the refusal, and runs the command with it, or
without it where the refusal says to leave it out. A text that names an option or a command and has
no row needs a reason.
"""

import ast
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import vftcli

PACKAGE = Path(vftcli.__file__).parent
ROOMS = ("cli", "readers", "robots", "signals", "batch", "doctor")

NOT_YET = "no row yet"
NAMED = "only names the option that is wrong, and what it may be"
WITHOUT_ROW = {
    NAMED: (
        ": too large for a file of options",
        ": not a text in UTF-8",
        "--config …: …",
        "--columns is empty",
        "has no column name while others have one",
        "is given twice. Skip the other",
        "--columns: no q; a log needs",
        "must be one whole number, from 1",
        "--columns: cannot understand",
        "--columns: no signal",
        ": _ only skips",
        "it must cover at least one",
        "a table without a clock is given as",
        "--columns: … has no unit",
        "has no field",
        "is neither a number, as in 0, nor all",
        "--columns turns the sign of the clock",
        "names a column of … twice",
        "is no address, as tcp",
        "--tip …: ",
        "--reference-columns names no tau_ext",
        "is for a xacro, which this is not",
    ),
    NOT_YET: (
        "give one of LOG, --release",
        "are of what -o DIR writes",
        "choose one of --json and --latex",
        "s force drives the replay",
        "leave --frame away",
        "choose one of --sensor and --truth",
        "holds still over a span",
        "the closed loop runs",
        "--do compare needs --reference",
        "--figures and -o DIR need each other",
        "leave --significance away",
        "and none ran",
        "vftcli init LOG writes one",
        "choose one of --details, --quiet",
        "choose one of --json, --csv",
        "--derive dq belongs to an estimate",
        "a load is found from one pair of logs",
        "free motion to identify the arm from",
        "`vftcli report LOG -o DIR` writes both",
        "--reference says where a log was touched",
        "two columns could be",
        "could both be",
        "with holes. Name them",
        "holds no number in its first row",
        "could each be the clock",
        "but a sample has one time",
        "--columns must name them",
        "and no topic has one; leave it out",
        "two arms were recorded",
        "the clock starts anew",
        "which no clock shows",
        "the clock stands still",
        "which no robot's log is",
        "the clock is coarser than the samples",
        "which looks like degrees",
        "Choose one with --observer.",
        "holds estimates, not what the drives measured",
        "could each be the positions",
        "laid out as",
        "no external torques of",
        "no joint positions among",
        "the positions are of",
        "The header was edited",
        "no episode",
        "arm alone; leave --arm out",
        "holds two arms",
        "a log of one arm; leave --arm out",
        "--episode all is for commands",
        "leave --episode out.",
        "--columns does not apply to",
        "Say which with --format.",
        "a table without a header. Say what its",
        "the reference torques cannot be told",
        "no timestamp among",
        "must count its",
        "--columns describes",
        "no clock. Name its column",
        "the two columns of the clock",
        "no observer can run on that",
        "no joint positions (q) among",
        "Check --columns.",
        "columns without a header. Say what they are",
        "only joints that move by themselves",
        "which payload the controller",
        "joints but robot",
        "positions alone carry no force",
        "do not tell those of robot",
        "is what an MJCF gives its joints",
        "the xacro takes no argument",
        "the xacro needs",
        "the xacro cannot be expanded",
        "the log waits",
        "leave --free away",
        "Record them, or name their columns with --columns….",
        "so none of it can be",
        "leave --ship out",
        "the torques of one observer; give --observer once",
        "leave --interval and --episode out",
        "--derive dq makes them",
        "gravity would be written as force",
        "states no standard deviation",
        "add --scheduler ADDRESS",
        "need Dask and cryptography",
        "(all three) belong together",
        "leave --workers out",
        "are given together",
        "can run code as you",
        "workers need a certificate",
        "no Dask scheduler answers",
        "has no worker; start some",
        "send the logs there with --ship",
        "of another log `vftcli estimate` writes",
        "exists; give another -o, or --force",
        "--force removes no other folder",
        "cannot be mended: leave out --causal",
        "With --anyway it goes on all the same.",
    ),
}
"""Why a text has no row, and words that only it has."""


@cache
def texts() -> dict[str, str]:
    """Every text of a raise that names an option or a command; a value in it is `…`."""
    found = {}
    for room in ROOMS:
        for path in sorted((PACKAGE / room).rglob("*.py")):
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                if isinstance(node, ast.Raise) and node.exc is not None:
                    text = "".join(spoken(node.exc))
                    if re.search(r"--[a-z]|vftcli [a-z]", text):
                        found[f"{path.relative_to(PACKAGE)}:{node.lineno}"] = text
    return found


def spoken(node: ast.expr) -> Iterator[str]:
    """The pieces of a text as they are written, `…` for a value."""
    for part in ast.iter_child_nodes(node):
        if isinstance(part, ast.FormattedValue):
            yield "…"
        elif isinstance(part, ast.Constant) and isinstance(part.value, str):
            yield part.value
        elif isinstance(part, ast.expr):
            yield from spoken(part)


def test_every_text_with_an_option_is_tried_or_says_why_not() -> None:
    reasons = [words for each in WITHOUT_ROW.values() for words in each]
    wrong = []
    for place, text in texts().items():
        by = [words for words in reasons if words in text]
        if len(by) != 1:
            wrong.append(f"{place}: {text!r} has {by}")
    unused = [words for words in reasons if not any(words in text for text in texts().values())]
    assert not wrong, "\n".join(wrong)
    assert not unused
