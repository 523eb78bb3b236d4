"""Readers: a log in any known format becomes a Recording. The content decides, never the name."""

from vftcli.readers.formats import FORMATS, LogFormat
from vftcli.readers.reader import LogFile, RawLog, ReadChoice
from vftcli.readers.reading import (
    episode_numbers,
    holds_episodes,
    read,
    read_chosen,
    read_first_recording,
    recognise,
)

__all__ = [
    "FORMATS",
    "LogFile",
    "LogFormat",
    "RawLog",
    "ReadChoice",
    "episode_numbers",
    "holds_episodes",
    "read",
    "read_chosen",
    "read_first_recording",
    "recognise",
]
