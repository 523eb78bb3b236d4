"""The commands: where each is, what it does in a sentence, and what one sets out to do with it."""

from typing import NamedTuple


class ListedCommand(NamedTuple):
    """One command: where it is, and its first sentence, so that --help need not load it."""

    target: str  #: Module of this package, and the function in it.
    summary: str  #: First line of the function's docstring.
    journey: str  #: Heading under which `--help` lists it.


#: What one sets out to do: the headings of the commands.
ASK, PREPARE, STUDY, LOOK_UP = (
    "Ask a log", "Prepare a robot and its logs", "Study further", "Look up"
)  # fmt: skip
#: Name → the command.
COMMANDS = {
    "contacts": ListedCommand(
        "contacts:list_contacts",
        "List what touched the arm: when, how hard, where, how sure.",
        ASK,
    ),
    "report": ListedCommand(
        "report:report",
        "Write a page, a recording, tables and estimates into one folder.",
        ASK,
    ),
    "estimate": ListedCommand(
        "estimate:estimate",
        "Estimate the external joint torques along a log.",
        ASK,
    ),
    "compare": ListedCommand(
        "compare:compare",
        "Print every observer's error against a reference, and its floor.",
        ASK,
    ),
    "batch": ListedCommand(
        "batch:batch",
        "Ask many logs the same, on every core or on a cluster.",
        ASK,
    ),
    "thresholds": ListedCommand(
        "thresholds:contact_thresholds",
        "Learn from free motion the thresholds that a robot is given.",
        ASK,
    ),
    "inspect": ListedCommand(
        "inspect:inspect_log",
        "Examine a log: format, signals, clock, and what looks wrong.",
        PREPARE,
    ),
    "init": ListedCommand(
        "init:write_config",
        "Write vftcli.toml: the options that a log calls for.",
        PREPARE,
    ),
    "identify": ListedCommand(
        "identify:identify_robot",
        "Make a robot file from logs: friction, inertias, payload.",
        PREPARE,
    ),
    "annotate": ListedCommand(
        "annotate:annotate_dataset",
        "Write the forces of every frame into a copy of a dataset.",
        PREPARE,
    ),
    "tune": ListedCommand(
        "tune:tune_gains",
        "Find gains on a log for a stated goal, for --gains.",
        PREPARE,
    ),
    "convert": ListedCommand(
        "convert:convert_log",
        "Convert any readable log into Parquet, CSV or MCAP.",
        PREPARE,
    ),
    "open": ListedCommand(
        "opening:open_folder",
        "Open the page of a folder that a command wrote.",
        ASK,
    ),
    "admit": ListedCommand(
        "admit:admit",
        "Replay a log's external force through admittance controllers.",
        STUDY,
    ),
    "simulate": ListedCommand(
        "simulate:simulate_log",
        "Simulate an experiment: the log, and the truth beside it.",
        STUDY,
    ),
    "reproduce": ListedCommand(
        "reproduce:reproduce",
        "Run a paper's experiments again, beside what it prints.",
        STUDY,
    ),
    "bench": ListedCommand(
        "bench:bench",
        "Time the observers.",
        STUDY,
    ),
    "robots": ListedCommand(
        "listings:robots",
        "List the robot profiles, or show one and its sources.",
        LOOK_UP,
    ),
    "observers": ListedCommand(
        "listings:observers",
        "List the observers, their equations and their parameters.",
        LOOK_UP,
    ),
    "formats": ListedCommand(
        "listings:list_formats",
        "List the log formats, or show how to record one.",
        LOOK_UP,
    ),
    "help": ListedCommand(
        "help:show_help",
        "Explain a topic, as columns or frames, or a command.",
        LOOK_UP,
    ),
}
