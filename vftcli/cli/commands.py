"""The commands: where each is, what it does in a sentence, and what one sets out to do with it."""

import os
import re
from pathlib import Path
from typing import NamedTuple


class ListedCommand(NamedTuple):
    """One command: where it is, so that --help need not load it."""

    file: str  #: File of this package.
    function: str  #: The function in it.
    journey: str  #: Heading under which `--help` lists it.

    @property
    def summary(self) -> str:
        """First line of the function's docstring, read from the file: to load it takes longer."""
        text = (Path(__file__).parent / f"{self.file}.py").read_text("utf-8")
        found = re.search(rf'(?sm)^def {self.function}\(.*?"""(.*?)\n', text)
        return found[1] if found else ""


#: What one sets out to do → its commands, each with where it is.
JOURNEYS = {
    "Ask a log": {
        "contacts": "contacts:list_contacts",
        "report": "report:report",
        "estimate": "estimate:estimate",
        "compare": "compare:compare",
        "batch": "batch:batch",
        "thresholds": "thresholds:contact_thresholds",
    },
    "Prepare a robot and its logs": {
        "inspect": "inspect:inspect_log",
        "init": "init:write_config",
        "identify": "identify:identify_robot",
        "annotate": "annotate:annotate_dataset",
        "tune": "tune:tune_gains",
        "convert": "convert:convert_log",
    },
    "Study further": {
        "admit": "admit:admit",
        "simulate": "simulate:simulate_log",
        "reproduce": "reproduce:reproduce",
        "bench": "bench:bench",
    },
    "Look up": {
        "help": "listings:show_help",
    },
}
#: Name → the command.
COMMANDS = {
    name: ListedCommand(place.partition(":")[0], place.partition(":")[2], journey)
    for journey, places in JOURNEYS.items()
    for name, place in places.items()
}

DEFAULT = "contacts"  #: The command of words that name none.
#: Options of the program itself.
OF_PROGRAM = frozenset({"-h", "--help", "--version", "--install-completion", "--show-completion"})


def with_command(words: list[str]) -> list[str]:
    """The words of a call with its command, also where a log or options come first."""
    if not words or words[0] in COMMANDS or words[0] in OF_PROGRAM:
        return words
    first = words[0]
    is_log = not {".", "/", os.sep}.isdisjoint(first) or Path(first).exists()
    return [DEFAULT, *words] if is_log or first.startswith("-") else words
