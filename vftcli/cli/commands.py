"""The commands: where each is, what it does in a sentence, and what one sets out to do with it."""

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
        "open": "opening:open_folder",
    },
    "Prepare a robot and its logs": {
        "inspect": "inspect:inspect_log",
        "identify": "identify:identify_robot",
        "annotate": "annotate:annotate_dataset",
        "convert": "convert:convert_log",
    },
    "Study further": {
        "admit": "admit:admit",
        "simulate": "simulate:simulate_log",
        "reproduce": "reproduce:reproduce",
        "bench": "bench:bench",
    },
    "Look up": {
        "robots": "listings:robots",
        "observers": "listings:observers",
        "formats": "listings:list_formats",
        "help": "help:show_help",
    },
}
#: Name → the command.
COMMANDS = {
    name: ListedCommand(place.partition(":")[0], place.partition(":")[2], journey)
    for journey, places in JOURNEYS.items()
    for name, place in places.items()
}
