"""Readers: a log in any known format becomes a Recording. The content decides, never the name."""

from typing import TYPE_CHECKING

from vftcli.signals.packages import door

if TYPE_CHECKING:
    from vftcli.readers.opening import LogFile
    from vftcli.readers.reader import RawLog, ReadChoice
    from vftcli.readers.reading import (
        FORMATS,
        LogFormat,
        episode_numbers,
        read,
        read_chosen,
        read_first_recording,
        recognise,
    )
else:
    __getattr__ = door(__name__, "reader", "opening", "reading")

__all__ = [
    "FORMATS",
    "LogFile",
    "LogFormat",
    "RawLog",
    "ReadChoice",
    "episode_numbers",
    "read",
    "read_chosen",
    "read_first_recording",
    "recognise",
]
