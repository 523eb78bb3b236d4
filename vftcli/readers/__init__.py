"""Readers: a log in any known format becomes a Recording. The content decides, never the name."""

from typing import TYPE_CHECKING

from vftcli.signals.packages import door

if TYPE_CHECKING:
    from vftcli.readers.reader import ReadChoice
    from vftcli.readers.reading import (
        FORMATS,
        LogFormat,
        read,
        read_chosen,
        read_first_recording,
        recognise,
    )
else:
    __getattr__ = door(__name__, "reader", "reading")

__all__ = [
    "FORMATS",
    "LogFormat",
    "ReadChoice",
    "read",
    "read_chosen",
    "read_first_recording",
    "recognise",
]
