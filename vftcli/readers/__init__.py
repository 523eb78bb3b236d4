"""Readers: a log in any known format becomes a Recording. The content decides, never the name."""

from vftcli.readers.reader import LogFile, RawLog, ReadChoice, Reader
from vftcli.readers.reading import (
    episode_numbers,
    holds_episodes,
    read,
    read_chosen,
    read_first_recording,
    recognise,
)
from vftcli.readers.registry import READERS

__all__ = [
    "READERS",
    "LogFile",
    "RawLog",
    "ReadChoice",
    "Reader",
    "episode_numbers",
    "holds_episodes",
    "read",
    "read_chosen",
    "read_first_recording",
    "recognise",
]
