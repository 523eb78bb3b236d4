"""Readers: a log in any known format becomes a Recording. The content decides, never the name.

What stands here is imported when it is first used: a text log is being parsed before what reads
bags, or NumPy, is there.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
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

#: Public name → the module of this room that it lives in.
HOMES = {
    "READERS": "registry",
    "LogFile": "reader",
    "RawLog": "reader",
    "ReadChoice": "reader",
    "Reader": "reader",
    "episode_numbers": "reading",
    "holds_episodes": "reading",
    "read": "reading",
    "read_chosen": "reading",
    "read_first_recording": "reading",
    "recognise": "reading",
}


def __getattr__(name: str) -> Any:  # noqa: ANN401 - the names are of every kind
    if name not in HOMES:
        raise AttributeError(f"module 'vftcli.readers' has no attribute {name!r}")
    return getattr(import_module(f"vftcli.readers.{HOMES[name]}"), name)


def __dir__() -> list[str]:
    return sorted(HOMES)


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
