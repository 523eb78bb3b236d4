"""The commands: their files, summaries and aims."""

import os
import re
from collections.abc import Container
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

from vftcli.signals.errors import ParameterError
from vftcli.signals.parsing import tables_beside


class ListedCommand(NamedTuple):
    """One command by its place, so that --help need not load it."""

    file: str  #: File of this package.
    function: str

    @property
    def summary(self) -> str:
        """First line of the docstring, read from the file for speed."""
        text = (Path(__file__).parent / f"{self.file}.py").read_text("utf-8")
        found = re.search(rf'(?sm)^def {self.function}\(.*?"""(.*?)\n', text)
        return found[1] if found else ""


#: Aim of the user → its commands, each with its place.
JOURNEYS = {
    "Ask a log": {
        "contacts": "contacts:list_contacts",
        "report": "report:report",
        "estimate": "report:estimate",
        "compare": "compare:compare",
        "batch": "batch:batch",
        "thresholds": "contacts:contact_thresholds",
    },
    "Prepare a robot and its logs": {
        "inspect": "inspect:inspect_log",
        "identify": "identify:identify_robot",
        "annotate": "batch:annotate_dataset",
        "convert": "convert:convert_log",
    },
    "Study further": {
        "admit": "admit:admit",
        "simulate": "convert:simulate_log",
        "reproduce": "benchmark:reproduce",
        "benchmark": "benchmark:benchmark",
    },
    "Look up": {"help": "help:show_help"},
}
#: Name → the command.
COMMANDS = {
    name: ListedCommand(*place.split(":"))
    for places in JOURNEYS.values()
    for name, place in places.items()
}

DEFAULT = "contacts"  #: The command of words without one.
#: Options of the program itself.
OF_PROGRAM = frozenset({"-h", "--help", "--version", "--install-completion", "--show-completion"})

#: Former commands and options with today's, and those that are `gone`.
former = partial(tables_beside, __file__, "former.toml")


def with_command(words: list[str]) -> list[str]:
    """The words of a call with its command."""
    if not words or words[0] in COMMANDS or words[0] in OF_PROGRAM:
        return words
    first = words[0]
    if first in former()["gone"]:
        return words
    if now := former()["commands"].get(first, "").split():
        # `init -o FILE` has its output.
        own = now[1] != "-o" or not any(word.startswith(("-o", "--output")) for word in words)
        return [now[0], *(now[1:] * own), *words[1:]]
    is_log = not {".", "/", os.sep}.isdisjoint(first) or Path(first).exists()
    return [DEFAULT, *words] if is_log or first.startswith("-") else words


def renewed(words: list[str], options: Container[str]) -> tuple[list[str], list[str]]:
    """The words with today's options; notes on former ones."""
    found, notes, arguments, rest = list[str](), list[str](), list[str](), iter(words)
    for word in rest:
        name, equals, value = word.partition("=")
        if word == "--":
            found.extend([word, *rest])
        elif name in options or (now := now_of(name, value)) is None:
            found.append(word)
        else:
            if "VALUE" in now and not equals:
                if (value := next(rest, "")) == "":
                    raise ParameterError(
                        f"{name} is now {now.replace('VALUE', '…')}; give a value"
                    )
                now = now_of(name, value) or now
            short = f"the argument {value}" if now == "VALUE" else now.replace("VALUE", "…")
            notes.append(f"{name} is now {short}")
            if name == "--robot-arg":
                arguments.append(value.replace("=", ":=", 1))
            else:
                found.extend(each.replace("VALUE", value) for each in now.split())
    if arguments:  # of a xacro: the words must name its robot
        given, pairs = " ".join(arguments), enumerate(pairwise(["", *found]))
        robots = [k for k, (a, b) in pairs if a == "--robot" or b.startswith("--robot=")]
        if not robots:
            raise ParameterError(f"--robot-arg is now --robot 'FILE {given}'; give --robot")
        found[robots[0]] += f" {given}"
    return found, notes


def now_of(name: str, value: str) -> str | None:
    """Today's form of a former option, else None. Gone ones raise."""
    if not name.startswith("-") or len(name) < len("--sd"):
        return None
    if name in former()["gone"]:
        raise ParameterError(f"{name} is gone; {former()['gone'][name]}")
    there: dict[str, str] = former()["options"]
    return there.get(f"{name[2:]}={value}") or there.get(name[2:])
