"""Choices that commands on logs share."""

import os
from dataclasses import replace
from typing import TYPE_CHECKING

from vftcli.bias import RefinementChoice
from vftcli.cli.console import health_of
from vftcli.cli.options import Talk
from vftcli.free_motion import FreeChoice
from vftcli.observers import ObserverChoice
from vftcli.outputs import OutputChoice
from vftcli.readers.reader import ReadChoice
from vftcli.robots import RobotChoice
from vftcli.signals.option import Anyway, Asked
from vftcli.wrench import AlsoWrench, WrenchChoice

if TYPE_CHECKING:
    from vftcli.pipeline import AnalysisChoice
    from vftcli.readers.library import Library

#: Choices of reading and arm; all but the reference.
OF_LOG = (ReadChoice, RobotChoice)
OF_ANALYSIS = (
    *OF_LOG,
    ObserverChoice,
    FreeChoice,
    RefinementChoice,
    AlsoWrench,
    WrenchChoice,
    Anyway,
    Talk,
)

#: Arrays from this size on have their own memory, returned with them. [bytes]
#:
#: Such memory is mapped and cleared anew: for the thousands of smaller arrays that took a
#: third of the time of an hour's report, and its peak was no lower.
LARGE = 1 << 24

#: The C library's number of the size from which memory is mapped.
MMAP_THRESHOLD = -3


def give_back() -> None:
    """Have freed arrays return their memory, if the C library can.

    Otherwise it keeps the memory, and a long log's peak is the sum of all its stages.
    """
    # Read at pyarrow's import: its own allocator keeps memory.
    os.environ.setdefault("ARROW_DEFAULT_MEMORY_POOL", "system")
    import ctypes

    try:
        ctypes.CDLL(None).mallopt(MMAP_THRESHOLD, LARGE)
    except (AttributeError, OSError, TypeError):  # another C library
        return


def choice_for(
    asked: Asked,
    library: "Library",
    *,
    on_screen: bool = False,
    observers: ObserverChoice | None = None,
) -> "AnalysisChoice":
    """The choice of a command on its logs, with an examiner that prints their health."""
    from vftcli.pipeline import choice_of

    if "observer" in asked.words:
        give_back()
    examiner = health_of(library, anyway=asked.anyway, on_screen=on_screen)
    return choice_of(asked, library, examiner, observers)


def outputs_of(asked: Asked) -> OutputChoice:
    """Outputs for other programs."""
    extras = tuple(name for name in ("csv", "rrd", "mcap") if asked.words.get(name))
    return replace(asked.of(OutputChoice), extras=extras)
